"""Elastic pendulum: a point mass on a massless spring that swings about a fixed pin and does not bend.

Zero: spring hanging, its length r zero; r > 0 always. x points right, z up; phi > 0 swings the mass
towards +x, so the pin axis is -y, and r grows along the spring, away from the pin.
Source: Taylor, Classical Mechanics, chapter 7, problem 7.36.
"""

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from harness import TIME, System

r, phi = dynamicsymbols("r phi")
m, k, l_0, g = sp.symbols("m k l_0 g", positive=True)

mass = r * sp.Matrix([sp.sin(phi), -sp.cos(phi)])
velocity = mass.diff(TIME)

SYSTEM = System(
    coordinates={phi: "pin", r: "spring"},
    kinetic=m * velocity.dot(velocity) / 2,
    potential=k * (r - l_0) ** 2 / 2 + m * g * mass[1],
    parameters={m: (4.0, "kg"), k: (90.0, "N/m"), l_0: (1.5, "m"), g: (9.81, "m/s^2")},
    total_mass=m,
    gravity=g,
    ranges={r: (1.0, 3.0), r.diff(TIME): (-5.0, 5.0)},
)
