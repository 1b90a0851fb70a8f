"""Bullet's way to the principal axes of an inertia matrix.

Source: bullet3, src/LinearMath/btMatrix3x3.h, ``btMatrix3x3::diagonalize``, as its importer of URDF calls it.
"""

from __future__ import annotations

import numpy as np

from harness.arrays import Array

_THRESHOLD, _STEPS = 1e-6, 30
_EPSILON = 2.0**-52


def diagonalized(matrix: Array) -> tuple[Array, Array, Array]:
    """The moments (3,) that Bullet takes of a symmetric matrix (3, 3), their axes (3, 3) as columns, and what it leaves out there.

    The matrix is axes (diag(moments) + rest) axes'.
    """
    found, axes = np.array(matrix, dtype=float), np.eye(3)
    for step in range(_STEPS):
        p, q = max(((0, 1), (0, 2), (1, 2)), key=lambda place: abs(found[place]))
        largest, allowed = abs(found[p, q]), _THRESHOLD * float(np.abs(np.diag(found)).sum())
        if largest <= _EPSILON * allowed:
            break
        turn = _turn(found, p, q)
        found, axes = turn.T @ found @ turn, axes @ turn
        found[p, q] = found[q, p] = 0.0
        if largest <= allowed or step == _STEPS - 1:
            break
    return np.diag(found).copy(), axes, found - np.diag(np.diag(found))


def _turn(matrix: Array, p: int, q: int) -> Array:
    """Jacobi's rotation by which the element (p, q) vanishes."""
    theta = (matrix[q, q] - matrix[p, p]) / (2 * matrix[p, q])
    tangent = (1.0 if theta >= 0 else -1.0) / (abs(theta) + np.hypot(1.0, theta))
    cosine = 1 / np.hypot(1.0, tangent)
    turn = np.eye(3)
    turn[p, p] = turn[q, q] = cosine
    turn[p, q], turn[q, p] = cosine * tangent, -cosine * tangent
    return turn
