"""Chain of n uniform bars, each of its own mass and length, hanging from a fixed pin.

Zero: chain hanging straight down. x points right, z up; joint i turns bar i against bar i - 1, and a positive
angle swings it towards +x, so every axis is -y. The text's angles are absolute, measured from the downward
vertical: the sum of the joint angles up to the bar.
Source: Greenwood, Principles of Dynamics, 2nd ed., section 6-6 (n-bar pendulum by Lagrange's equations).
"""

import itertools

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from harness import TIME, System

SIZES = (2, 3, 10)

g = sp.Symbol("g", positive=True)


def system(n: int) -> System:
    """The chain of ``n`` bars."""
    joints = [dynamicsymbols(f"q{i}") for i in range(1, n + 1)]
    masses, lengths = (sp.symbols(f"{name}1:{n + 1}", positive=True) for name in "mL")
    absolute = list(itertools.accumulate(joints))
    turns = [angle.diff(TIME) for angle in absolute]
    kinetic, height = sp.S.Zero, sp.S.Zero
    for i, (angle, turn, m, length) in enumerate(zip(absolute, turns, masses, lengths, strict=True)):
        below = sum(masses[i + 1 :])
        # A bar's end carries every bar below it; its own mass acts at half its length.
        kinetic += length**2 * (m / 3 + below) * turn**2 / 2
        height -= length * (m / 2 + below) * sp.cos(angle)
        for other, other_turn, other_length in zip(absolute[:i], turns[:i], lengths[:i], strict=True):
            kinetic += length * other_length * (m / 2 + below) * turn * other_turn * sp.cos(angle - other)
    return System(
        coordinates={joint: f"joint_{i}" for i, joint in enumerate(joints, start=1)},
        kinetic=kinetic,
        potential=g * height,
        parameters={**dict.fromkeys(masses, (1.0, "kg")), **dict.fromkeys(lengths, (0.5, "m")), g: (9.81, "m/s^2")},
        total_mass=sum(masses),
        gravity=g,
    )
