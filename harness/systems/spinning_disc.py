"""Disc that spins on a foot: friction about the normal, whose moment is a length times the normal force, slows its spin linearly, by
mu m g / I, until it stands still.

Zero: centre of the foot at the origin, in the floor. z points up; psi > 0 spins the disc about it.
Source: Pfeiffer, Glocker, Multibody Dynamics with Unilateral Contacts, section 5.3 (Coulomb friction), of a turn in place of a slip;
MuJoCo documentation, Computation, section Contact (torsional friction), for the length.
"""

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from harness import TIME, Contact, System

z, psi = dynamicsymbols("z psi")
m, R, foot, mu, g = sp.symbols("m R foot mu g", positive=True)

SYSTEM = System(
    coordinates={z: "lift", psi: "spin"},
    kinetic=m * z.diff(TIME) ** 2 / 2 + m * R**2 / 4 * psi.diff(TIME) ** 2,
    potential=m * g * z,
    contacts={"floor": Contact(gap=z - foot, slip=psi.diff(TIME), friction=mu)},
    parameters={m: (2.0, "kg"), R: (0.1, "m"), foot: (0.05, "m"), mu: (0.02, "m"), g: (9.81, "m/s^2")},
    total_mass=m,
    gravity=g,
    ranges={z: (0.1, 1.0), z.diff(TIME): (-3.0, 3.0)},
)
