"""The mechanism that an engine documents: what it reads of a file, with the elements that are on by the laws of its documentation."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from harness.engines import ConstraintLaw, Engine
from harness.explain.changes.departures import Departure, departed, departures_of
from harness.explain.changes.readings import element_at
from harness.explain.meant import largest_change, reference_of
from harness.explain.switches import Switch, constraints_among, held_with, judged_among, switches_of
from harness.files.equalities import Constraint, DryFriction, Equality, Limit
from harness.files.findings import ACTUATORS, CONTACTS, EQUALITIES, SWITCHED_OFF
from harness.files.touching import Touch
from harness.programs.mechanisms.mechanism import Mechanism
from harness.results.readings import Effect
from harness.trees.mechanism import RobotMechanism, mechanism_of
from harness.trees.robot import Robot, with_actuators
from harness.truth.optimum import optimum
from harness.truth.reference import Reference


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


def all_judged(robot: Robot, caller: Engine) -> list[Switch]:
    """The elements of a robot, as an engine's reader has it, with which the engine's answers are judged at any state."""
    return judged_among(switched_off_by_file(switches_of(robot, robot, caller), robot, caller), caller)


def with_all_on(mechanism: RobotMechanism, caller: Engine) -> RobotMechanism:
    """A user's file with all on with which an engine's answers are judged, as the engine is to load it; smooth where that is nothing."""
    robot, request = mechanism.robot, mechanism.request
    judged = all_judged(robot, caller)
    # One that is supplied with what it leaves out is asked about the tree alone.
    if not judged or request is None or request.aid is not None:
        return mechanism.smooth
    acting = [one.number for one in judged if one.group.what == ACTUATORS]
    if acting != [one.number for one in robot.tree.actuators]:
        mechanism = replace(mechanism_of(with_actuators(robot, acting)), name=mechanism.name, digest=mechanism.digest)
    return replace(mechanism, request=replace(request, held=held_with(robot, judged)))


@dataclass(frozen=True)
class Softening:
    """Makes of a robot's mechanism the one that an engine documents with ``judged`` on, or with departures from that.

    Attributes:
        laws: of the constraints among these. ties: the equalities among them.
    """

    robot: Robot
    caller: Engine
    judged: Sequence[Switch]
    departures: Sequence[Departure]
    laws: Mapping[str, ConstraintLaw]
    ties: tuple[Equality, ...]

    def __call__(self, mechanism: Mechanism) -> Mechanism:
        return documented(self.robot, self.caller, self.judged, self.departures, mechanism=mechanism)


def softening_of(robot: Robot, caller: Engine, departures: Collection[str] = ()) -> Softening | None:
    """That of a user's file with all on, with the departures of these names; None where no constraint is."""
    judged = all_judged(robot, caller)
    chosen, laws = laws_of(robot, caller, judged)
    own = [one for one in departures_of(caller.name, caller.reader) if one.name in departures]
    ties = tuple(one for one in chosen if isinstance(one, Equality))
    return Softening(robot, caller, judged, own, departed(own, robot.tree, chosen, laws), ties) if laws else None


def departing(robot: Robot, caller: Engine) -> dict[Departure, list[Constraint]]:
    """The engine's departures that bear on constraints of a user's file with all on, each with these."""
    chosen, laws = laws_of(robot, caller, all_judged(robot, caller))
    known = departures_of(caller.name, caller.reader)
    return {one: concerned for one in known if (concerned := one.concerned(robot.tree, chosen, laws))}


def effect_of(departure: Departure, concerned: Sequence[Constraint], documented: Reference, departed: Reference) -> Effect:
    """The effect of a departure that concerns some constraints, from accelerations by the documented law to those with it."""
    kinds = set(map(_kind_of, concerned))
    return Effect(
        name=departure.name,
        sentence=departure.sentence,
        concerns=kinds.pop() if len(kinds) == 1 else "constraints",
        lines=tuple(dict.fromkeys(one.line for one in concerned)),
        count=len(concerned),
        alone=largest_change(documented, departed.high, documented.certified & departed.certified),
        source=departure.source,
        remedy=departure.remedy,
        departs=True,
    )


def _kind_of(constraint: Constraint) -> str:
    """The noun of a constraint in the plural; of dry friction that of what rubs."""
    match constraint.says:
        case Touch():
            return CONTACTS
        case Limit():
            return "limits"
        case DryFriction(of=of):
            return "joints" if isinstance(of, str) else "tendons"
        case _:
            return EQUALITIES
