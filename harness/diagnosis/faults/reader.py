"""A reader of a file: its answers to changed texts, judged at those certified states at which it agrees on the unchanged file.

A relative change epsilon of a number moves the accelerations by epsilon |D|, D their derivative by its logarithm. The check
fails from AGREEMENT data roundoffs on, so at one state the smallest change that it catches is, by theory,

    epsilon = AGREEMENT * data roundoff / |D|,

and over many states the least of these. D is taken from the engine itself, by central differences; the change that is
really caught is searched for by planting it in the file. A state at which the engine lost digits before anything was
planted shows nothing, and is left out of both.

Source: Higham, Accuracy and Stability of Numerical Algorithms, 2nd ed., section 1.6.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.crosscheck.expected import Expectation
from harness.crosscheck.explanation import written_columns
from harness.engines import Engine, Subject
from harness.errors import InvalidInput
from harness.explain.columns import Whitening
from harness.explain.fit import Projection, explaining_directions
from harness.files.text.scan import Watch, largest_change
from harness.truth.compare import Comparison, compare
from harness.truth.reference import Reference, energy_norm
from harness.verdict import AGREEMENT, Verdict, gravest

# Lost digits are no wrong answer.
RED = (Verdict.DISAGREES.value, Verdict.ERROR.value)
# Ratio of the two changes between which the search for the smallest that is caught ends.
RESOLUTION = 2.0**0.25
# Beyond this ratio to theory, digits are lost on the way from the engine to the verdict.
MOST_ABOVE_THEORY = 10.0
# The search gives up this far above theory, and stops this far below it.
FURTHEST = 2.0**20


@dataclass(frozen=True)
class Reader:
    """One subject's answers, to the unchanged model and to changed texts of it, at n states with certified accelerations."""

    subject: Subject
    engine: Engine
    reference: Reference
    watch: Watch

    @cached_property
    def sound(self) -> np.ndarray[Any, np.dtype[np.bool_]]:
        """(n,) bool; true where the subject agrees on the unchanged model. A state at which it does not can show no change."""
        return np.asarray(self.compared(self.watch.healthy).verdicts == Verdict.AGREES.value)

    @cached_property
    def columns(self) -> list[Array]:
        """Effect of a change of each number of the model at the sound states; see ``harness.crosscheck.explanation``."""
        return [column.values[self.sound] for column in written_columns(self.watch, self.reference)]

    def compared(self, accelerations: Array) -> Comparison:
        """The judgement of answers, (n, nv), at all states."""
        return compare(self.reference, accelerations, self.engine.factorises_mass_matrix)

    def verdict(self, accelerations: Array) -> str:
        """The worst verdict on answers, (n, nv), over the states that are sound, as a cross-check comes to it."""
        verdict = gravest(self.compared(accelerations).verdicts[self.sound].tolist())
        if verdict == Verdict.UNSTABLE.value:
            residual = Whitening(self.reference).residual(accelerations)[self.sound]
            if explaining_directions([Projection.of(self.reference[self.sound], residual, self.columns)]):
                return Verdict.DISAGREES.value
        return verdict

    def answer(self, text: Callable[[float], str], size: float) -> Array | None:
        """The accelerations (n, nv) with a change of a size, in the other direction where that is refused; None where both are."""
        answers = self.watch.accelerations(text(size))
        return self.watch.accelerations(text(-size)) if answers is None else answers

    def catches(self, text: Callable[[float], str], size: float) -> bool:
        """True where the answers to a change of a size are wrong at a sound state."""
        answers = self.answer(text, size)
        return answers is not None and self.verdict(answers) in RED

    def movement(self, accelerations: Array) -> float:
        """``harness.files.text.scan.largest_change`` from the answers to the unchanged model to others, at the sound states."""
        return largest_change(self.watch.healthy[self.sound], accelerations[self.sound], self.watch.nv)

    def theory(self, slope: Array | None) -> float:
        """Smallest change that theory says is caught, from the accelerations' derivative by the change, (n, nv); inf for None."""
        if slope is None:
            return math.inf
        reference = self.reference[self.sound]
        with np.errstate(all="ignore"):
            sizes = AGREEMENT * reference.roundoff_with_share / energy_norm(reference.norm_factor, slope[self.sound])
        return float(np.nanmin(sizes))


def require_sound(path: Path, system: str, subject: Subject, comparison: Comparison, expected: Expectation) -> None:
    """Refuse a subject whose answers to the unchanged model are wrong; those that lost digits as expected are right.

    Raises:
        InvalidInput: it disagrees, answers nothing finite, or agrees nowhere; ``path`` is the file to blame.
    """
    verdict = gravest(comparison.verdicts.tolist())
    error = float(np.nanmax(comparison.backward_error, initial=0.0))
    lost_digits = verdict == expected.verdict == Verdict.UNSTABLE.value and error <= expected.limit
    if verdict != Verdict.AGREES.value and not lost_digits:
        problem = f"the verdict on {subject} is {verdict!r} before any fault is planted (backward error up to {error:.3g})"
        raise InvalidInput(path, None, f"{problem}, so that it can show none; make 'harness check {system}' green first")
    if not (comparison.verdicts == Verdict.AGREES.value).any():
        raise InvalidInput(
            path, None, f"{subject} agrees at none of {len(comparison)} states before any fault is planted; give more --states"
        )


def smallest_caught(theory: float, catches: Callable[[float], bool]) -> float:
    """Smallest size that is caught, searched for from that of ``theory``; inf where none up to ``FURTHEST`` times that is.

    Where all sizes down to ``theory / FURTHEST`` are caught it is that: what is caught below has nothing to do with its size.
    """
    if not np.finfo(np.float64).tiny * FURTHEST < theory < math.inf:
        return math.inf
    low, high = theory, theory
    while high < FURTHEST * theory and not catches(high):
        low, high = high, 2 * high
    if low == high:
        while low > theory / FURTHEST and catches(low / 2):
            low, high = low / 2, low / 2
        if high <= theory / FURTHEST:
            return high
        low /= 2
    found = least_that(catches, low, high)
    return found if found < FURTHEST * theory else math.inf


def least_that(does: Callable[[float], bool], low: float, high: float) -> float:
    """The least size between one that does not and one that does, to ``RESOLUTION``."""
    while high / low > RESOLUTION:
        middle = math.sqrt(low * high)
        low, high = (low, middle) if does(middle) else (middle, high)
    return high
