"""Departures: where an engine's program leaves the law of constraints that its documentation gives, found in its source alone.

The documented law is the truth. That with all departures is what the engine is known to compute: answers by it are explained, and told as
what they are. Nothing an engine answers enters either.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from fractions import Fraction

from packaging.specifiers import SpecifierSet

from harness.environments import NEWEST, split_name
from harness.files.equalities import AnyRows, Constraint, DryFriction, Limit, Linkage, Polygon, Sum, TendonLinkage
from harness.files.given import Given, Pose
from harness.files.joint_kinds import JointKind
from harness.files.rules import LEAST_IMPEDANCE, LEAST_WIDTH, MOST_IMPEDANCE, ConstraintLaw, InverseWeight
from harness.files.tree import WORLD, Body, Tree
from harness.trees.bodies.inertias import whole

# IsNullPose and mjEPS of MuJoCo's compiler, and kEigEPS, by which moments fall before they are sorted [kg m^2].
_NO_SHIFT, _NO_COMPONENT, _NO_FALL = Fraction(1e-6), Fraction(1e-14), Fraction(1e-12)
# Measured of MuJoCo 4.0.0: a product of inertia that is no larger, over the largest moment, turns no axis.
_NO_PRODUCT = Fraction(1, 1 << 48)


@dataclass(frozen=True, kw_only=True)
class Departure:
    """One departure of an engine.

    Attributes:
        name: as in a table. engine, versions: of whom, as of ``harness.explain.changes.readings.Reading``.
        sentence: for the reader of a report, the engine first. remedy: what the engine's user can do about it, an imperative.
        source: where the documentation says otherwise, and the line of the program that departs.
        law: that of an equality of a tree as the program has it, from the one before; an equal one where it does not depart.
    """

    name: str
    engine: str
    versions: str = ""
    sentence: str
    remedy: str
    source: str
    law: Callable[[Tree, Constraint, ConstraintLaw], ConstraintLaw]

    def concerned(self, tree: Tree, equalities: Iterable[Constraint], laws: Mapping[str, ConstraintLaw]) -> list[Constraint]:
        """The equalities of a tree of whose laws, by name, it makes others."""
        return [one for one in equalities if one.name in laws and self.law(tree, one, laws[one.name]) != laws[one.name]]


def departures_of(engine: str, reader: str) -> list[Departure]:
    """The departures of an engine, or ``engine@version``, and of the engine whose reader it has, if any."""
    name, version = split_name(engine)
    own = (one for one in _DEPARTURES if one.engine in (name, reader))
    return [one for one in own if (version or NEWEST) in SpecifierSet(one.versions, prereleases=True)]


def departed(
    departures: Iterable[Departure], tree: Tree, equalities: Iterable[Constraint], laws: Mapping[str, ConstraintLaw]
) -> dict[str, ConstraintLaw]:
    """The laws of a tree's equalities, by their names, with these departures."""
    found, by_name = dict(laws), {one.name: one for one in equalities}
    for departure in departures:
        found = {name: departure.law(tree, by_name[name], law) for name, law in found.items()}
    return found


def _weighed_by_mass(tree: Tree, _: Constraint, law: ConstraintLaw) -> ConstraintLaw:
    """The law whose bodies that only slide, and joints of these, weigh as all three directions of a mass do."""
    slid = [body for body in tree.bodies if only_slides(tree, body)]
    sliders = {name: body.name for body in slid for name in (body.name, *(joint.name for joint in body.joints))}

    def weighed(one: InverseWeight) -> InverseWeight:
        if one.of not in sliders or one.kind not in ("translation", "joint"):
            return one
        return InverseWeight("mass", sliders[one.of])

    return _with_weights(law, weighed)


def only_slides(tree: Tree, body: Body) -> bool:
    """True where MuJoCo takes a body for one whose block of M is its mass: its "simple" body of level 2.

    It slides along its own axes alone, hangs on the world, carries no body, and has its inertia in its own frame.
    """
    parents = {other.name: other for other in tree.bodies}
    parent = parents.get(body.parent)
    hangs = parent is None or (not parent.joints and parent.parent == WORLD)
    is_leaf = all(other.parent != body.name for other in tree.bodies)
    # Along one of the body's axes, through the body's origin.
    slides = bool(body.joints) and all(
        joint.kind == JointKind.SLIDE
        and not joint.pose
        and all(abs(value) < _NO_SHIFT for value in joint.anchor)
        and sum(abs(value) > _NO_COMPONENT for value in joint.axis) == 1
        for joint in body.joints
    )
    return hangs and is_leaf and slides and _has_own_frame(body)


