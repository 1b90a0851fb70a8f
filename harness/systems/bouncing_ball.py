"""Ball that falls on a level floor and bounces: by Newton's law of impact its speed after each is e times that before.

Zero: centre of the ball at the origin, in the floor. z points up. Thrown up with v0, with flights that shrink by e each, it rests after
(2 v0 / g) / (1 - e).
Source: Brogliato, Nonsmooth Mechanics, 3rd ed., section 1.1 (the bouncing ball).
"""

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from harness import TIME, Contact, System

z = dynamicsymbols("z")
m, R, g = sp.symbols("m R g", positive=True)

SYSTEM = System(
    coordinates={z: "lift"},
    kinetic=m * z.diff(TIME) ** 2 / 2,
    potential=m * g * z,
    contacts={"floor": Contact(gap=z - R)},
    parameters={m: (0.5, "kg"), R: (0.1, "m"), g: (9.81, "m/s^2")},
    total_mass=m,
    gravity=g,
    ranges={z: (0.1, 1.0), z.diff(TIME): (-3.0, 3.0)},
)
