"""A file as an engine has it: the mechanism that the engine computes with, its states, and the truth of its answers.

What the reader makes of the file follows from its declared readings, never from an answer. A plain engine on a user's file has all of
them, an aided one those that nothing is supplied for; on a mechanism's model an engine is supplied with all that the model says, so that
its misreadings alone are left. A reader that is mended agrees with the file again, and one that does something else disagrees with both.

Readings act on one tree one after the other, so that one may undo another, or matter only beside it. The effect of a reading is
therefore that of it alone; and where it does nothing alone, that beside all others.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np

from harness.arrays import Array
from harness.engines import Calls, Engine, Model, Unsupported, load_engine
from harness.engines.request import EngineAnswers
from harness.engines.tree_request import asked_joints
from harness.explain.changes.readings import Reading, find_readings
from harness.explain.meant import STATES, Meant, change, columns_of, meant, read_as, request_of, spread, undetermined, why_unread, worst
from harness.files.model_file import ModelFile
from harness.library import Library, Stance
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.states import States
from harness.results.readings import FELT, Effect
from harness.storage import Kept
from harness.trees.mechanism import RobotMechanism, mechanism_of
from harness.trees.robot import Robot, robot_of
from harness.truth.compare import Certified, Comparison, Flags, compare
from harness.truth.quantities import ASKED_ELSEWHERE, Quantity, Truth, TruthBasis, find_quantities
from harness.verdict import AGREEMENT, Verdict

# Readings that may not hold at once; with ten readings there are 55 ways.
_MOST_DROPPED = 2


@dataclass(frozen=True)
class Folded:
    """A robot after readings.

    Attributes:
        robot: after all of them. applied: each that changes what those before it leave, with the robot before it.
    """

    robot: Robot
    applied: tuple[tuple[Reading, Robot], ...]


def fold(robot: Robot, readings: Iterable[Reading]) -> Folded:
    """The readings one after the other; those that leave everything as it is are none of it."""
    applied = []
    for reading in readings:
        changed = reading.read(robot)
        if changed is not robot:
            applied.append((reading, robot))
            robot = changed
    return Folded(robot, tuple(applied))


def read_by(robot: Robot, name: str, engine: Engine, stance: Stance, quantity: str = "") -> Folded:
    """A robot as an engine's reader has it; an aided one is supplied with what some of its readings leave out.

    ``name``: of the engine, with its version where that is not the one beside the harness. ``quantity``: that it is asked for, where that
    is another than accelerations.
    """
    readings = find_readings(name, robot.format, engine.reader, quantity)
    return fold(robot, (one for one in readings if not (stance == Stance.AIDED and one.supplied)))


def misread_by(file: ModelFile, gravity: float, engine: str, library: Library) -> tuple[Robot, Folded]:
    """The robot in a mechanism's model, and what an engine's misreadings make of it; those of numbers that the harness supplies do nothing.

    ``gravity`` [m/s^2] is that of a URDF, which holds none.
    """
    robot = robot_of(file, gravity)
    readings = find_readings(engine, file.format, getattr(load_engine(library, engine), "reader", ""))
    return robot, fold(robot, (one for one in readings if one.is_misread and not one.supplied))


def effects(found: Meant, folded: Folded) -> list[Effect]:
    """Effect of each reading, at a few states: on accelerations, or where one bears on another quantity alone, of all on that."""
    few, readings = found.few, [reading for reading, _ in folded.applied]
    quantity = next((one.quantity for one in readings if one.quantity), "")
    return [_effect(few, reading, robot, readings, quantity) for reading, robot in folded.applied]


def _effect(few: Meant, reading: Reading, robot: Robot, readings: Sequence[Reading], quantity: str) -> Effect:
    alone = _change(few, few.robot, reading.read(few.robot), quantity)
    beside = None
    if len(readings) > 1 and alone is not None and alone <= FELT:
        others = fold(few.robot, [one for one in readings if one is not reading]).robot
        beside = _change(few, fold(few.robot, readings).robot, others, quantity)
    count, places = reading.places(robot)
    return Effect(
        name=reading.name,
        sentence=reading.sentence,
        concerns=reading.concerns,
        lines=tuple(place.line for place in places if place.path == robot.path),
        included=tuple(f"{place.path.name}:{place.line}" for place in places if place.path != robot.path),
        count=count,
        alone=alone,
        source=reading.source,
        remedy=reading.remedy,
        beside=beside,
        is_misread=reading.is_misread,
        page=reading.page,
        quantity=quantity,
    )


def _change(few: Meant, before: Robot, after: Robot, quantity: str) -> float | None:
    """The largest relative change of accelerations, or of another quantity, from one robot to another; as of ``meant.change``."""
    both = [few if robot is few.robot else read_as(few, robot) for robot in (before, after)]
    if not quantity:
        return None if any(one.undetermined for one in both) else change(*both)
    if not set(before.joints) <= set(after.joints):
        return math.inf
    truths = [find_quantities()[quantity].truth(TruthBasis(mechanism_of(one.robot), None, None, False)) for one in both]
    values, others = (truth.evaluate(one.states) for truth, one in zip(truths, both, strict=True))
    return None if values.high.shape != others.high.shape else worst(compare(values, others.high), "relative_error")


def readings_that_do_not_hold(found: Meant, folded: Folded, answers: EngineAnswers) -> list[str]:
    """The fewest readings without which all others explain an answer, a sentence; none where no one or two of them do.

    They are declarations that the engine in use, or this file, departs from.
    """
    readings = [reading for reading, _ in folded.applied]
    for count in range(1, min(_MOST_DROPPED, len(readings)) + 1):
        for dropped in itertools.combinations(readings, count):
            kept = fold(found.robot, [one for one in readings if one not in dropped]).robot
            if _left(found.few, kept, answers) <= AGREEMENT and (left := _left(found, kept, answers)) <= AGREEMENT:
                names = " and ".join(f'"{one.name}"' for one in dropped)
                return [
                    f"without the reading {names} {left:.3g} data roundoffs are left: the engine reads what that is about as the file says"
                ]
    return []


def _left(found: Meant, robot: Robot, answers: EngineAnswers) -> float:
    """The worst backward error of the first answers against what ``robot`` means; infinite where they cannot be compared."""
    if not set(robot.joints) <= set(answers.accelerations):
        return math.inf
    read = read_as(found, robot)
    left = None if read.undetermined else worst(compare(read.truth, answers.of(robot.joints)[: len(found.states)]))
    return math.inf if left is None else left


@dataclass(frozen=True)
class FileAsRead:
    """The file of a mechanism as an engine's reader has it.

    Attributes:
        mechanism: of the file, or of the system whose model it is. robot: in the file. folded: what the readings make of that.
        quantity: that the engine is asked for.
    """

    library: Library
    engine: str
    mechanism: Mechanism
    robot: Robot
    folded: Folded
    quantity: str = ""

    @property
    def why_not(self) -> str:
        """Why states of the file have no accelerations in what is read; "" where they have."""
        return why_unread(self.folded.robot, self.robot) or undetermined(self.folded.robot)

    @property
    def _because(self) -> str:
        """The first reading by which that is so, with what the engine's user can do about it, in brackets."""
        for reading, before in self.folded.applied:
            after = reading.read(before)
            if why_unread(after, self.robot) or undetermined(after):
                return f" ({reading.sentence}: {reading.remedy})"
        return ""

    def into(self, states: States) -> States:
        """States of the mechanism, over the joints of what is read."""
        sizes, read = self.mechanism.joint_sizes, self.folded.robot
        q, v = (_columns({joint: size[which] for joint, size in sizes.items()}, self.robot.joints) for which in (0, 1))
        own = States(states.q[:, q], states.v[:, v], states.tau[:, v], states.time, states.control, states.activation)
        return spread(self.robot, own, asked_joints(read.tree, read.joints))

    @property
    def written(self) -> RobotMechanism:
        """The mechanism of what is read."""
        return mechanism_of(self.folded.robot)

    @property
    def computed(self) -> Mechanism:
        """The mechanism that the engine computes with on a user's file; raises as ``Assignment.as_read``."""
        own, read, engine = self.mechanism, self.folded.robot, self.engine
        if not isinstance(own, RobotMechanism) or own.reader or not self.folded.applied:
            return own
        if self.why_not:
            raise Unsupported(f"as {engine} reads the file, {self.why_not}{self._because}")

        def asked() -> RobotMechanism:
            request = request_of(self.robot, self.library.stance, read)
            if own.held is not None and (own.held.touches or own.held.kinds + own.held.rubbing + own.held.limited):
                request = replace(request, held=own.held)
            return replace(self.written, name=own.name, digest=own.digest, reader=engine, request=request)

        return _READ.get((self.library, engine, own.key, self.quantity), asked)

    def columns(self, quantity: Quantity) -> list[int] | slice | None:
        """The columns of the file's values of a quantity among those of what is read; None where these are others."""
        own, read = self.robot.joints, self.folded.robot
        if read.joints == own:
            return slice(None)
        if not quantity.is_default or not set(own) <= set(read.joints):
            return None
        return columns_of(asked_joints(read.tree, read.joints), own)

    def effects_and_refusal(self, seed: int, failure: str = "") -> tuple[list[Effect], list[str]]:
        """Effect of each reading, at the states of a comparison of the file; or reasons why the engine refuses the file, if it fails."""
        if failure:
            return [], why_refused(self.robot, failure)
        key = self.library, self.engine, self.robot.path, self.robot.tree, self.quantity, seed
        return _EFFECTS.get(key, lambda: effects(meant(self.robot, STATES, seed), self.folded)), []


