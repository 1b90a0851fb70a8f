"""Atwood's machine: two masses on the ends of a massless rope over a pulley that has inertia.

Zero: both masses at one height. z points up; left and right are the heights of the masses, and turn > 0 lifts the left one, which
hangs towards -x, so the pulley's axis is +y. The rope does not slip: each side of it ties a height to the turn.
Source: Goldstein, Poole, Safko, Classical Mechanics, 3rd ed., section 1.6, example 2, with the pulley's inertia;
Taylor, Classical Mechanics, problem 7.8.
"""

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from harness import TIME, Constraint, System

turn, left, right = dynamicsymbols("turn left right")
m_left, m_right, inertia, R, g = sp.symbols("m_left m_right I R g", positive=True)

SYSTEM = System(
    coordinates={turn: "pulley", left: "rope_left", right: "rope_right"},
    kinetic=m_left * left.diff(TIME) ** 2 / 2 + m_right * right.diff(TIME) ** 2 / 2 + inertia * turn.diff(TIME) ** 2 / 2,
    potential=m_left * g * left + m_right * g * right,
    parameters={m_left: (2.0, "kg"), m_right: (3.0, "kg"), inertia: (0.05, "kg m^2"), R: (0.2, "m"), g: (9.81, "m/s^2")},
    total_mass=m_left + m_right,
    gravity=g,
    ranges={turn: (-5.0, 5.0), left: (-1.0, 1.0), right: (-1.0, 1.0)},
    angles=(turn,),
    constraints={
        "rope_left": Constraint(rows=[left - R * turn], determines=[left]),
        "rope_right": Constraint(rows=[right + R * turn], determines=[right]),
    },
)
