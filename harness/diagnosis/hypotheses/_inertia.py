"""Inertia matrices of bodies, and what is added to them about another point.

Source: Featherstone, Rigid Body Dynamics Algorithms, section 2.13, equation 2.63.
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from harness.arrays import Array
from harness.diagnosis.hypotheses._changes import Writes
from harness.models.anatomy.parts import ENTRIES, Inertial

# What is left of a mass or moment after another is taken off, and is rounding.
ROUNDING = Fraction(1, 2**48)
# A moving body needs this much in MuJoCo.
_LEAST = {"mjcf": "1e-15", "urdf": "0"}


def parallel_axis(mass: float, centre: Array) -> Array:
    """m (r^2 1 - r r'), (3, 3) [kg m^2]: what an inertia about a point r away from the centre of mass has more."""
    return mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))


def with_added(inertial: Inertial, added: Array, sign: int, model_format: str) -> Writes:
    """The writes for another inertia matrix, the one that stands there plus or minus ``added``."""
    rows, columns = (0, 1, 2, 0, 0, 1), (0, 1, 2, 1, 2, 2)
    largest = Fraction(float(np.abs(added).max()))
    words = {}
    for name, row, column in zip(ENTRIES, rows, columns, strict=True):
        change = Fraction(float(added[row, column]))
        if not change:
            continue
        total = Fraction(inertial.words[name]) + sign * change
        least = _LEAST[model_format] if row == column else "0"
        # A product of inertia beside moments far above it is their rounding.
        negligible = ROUNDING * (max(abs(change), Fraction(least)) if row == column else largest)
        words[name] = least if abs(total - Fraction(least)) <= negligible else repr(float(total))
    return inertial.rewritten(words)
