"""Sphere thrown along a rough level floor without spin, as a bowling ball: it slides until it rolls, at 5/7 of its speed v0, after
2 v0 / (7 mu g).

Zero: centre of the sphere at the origin, in the floor. x points right, z up; theta > 0 rolls the sphere along x, about +y.
Source: Greenwood, Principles of Dynamics, 2nd ed., section 3-4 (Coulomb friction); Sommerfeld, Mechanics, section 27 (billiards).
"""

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from harness import TIME, Contact, System

x, z, theta = dynamicsymbols("x z theta")
m, R, mu, g = sp.symbols("m R mu g", positive=True)

SYSTEM = System(
    coordinates={x: "along", z: "lift", theta: "roll"},
    kinetic=m * (x.diff(TIME) ** 2 + z.diff(TIME) ** 2) / 2 + m * R**2 / 5 * theta.diff(TIME) ** 2,
    potential=m * g * z,
    contacts={"floor": Contact(gap=z - R, slip=x.diff(TIME) - R * theta.diff(TIME), friction=mu)},
    parameters={m: (2.5, "kg"), R: (0.2, "m"), mu: (0.3, "1"), g: (9.81, "m/s^2")},
    total_mass=m,
    gravity=g,
    ranges={x: (-1.0, 1.0), z: (0.3, 1.0), x.diff(TIME): (-1.0, 1.0), z.diff(TIME): (-1.0, 1.0), theta.diff(TIME): (-3.0, 3.0)},
)
