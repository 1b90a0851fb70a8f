"""Painleve's rod: its lower end slides along a rough floor. With mu above 4/3 there are angles at which Coulomb's friction presses the
sliding end into the floor, and the rod has two accelerations, or none.

Zero: rod along x, its centre at the origin. x points right, z up; theta > 0 lifts the right end, so the axis of the turn is -y. The left
end, a ball of radius r about the end of the rod, is the lower one.
Source: Brogliato, Nonsmooth Mechanics, 3rd ed., section 5.6 (Painleve's example); Genot, Brogliato, New results on Painleve paradoxes,
European Journal of Mechanics A 18 (1999).
"""

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from harness import TIME, Contact, System

x, z, theta = dynamicsymbols("x z theta")
m, half, r, mu, g = sp.symbols("m l r mu g", positive=True)
turn = theta.diff(TIME)

SYSTEM = System(
    coordinates={x: "along", z: "lift", theta: "turn"},
    kinetic=m * (x.diff(TIME) ** 2 + z.diff(TIME) ** 2) / 2 + m * half**2 / 6 * turn**2,
    potential=m * g * z,
    contacts={
        "end": Contact(gap=z - half * sp.sin(theta) - r, slip=x.diff(TIME) + (half * sp.sin(theta) + r) * turn, friction=mu),
    },
    parameters={m: (3.0, "kg"), half: (0.5, "m"), r: (0.002, "m"), mu: (1.6, "1"), g: (9.81, "m/s^2")},
    total_mass=m,
    gravity=g,
    ranges={x: (-1.0, 1.0), z: (0.6, 1.0), x.diff(TIME): (-1.0, 1.0), z.diff(TIME): (-1.0, 1.0), theta.diff(TIME): (-3.0, 3.0)},
)
