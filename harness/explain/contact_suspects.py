"""Contacts that differ from those that an engine tells, and with which the truth is what it answers.

Tried are a friction and a distance that are so many times as large, normals that point the other way, and contacts of two bodies that are
left out. They are tried at a few states at which answers are wrong, beside some at which bodies touch and answers are right.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from harness.arrays import Array, Indices
from harness.explain.touching import Touching
from harness.files.equalities import Constraint
from harness.files.given import Given
from harness.files.touching import Touch
from harness.truth.compare import Comparison, compare
from harness.truth.reference import Reference
from harness.verdict import Verdict

if TYPE_CHECKING:
    from harness.explain.file_case import FileCase

# States at which answers are wrong, and right.
_WRONG, _RIGHT = 12, 4
# The first change of a number, relative, and steps of the search for it.
_FIRST, _STEPS = 2.0**-20, 6

Contacts = Sequence[Constraint]


@dataclass(frozen=True)
class _Scaled:
    """One number of all contacts that is so many times as large; ``change`` makes another contact of one and the factor."""

    words: str
    change: Callable[[Touch, float], Touch]


def _times(number: object, factor: float) -> Given:
    assert isinstance(number, Given)
    return Given(float(number) * factor, number.place, number.attribute, number.index)


_SCALED = (
    _Scaled("friction", lambda touch, by: replace(touch, friction=tuple(_times(one, by) for one in touch.friction))),
    _Scaled("distance", lambda touch, by: replace(touch, distance=_times(touch.distance, by))),
)


def _turned(touch: Touch) -> Touch:
    x, y, z = (_times(one, -1.0) for one in touch.frame[0])
    return replace(touch, frame=((x, y, z), *touch.frame[1:]))


def contacts_explaining(case: FileCase, answers: Array, compared: Comparison) -> list[str]:
    """Sentences on contacts with which the truth is ``answers``, (n, nv), of which ``compared`` says that some are wrong."""
    is_wrong, touches = compared.verdicts == Verdict.DISAGREES.value, case.touching.is_any
    rising = sorted(np.flatnonzero(touches).tolist(), key=lambda number: len(case.touching.contacts[number]))
    own = [*[one for one in rising if is_wrong[one]][:_WRONG], *[one for one in rising if not is_wrong[one]][:_RIGHT]]
    return [*_Tried(case, np.array(own, dtype=np.int64), answers).found()] if own else []


class _Tried:
    """Some states of a case, with the answers there."""

    def __init__(self, case: FileCase, numbers: Indices, answers: Array) -> None:
        self._case = case.among(numbers)
        self._contacts: Sequence[Contacts] = self._case.touching.contacts
        self._answers, self._departures = answers[numbers], case.departures

    def found(self) -> Iterator[str]:
        for scaled in _SCALED:
            if (factor := self._fitted(scaled)) is not None:
                yield f"it is what contacts with {factor:.9g} times the {scaled.words} give"
        if self._fits(self._truth(lambda own: [_with(one, _turned(one.says)) for one in own if isinstance(one.says, Touch)])):
            yield "it is what contacts give whose normals point the other way"
        for bodies in dict.fromkeys(one.says.bodies for own in self._contacts for one in own if isinstance(one.says, Touch)):
            if self._fits(self._truth(partial(_without, bodies))):
                yield f"it is what there is without the contacts of {bodies[0]} and {bodies[1]}"

    def _truth(self, change: Callable[[Contacts], Contacts]) -> Reference:
        contacts = [change(own) for own in self._contacts]
        return replace(self._case, touching=Touching(contacts, np.arange(len(contacts)))).by(self._departures, self._answers)

    def _fits(self, truth: Reference) -> bool:
        verdicts = set(compare(truth, self._answers, factorises=True).verdicts.tolist())
        return Verdict.DISAGREES.value not in verdicts and Verdict.AGREES.value in verdicts

    def _fitted(self, scaled: _Scaled) -> float | None:
        """The factor with which all answers are the truth, by the secant method on the error along what the number does; None without."""

        def truth(change: float) -> Reference:
            return self._truth(lambda own: [_with(one, scaled.change(one.says, 1 + change)) for one in own if isinstance(one.says, Touch)])

        start = truth(0.0)
        with np.errstate(all="ignore"):
            weights = np.where(start.certified & (start.data_roundoff > 0), 1 / start.data_roundoff, 0.0)

        def along(one: Array, other: Array) -> float:
            # The inner product of the norm.
            parts = (start.lengths(one + other) ** 2 - start.lengths(one - other) ** 2) * weights**2 / 4
            return float(np.nansum(parts[start.certified]))

        before, change = start, 0.0
        moved = truth(_FIRST)
        slope = (moved.high - start.high) / _FIRST
        for _ in range(_STEPS):
            size = along(slope, slope)
            if not size > 0:
                return None
            step = along(self._answers - before.high, slope) / size
            change, last = change + step, before
            if not -0.99 < change < 100:
                return None
            before = truth(change)
            if self._fits(before):
                return 1 + change
            if step:
                slope = (before.high - last.high) / step
        return None


def _without(bodies: tuple[str, str], contacts: Contacts) -> Contacts:
    return [one for one in contacts if not (isinstance(one.says, Touch) and one.says.bodies == bodies)]


def _with(constraint: Constraint, touch: Touch) -> Constraint:
    return replace(constraint, says=touch)