def _has_own_frame(body: Body) -> bool:
    """True where MuJoCo's compiler finds the principal axes of inertia in the body's own frame."""
    heavy = [solid for solid in body.solids if not solid.is_massless]
    if body.inertia is None and len(heavy) == 1:
        # One shape has its inertia in its own frame.
        return heavy[0].ends is None and _is_in_place(heavy[0].pose)
    given = whole(body)
    if given is None or not _is_in_place(given.pose):
        return False
    xx, yy, zz, *products = given.moments
    is_diagonalised = bool(heavy) or (isinstance(xx, Given) and xx.attribute != "diaginertia")
    falls = xx + _NO_FALL >= yy and yy + _NO_FALL >= zz
    return max(map(abs, products)) <= _NO_PRODUCT * max(xx, yy, zz) and (falls or not is_diagonalised)


def _weighed_at_position(tree: Tree, _: Constraint, law: ConstraintLaw) -> ConstraintLaw:
    """The law whose bodies without any mass weigh at their positions in their parents, taken in their own frames."""
    empty = {body.name for body in tree.bodies if body.inertia is None and body.is_massless and body.pose}

    def weighed(one: InverseWeight) -> InverseWeight:
        return InverseWeight("position", one.of) if one.kind == "translation" and one.of in empty else one

    return _with_weights(law, weighed)


def _with_weights(law: ConstraintLaw, weighed: Callable[[InverseWeight], InverseWeight]) -> ConstraintLaw:
    """The law with another inverse weight in place of each; itself where it has none."""
    return law if law.weights is None else replace(law, weights=tuple(tuple(map(weighed, row)) for row in law.weights))


def _is_in_place(pose: Pose) -> bool:
    return all(not place.rotation and all(abs(x) < _NO_SHIFT for x in place.position) for place in pose)


def _without_curvature_of_couplings(tree: Tree, constraint: Constraint, law: ConstraintLaw) -> ConstraintLaw:
    return _without_curvature(tree, constraint, law) if isinstance(constraint.says, Linkage | TendonLinkage) else law


def _without_curvature_of_bounds(tree: Tree, constraint: Constraint, law: ConstraintLaw) -> ConstraintLaw:
    return _without_curvature(tree, constraint, law) if isinstance(constraint.says, DryFriction | Limit) else law


def _without_curvature(tree: Tree, constraint: Constraint, law: ConstraintLaw) -> ConstraintLaw:
    return law if _is_linear(tree, constraint.says) else replace(law, has_curvature=False)


def _is_linear(tree: Tree, says: AnyRows | None) -> bool:
    """True for rows that are linear in the positions of joints, so that J is the same everywhere."""
    if isinstance(says, Linkage | TendonLinkage):
        return not any(says.coefficients[2:]) and (isinstance(says, Linkage) or all(isinstance(one, Sum) for one in says.tendons))
    if isinstance(says, Limit) and isinstance(says.of, str):
        return all(joint.kind.is_single for joint in tree.joints if joint.name == says.of)
    return isinstance(says, DryFriction | Limit) and not isinstance(says.of, Polygon)


def _without_limits_of_balls(tree: Tree, constraint: Constraint, law: ConstraintLaw) -> ConstraintLaw:
    """The law of a limit of a ball joint, whose force is zero."""
    balls = {joint.name for joint in tree.joints if joint.kind == JointKind.BALL}
    return replace(law, force_range=(0.0, 0.0)) if isinstance(constraint.says, Limit) and constraint.says.of in balls else law


def _mean_impedance_of_friction(_: Tree, constraint: Constraint, law: ConstraintLaw) -> ConstraintLaw:
    """The law of dry friction whose ``solimp`` has no width."""
    softness = constraint.softness
    if not isinstance(constraint.says, DryFriction) or softness is None or softness.solimp[2] > LEAST_WIDTH:
        return law
    # What ``solimp`` is bounded by bounds both of its impedances, of which the law has the first.
    least, most = law.impedance.least, min(max(float(softness.solimp[1]), LEAST_IMPEDANCE), MOST_IMPEDANCE)
    return replace(law, impedance=replace(law.impedance, least=(least + most) / 2, most=(least + most) / 2))


def _within_window(_: Tree, constraint: Constraint, law: ConstraintLaw) -> ConstraintLaw:
    """The law of a limit that is left out of a step unless twice the way of the step leads there."""
    if law.of_step is None or not isinstance(constraint.says, Limit):
        return law
    return replace(law, of_step=replace(law.of_step, window=2.0))


