"""Chain of n equal uniform bars hanging from a fixed pin, each pinned to the end of the one above.

Zero: chain hanging straight down. x points right, z up; joint i turns bar i against bar i - 1, and a
positive angle swings it towards +x, so every axis is -y. The text's angles are absolute, measured from
the downward vertical: the sum of the joint angles up to the bar.
Source: Greenwood, Principles of Dynamics, 2nd ed., section 6-6 (n-bar pendulum by Lagrange's equations).
"""

import itertools

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from harness.system import TIME, System

SIZES = (3, 6, 12)

m, L, g = sp.symbols("m L g", positive=True)


def system(n: int) -> System:
    """The chain of ``n`` bars."""
    joints = [dynamicsymbols(f"q{i}") for i in range(1, n + 1)]
    absolute = list(itertools.accumulate(joints))
    turns = [angle.diff(TIME) for angle in absolute]
    kinetic, height = sp.S.Zero, sp.S.Zero
    for i, (angle, turn) in enumerate(zip(absolute, turns, strict=True)):
        bars_below = n - 1 - i
        # A bar's end carries every bar below it; its own mass acts at half its length.
        kinetic += m * L**2 * (sp.Rational(1, 3) + bars_below) * turn**2 / 2
        height -= L * (sp.Rational(1, 2) + bars_below) * sp.cos(angle)
        for other, other_turn in zip(absolute[:i], turns[:i], strict=True):
            kinetic += m * L**2 * (sp.Rational(1, 2) + bars_below) * turn * other_turn * sp.cos(angle - other)
    return System(
        coordinates={joint: f"joint_{i}" for i, joint in enumerate(joints, start=1)},
        kinetic=kinetic,
        potential=m * g * height,
        parameters={m: (1.5, "kg"), L: (0.5, "m"), g: (9.81, "m/s^2")},
        total_mass=n * m,
        gravity=g,
    )
