"""Coplanar double pendulum: a point mass on a massless rod, and a second one hanging from the first.

Zero: both rods hanging. x points right, z up; positive angles swing the masses towards +x, so both
axes are -y. The text measures both angles, phi1 and phi2, from the vertical; the second joint turns by
their difference.
Source: Landau, Lifshitz, Mechanics, 3rd ed., section 5, problem 1; Goldstein, Poole, Safko, Classical
Mechanics, 3rd ed., chapter 1, exercise 22.
"""

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from harness import TIME, System

q1, q2 = dynamicsymbols("q1 q2")
m1, m2, l1, l2, g = sp.symbols("m1 m2 l1 l2 g", positive=True)

phi1, phi2 = q1, q1 + q2
mass_1 = l1 * sp.Matrix([sp.sin(phi1), -sp.cos(phi1)])
mass_2 = mass_1 + l2 * sp.Matrix([sp.sin(phi2), -sp.cos(phi2)])
velocity_1, velocity_2 = mass_1.diff(TIME), mass_2.diff(TIME)

SYSTEM = System(
    coordinates={q1: "upper", q2: "lower"},
    kinetic=m1 * velocity_1.dot(velocity_1) / 2 + m2 * velocity_2.dot(velocity_2) / 2,
    potential=m1 * g * mass_1[1] + m2 * g * mass_2[1],
    parameters={
        m1: (2.0, "kg"),
        m2: (1.25, "kg"),
        l1: (1.5, "m"),
        l2: (2.0, "m"),
        g: (9.81, "m/s^2"),
    },
    total_mass=m1 + m2,
    gravity=g,
    # Under a horizontal upper rod both masses fall freely, whatever q2; more turns would only show how q1 + q2 rounds.
    ranges={q2: (-6.5, 6.5), q1.diff(TIME): (-5.0, 5.0), q2.diff(TIME): (-5.0, 5.0)},
)
