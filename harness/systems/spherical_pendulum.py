"""Spherical pendulum: a point mass on a massless rod that swings in every direction about a fixed point.

Zero: rod hanging. z points up; theta is the angle from the downward vertical, phi the azimuth of the plane
of swing, about +z from the x axis. At phi = 0, theta > 0 swings towards +x, so its axis is -y. At theta = 0
and pi the azimuth means nothing, so theta keeps away from both.
Source: Goldstein, Poole, Safko, Classical Mechanics, 3rd ed., chapter 1, derivations and exercises (the
spherical pendulum); Landau, Lifshitz, Mechanics, section 14, problem 1.
"""

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from harness import TIME, System

theta, phi = dynamicsymbols("theta phi")
m, L, g = sp.symbols("m L g", positive=True)

# Along the meridian and along the parallel of latitude.
velocity = L * sp.Matrix([theta.diff(TIME), phi.diff(TIME) * sp.sin(theta)])

SYSTEM = System(
    coordinates={theta: "swing", phi: "azimuth"},
    kinetic=m * velocity.dot(velocity) / 2,
    potential=-m * g * L * sp.cos(theta),
    parameters={m: (4.0, "kg"), L: (2.0, "m"), g: (9.81, "m/s^2")},
    total_mass=m,
    gravity=g,
    ranges={theta: (0.3, 2.8), theta.diff(TIME): (-5.0, 5.0), phi.diff(TIME): (-5.0, 5.0)},
)
