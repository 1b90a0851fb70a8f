"""The actuators of a stage: drives of joints, and the actuators of MuJoCo's schema.

A drive is a servo whose control is its target: of the position where it has a stiffness, else of the velocity. The gains of an angular
drive are per degree.

Source: OpenUSD documentation, UsdPhysicsDriveAPI; MuJoCo documentation, OpenUSD, MjcActuator.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from fractions import Fraction
from typing import Any

from harness.files.document.stage import Prim
from harness.files.given import Given
from harness.files.joint_kinds import JointKind
from harness.files.tree import Actuator, Joint, Signed
from harness.files.usd.frames import Units, times
from harness.files.usd.joints import PER_DEGREE

DRIVE, MUJOCO = "PhysicsDriveAPI", "MjcActuator"
_ONE, _ZERO = Fraction(1), (1, Fraction(0))
_READ = {"gainType": ("fixed", "affine"), "biasType": ("none", "affine"), "dynType": ("none", "integrator", "filter", "filterexact")}


def drives_of(prim: Prim, joint: Joint, units: Units) -> Iterator[Actuator]:
    """The drives of a joint of one degree of freedom, to be numbered."""
    for degree in dict.fromkeys(name.split(":")[1] for name in prim.values if name.startswith("drive:")):
        name = f"drive:{degree}:physics"
        stiffness, damping = (prim.number(f"{name}:{one}") for one in ("stiffness", "damping"))
        if not stiffness and not damping:
            continue
        first = f"{name}:{'stiffness' if stiffness else 'damping'}"
        unit = units.kilogram * (1.0 if joint.kind.linear else units.metre**2 * PER_DEGREE)
        about: dict[str, Any] = {"kind": "drive", "name": joint.name, "line": prim.at(first).line, "number": 0, "place": prim.at(first)}
        turns = joint.kind is JointKind.HINGE
        if not joint.kind.is_single or degree not in (
            ("angular", "rotX", "rotY", "rotZ") if turns else ("linear", "transX", "transY", "transZ")
        ):
            yield Actuator(**about, why_not=f"drives {degree} of a {joint.kind} joint, which is not read")
            continue
        if prim.word(f"{name}:type", "force") != "force":
            yield Actuator(**about, why_not="is a drive of the type acceleration, whose gains an engine makes")
            continue
        own = [None if number is None else times(number, unit) for number in (stiffness, damping)]
        gain = own[0] if stiffness else own[1]
        assert gain is not None
        bias: tuple[Signed, ...] = (_ZERO, (-1, own[0]) if own[0] else _ZERO, (-1, own[1]) if own[1] else _ZERO)
        limit = prim.number(f"{name}:maxForce")
        force = None if limit is None else times(limit, units.kilogram * units.metre * (1.0 if joint.kind.linear else units.metre))
        why_not = "aims at a velocity and at a position" if stiffness and prim.number(f"{name}:targetVelocity") else ""
        yield Actuator(
            **about,
            joints=((joint.name, _ONE),),
            gear=(_ONE, *(Fraction(0),) * 5),
            gain=((1, gain), _ZERO, _ZERO),
            bias=bias,
            force_range=None if force is None else (-force, force),
            why_not=why_not,
        )


def actuator_of(prim: Prim, driven: Mapping[str, tuple[tuple[str, Fraction], ...]]) -> Actuator:
    """An actuator of MuJoCo's schema; ``driven`` are joints and fixed tendons by path, each as joints with their multiples."""
    about: dict[str, Any] = {"kind": "general", "name": prim.name, "line": prim.place.line, "number": 0, "place": prim.place}
    target = next(iter(prim.words("mjc:target")), "")
    if target not in driven:
        return Actuator(**about, why_not=f"drives <{target}>, which is no joint of one degree of freedom and no fixed tendon")
    for name, options in _READ.items():
        if (word := prim.word(f"mjc:{name}", options[0])) not in options:
            return Actuator(**about, why_not=f"has {name} {word!r}, which is not read")
    gain, bias = (_three(prim, f"mjc:{name}Prm") for name in ("gain", "bias"))
    gain = gain or ((1, _ONE), _ZERO, _ZERO)
    if prim.word("mjc:gainType", "fixed") == "fixed":
        gain = (gain[0], _ZERO, _ZERO)
    if prim.word("mjc:biasType", "none") == "none" or not bias:
        bias = (_ZERO,) * 3
    if prim.number("mjc:inheritRange"):
        return Actuator(**about, why_not="has mjc:inheritRange, which is not read")
    damping = bias[2][1] if bias[2][1] > 0 else Fraction(0)
    if damping and gain[0][1] == -bias[1][1]:
        return Actuator(**about, why_not="has a ratio of damping, which is not read")
    gear = prim.finite("mjc:gear") or (_ONE,)
    return Actuator(
        **about,
        joints=driven[target],
        gear=(*gear, *(Fraction(0),) * (6 - len(gear))),
        gain=gain,
        bias=bias,
        dynamics=prim.word("mjc:dynType", "none"),
        control_range=_range(prim, "ctrl"),
        activation_range=_range(prim, "act"),
        force_range=_range(prim, "force"),
    )


def _three(prim: Prim, name: str) -> tuple[Signed, ...]:
    numbers = prim.finite(name)[:3]
    return tuple((1, number) for number in numbers) + (_ZERO,) * (3 - len(numbers)) if numbers else ()


def _range(prim: Prim, name: str) -> tuple[Fraction, Fraction] | None:
    return limited(prim, f"mjc:{name}Limited", f"mjc:{name}Range")


def limited(prim: Prim, switch: str, name: str) -> tuple[Fraction, Fraction] | None:
    """A range of MuJoCo's schema, which holds by itself where it is given."""
    place = prim.at(f"{name}:max" if f"{name}:max" in prim.values else f"{name}:min")
    low, high = (prim.number(f"{name}:{end}") or Given(0.0, place, f"{name}:{end}") for end in ("min", "max"))
    word = prim.word(switch, "auto")
    return (low, high) if word == "true" or (word == "auto" and low < high) else None
