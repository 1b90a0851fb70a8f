"""Chain of n equal uniform bars hanging from a fixed pin, each pinned to the end of the one above.

Zero: chain hanging straight down. x points right, z up; joint i turns bar i against bar i - 1, and a
positive angle swings it towards +x, so every axis is -y. The energies are written in the text's angles, which are
absolute, measured from the downward vertical.
Source: Greenwood, Principles of Dynamics, 2nd ed., section 6-6 (n-bar pendulum by Lagrange's equations).
"""

import itertools

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from harness import TIME, System

SIZES = (3, 6, 12)

m, L, g = sp.symbols("m L g", positive=True)


def system(n: int) -> System:
    """The chain of ``n`` bars."""
    angles = [dynamicsymbols(f"q{i}") for i in range(1, n + 1)]
    turns = [angle.diff(TIME) for angle in angles]
    kinetic, height = [], []
    for i, (angle, turn) in enumerate(zip(angles, turns, strict=True)):
        bars_below = n - 1 - i
        # A bar's end carries every bar below it; its own mass acts at half its length.
        kinetic.append(m * L**2 * (sp.Rational(1, 3) + bars_below) * turn**2 / 2)
        height.append(-L * (sp.Rational(1, 2) + bars_below) * sp.cos(angle))
        for other, other_turn in zip(angles[:i], turns[:i], strict=True):
            kinetic.append(m * L**2 * (sp.Rational(1, 2) + bars_below) * turn * other_turn * sp.cos(angle - other))
    return System(
        coordinates={angle: f"joint_{i}" for i, angle in enumerate(angles, start=1)},
        measured_from=dict(itertools.pairwise(reversed(angles))),
        kinetic=sp.Add(*kinetic),
        potential=m * g * sp.Add(*height),
        parameters={m: (1.5, "kg"), L: (0.5, "m"), g: (9.81, "m/s^2")},
        total_mass=n * m,
        gravity=g,
    )
