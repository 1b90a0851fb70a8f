"""The mechanism that an engine documents: what it reads of a file, with the elements that are on by the laws of its documentation."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

from harness.comparison.switches import Switch, constraints_among
from harness.engines import ConstraintLaw, Engine
from harness.explain.changes.departures import Departure, departed
from harness.explain.changes.readings import element_at
from harness.explain.meant import reference_of
from harness.files.equalities import Constraint
from harness.files.findings import SWITCHED_OFF
from harness.programs.mechanisms.mechanism import Mechanism
from harness.trees.mechanism import RobotMechanism
from harness.trees.robot import Robot
from harness.truth.optimum import optimum


def laws_of(
    robot: Robot, caller: Engine, switches: Sequence[Switch], contacts: Sequence[Constraint] = ()
) -> tuple[list[Constraint], Mapping[str, ConstraintLaw]]:
    """The constraints among what is on, with these contacts, and the laws that the engine documents of them."""
    chosen = [*constraints_among(robot, switches), *contacts]
    return chosen, caller.laws(element_at(robot.tree.place), robot.format, chosen)


def switched_off_by_file(switches: Sequence[Switch], read: Robot, caller: Engine) -> list[Switch]:
    """The same; an element that the file switches off has no law, and says so."""
    known = [one for one in switches if not one.why_not and one.group.what not in caller.why_off]
    chosen, laws = laws_of(read, caller, known)
    lawless = {one.name for one in chosen} - set(laws)
    return [
        replace(one, why_not=SWITCHED_OFF) if lawless & {own.name for own in constraints_among(read, [one])} else one for one in switches
    ]


def documented(
    robot: Robot,
    caller: Engine,
    switches: Sequence[Switch],
    departures: Iterable[Departure] = (),
    contacts: Sequence[Constraint] = (),
    mechanism: Mechanism | None = None,
) -> Mechanism:
    """A robot with some of its constraints by the laws that an engine documents, or with departures from them.

    ``mechanism`` has its equations of motion, where they are written.
    """
    chosen, laws = laws_of(robot, caller, switches, contacts)
    laws = departed(departures, robot.tree, chosen, laws)
    mechanism = mechanism or reference_of(robot).mechanism
    assert isinstance(mechanism, RobotMechanism)
    return optimum(mechanism, robot, chosen, laws, caller.fuses(element_at(robot.tree.place), robot.format))
