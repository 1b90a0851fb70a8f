"""The inverse weights by which MuJoCo scales soft constraints, from a model file alone: diagonals of J M^-1 J' in its zero position.

There every body stands where its pose says, so that no joint turns anything: each velocity is a motion about or along a line of the
file. M is summed over the bodies in the frame of the world, and everything is evaluated in balls.

MuJoCo's program makes an exception that its documentation does not hold: a body that only slides along its own axes, that hangs on
the world, carries no body, and whose inertia is given in its own frame, has 1/m for its translation and for each slide.

Source: MuJoCo 4.0, engine_setconst.c (set0) and user_model.cc (body_simple).
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from fractions import Fraction
from typing import Any

from harness.equations.term import Matrix, Term, Vector, cross, matrix
from harness.files.equalities import Polygon, Tendon, TendonLinkage
from harness.files.joint_kinds import JointKind
from harness.files.tree import WORLD, Body, Given, Joint, Tree
from harness.models.constraint_law import InverseWeight
from harness.models.model_file import ROOT_TAGS, ModelFile
from harness.models.xml import parse_document
from harness.robots.bounds import bounded
from harness.robots.rigid import Rigid, Spatial, Weights, joined, power, spatial
from harness.robots.robot import tree_of
from harness.robots.spatial import FileBuilder, Frame, direction, placed, unit

_BITS = 192
# IsNullPose and mjEPS of MuJoCo's compiler.
_NO_SHIFT, _NO_COMPONENT = Fraction(1e-6), Fraction(1e-14)


def inverse_weights(model: ModelFile, wanted: Iterable[InverseWeight]) -> dict[InverseWeight, float]:
    """Each inverse weight, rounded once [1/kg, or 1/(kg m^2)]; 0 for what no joint moves.

    Raises:
        InvalidModel: as ``read_robot``. ValueError: the zero position has no inverse of M.
    """
    tendons = (tendon for one in model.constraints if isinstance(one.says, TendonLinkage) for tendon in one.says.tendons)
    # Gravity has no part in it.
    return inverse_weights_of(tree_of(model, 0.0), wanted, _fuses(model), tendons)


def inverse_weights_of(
    tree: Tree, wanted: Iterable[InverseWeight], fuses: bool, tendons: Iterable[Tendon] = ()
) -> dict[InverseWeight, float]:
    """Those of a tree of bodies; ``fuses`` says whether an engine makes bodies that no joint moves one with their parents.

    Raises:
        ValueError: as ``inverse_weights``.
    """
    return _AtZero(bounded(tree), fuses, tendons).evaluated(list(dict.fromkeys(wanted)))


class _AtZero:
    """M, and rows J, of one tree in its zero position."""

    def __init__(self, tree: Tree, fuses: bool, tendons: Iterable[Tendon]) -> None:
        self._builder = FileBuilder(())
        self._tree, self._weights = tree, Weights(self._builder, tree)
        self._motions: list[Spatial] = []
        self._columns: dict[str, list[int]] = {}
        self._armatures: list[Term] = []
        self._frames = {WORLD: placed(self._builder, ())}
        # The velocities that move each body, of its own joints and of those before.
        self._moved_by: dict[str, list[int]] = {WORLD: []}
        self._rigids: dict[str, Rigid] = {}
        # The body that an engine makes one with what is fixed to it.
        self._carrier = {WORLD: WORLD}
        for body in tree.bodies:
            self._place(body)
            self._carrier[body.name] = self._carrier[body.parent] if fuses and not body.joints else body.name
        self._tendons = {one.name: one for one in tendons}

    def _place(self, body: Body) -> None:
        frame = self._frames[body.name] = placed(self._builder, body.pose, self._frames[body.parent])
        for joint in body.joints:
            first = len(self._motions)
            self._motions += _motions(self._builder, joint, frame)
            columns = self._columns[joint.name] = list(range(first, len(self._motions)))
            self._armatures += [self._builder.number(joint.armature)] * len(columns)
        own = [column for joint in body.joints for column in self._columns[joint.name]]
        self._moved_by[body.name] = [*self._moved_by[body.parent], *own]
        self._rigids[body.name] = joined(self._builder, (part.moved(frame) for part in self._weights.parts(body)))

    def _mass_matrix(self) -> Matrix:
        size = len(self._motions)
        entries = self._builder.zeros(size, size)
        for body in self._tree.bodies:
            rigid, columns = self._rigids[body.name], self._moved_by[body.name]
            for column in columns:
                momentum = rigid.momentum(self._motions[column])
                for row in columns:
                    entries[row, column] = entries[row, column] + power(self._motions[row], momentum)
        for column, armature in enumerate(self._armatures):
            entries[column, column] = entries[column, column] + armature
        return entries

    def _rows(self, wanted: InverseWeight) -> Matrix:
        """The rows of J of an inverse weight."""
        size = len(self._motions)
        if wanted.kind == "joint":
            # Of a free joint the translations, as those of its first velocity.
            own = self._columns[wanted.of][:3]
            return matrix([[self._builder.number(int(column == one)) for column in range(size)] for one in own])
        if wanted.kind == "tendon":
            return matrix([self._tendon(self._tendons[wanted.of])])
        columns = self._moved_by[wanted.of]
        centre = self._centre(wanted.of) if wanted.kind == "translation" and columns else self._builder.still
        found = self._builder.zeros(3, size)
        for column in columns:
            found[:, column] = self._motions[column][0] if wanted.kind == "rotation" else self._velocity(column, centre)
        return found

    def _centre(self, name: str) -> Vector:
        """The centre of mass of a body with all that is made one with it."""
        bodies = [body for body, carrier in self._carrier.items() if carrier == self._carrier[name] and body != WORLD]
        whole = joined(self._builder, (self._rigids[body] for body in bodies))
        return whole.first / whole.mass

    def _velocity(self, column: int, point: Vector) -> Vector:
        angular, linear = self._motions[column]
        return linear + cross(angular, point)

    def _tendon(self, tendon: Tendon) -> Vector:
        found = self._builder.zeros(len(self._motions))
        if not isinstance(tendon, Polygon):
            for name, multiple in tendon.terms:
                (column,) = self._columns[name]
                found[column] = found[column] + Fraction(multiple)
            return found
        places = [(body, placed(self._builder, pose, self._frames[body]).shift) for body, pose in tendon.points]
        for (first, start), (second, end) in itertools.pairwise(places):
            along = unit(end + -start)
            for sign, body, point in ((1, second, end), (-1, first, start)):
                for column in self._moved_by[body]:
                    rate = self._builder.number(sign) * (along @ self._velocity(column, point))
                    found[column] = found[column] + rate
        return found

    def evaluated(self, wanted: Sequence[InverseWeight]) -> dict[InverseWeight, float]:
        """The inverse weights."""
        import flint

        sliders = {name: body for body in self._tree.bodies if self._only_slides(body) for name in (body.name, *_names(body.joints))}
        masses = {name: self._rigids[body.name].mass for name, body in sliders.items()}
        rows = {one: () if one.of in sliders and one.kind != "tendon" else self._rows(one).flat for one in wanted}
        outputs = {"mass": self._mass_matrix().flat, **{str(number): each for number, each in enumerate(rows.values())}}
        with flint.ctx.workprec(_BITS):
            found = self._builder.evaluated(outputs | {"sliders": masses.values()})
            mass = flint.arb_mat(len(self._motions), len(self._motions), found["mass"])
            of_slider = dict(zip(masses, found["sliders"], strict=True))
            weights = {}
            for number, one in enumerate(rows):
                if one.of in of_slider and one.kind != "tendon":
                    weights[one] = 0.0 if one.kind == "rotation" else float(1 / of_slider[one.of])
                else:
                    weights[one] = _mean_diagonal(mass, found[str(number)])
            return weights

    def _only_slides(self, body: Body) -> bool:
        """Whether MuJoCo takes a body for one whose M is its mass; see the module."""
        hangs = body.parent == WORLD or (not self._moved_by[body.parent] and self._parent(body.parent) == WORLD)
        is_leaf = all(other.parent != body.name for other in self._tree.bodies)
        slides = bool(body.joints) and all(joint.kind == JointKind.SLIDE and _is_along_one(joint) for joint in body.joints)
        return hangs and is_leaf and slides and body.inertia is not None and not body.solids and _stands_in_body(body)

    def _parent(self, name: str) -> str:
        return next(body.parent for body in self._tree.bodies if body.name == name)


def _motions(builder: FileBuilder, joint: Joint, frame: Frame) -> list[Spatial]:
    """The motion of the world's frame for each velocity of a joint of a body with a frame."""
    own = placed(builder, joint.pose, frame)
    anchor = own.at(builder.vector(joint.anchor))
    kind = joint.kind
    if kind.is_single:
        axis = own.turn @ direction(builder, joint.axis)
        return [spatial(builder.still, axis) if kind.linear else spatial(axis, cross(anchor, axis))]
    found = [spatial(axis, cross(anchor, axis)) for axis in frame.turn.T]
    return [*(spatial(builder.still, row) for row in builder.identity), *found] if kind.linear else found


