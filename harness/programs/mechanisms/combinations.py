"""Accelerations that solve M a - M a0 = J' f(J a - aref) in float64, for forces that no cost has: where proofs begin.

Each contact parts, sticks, or slides along where it slides by the convex problem of the same rows, or back. From each combination of
these, Newton's method goes on until nothing changes; of many contacts one at a time does something else than by the convex problem.

Source: Qi, Sun, A nonsmooth version of Newton's method, Math. Programming 58 (1993).
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np

from harness.arrays import Array
from harness.programs.mechanisms.descent import Problem

# Combinations that are all tried, steps from each, and of the length of an acceleration what is none, and what is one with another.
_MOST, _STEPS, _SETTLED, _SAME = 64, 50, 1e-11, 1e-7
# Lengths of y across the normal where a contact slides, in part of what it sticks at.
_BEYOND = 4.0


def candidates(problem: Problem, near: Array | None = None) -> list[Array]:
    """The solutions that are found of a problem of one state, (nv,) each, that of the convex problem's zones first.

    ``near``: what rows of contacts leave, one after the other, where the search begins besides.
    """
    with np.errstate(all="ignore"):
        convex = problem.associated.least()[0]
        y = np.array([*_starts(problem, convex), *([] if near is None else [_with_contacts(problem, convex, near)])])
        own = problem[np.zeros(len(y), dtype=np.int64)]
        a, is_settled = own.linear(y), np.zeros(len(y), dtype=np.bool_)
        for _ in range(_STEPS):
            left = np.flatnonzero(~is_settled)
            if not len(left):
                break
            moved = own[left].linear(own[left].left_by(a[left]))
            lengths = [np.sqrt(np.einsum("ni,nij,nj->n", one, own.mass[left], one)) for one in (moved - a[left], moved)]
            a[left], is_settled[left] = moved, lengths[0] <= _SETTLED * lengths[1]
    found: list[Array] = []
    for one in a[is_settled & np.isfinite(a).all(axis=1)]:
        if all(np.abs(one - other).max() > _SAME * np.abs(other).max() for other in found):
            found.append(one)
    return found


def _starts(problem: Problem, y: Array) -> Iterator[Array]:
    """y of all rows, (rows,) each, with the contacts in other zones than by the convex problem, which leaves ``y``."""
    yield y
    ways = [list(_ways(y[one.rows], float(one.friction[0, 0]))) for one in problem.cones]
    if np.prod([float(len(own)) for own in ways]) <= _MOST:
        chosen = [list(own) for own in itertools.product(*ways)]
    else:
        kept = [y[one.rows] for one in problem.cones]
        alike = [list(own) for own in zip(*ways, strict=True)]
        chosen = alike + [[*kept[:place], way, *kept[place + 1 :]] for place, own in enumerate(ways) for way in own]
    for own in chosen:
        start = y.copy()
        for one, way in zip(problem.cones, own, strict=True):
            start[one.rows] = way
        yield start


def _with_contacts(problem: Problem, y: Array, near: Array) -> Array:
    found, sizes = y.copy(), [one.rows.stop - one.rows.start for one in problem.cones]
    for one, own in zip(problem.cones, np.split(near, np.cumsum(sizes)[:-1]), strict=True):
        found[one.rows] = own
    return found


def _ways(y: Array, friction: float) -> Iterator[Array]:
    """y of a contact that parts, that sticks, and that slides to either side."""
    across = float(np.linalg.norm(y[1:]))
    along = y[1:] / across if across else np.eye(len(y) - 1)[0]
    size = max(abs(float(y[0])), across) or 1.0
    yield np.array([size, *(0.0 * along)])
    yield np.array([-size, *(0.0 * along)])
    for sign in (1.0, -1.0):
        yield np.array([-size, *(sign * _BEYOND * max(friction, 1.0) * size * along)])
