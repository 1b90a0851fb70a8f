"""The numbers of dry friction and limits of a user's file by which an engine's answers with these on are explained.

The numbers of their laws are no parameters of the truth: they follow from several of the file's, and differ from state to state. The truth
is certified anew with each value of a number that is tried, and no change is taken for linear where a number is named.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.explain.columns import Whitening
from harness.explain.fit import best_change
from harness.files.equalities import SolverParameters
from harness.files.given import Given, Place
from harness.files.tree import Tree
from harness.results.table import error_text
from harness.trees.bodies.spatial import parameter_name
from harness.truth.compare import compare
from harness.truth.reference import Reference
from harness.verdict import AGREEMENT

# Of a number, by which its effect is measured, and numbers that are fitted, steps of a fit, and numbers that are screened.
DIFFERENCE, MOST_FITTED, MOST_STEPS, MOST_SCREENED = 1e-6, 4, 8, 150

TruthOf = Callable[[Tree], Reference]


@dataclass(frozen=True)
class RowNumber:
    """One number of a file; ``tree`` gives the tree with another value of it."""

    number: Given
    tree: Callable[[float], Tree]


def numbers_of_rows(tree: Tree) -> Iterator[RowNumber]:
    """The numbers of dry friction and limits of joints and tendons, a default that no file gives at the place of its joint or tendon."""
    for body_at, body in enumerate(tree.bodies):
        for joint_at, joint in enumerate(body.joints):

            def with_joint(changed: Any, body_at: int = body_at, joint_at: int = joint_at) -> Tree:
                body = tree.bodies[body_at]
                joints = (*body.joints[:joint_at], changed, *body.joints[joint_at + 1 :])
                return replace(tree, bodies=(*tree.bodies[:body_at], replace(body, joints=joints), *tree.bodies[body_at + 1 :]))

            yield from _numbers_of(joint, with_joint)
    for at, tendon in enumerate(tree.tendons):

        def with_tendon(changed: Any, at: int = at) -> Tree:
            return replace(tree, tendons=(*tree.tendons[:at], changed, *tree.tendons[at + 1 :]))

        yield from _numbers_of(tendon, with_tendon) if not tendon.why_not else ()


def _numbers_of(owner: Any, tree: Callable[[Any], Tree]) -> Iterator[RowNumber]:
    """Those of a joint or a ``BoundTendon``."""
    place = owner.place
    if place is None:
        return

    def other(field: str, value: Fraction, number: Given) -> RowNumber:
        return RowNumber(number, lambda new: tree(replace(owner, **{field: _other(value, new)})))

    def bound(limits: tuple[Fraction, Fraction], index: int) -> RowNumber:
        def changed(new: float) -> Tree:
            low, high = (_other(limits[at], new) if at == index else limits[at] for at in range(2))
            return tree(replace(owner, limits=(low, high)))

        return RowNumber(_given(limits[index], place, "range", index), changed)

    if owner.friction_loss:
        yield other("friction_loss", owner.friction_loss, _given(owner.friction_loss, place, "frictionloss"))
        yield from _of_softness(owner, "friction", place, tree)
    if owner.limits is not None:
        yield from (bound(owner.limits, index) for index in range(2))
        yield other("margin", owner.margin, _given(owner.margin, place, "margin"))
        yield from _of_softness(owner, "limit", place, tree)


def _of_softness(owner: Any, of: str, place: Place, tree: Callable[[Any], Tree]) -> Iterator[RowNumber]:
    field = f"{of}_softness"
    softness: SolverParameters = getattr(owner, field)
    for name in ("solref", "solimp"):
        values: tuple[float, ...] = getattr(softness, name)
        for index, own in enumerate(values):

            def changed(value: float, name: str = name, values: tuple[float, ...] = values, index: int = index) -> Tree:
                others = (*values[:index], value, *values[index + 1 :])
                changes: dict[str, Any] = {name: others}
                return tree(replace(owner, **{field: replace(softness, **changes)}))

            yield RowNumber(Given(own, place, f"{name}{of}", index), changed)


def _given(number: Fraction, place: Place, attribute: str, index: int = 0) -> Given:
    return number if isinstance(number, Given) else Given(float(number), place, attribute, index)


def _other(number: Fraction, value: float) -> Fraction:
    return Given(value, number.place, number.attribute, number.index) if isinstance(number, Given) else Fraction(value)


def row_numbers_that_explain(tree: Tree, truth_of: TruthOf, documented: Reference, answers: Array) -> list[str]:
    """A sentence on each number that makes answers agree, the slightest change first; ``documented`` is the truth of the tree."""
    search = _Search(truth_of, documented, answers)
    numbers = list(numbers_of_rows(tree))[:MOST_SCREENED]
    screened = sorted(((search.left_linearly(one), at) for at, one in enumerate(numbers)), key=lambda pair: pair[0])
    found = []
    for left, at in screened[:MOST_FITTED]:
        value = search.fitted(numbers[at]) if left < 1.0 else None
        if value is not None:
            number = numbers[at].number
            behaves = f"{parameter_name(number)} = {float(number):g}: the engine behaves as with {value:.10g}"
            found.append(f"{behaves}, which leaves {error_text(search.worst(numbers[at], value))} data roundoffs")
    return found


class _Search:
    def __init__(self, truth_of: TruthOf, documented: Reference, answers: Array) -> None:
        self._truth_of, self._documented, self._answers = truth_of, documented, answers
        self._whitening = Whitening(documented)
        residual = self._whitening.residual(answers)
        self._seen = documented.certified & np.isfinite(residual).all(axis=1)
        self._here = residual[self._seen]

    def _truth(self, one: RowNumber, value: float) -> Reference | None:
        try:
            return self._truth_of(one.tree(value))
        except (ValueError, ZeroDivisionError):
            # No law has such a number.
            return None

    def _moved(self, one: RowNumber, value: float) -> Array | None:
        """What a value does to the truth, in data roundoffs; None where it has none at a state."""
        truth = self._truth(one, value)
        moved = None if truth is None else self._whitening.change(truth.high - self._documented.high)[self._seen]
        return moved if moved is not None and np.isfinite(moved).all() else None

    def left_linearly(self, one: RowNumber) -> float:
        """Share of the errors that the best small change leaves; 1 for a number that nothing feels."""
        moved = self._moved(one, float(one.number) + self._step(one))
        return 1.0 if moved is None else best_change(moved, self._here)[1]

    @staticmethod
    def _step(one: RowNumber) -> float:
        return DIFFERENCE * (abs(float(one.number)) or 1.0)

    def fitted(self, one: RowNumber) -> float | None:
        """The value by Newton's method on the errors, of as few digits as agree; None where none agrees."""
        start, step = float(one.number), self._step(one)
        value, moved = start, np.zeros_like(self._here)
        for _ in range(MOST_STEPS):
            further = self._moved(one, value + step)
            if further is None:
                return None
            # The errors lessen by what the truth moves.
            change, _ = best_change(moved - further, self._here - moved)
            value += step * change
            moved_there = self._moved(one, value)
            if moved_there is None or not math.isfinite(value):
                return None
            moved = moved_there
            if self.worst(one, value) <= AGREEMENT:
                rounded = (float(f"{value:.{digits}g}") for digits in range(1, 17))
                return next((short for short in rounded if self.worst(one, short) <= AGREEMENT), value)
        return None

    def worst(self, one: RowNumber, value: float) -> float:
        """The largest error that a value leaves [data roundoffs]."""
        truth = self._truth(one, value)
        return math.inf if truth is None else float(compare(truth, self._answers).known("backward_error").max(initial=0.0))
