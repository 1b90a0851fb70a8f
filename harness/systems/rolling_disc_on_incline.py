"""Uniform disc rolling down an incline without slipping.

Zero: disc's centre at the origin. x points right, z up; the incline falls to the right by alpha, and s > 0 moves the centre down it.
phi > 0 turns the disc as it rolls that way, so the axis is +y. Rolling ties the turn to the way. The incline is a 3-4-5 triangle: the
slope's direction is (4/5, 0, -3/5).
Source: Goldstein, Poole, Safko, Classical Mechanics, 3rd ed., section 2.4 (the hoop that rolls down an inclined plane).
"""

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from harness import TIME, Constraint, System

s, phi = dynamicsymbols("s phi")
m, R, alpha, g = sp.symbols("m R alpha g", positive=True)

centre = s * sp.Matrix([sp.cos(alpha), -sp.sin(alpha)])
velocity = centre.diff(TIME)
inertia = m * R**2 / 2

SYSTEM = System(
    coordinates={s: "slide", phi: "roll"},
    kinetic=m * velocity.dot(velocity) / 2 + inertia * phi.diff(TIME) ** 2 / 2,
    potential=m * g * centre[1],
    parameters={
        m: (3.0, "kg"),
        R: (0.25, "m"),
        alpha: (0.6435011087932844, "rad"),
        g: (9.81, "m/s^2"),
    },
    total_mass=m,
    gravity=g,
    ranges={s: (-2.0, 2.0), s.diff(TIME): (-5.0, 5.0), phi: (-8.0, 8.0)},
    angles=(phi,),
    constraints={"roll": Constraint(rows=[phi - s / R], determines=[phi])},
)
