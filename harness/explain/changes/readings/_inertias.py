"""Inertias in float64, as readers of engines compute with them."""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from harness.arrays import Array
from harness.files.tree import WORLD, Body, Given, Inertia, Tree

_ROWS, _COLUMNS = (0, 1, 2, 0, 0, 1), (0, 1, 2, 1, 2, 2)


def moving(tree: Tree) -> set[str]:
    """The names of the bodies that some joint moves."""
    found: set[str] = set()
    for body in tree.bodies:
        if body.joints or (body.parent != WORLD and body.parent in found):
            found.add(body.name)
    return found


def matrix_of(inertia: Inertia) -> Array:
    """(3, 3) about the centre of mass, in the frame of the inertia [kg m^2]."""
    matrix = np.zeros((3, 3))
    values = [float(moment) for moment in inertia.moments]
    matrix[_ROWS, _COLUMNS] = matrix[_COLUMNS, _ROWS] = values
    return matrix


def moments_of(matrix: Array) -> tuple[float, ...]:
    """xx, yy, zz, xy, xz, yz of a matrix (3, 3)."""
    return tuple(matrix[_ROWS, _COLUMNS].tolist())


def computed(value: float, body: Body, what: str, index: int = 0) -> Fraction:
    """A number that a reader computes for a body, and rounds as it does one of the file; ``index`` among those called ``what``."""
    place = body.place if body.inertia is None else body.inertia.place
    return Fraction(value) if place is None else Given(value, place, what, index)
