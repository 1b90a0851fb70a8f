"""The joints of a stage: their kinds, their numbers in the namespaces that state them, and what ties bodies besides.

Angles, and what is per angle, are in degrees in ``physics``, ``drive``, ``limit`` and ``newton``, and in radians in ``mjc`` but for
``mjc:ref`` and ``mjc:springref``, which are in what ``mjc:compiler:angle`` says, degrees by default. Where several namespaces state one
number, ``newton`` is stronger than ``mjc``, which its schema calls deprecated there, and that than ``physxJoint``.

Source: OpenUSD documentation, UsdPhysicsJoint and its kinds; newton-usd-schemas, NewtonJointAPI and NewtonMimicAPI; MuJoCo documentation,
OpenUSD, MjcJointAPI; PhysX USD schemas, PhysxJointAPI and PhysxMimicJointAPI.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from fractions import Fraction
from typing import Any

from harness.files.document.stage import Prim
from harness.files.equalities import BY_DEFAULT, Equality, Linkage, Meeting, SolverParameters, Weld
from harness.files.given import Given, Pose
from harness.files.joint_kinds import JointKind
from harness.files.tree import Joint
from harness.files.usd.frames import UNITS, Units, opposite, radians, times

PER_DEGREE = 180 / math.pi
KINDS: Mapping[str, JointKind | None] = {
    "PhysicsRevoluteJoint": JointKind.HINGE,
    "PhysicsPrismaticJoint": JointKind.SLIDE,
    "PhysicsSphericalJoint": JointKind.BALL,
    "PhysicsFixedJoint": None,
}
# Of six degrees of freedom, and of a length, which no tree holds.
GENERIC, DISTANCE = "PhysicsJoint", "PhysicsDistanceJoint"
JOINTS = (*KINDS, GENERIC, DISTANCE)
_DEGREES = ("transX", "transY", "transZ", "rotX", "rotY", "rotZ")
_ALL, _TURNS, _PLANE = frozenset(_DEGREES), frozenset(_DEGREES[3:]), frozenset(("transX", "transY", "rotZ"))
# By field: namespaces with their unit per degree, the strongest first.
_NUMBERS = {
    "armature": (("newton:armature", False), ("mjc:armature", False), ("physxJoint:armature", False)),
    "damping": (("newton:damping", True), ("mjc:damping", False)),
    "friction_loss": (("newton:friction", False), ("mjc:frictionloss", False)),
    "stiffness": (("mjc:stiffness", False),),
}


class JointReader:
    """Reads joints whose bodies are known; ``in_degrees`` says in what ``mjc:ref`` is.

    Attributes:
        weaker: attributes that a stronger namespace contradicts.
    """

    def __init__(self, units: Units, in_degrees: bool) -> None:
        self._units, self._in_degrees = units, in_degrees
        self.weaker: list[tuple[Prim, str]] = []

    def kind(self, prim: Prim) -> tuple[JointKind | None, str]:
        """The kind of a joint, None for a fixed one, and the degree of freedom that it has alone, as "rotX"; "" for other kinds.

        Raises:
            InvalidModel: it is of no kind that a tree has.
        """
        if prim.kind == DISTANCE:
            prim.refuse("holds two points at a distance, which is not read; leave it out, or disable it")
        if prim.kind != GENERIC:
            kind, axis = KINDS[prim.kind], prim.word("physics:axis", "X")
            if axis not in UNITS:
                prim.refuse(f"physics:axis is {axis!r}; expected X, Y or Z", "physics:axis")
            return kind, f"{'rot' if kind is JointKind.HINGE else 'trans'}{axis}" if kind is not None and kind.is_single else ""
        free = frozenset(one for one in _DEGREES if not self._is_locked(prim, one))
        if len(free) == 1:
            (one,) = free
            return JointKind.HINGE if one in _TURNS else JointKind.SLIDE, one
        kinds = {frozenset[str](): None, _TURNS: JointKind.BALL, _ALL: JointKind.FREE, _PLANE: JointKind.PLANAR}
        if free not in kinds:
            found = ", ".join(one for one in _DEGREES if one in free)
            prim.refuse(f"leaves {found} free, in which engines have other coordinates each; write it as joints of one degree of freedom")
        return kinds[free], ""

    def _is_locked(self, prim: Prim, degree: str) -> bool:
        low, high = (prim.values.get(f"limit:{degree}:physics:{end}") for end in ("low", "high"))
        return low is not None and high is not None and bool(low.numbers) and bool(high.numbers) and low.numbers[0] > high.numbers[0]

    def joint(self, prim: Prim, name: str, pose: Pose, is_reversed: bool) -> Joint | None:
        """The joint in the frame ``pose`` of the body that it carries, the first one where ``is_reversed``; None of a fixed joint."""
        kind, degree = self.kind(prim)
        if kind is None:
            return None
        joint = Joint(
            name, kind, pose=pose, place=prim.place, **({} if kind.has_attitude and kind is JointKind.FREE else self._numbers(prim, kind))
        )
        if kind is JointKind.FREE:
            return joint
        fields: dict[str, Any] = {}
        if kind.has_axis:
            axis = UNITS[degree[-1]] if kind.is_single else UNITS["Z"]
            fields = {"axis": opposite(axis) if is_reversed else axis}
        if kind.is_single:
            fields |= self._positions(prim, kind, degree)
        return Joint(**{**{one: getattr(joint, one) for one in joint.__dataclass_fields__}, **fields})

    def _numbers(self, prim: Prim, kind: JointKind) -> dict[str, Any]:
        """Inertia, damping, friction and stiffness."""
        length, mass, found = self._units.metre, self._units.kilogram, dict[str, Any]()
        unit = mass * length**2 if not kind.linear else mass
        for field, names in _NUMBERS.items():
            written = [(name, number, per_degree) for name, per_degree in names if (number := prim.number(name)) is not None]
            if not written or (field == "stiffness" and not kind.is_single):
                continue
            values = [times(number, unit * (PER_DEGREE if per_degree and not kind.linear else 1.0)) for _, number, per_degree in written]
            if field == "friction_loss" and kind.linear:
                values = [times(number, length) for number in values]
            if values[0] < 0:
                prim.refuse(f"{written[0][0]} is {float(written[0][1]):g}; expected zero or more", written[0][0])
            found[field] = values[0]
            self.weaker += [
                (prim, name)
                for (name, _, _), value in zip(written[1:], values[1:], strict=True)
                if not math.isclose(value, values[0], rel_tol=1e-6)
            ]
        for field, name in (("friction_softness", "friction"), ("limit_softness", "limit")):
            found[field] = softness(prim, f"mjc:solref{name}", f"mjc:solimp{name}") or BY_DEFAULT
        if prim.is_on("mjc:actuatorgravcomp", False):
            found["compensated_by_actuators"] = True
        if (margin := prim.number("mjc:margin")) is not None:
            found["margin"] = times(margin, length if kind.linear else 1.0)
        return found

    def _positions(self, prim: Prim, kind: JointKind, degree: str) -> dict[str, Any]:
        """Limits and positions that are measured as the joint is; all in degrees, or all in radians."""
        names = ("physics:lowerLimit", "physics:upperLimit")
        if prim.kind == GENERIC:
            names = (f"limit:{degree}:physics:low", f"limit:{degree}:physics:high")
        low, high = (prim.number(name) for name in names)
        given = {
            field: number
            for field, name in (("reference", "mjc:ref"), ("spring_reference", "mjc:springref"))
            if (number := prim.number(name))
        }
        if kind.linear:
            found: dict[str, Any] = {field: times(number, self._units.metre) for field, number in given.items()}
            if low is not None and high is not None and low < high:
                found["limits"] = times(low, self._units.metre), times(high, self._units.metre)
            return found
        in_degrees = self._in_degrees or not given
        found = {**given, "in_degrees": in_degrees}
        if low is not None and high is not None and low < high:
            found["limits"] = (low, high) if in_degrees else (radians(low, low), radians(high, high))
        return found

    def one_sided(self, prim: Prim) -> bool:
        """True for a limit on one side, which no tree holds."""
        ends = [prim.values.get(name) for name in ("physics:lowerLimit", "physics:upperLimit")]
        return sum(end is not None and bool(end.numbers) and math.isfinite(end.numbers[0]) for end in ends) == 1

    # What ties besides.

    def equality(self, prim: Prim, bodies: tuple[str, str], ends: tuple[Pose, Pose]) -> Equality:
        """The equality of a joint that closes a loop: of frames for a fixed one, and of points for a spherical one."""
        soft = softness(prim, "mjc:solref", "mjc:solimp") or BY_DEFAULT if any(map(_is_soft, prim.schemas)) else None
        about: dict[str, Any] = {"softness": soft, "name": prim.name}
        if prim.kind == "PhysicsSphericalJoint":
            return Equality(prim.kind, prim.place, prim.place.line, Meeting(bodies, *ends), **about)
        if prim.kind == "PhysicsFixedJoint":
            scale = Fraction(next(iter(prim.finite("mjc:torqueScale")), 1))
            return Equality(prim.kind, prim.place, prim.place.line, Weld(bodies, *ends, torque_scale=scale), **about)
        return Equality(
            prim.kind, prim.place, prim.place.line, None, "closes a loop, which is read of fixed and spherical joints alone", **about
        )

    def mimics(self, prim: Prim, names: Mapping[str, str], kinds: Mapping[str, JointKind]) -> Iterator[Equality]:
        """The constraints by which a joint follows another; ``names`` are those of moving joints by path, ``kinds`` theirs by name."""
        newton, physx = prim.words("newton:mimicJoint"), [name for name in prim.values if name.startswith("physxMimicJoint:")]
        leaders = [
            *((leader, "newton:mimicCoef0", "newton:mimicCoef1", 1, "newton:mimicJoint") for leader in newton),
            *(
                (leader, name.replace("referenceJoint", "offset"), name.replace("referenceJoint", "gearing"), -1, name)
                for name in physx
                if name.endswith(":referenceJoint")
                for leader in prim.words(name)
            ),
        ]
        for leader, offset, factor, sign, name in leaders:
            if leader not in names:
                prim.refuse(f"{name} names <{leader}>, which is no joint that moves; name one", name)
            own = names[prim.path]
            constant = prim.number(offset) or Given(0.0, prim.at(name), offset)
            multiple = prim.number(factor) or Given(1.0 if sign > 0 else 0.0, prim.at(name), factor)
            in_metres = times(constant, self._units.metre) if kinds[own].linear else radians(constant, constant)
            further = tuple(prim.number(f"mjc:coef{power}") or Fraction(0) for power in (2, 3, 4))
            soft = softness(prim, "mjc:solref", "mjc:solimp") or BY_DEFAULT if any(map(_is_soft, prim.schemas)) else None
            says = Linkage(
                own, names[leader], (sign * in_metres if sign < 0 else in_metres, sign * multiple if sign < 0 else multiple, *further)
            )
            place = prim.at(name)
            yield Equality("mimic", place, place.line, says, softness=soft, is_active=prim.is_on("newton:mimicEnabled"), name=own)


def _is_soft(schema: str) -> bool:
    return schema.startswith("MjcEquality")


def softness(prim: Prim, solref: str, solimp: str) -> SolverParameters | None:
    """The parameters of MuJoCo's solver at a prim; None where it states none."""
    own, impedance = prim.finite(solref), prim.finite(solimp)
    if not own and not impedance:
        return None
    default = SolverParameters()
    first, second = own[:2] if len(own) > 1 else default.solref
    five = (*impedance[:5], *default.solimp[len(impedance[:5]) :])
    return SolverParameters((first, second), (five[0], five[1], five[2], five[3], five[4]))
