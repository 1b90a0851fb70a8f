"""Uniform bar hanging from a fixed pin, with a torsional spring in the pin.

Zero: bar hanging, spring relaxed. x points right, z up; theta > 0 swings the bar towards +x, so the
pin axis is -y.
Source: Rao, Mechanical Vibrations, 5th ed., section 2.3 (undamped torsional system; compound pendulum).
"""

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from harness import TIME, System

theta = dynamicsymbols("theta")
m, L, k_t, g = sp.symbols("m L k_t g", positive=True)

centre = L / 2 * sp.Matrix([sp.sin(theta), -sp.cos(theta)])
velocity = centre.diff(TIME)
inertia = m * L**2 / 12

SYSTEM = System(
    coordinates={theta: "pin"},
    kinetic=m * velocity.dot(velocity) / 2 + inertia * theta.diff(TIME) ** 2 / 2,
    potential=k_t * theta**2 / 2 + m * g * centre[1],
    parameters={m: (1.5, "kg"), L: (1.0, "m"), k_t: (5.0, "N m"), g: (9.81, "m/s^2")},
    total_mass=m,
    gravity=g,
    ranges={theta: (-6.0, 6.0)},
)