def _columns(sizes: Mapping[str, int], joints: tuple[str, ...]) -> list[int]:
    """The columns of joints, in their order, where the joints with ``sizes`` stand one after the other."""
    ends = dict(zip(sizes, itertools.accumulate(sizes.values()), strict=True))
    return [column for joint in joints for column in range(ends[joint] - sizes[joint], ends[joint])]


def why_refused(robot: Robot, refusal: str) -> list[str]:
    """The file's numbers of the body that an engine's refusal names, and what is impossible in it, a sentence each."""
    impossible = [f"{one.place}: {one.body}: {one.what}" for one in robot.impossible]
    named = next((body for body in robot.tree.bodies if f"'{body.name}'" in refusal), None)
    if named is None or named.place is None:
        return impossible
    place, numbers = named.place, "no inertia"
    if (inertia := named.inertia) is not None:
        place, numbers = inertia.place_of("moments"), f"{_numbers((inertia.mass,))} kg, {_numbers(inertia.moments)} kg m^2"
    return [f"{place.within(robot.path)}: {named.name}: {numbers}", *impossible]


def _numbers(values: Sequence[Fraction]) -> str:
    return " ".join(f"{float(value):g}" for value in values)


def read_file(library: Library, engine: str, mechanism: Mechanism, model: ModelFile | None, quantity: str) -> FileAsRead:
    """A user's file, whose mechanism is one of a robot, or the model of a mechanism, as an engine has it that is asked for a quantity."""
    if not isinstance(mechanism, RobotMechanism):
        assert model is not None
        return FileAsRead(library, engine, mechanism, *misread_by(model, mechanism.gravity, engine, library), quantity)
    robot, key = mechanism.robot, (library, engine, mechanism.key, quantity)
    folded = _FOLDED.get(key, lambda: read_by(robot, engine, load_engine(library, engine), library.stance, quantity))
    return FileAsRead(library, engine, mechanism, robot, folded, quantity)


