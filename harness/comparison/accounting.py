"""The readings of an engine on one file, together: what they make of the robot, what each of them does, and which do not hold.

Readings act on one tree one after the other, so that one may undo another, or matter only beside it. What a reading does is therefore
said alone; and where it does nothing alone, beside all others.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from harness.comparison.truth import STATES_OF_EFFECTS, Meant, change, read_as
from harness.engines.request import EngineAnswers
from harness.explain.changes.readings import Reading
from harness.results.comparison import FELT, Effect
from harness.trees.robot import Robot
from harness.truth.compare import compare
from harness.verdict import AGREEMENT

# Readings that may not hold at once; with ten readings there are 55 ways.
_MOST_DROPPED = 2


@dataclass(frozen=True)
class Folded:
    """What readings make of a robot.

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


def effects(meant: Meant, folded: Folded) -> list[Effect]:
    """What each reading does, at a few states."""
    few = _few(meant)
    readings = [reading for reading, _ in folded.applied]
    return [_effect(few, reading, robot, readings) for reading, robot in folded.applied]


def _few(meant: Meant) -> Meant:
    first = np.arange(min(STATES_OF_EFFECTS, len(meant.states)))
    return Meant(meant.robot, meant.states[first], meant.truth[first])


def _effect(few: Meant, reading: Reading, robot: Robot, readings: Sequence[Reading]) -> Effect:
    alone = change(few, read_as(few, reading.read(few.robot)))
    beside = None
    if len(readings) > 1 and alone is not None and alone <= FELT:
        every = read_as(few, fold(few.robot, readings).robot)
        others = read_as(few, fold(few.robot, [one for one in readings if one is not reading]).robot)
        beside = None if every.undetermined or others.undetermined else change(every, others)
    return Effect(
        name=reading.name,
        sentence=reading.sentence,
        concerns=reading.concerns,
        lines=tuple(place.line for place in reading.places(robot)),
        alone=alone,
        source=reading.source,
        beside=beside,
    )


def readings_that_do_not_hold(meant: Meant, folded: Folded, answers: EngineAnswers) -> list[str]:
    """The fewest readings without which all others explain an answer, a sentence; none where no one or two of them do.

    They are declarations that the engine in use, or this file, departs from.
    """
    readings = [reading for reading, _ in folded.applied]
    for count in range(1, min(_MOST_DROPPED, len(readings)) + 1):
        for dropped in itertools.combinations(readings, count):
            kept = fold(meant.robot, [one for one in readings if one not in dropped]).robot
            if _left(_few(meant), kept, answers) <= AGREEMENT and (left := _left(meant, kept, answers)) <= AGREEMENT:
                names = " and ".join(f'"{one.name}"' for one in dropped)
                return [
                    f"without the reading {names} {left:.3g} data roundoffs are left: the engine reads what that is about as the file says"
                ]
    return []


def _left(meant: Meant, robot: Robot, answers: EngineAnswers) -> float:
    """The worst backward error of the first answers against what ``robot`` means; infinite where they cannot be compared."""
    if not set(robot.joints) <= set(answers.accelerations):
        return np.inf
    read = read_as(meant, robot)
    if read.undetermined:
        return np.inf
    known = compare(read.truth, answers.of(robot.joints)[: len(meant.states)]).known("backward_error")
    return float(known.max()) if len(known) else np.inf
