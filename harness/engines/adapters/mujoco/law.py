"""The law of each constraint that MuJoCo documents, and the rules of its integrators, from the model file alone.

Stiffness and damping follow from ``solref``, the impedance from ``solimp``. Where the program leaves this law is in
``harness.explain.changes.departures``.

The steps of its integrators: ``Euler`` takes the dampers in joints implicitly, unless ``eulerdamp`` is disabled; ``implicit`` and
``implicitfast`` all dampers on lengths too, and ``implicit`` all velocity terms, where ``implicitfast`` takes those of bodies that float
alone. Both leave out what a damper on a length does across branches of the tree. ``discrete`` takes dampers and springs in joints and on
lengths, and the velocity terms of bodies that float alone. ``RK4`` is the classical method, which works in the coordinates of the
exponential map. All of this is documented: that dampers across branches are left out, with the integrators; Munthe-Kaas' correction of
``RK4``, in the release notes of 4.0.0.

Source: MuJoCo documentation, Computation, sections Contact, Friction cones, Solver parameters and Numerical integration; Modeling, URDF
extensions; XML reference,
``compiler/fusestatic``; release notes of 3.13.0, ``discrete``; MuJoCo 4.0, engine_core_constraint.c (getsolparam, mj_makeImpedance,
mj_diagApprox), mj_step and engine_metric.c (springs on lengths count by the first derivatives of these).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace
from fractions import Fraction
from typing import Literal

from lxml import etree

from harness.files.equalities import AnyRows, Constraint, DryFriction, Limit, Linkage, Meeting, SolverParameters, TendonLinkage, Weld
from harness.files.findings import FRICTION, SWITCHED_OFF
from harness.files.mjcf.attributes import is_on
from harness.files.rules import (
    LEAST_IMPEDANCE,
    MOST_IMPEDANCE,
    ConstraintLaw,
    FrictionCone,
    Impedance,
    ImplicitPart,
    InverseWeight,
    StepRule,
)
from harness.files.touching import ConeKind, Touch

# mjMINVAL.
LEAST_NUMBER = 1e-15
_OF_BODIES: tuple[Literal["translation", "rotation"], ...] = ("translation", "rotation")
# Velocities of a joint before those by which a free one turns.
_LINEAR = 3
# Flags by which contacts have other laws.
_OTHER_LAWS = ("speculative", "ipc")
_NOSLIP = "goes through noslip iterations, which solve no problem that is documented"
# Of a file that does not say [s].
_TIMESTEP = 0.002
_HALF, _ONE, _NONE = Fraction(1, 2), Fraction(1), Fraction(0)
_STAGES = ((_HALF,), (_NONE, _HALF), (_NONE, _NONE, _ONE))
_WEIGHTS = (Fraction(1, 6), Fraction(1, 3), Fraction(1, 3), Fraction(1, 6))
_DAMPERS = frozenset({ImplicitPart.JOINT_DAMPERS, ImplicitPart.LINE_DAMPERS})
_SPRINGS = frozenset({ImplicitPart.JOINT_SPRINGS, ImplicitPart.LINE_SPRINGS})


def settings(root: etree._Element, model_format: str) -> etree._Element:
    """The element in which compiler and options stand: that of a URDF's extension, where it has one."""
    extension = root.find("mujoco") if model_format == "urdf" else root
    return root if extension is None else extension


def fuses(root: etree._Element, model_format: str) -> bool:
    """True where the compiler makes bodies that no joint moves one with their parents, which it does by itself in a URDF alone."""
    told = [compiler.get("fusestatic") for compiler in settings(root, model_format).iterfind("compiler[@fusestatic]")]
    return told[-1] == "true" if told else model_format == "urdf"


def laws_in(root: etree._Element, constraints: Iterable[Constraint]) -> dict[str, ConstraintLaw]:
    """The law of each of some constraints of the file with this root element; none of dry friction and limits that it switches off."""
    least_time = _least_time_constant(root)
    exact = [flag.get("diagexact") for flag in root.iterfind("option/flag[@diagexact]")][-1:] == ["enable"]
    ratio = float(_option(root, "impratio") or 1.0)
    return {one.name: _law(one, least_time, exact, ratio) for one in constraints if _acts(root, one)}


def contacts(root: etree._Element, model_format: str) -> tuple[ConeKind, str]:
    """See ``harness.engines.Engine``."""
    own = settings(root, model_format)
    return cone_of(own), _why_no_contacts(own)


def _why_no_contacts(root: etree._Element) -> str:
    if not (is_on(root, "contact") and is_on(root, "constraint")):
        return SWITCHED_OFF
    if _goes_through_noslip(root):
        return _NOSLIP
    if _option(root, "integrator") == "discrete":
        return "is solved in the metric of a step, which the discrete integrator has"
    flags = [name for name in _OTHER_LAWS if [flag.get(name) for flag in root.iterfind(f"option/flag[@{name}]")][-1:] == ["enable"]]
    return f"has the law of the flag {flags[0]!r}, which is not read" if flags else ""


def unjudged(root: etree._Element, model_format: str) -> Mapping[str, str]:
    """See ``harness.engines.Engine``; noslip iterations change the forces of all rows with friction, those of joints and tendons too."""
    return {FRICTION: _NOSLIP} if _goes_through_noslip(settings(root, model_format)) else {}


def _goes_through_noslip(root: etree._Element) -> bool:
    return float(_option(root, "noslip_iterations") or 0) > 0


def cone_of(root: etree._Element) -> ConeKind:
    """The cones of the file with this root element."""
    return ConeKind(_option(root, "cone") or ConeKind.PYRAMIDAL)


