"""The mechanism that an engine documents: what it reads of a file, with the elements that are on by the laws of its documentation."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from harness.engines import ConstraintLaw, Engine, file_engines
from harness.explain.as_read import read_by
from harness.explain.changes.departures import Departure, departed, departures_of
from harness.explain.changes.readings import element_at
from harness.explain.meant import Meant, largest_change, reference_of
from harness.explain.switches import Switch, constraints_among, held_with, judged_among, switches_of
from harness.files.equalities import Constraint, DryFriction, Equality, Limit
from harness.files.findings import CONTACTS, EQUALITIES, FRICTION, SWITCHED_OFF
from harness.files.touching import Touch
from harness.library import Library, Stance
from harness.programs.mechanisms.mechanism import Mechanism
from harness.results.readings import Effect
from harness.trees.mechanism import RobotMechanism
from harness.trees.robot import Robot
from harness.truth.optimum import optimum
from harness.truth.reference import Reference, ReferenceKernel


def laws_of(
    robot: Robot, caller: Engine, switches: Sequence[Switch], contacts: Sequence[Constraint] = ()
) -> tuple[list[Constraint], Mapping[str, ConstraintLaw]]:
    """The constraints among what is on, with these contacts, and the laws that the engine documents of them."""
    chosen = [*constraints_among(robot, switches), *contacts]
    return chosen, caller.laws(element_at(robot.tree.place), robot.format, chosen) if chosen else {}


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
    fuses = caller.fuses(element_at(robot.tree.place), robot.format)
    return optimum(mechanism, robot, chosen, laws, fuses, caller.step if switches else None)


def all_judged(robot: Robot, caller: Engine, read: Robot | None = None, touches: bool = False) -> list[Switch]:
    """The elements of a robot with which an engine's answers are judged at any state; ``read`` is what its reader makes of the robot.

    With ``touches`` its contacts, too, which are judged where the engine finds some.
    """
    read = robot if read is None else read
    found = switched_off_by_file(switches_of(robot, read, caller), read, caller)
    contacts = [one for one in found if touches and one.group.what == CONTACTS and not one.why_not]
    return [*judged_among(found, caller), *contacts]


def with_all_on(mechanism: RobotMechanism, name: str, caller: Engine, touches: bool = False) -> RobotMechanism:
    """A user's file with all on with which an engine's answers are judged, as the engine, of this name, is to load it.

    ``touches`` as of ``all_judged``.
    """
    request = mechanism.request
    if request is None:
        return mechanism
    judged = all_judged(mechanism.robot, caller, read_by(mechanism.robot, name, caller, Stance.PLAIN).robot, touches)
    return replace(mechanism, request=replace(request, held=held_with(mechanism.robot, judged) if judged else None))


def engine_documenting(what: str, model_format: str, library: Library) -> Engine | None:
    """The first engine that is asked with elements of a kind, of which it documents a law."""
    return next((one for one in file_engines(library).values() if what not in one.why_off and model_format in one.formats), None)


def friction_left_out(robot: Robot, caller: Engine, library: Library) -> tuple[Engine, list[Switch]] | None:
    """Dry friction of a file of which an engine documents that it applies none, with another engine, which documents a law of it."""
    own = [one for one in switches_of(robot, robot, caller) if one.group.what == FRICTION and not one.why_not]
    # One that documents a law applies some.
    if not own or FRICTION not in caller.why_off or laws_of(robot, caller, own)[1]:
        return None
    other = engine_documenting(FRICTION, robot.format, library)
    return None if other is None else (other, own)


def why_no_friction(mechanism: RobotMechanism, caller: Engine, library: Library) -> dict[str, str]:
    """The reason why an engine applies no dry friction of a file that has some; none of a file as the engine's reader has it."""
    left_out = None if mechanism.reader else friction_left_out(mechanism.robot, caller, library)
    return {} if left_out is None else {FRICTION: caller.why_off[FRICTION]}


def effect_of_friction(meant: Meant, caller: Engine, library: Library) -> list[Effect]:
    """The effect of dry friction that an engine leaves out, by the law that another one documents of the file; none where it has none."""
    left_out = friction_left_out(meant.robot, caller, library)
    if left_out is None:
        return []
    other, own = left_out
    rubbing = ReferenceKernel(documented(meant.few.robot, other, own)).evaluate(meant.few.states)
    return [
        Effect(
            name=FRICTION,
            sentence=caller.why_off[FRICTION],
            concerns="joints",
            lines=tuple(dict.fromkeys(one.element.line for one in own)),
            count=len(own),
            alone=largest_change(meant.few.truth, rubbing.high, meant.few.truth.certified & rubbing.certified),
            source=f"by the law that {other.title} documents",
        )
    ]


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


def softening_of(mechanism: RobotMechanism, caller: Engine, library: Library, departures: Collection[str] = ()) -> Softening | None:
    """That of a user's file with all on, with the departures of these names; None where no constraint is.

    A file has dry friction even where its engine applies none; what the engine's reader makes of it has none, nor has a departure of
    that name.
    """
    robot, known = mechanism.robot, departures_of(caller.name, caller.reader)
    left_out = None if mechanism.reader or FRICTION in departures else friction_left_out(robot, caller, library)
    caller, judged = left_out or (caller, all_judged(robot, caller))
    chosen, laws = laws_of(robot, caller, judged)
    own = [one for one in known if one.name in departures]
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
