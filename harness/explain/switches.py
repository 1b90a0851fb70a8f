"""Kinds of elements of a file of which an engine may let some act and others not, and how it is told to.

A kind is a ``Group``: what of a file it is, why an answer with one of it is not judged, and how an engine is told to let some act.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from harness.engines import Engine
from harness.engines.request import Held, SolverSettings
from harness.explain.changes.readings import element_at
from harness.files.contacts import touching_of
from harness.files.equalities import Constraint, Equality, Meeting, Sum, TendonLinkage, frictions_of, limits_of
from harness.files.findings import ACTUATORS, CONTACTS, EQUALITIES, FRICTION, LIMITS, SWITCHED_OFF, TENDON_LIMITS
from harness.files.tree import WORLD, Actuator
from harness.results.switched_on import SwitchedOnPart
from harness.trees.robot import Robot


@dataclass(frozen=True)
class Group:
    """A kind of elements.

    Attributes:
        what: as of ``LeftOut``. of: all of a file, in its order.
        why_not: why an engine's answer with one is not judged, for what its reader makes of the file; "" where it is.
        acts_unjudged: whether an engine may be asked what one does whose answer is not judged.
        held: what else an engine holds with some of them on.
        constraints: of a robot, those of them that are constraints, each under a name of its own.
        is_told_alone: whether it is told what each does alone.
    """

    what: str
    of: Callable[[Robot], Sequence[Any]]
    why_not: Callable[[Any, Robot], str]
    acts_unjudged: Callable[[Any], bool]
    held: Callable[[Held, Sequence[Switch]], Held]
    constraints: Callable[[Robot, Sequence[Switch]], list[Constraint]] = lambda robot, switches: []
    is_told_alone: bool = True


@dataclass(frozen=True)
class Switch:
    """An element by its number in its group; ``why_not`` as of a part of a record."""

    group: Group
    number: int
    element: Any
    why_not: str

    def part(self, alone: float | None = None) -> SwitchedOnPart:
        one = self.element
        return SwitchedOnPart(what=self.group.what, kind=one.kind, line=one.line, why_not=self.why_not, alone=alone)


def has_switches(robot: Robot) -> bool:
    """True for a file with elements of which an engine may let some act and others not."""
    return any(group.of(robot) for group in GROUPS)


def why_no_equality(equality: Equality, read: Robot) -> str:
    """Why an engine's answer with an equality is not judged; "" where it is."""
    if not equality.is_active:
        return SWITCHED_OFF
    if equality.rows is None:
        return equality.why_not
    joints, bodies = {joint.name for joint in read.tree.joints}, {body.name for body in read.tree.bodies} | {WORLD}
    if isinstance(equality.rows, Meeting):
        named, known = set(equality.rows.bodies), bodies
    elif isinstance(equality.rows, TendonLinkage):
        named, known = {joint for tendon in equality.rows.tendons if isinstance(tendon, Sum) for joint, _ in tendon.terms}, joints
    else:
        named, known = {equality.rows.joint, equality.rows.leader or equality.rows.joint}, joints
    missing = ", ".join(sorted(named - known))
    return f"is about {missing}, which the engine does not have" if missing else ""


def _why_not_driven(actuator: Actuator, read: Robot) -> str:
    """Why an engine's answer with an actuator is not judged; "" where it is."""
    is_read = any(one.number == actuator.number for one in read.tree.actuators)
    return actuator.why_not or ("" if is_read else "is left out by the engine's reader")


def _why_no_row(constraint: Constraint, read: Robot) -> str:
    """Why an engine's answer with dry friction or a limit is not judged; "" where it is."""
    of_tree = [*frictions_of(read.tree), *limits_of(read.tree), *limits_of(read.tree, of_tendons=True)]
    return constraint.why_not or ("" if any(one.name == constraint.name for one in of_tree) else "is left out by the engine's reader")


def _numbered(robot: Robot, switches: Sequence[Switch]) -> list[Constraint]:
    return [
        replace(one, name=f"{one.kind} {number}")
        for switch in switches
        for number, one in [(switch.number, robot.equalities[switch.number])]
    ]


