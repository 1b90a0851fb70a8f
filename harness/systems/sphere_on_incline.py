"""Sphere on a rough incline: it rolls with 5/7 g sin(alpha) while mu >= 2/7 tan(alpha); where mu is less it slides, and its spin grows with
5/2 mu g cos(alpha)/R.

Zero: centre of the sphere in the surface of the incline. x points right, z up; the incline falls to the right and is a 3-4-5 triangle.
s > 0 moves the sphere down it, n > 0 away from it, and theta > 0 rolls it down, about +y.
Source: Goldstein, Poole, Safko, Classical Mechanics, 3rd ed., section 2.4, with a sphere in place of the hoop; Greenwood, Principles of
Dynamics, 2nd ed., section 3-4 (Coulomb friction).
"""

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from harness import TIME, Contact, System

s, n, theta = dynamicsymbols("s n theta")
m, R, mu, alpha, g = sp.symbols("m R mu alpha g", positive=True)

SYSTEM = System(
    coordinates={s: "slide", n: "lift", theta: "roll"},
    kinetic=m * (s.diff(TIME) ** 2 + n.diff(TIME) ** 2) / 2 + m * R**2 / 5 * theta.diff(TIME) ** 2,
    potential=m * g * (n * sp.cos(alpha) - s * sp.sin(alpha)),
    contacts={"incline": Contact(gap=n - R, slip=s.diff(TIME) - R * theta.diff(TIME), friction=mu)},
    parameters={m: (2.5, "kg"), R: (0.2, "m"), mu: (0.3, "1"), alpha: (0.6435011087932844, "rad"), g: (9.81, "m/s^2")},
    total_mass=m,
    gravity=g,
    ranges={s: (-1.0, 1.0), n: (0.3, 1.0), s.diff(TIME): (-1.0, 1.0), n.diff(TIME): (-1.0, 1.0), theta.diff(TIME): (-3.0, 3.0)},
)
