"""Mistakes that a step may hold: what makes a wrong answer right is what is wrong with it.

Each is tried on the answers: another rule, which they then have to follow, or the undoing of a convention, after which they have to
follow their own.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from harness.arrays import Array
from harness.certify.certified import Certified
from harness.certify.compare import farthest_block
from harness.certify.numbers import UNIT_ROUNDOFF
from harness.equations.states import States
from harness.files.rules.step_rule import Part, StepRule
from harness.verdict import AGREEMENT

if TYPE_CHECKING:
    from harness.certify.quantities.steps import StepTruth

# What was done to a quaternion (n, 4), with what undoes it, by the quaternion before the step.
Undone = Callable[[Array, Array], Array]


def describe(truth: StepTruth, states: States, certified: Certified, answers: Array) -> str:
    """The block of a wrong answer that is farthest off, and the mistake that explains both blocks of its rule, where one does."""
    block = farthest_block(certified, answers)
    number = block // 2
    rule, own = truth.rules[number], slice(2 * number, 2 * number + 2)
    allowed = AGREEMENT * UNIT_ROUNDOFF * (certified.sensitivity + certified.share)[:, own]

    def explains(expected: Array, found: Array) -> bool:
        lengths = np.linalg.norm((found - expected) @ certified.norm_factor.transpose(0, 2, 1), axis=2)
        return bool((lengths <= allowed)[certified.certified].all())

    sentence = f"Farthest off are the {truth.blocks[block]}"
    of_others = ((one.name, certified.high[:, 2 * other : 2 * other + 2]) for other, one in enumerate(truth.rules) if other != number)
    if names := [name for name, expected in of_others if explains(expected, answers[:, own])]:
        return f"{sentence}; the step is that by {' and '.join(names)}"
    for mistake, changed in _other_rules(rule):
        if explains(truth.by(changed, states), answers[:, own]):
            return f"{sentence}; {mistake}"
    for mistake, undo in CONVENTIONS.items():
        if explains(certified.high[:, own], _with_rotations(truth, states, answers[:, own], undo)):
            return f"{sentence}; {mistake}"
    return sentence


def _other_rules(rule: StepRule) -> Iterator[tuple[str, StepRule]]:
    """Rules that differ in one thing, each with the mistake that makes it."""
    if rule.stages:
        return
    yield "positions follow with the velocities before the step", replace(rule, with_old_velocities=not rule.with_old_velocities)
    for part in Part:
        how = "explicitly, which are implicit" if part in rule.implicit else "implicitly, which are explicit"
        yield f"it takes {part} {how}", replace(rule, implicit=rule.implicit ^ {part})
    yield "dampers act across branches as the rule does not say", replace(rule, along_branches=not rule.along_branches)


def _with_rotations(truth: StepTruth, states: States, answers: Array, undo: Undone) -> Array:
    """Answers, (n, 2, nv + nq), with each of their quaternions undone."""
    mechanism, found = truth.question.mechanism, answers.copy()
    for number, place in enumerate(mechanism.attitudes):
        first = place + number
        before = states.q[:, first : first + 4]
        found[:, 1, mechanism.nv + first : mechanism.nv + first + 4] = undo(answers[:, 1, mechanism.nv + first :][:, :4], before)
    return found


def _product(a: Array, b: Array) -> Array:
    scalar = a[:, :1] * b[:, :1] - (a[:, 1:] * b[:, 1:]).sum(axis=1, keepdims=True)
    return np.concatenate([scalar, a[:, :1] * b[:, 1:] + b[:, :1] * a[:, 1:] + np.cross(a[:, 1:], b[:, 1:])], axis=1)


def _about_own_axes(after: Array, before: Array) -> Array:
    """The turn that the world's axes were taken for, about the body's."""
    inverse = before * [1.0, -1.0, -1.0, -1.0] / (before**2).sum(axis=1, keepdims=True)
    return _product(before, _product(after, inverse))


CONVENTIONS: dict[str, Undone] = {
    "quaternions have their scalar last": lambda after, before: after[:, [3, 0, 1, 2]],
    "quaternions are those of the inverse rotations": lambda after, before: after * [1.0, -1.0, -1.0, -1.0],
    "rotations turn about the world's axes": _about_own_axes,
}
