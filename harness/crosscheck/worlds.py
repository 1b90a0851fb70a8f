"""Equal worlds: one state many times in one batch, of which every answer should have the same bits, in each run and by itself.

It is a question about a program and no verdict on it: all of these answers may be as right as one another.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from harness.arrays import Array
from harness.crosscheck.assignment import Assignment
from harness.programs.states import States
from harness.truth.sampling import random_sample

# States that are asked so.
_STATES = 4


def equal_worlds(assignment: Assignment, worlds: int, seed: int) -> tuple[float, str]:
    """The largest difference of a subject's answers at so many equal worlds at once, and a sentence on those of each kind.

    Differences are relative to the largest component of the answer in the first world; 0 for the same bits.
    """
    states = assignment.truth.asked_at(random_sample(assignment.mechanism, _STATES, seed))
    worst: dict[str, tuple[float, str]] = {}
    for number in range(len(states)):
        for kind, what, size in _differences(assignment, states[[number]], worlds):
            if kind not in worst or worst[kind][0] < size:
                worst[kind] = size, f"{what} by {size:.2g}"
    if not worst:
        return 0.0, f"{worlds:,} equal worlds answer with the same bits, in a second run and one by itself too"
    largest = max(size for size, _ in worst.values())
    return largest, f"Equal worlds differ: {', '.join(text for _, text in worst.values())} of the answer"


def _differences(assignment: Assignment, state: States, worlds: int) -> Iterator[tuple[str, str, float]]:
    """Kind, words and size of each way in which answers at one state are not the same bits."""
    equal = state[np.zeros(worlds, dtype=np.int64)]
    first, second, alone = (_rows(assignment.answers(asked)) for asked in (equal, equal, state))
    apart = _apart(first, first[:1])
    if apart.any():
        world = int(apart.argmax())
        yield "world", f"world {world} from world 0 of {worlds:,}", float(apart[world])
    if (again := _apart(second, first)).any():
        yield "run", f"a second run from the first in world {int(again.argmax())}", float(again.max())
    if (single := _apart(alone, first[:1])).any():
        yield "alone", f"a world by itself from world 0 of {worlds:,}", float(single.max())


def _rows(answers: Array) -> Array:
    return np.asarray(answers).reshape(len(answers), -1)


def _apart(answers: Array, others: Array) -> Array:
    """(n,) the largest difference of each answer from the other, relative; infinite where one alone is not finite."""
    differ = answers.view(np.uint64) != np.broadcast_to(others, answers.shape).copy().view(np.uint64)
    with np.errstate(invalid="ignore"):
        size = np.abs(answers - others).max(axis=1) / np.maximum(np.abs(others).max(axis=1), np.finfo(float).tiny)
    # Zeros of both signs are other bits, and no distance.
    return np.where(differ.any(axis=1), np.where(np.isfinite(size), np.maximum(size, np.finfo(float).tiny), np.inf), 0.0)
