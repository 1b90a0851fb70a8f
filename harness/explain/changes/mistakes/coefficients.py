"""Dampers, springs and rotors of joints go missing, count twice, are left in, or stand in one model only.

The smooth equations hold no Coulomb friction, so the validator refuses a model with some by line and attribute. It never
reaches a diagnosis: the mistake is planted, to see that it is refused, and has no mend.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from harness.explain.changes.mistakes import FixedChange, FreeChange, Mistake, is_zero, times
from harness.files.joint_kinds import JointKind
from harness.files.text.slots import Anatomy, Slot

# What a mistake leaves in, of the natural size, to one digit.
_LEFT_IN = 0.1


@dataclass(frozen=True)
class Coefficient:
    """A slot with its natural size; ``removable``: it is taken away by leaving it out, and not by writing zero."""

    slot: Slot
    size: float
    removable: bool = True


def _coefficient_mistake(
    name: str, title: str, source: str, coefficients: Callable[[Anatomy], Iterator[Coefficient]], stage: str = ""
) -> Mistake:
    """Missing, doubled or left in; and the ``stage`` of MJCF that applies them switched off."""

    def switched(parts: Anatomy, state: str, other: str) -> Iterator[FixedChange]:
        for known, slot in parts.stages.items():
            if known == stage and slot.words == (state,):
                yield FixedChange(f"{stage} stage switched off", [(slot, [other])])

    def altered(one: Coefficient, more: str, factor: str, none: str) -> Iterator[FixedChange]:
        if not is_zero(one.slot.words):
            yield FixedChange(more, [(one.slot, times(one.slot.words, factor))])
            yield FixedChange(none, [(one.slot, None if one.removable else ["0"])])

    def changes(parts: Anatomy) -> Iterator[FixedChange]:
        yield from switched(parts, "disable", "enable")
        for one in coefficients(parts):
            yield from altered(one, "counted twice", "0.5", "left in")

    def free(parts: Anatomy) -> Iterator[FreeChange]:
        for one in coefficients(parts):
            if one.slot.absent:
                yield FreeChange("left out", lambda value, slot=one.slot: [(slot, [repr(value)])], one.size)  # type: ignore[misc]

    def plants(parts: Anatomy) -> Iterator[FixedChange]:
        if not all(is_zero(one.slot.words) for one in coefficients(parts)):
            yield from switched(parts, "enable", "disable")
        for one in coefficients(parts):
            yield from altered(one, "doubled", "2", "left out")
            if one.slot.absent:
                yield FixedChange("left in", [(one.slot, [repr(float(f"{_LEFT_IN * one.size:.1g}"))])])

    return Mistake(name, title, source, changes, free, plants)


def _rotors(parts: Anatomy) -> Iterator[Coefficient]:
    return (Coefficient(joint.armature, parts.inertia(joint)) for joint in parts.joints if joint.armature is not None)


def _dampers(parts: Anatomy) -> Iterator[Coefficient]:
    for joint in parts.joints:
        if joint.damping is not None:
            yield Coefficient(joint.damping, parts.inertia(joint))
    for _, damping, _ in parts.others:
        yield Coefficient(damping, parts.mass, removable=False)


def _springs(parts: Anatomy) -> Iterator[Coefficient]:
    for joint in parts.joints:
        if joint.stiffness is None:
            continue
        # A spring that is relaxed elsewhere than at zero would take its reference along.
        alone = joint.spring_reference is None or is_zero(joint.spring_reference.words)
        yield Coefficient(joint.stiffness, parts.inertia(joint), removable=alone)
        if joint.spring_reference is not None and not is_zero(joint.stiffness.words):
            yield Coefficient(joint.spring_reference, 1.0 if joint.kind == JointKind.HINGE else parts.length, removable=False)
    for stiffness, _, length in parts.others:
        yield Coefficient(stiffness, parts.mass, removable=False)
        yield Coefficient(length, parts.length, removable=False)


ARMATURE = _coefficient_mistake(
    "armature",
    "reflected inertia of a rotor missing, doubled or left in",
    "MuJoCo, XML reference, joint/armature; Drake, Parsing model files, Reflected Inertia",
    _rotors,
)
DAMPING = _coefficient_mistake(
    "damping",
    "damping missing, doubled or left in",
    "Pinocchio's aba stores <dynamics damping> and does not apply it; MuJoCo, XML reference, joint/damping",
    _dampers,
    "damper",
)
SPRING = _coefficient_mistake(
    "spring",
    "spring missing, doubled, left in, or relaxed elsewhere",
    "Pinocchio's MJCF reader passes over stiffness and springref; a plain URDF has no springs",
    _springs,
    "spring",
)
FRICTION = Mistake(
    "friction",
    "Coulomb friction left in",
    "MuJoCo, XML reference, joint/frictionloss; http://wiki.ros.org/urdf/XML/joint, dynamics",
    changes=lambda parts: (),
    plants=lambda parts: [FixedChange("left in", [(joint.friction, ["0.1"])]) for joint in parts.joints if joint.friction is not None],
)