def _names(joints: Iterable[Joint]) -> tuple[str, ...]:
    return tuple(joint.name for joint in joints)


def _is_along_one(joint: Joint) -> bool:
    """True for an axis along one of the body's, through the body's origin."""
    is_still = not joint.pose and all(abs(value) < _NO_SHIFT for value in joint.anchor)
    return is_still and sum(abs(value) > _NO_COMPONENT for value in joint.axis) == 1


def _stands_in_body(body: Body) -> bool:
    """True where a body's inertia is given about its origin, along its axes, in falling order where that is found by diagonalising."""
    assert body.inertia is not None
    xx, yy, zz, *products = body.inertia.moments
    is_matrix = isinstance(xx, Given) and xx.attribute != "diaginertia"
    in_order = not any(products) and (not is_matrix or xx >= yy >= zz)
    return in_order and all(not place.rotation and all(abs(x) < _NO_SHIFT for x in place.position) for place in body.inertia.pose)


def _fuses(model: ModelFile) -> bool:
    """True where MuJoCo makes bodies that no joint moves one with their parents; in a URDF with constraints it is told not to."""
    if model.format == "urdf":
        return False
    root = parse_document(model.path, model.text, ROOT_TAGS[model.format]).root
    return [compiler.get("fusestatic") for compiler in root.iterfind("compiler[@fusestatic]")][-1:] == ["true"]


def _mean_diagonal(mass: Any, entries: list[Any]) -> float:
    """The mean of the diagonal of J M^-1 J', J by rows in ``entries``."""
    import flint

    size = mass.nrows()
    jacobian = flint.arb_mat(len(entries) // size, size, entries)
    try:
        weights = jacobian * mass.solve(jacobian.transpose())
    except ZeroDivisionError:
        raise ValueError("the mass matrix has no inverse in the zero position of the model") from None
    return float(sum((weights[i, i] for i in range(weights.nrows())), flint.arb(0)) / weights.nrows())