class ReadTruth(Truth):
    """The truth of the mechanism that an engine's readings make of a user's file, at the states of the file.

    An answer that agrees with it, and not with the file, is ``explained``.

    Attributes:
        read: the truth, at states of the mechanism as it is read. of_file: that of the file. into: from states of the file to these.
        columns: of the file's values among those that are read; None where they cannot be compared.
    """

    def __init__(self, read: Truth, of_file: Truth, into: Callable[[States], States], columns: list[int] | slice | None) -> None:
        self.read, self.of_file, self.into, self.columns = read, of_file, into, columns
        self.blocks = read.blocks

    @property
    def key(self) -> Hashable:
        """See ``Truth``."""
        return self.read.key, self.of_file.key

    @property
    def is_compiled(self) -> bool:
        """See ``Truth``."""
        return self.read.is_compiled

    def asked_at(self, states: States, share: float = ASKED_ELSEWHERE) -> States:
        """See ``Truth``."""
        return self.of_file.asked_at(states, share)

    def evaluate(self, states: States) -> Certified:
        """See ``Truth``; of what is read."""
        return self.read.evaluate(self.into(states))

    def asks(self, model: Model, states: States) -> Calls:
        """See ``Truth``."""
        return self.read.asks(model, self.into(states))

    def may_lose_digits(self, model: Model) -> bool:
        """See ``Truth``."""
        return self.read.may_lose_digits(model)

    def judge(self, certified: Certified, states: States, answers: Array, model: Model) -> Comparison:
        """See ``Truth``."""
        found = self.read.judge(certified, self.into(states), answers, model)
        explained = found.verdicts == Verdict.AGREES.value
        if explained.any():
            explained[explained] = ~self._agrees_with_file(states[explained], answers[explained])
        return replace(found, verdicts=np.where(explained, Verdict.EXPLAINED.value, found.verdicts))

    def _agrees_with_file(self, states: States, answers: Array) -> Flags:
        if self.columns is None:
            return np.zeros(len(states), dtype=bool)
        own = answers[:, self.columns]
        return np.asarray(compare(self.of_file.evaluate(states), own).verdicts == Verdict.AGREES.value)

    def describe(self, certified: Certified, states: States, answers: Array, model: Model) -> str:
        """See ``Truth``."""
        return self.read.describe(certified, self.into(states), answers, model)


_FOLDED: Kept[Folded] = Kept(32)
_READ: Kept[RobotMechanism] = Kept(32)
_EFFECTS: Kept[list[Effect]] = Kept(32)