def _option(root: etree._Element, name: str) -> str | None:
    """An attribute of the options, the last that is given."""
    return next(reversed([option.get(name) for option in root.iterfind(f"option[@{name}]")]), None)


def _acts(root: etree._Element, constraint: Constraint) -> bool:
    stages = {DryFriction: ("constraint", "frictionloss"), Limit: ("constraint", "limit"), Touch: ("constraint", "contact")}
    return all(is_on(root, stage) for stage in stages.get(type(constraint.says), ()))


def _least_time_constant(root: etree._Element) -> Fraction:
    """The least time constant, to which ``solref`` is raised: two steps, unless the flag "refsafe" is off."""
    return 2 * Fraction(time_step(root)) if is_on(root, "refsafe") else Fraction(0)


def time_step(root: etree._Element) -> float:
    """The length of a step [s] of a file with this root element."""
    return float(_option(root, "timestep") or _TIMESTEP)


def _law(constraint: Constraint, least_time: Fraction, exact: bool, ratio: float) -> ConstraintLaw:
    softness, says = constraint.softness or SolverParameters(), constraint.says
    impedance = _impedance(softness)
    stiffness, damping = _stiffness_and_damping(softness, Fraction(impedance.most), least_time)
    if isinstance(says, DryFriction):
        # Of a residual that is 0 always; its damping has the most in it as that of others.
        impedance, stiffness = replace(impedance, most=impedance.least), Fraction(0)
    return ConstraintLaw(
        impedance=impedance,
        stiffness=float(stiffness),
        damping=float(damping),
        weights=None if exact else _weights(constraint),
        # "For contacts, the term remains omitted."
        has_curvature=not isinstance(says, Touch),
        least_regularisation=LEAST_NUMBER,
        force_range=_force_range(says),
        is_contact=isinstance(says, Touch),
        cone=_cone(says, impedance, least_time, ratio) if isinstance(says, Touch) and says.friction else None,
    )


def _force_range(says: AnyRows | None) -> tuple[float, float]:
    if isinstance(says, DryFriction):
        return -float(says.bound), float(says.bound)
    pushes_alone = isinstance(says, Limit) or (isinstance(says, Touch) and not says.is_elliptic)
    return (0.0 if pushes_alone else -math.inf), math.inf


def _cone(touch: Touch, impedance: Impedance, least_time: Fraction, ratio: float) -> FrictionCone:
    damping = None
    if touch.is_elliptic and any(touch.sliding):
        sliding = replace(SolverParameters(), solref=touch.sliding)
        damping = float(_stiffness_and_damping(sliding, Fraction(impedance.most), least_time)[1])
    return FrictionCone(tuple(map(float, touch.friction)), max(LEAST_NUMBER, ratio), touch.is_elliptic, damping)


def _impedance(softness: SolverParameters) -> Impedance:
    least, most, width, midpoint, power = map(float, softness.solimp)
    bounded = (min(MOST_IMPEDANCE, max(LEAST_IMPEDANCE, value)) for value in (least, most, midpoint))
    least, most, midpoint = bounded
    return Impedance(least, most, max(0.0, width), midpoint, max(1.0, power))


def _stiffness_and_damping(softness: SolverParameters, most: Fraction, least_time: Fraction) -> tuple[Fraction, Fraction]:
    time, ratio = (Fraction(value) for value in softness.solref)
    least = Fraction(LEAST_NUMBER)
    if time <= 0:
        return -time / max(least, most**2), -ratio / max(least, most)
    time = max(time, least_time)
    return 1 / max(least, (most * time * ratio) ** 2), 2 / max(least, most * time)


def _weights(constraint: Constraint) -> tuple[tuple[InverseWeight, ...], ...]:
    says = constraint.says
    if isinstance(says, Meeting):
        translation, rotation = (tuple(InverseWeight(kind, body) for body in says.bodies) for kind in _OF_BODIES)
        return (translation,) * 3 + ((rotation,) * 3 if isinstance(says, Weld) else ())
    if isinstance(says, Linkage):
        return (tuple(InverseWeight("joint", name) for name in (says.joint, says.leader) if name is not None),)
    if isinstance(says, TendonLinkage):
        return (tuple(InverseWeight("tendon", one.name) for one in says.tendons),)
    if isinstance(says, Touch):
        return (tuple(InverseWeight("translation", body) for body in says.bodies),)
    assert isinstance(says, DryFriction | Limit)
    if not isinstance(says.of, str):
        return ((InverseWeight("tendon", says.of.name),),)
    count = says.velocities if isinstance(says, DryFriction) else 1
    return tuple((InverseWeight("joint" if number < _LINEAR else "turn", says.of),) for number in range(count))


def rules_in(root: etree._Element) -> tuple[StepRule, ...]:
    """The rules of all integrators by the options of a file with this root element, first the one that the file chooses."""
    length = time_step(root)
    chosen = _option(root, "integrator")
    euler = frozenset({ImplicitPart.JOINT_DAMPERS} if is_on(root, "eulerdamp") else ())
    rules = (
        StepRule("Euler", length, euler),
        StepRule("RK4", length, stages=_STAGES, weights=_WEIGHTS),
        StepRule("implicit", length, _DAMPERS | {ImplicitPart.VELOCITY_TERMS}, along_branches=True),
        StepRule("implicitfast", length, _DAMPERS | {ImplicitPart.VELOCITY_TERMS_OF_FREE_BODIES}, along_branches=True),
        StepRule(
            "discrete",
            length,
            _DAMPERS | _SPRINGS | {ImplicitPart.VELOCITY_TERMS_OF_FREE_BODIES},
        ),
    )
    return tuple(sorted(rules, key=lambda rule: rule.name != chosen))