_DUAL_PROBLEM = "MuJoCo documentation, Computation, Dual problem: the unconstrained acceleration of a constraint has the term J' v"
_PARAMETERS = (
    "MuJoCo documentation, Computation, Parameters, Diagonal approximation: the directional inverse inertia is averaged into a scalar"
)
_FRICTION = "MuJoCo documentation, Modeling, Friction: the impedance is always the first number of solimp, whatever the width"
_OF_MJX = Departure(
    name="J' v of all equalities",
    engine="mjx",
    sentence="MJX leaves J' v out of all equalities, and loops are wrong by it wherever they move",
    remedy="use MuJoCo where loops move fast",
    source=f"{_DUAL_PROBLEM}; mujoco.mjx, _src/constraint.py: aref has no such term",
    law=_without_curvature,
)

_OF_MUJOCO = (
    Departure(
        name="inverse weight of a slider",
        engine="mujoco",
        sentence="MuJoCo takes 1/m for the inverse weight of a body that only slides, where it documents the mean over three directions",
        remedy='set <flag diagexact="enable"/>, or write simple="false" on the body',
        source=f"{_PARAMETERS}; MuJoCo, src/engine/engine_setconst.c, set0: body_simple == 2 has 1 / mass; src/user/user_model.cc",
        law=_weighed_by_mass,
    ),
    Departure(
        name="inverse weight of a body without mass",
        engine="mujoco",
        sentence="MuJoCo has the centre of a body without mass where its position in the parent is in its own frame, and weighs it there",
        remedy='write <inertial pos="0 0 0" mass="0" diaginertia="0 0 0"/> into it',
        source=f"{_PARAMETERS}; MuJoCo, src/user/user_objects.cc, mjCBody::Compile: ipos undefined: copy body frame into inertial",
        law=_weighed_at_position,
    ),
    Departure(
        name="impedance of friction without width",
        engine="mujoco",
        sentence="MuJoCo takes the mean of two impedances for dry friction without a width in solimpfriction, where it documents the first",
        remedy="write a width above 0 in solimpfriction",
        source=f"{_FRICTION}; MuJoCo, src/engine/engine_core_constraint.c, getimpedance: flat function",
        law=_mean_impedance_of_friction,
    ),
    Departure(
        name="J' v of couplings",
        engine="mujoco",
        sentence="MuJoCo leaves J' v out of couplings of joints and tendons, and one that is not linear is wrong by it wherever it moves",
        remedy="couple by a linear polynomial, or expect the error to grow with the square of the speed",
        source=f"{_DUAL_PROBLEM}; MuJoCo, src/engine/engine_core_constraint.c, mj_Jdotv: rows of connect and weld alone",
        law=_without_curvature_of_couplings,
    ),
    Departure(
        name="J' v of tendons and ball joints",
        engine="mujoco",
        sentence="MuJoCo leaves J' v out of limits of ball joints and of limits and dry friction of tendons through sites",
        remedy="expect the error to grow with the square of the speed",
        source=f"{_DUAL_PROBLEM}; MuJoCo, src/engine/engine_core_constraint.c, mj_Jdotv: rows of connect and weld alone",
        law=_without_curvature_of_bounds,
    ),
)
# Newton writes simple="false" on each body, and centres of its own.
_OF_MUJOCO_IN_NEWTON = ("impedance of friction without width", "J' v of couplings", "J' v of tendons and ball joints")

_DEPARTURES = (
    *_OF_MUJOCO,
    *(replace(one, engine="newton_mujoco") for one in _OF_MUJOCO if one.name in _OF_MUJOCO_IN_NEWTON),
    Departure(
        name="limits of ball joints",
        engine="newton_mujoco",
        sentence="Newton's SolverMuJoCo limits no ball joint, whatever range the file gives it",
        remedy="make the joint of three hinges with limits",
        source="MuJoCo documentation, XML reference, body/joint: range, of ball joints; Newton 1.8, "
        "newton/_src/solvers/mujoco/solver_mujoco.py, JointType.BALL: limited=False",
        law=_without_limits_of_balls,
    ),
    *(replace(_OF_MJX, engine=name) for name in ("mjx", "mjx_float32")),
    Departure(
        name="limits beyond a window",
        engine="drake_step",
        sentence="Drake leaves a limit out of a step unless twice the way that velocities lead without constraints reaches it, whatever "
        "another limit makes of them",
        remedy="expect a limit to be passed in a step in which another one throws its joint there, or take shorter steps",
        source="Drake, documentation of SapLimitConstraint: the impulse is (y)_+ at every distance; multibody/plant/sap_driver.cc, "
        "AddLimitConstraints: kLimitWindowFactor",
        law=_within_window,
    ),
)