def _names(switches: Sequence[Switch]) -> tuple[str, ...]:
    return tuple(one.element.says.owner for one in switches)


def _limits(what: str, of_tendons: bool) -> Group:
    """Limits of joints or tendons, of which an engine has both of one on, or none; within them there is nothing to tell."""

    def of_owners(robot: Robot) -> list[Constraint]:
        return list({one.name.partition(" of ")[2]: one for one in limits_of(robot.tree, of_tendons)}.values())

    def chosen(robot: Robot, switches: Sequence[Switch]) -> list[Constraint]:
        own = {one.element.name.partition(" of ")[2] for one in switches}
        return [one for one in limits_of(robot.tree, of_tendons) if one.name.partition(" of ")[2] in own]

    def held(held: Held, switches: Sequence[Switch]) -> Held:
        return replace(held, limited=(*held.limited, *_names(switches)))

    return Group(what, of_owners, _why_no_row, lambda _: False, held, chosen, is_told_alone=False)


GROUPS = (
    Group(
        EQUALITIES,
        of=lambda robot: robot.equalities,
        why_not=why_no_equality,
        acts_unjudged=lambda one: one.is_active,
        held=lambda held, own: replace(held, switched_on=tuple(one.number for one in own)),
        constraints=_numbered,
    ),
    Group(
        ACTUATORS,
        of=lambda robot: robot.actuators,
        why_not=_why_not_driven,
        # Nobody knows its range.
        acts_unjudged=lambda _: False,
        held=lambda held, own: replace(held, actuators=tuple(one.number for one in own)),
    ),
    Group(
        FRICTION,
        of=lambda robot: frictions_of(robot.tree),
        why_not=_why_no_row,
        acts_unjudged=lambda _: False,
        held=lambda held, own: replace(held, rubbing=_names(own)),
        constraints=lambda robot, own: [one for one in frictions_of(robot.tree) if one.name in {other.element.name for other in own}],
    ),
    _limits(LIMITS, of_tendons=False),
    _limits(TENDON_LIMITS, of_tendons=True),
    Group(
        CONTACTS,
        of=lambda robot: touching_of(robot.declared),
        why_not=lambda one, _: one.why_not,
        acts_unjudged=lambda _: False,
        held=lambda held, own: replace(held, touches=bool(own)),
        # Those of each state are found there.
        is_told_alone=False,
    ),
)


def switches_of(original: Robot, read: Robot, caller: Engine) -> list[Switch]:
    """All elements of a robot that a caller may be asked with; ``read`` is what the engine's reader makes of it."""
    about = element_at(original.tree.place), original.format
    whole = {} if caller.unjudged is None else {**caller.unjudged(*about)}
    if caller.contacts is not None:
        whole[CONTACTS] = caller.contacts(*about)[1]
    return [
        Switch(group, number, one, whole.get(group.what) or group.why_not(one, read))
        for group in GROUPS
        if group.what != CONTACTS or caller.contacts is not None
        for number, one in enumerate(group.of(original))
    ]


def judged_among(switches: Sequence[Switch], caller: Engine) -> list[Switch]:
    """The elements with which an engine's answers are judged at any state: contacts are of some states alone."""
    return [one for one in switches if not one.why_not and one.group.what not in (CONTACTS, *caller.why_off)]


def held_with(robot: Robot, switches: Sequence[Switch], solver: SolverSettings | None = None) -> Held:
    """The parts of a robot that an engine is to hold with some of its elements on."""
    held = Held(tuple(one.kind for one in robot.equalities), (), solver)
    for group in GROUPS:
        held = group.held(held, [one for one in switches if one.group is group])
    return held


def constraints_among(robot: Robot, switches: Sequence[Switch]) -> list[Constraint]:
    """The constraints of a robot among what is on, but contacts, which every state has of its own."""
    return [one for group in GROUPS for one in group.constraints(robot, [switch for switch in switches if switch.group is group])]
