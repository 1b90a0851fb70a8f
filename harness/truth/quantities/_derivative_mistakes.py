"""Mistakes that an engine may make of derivatives, each recognised by undoing it in what the engine answers.

A mistake is a declaration: the ways to undo it, each with what it is called. Where the answers agree with the certified derivatives
afterwards at all states, within the data roundoffs that an answer has, the mistake is named.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from harness.arrays import Array
from harness.programs.states import States
from harness.truth.compare import Certified, compare, farthest_block
from harness.verdict import Verdict

if TYPE_CHECKING:
    from harness.truth.quantities.derivatives import DerivativeTruth

# What the derivatives are by, in the order of the answers; the third is what is given beside q and v.
_BY_POSITION, _BY_VELOCITY = 0, 1


# The answers, (n, 3, nv, nv) by column and row, without a mistake, and what the mistake is.
Undone = Iterator[tuple[str, Array]]


@dataclass(frozen=True)
class DerivativeMistake:
    """One kind of mistake; ``undone`` gives the ways in which it may have been made, with the answers without it."""

    undone: Callable[[DerivativeTruth, States, Array], Undone]


def describe(truth: DerivativeTruth, states: States, certified: Certified, answers: Array) -> str:
    """The column and the row that are farthest off, and the mistake that explains all that disagrees, where one does."""
    block = farthest_block(certified, answers)
    # Each component at the length that it has alone.
    errors = np.abs(certified.errors(answers)[:, block]) * np.linalg.norm(certified.norm_factor, axis=1)
    row = int(np.nan_to_num(errors[certified.certified]).max(axis=0).argmax())
    said = f"Farthest off is the {truth.blocks[block]}, in the row of {truth.rows[row]}"
    mistake = recognised(truth, states, certified, answers)
    return f"{said}. {mistake}" if mistake else said


def recognised(truth: DerivativeTruth, states: States, certified: Certified, answers: Array) -> str:
    """The mistake that the answers, (n, 3 nv, nv), are free of disagreement without; "" for none."""
    nv = answers.shape[2]
    matrices = answers.reshape(len(answers), 3, nv, nv)
    for mistake in MISTAKES:
        for name, undone in mistake.undone(truth, states, matrices):
            verdicts = compare(certified, undone.reshape(answers.shape)).verdicts[certified.certified]
            if (verdicts == Verdict.AGREES.value).all():
                return name
    return ""


def _with(matrices: Array, part: int, other: Array) -> Array:
    changed = matrices.copy()
    changed[:, part] = other
    return changed


def _transposed(truth: DerivativeTruth, states: States, matrices: Array) -> Undone:
    for part, name in enumerate(truth.parts):
        yield f"{name} is transposed", _with(matrices, part, matrices[:, part].transpose(0, 2, 1))
    yield "All matrices are transposed", matrices.transpose(0, 1, 3, 2)


def _signs(truth: DerivativeTruth, states: States, matrices: Array) -> Undone:
    for part, name in enumerate(truth.parts):
        yield f"{name} has the other sign", _with(matrices, part, -matrices[:, part])
    for block, name in enumerate(truth.blocks):
        part, column = divmod(block, matrices.shape[2])
        changed = matrices.copy()
        changed[:, part, column] *= -1.0
        yield f"The {name} has the other sign", changed


def _terms(truth: DerivativeTruth, states: States, matrices: Array) -> Undone:
    ways = {"is missing": 1.0, "has the other sign": 2.0, "stands there twice": -1.0}
    terms = {name: columns.reshape(matrices.shape) for name, columns in truth.of_terms(states).items()}
    for term, columns in terms.items():
        for what, times in ways.items():
            for part in (_BY_POSITION, _BY_VELOCITY):
                yield (
                    f"In {truth.parts[part]} the derivative of the {term} {what}",
                    _with(matrices, part, matrices[:, part] + times * columns[:, part]),
                )
            yield f"The derivative of the {term} {what}", matrices + times * columns
    nv = matrices.shape[2]
    for term, columns in terms.items():
        for what, times in ways.items():
            for block, name in enumerate(truth.blocks[: 2 * nv]):
                changed = matrices.copy()
                changed[:, block // nv, block % nv] += times * columns[:, block // nv, block % nv]
                yield f"In the {name} the derivative of the {term} {what}", changed


def _tangents(truth: DerivativeTruth, states: States, matrices: Array) -> Undone:
    mechanism, by_position = truth.mechanism, matrices[:, _BY_POSITION]
    for number, first in enumerate(mechanism.attitudes):
        joint, turn = mechanism.joints[first], rotations(states.q[:, first + number : first + number + 4])
        back, same = turn.transpose(0, 2, 1), np.broadcast_to(np.eye(3), turn.shape)
        ways = {"about the axes of its parent": back, "by half its angle": 2.0 * same, "by twice its angle": 0.5 * same}
        for name, matrix in ways.items():
            yield f"{truth.parts[_BY_POSITION]} turns joint {joint!r} {name}", _with(matrices, 0, _mixed(by_position, first, matrix))


def _mixed(columns: Array, first: int, matrix: Array) -> Array:
    """Three columns from ``first`` on, each replaced by the sum of all three times a row of ``matrix``, (n, 3, 3)."""
    changed = columns.copy()
    changed[:, first : first + 3] = matrix @ columns[:, first : first + 3]
    return changed


def rotations(quaternions: Array) -> Array:
    """The rotation matrices, (n, 3, 3), from the body's frame to the parent's, of quaternions (w, x, y, z)."""
    w, x, y, z = (quaternions / np.linalg.norm(quaternions, axis=1)[:, None]).T
    rows = [
        [w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z],
    ]
    return np.array(rows).transpose(2, 0, 1)


MISTAKES = tuple(map(DerivativeMistake, (_transposed, _signs, _terms, _tangents)))
