"""Bead on a smooth hoop that turns freely about its vertical diameter; the torque on the hoop is an applied force.

Zero: hoop in the x-z plane, bead at its +x side. z points up; phi > 0 turns the hoop about +z, rise > 0 lifts the
bead from the hoop's +x side, so its axis is the hoop's -y. The book's theta = rise + pi/2 is zero at the lowest
point. The hoop has the inertia I_h about the vertical; its mass is not felt and left out.
Source: Taylor, Classical Mechanics, section 7.6, the bead on a spinning wire hoop; Goldstein, Poole, Safko,
Classical Mechanics, 3rd ed., chapter 2, exercise 18.
"""

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from harness import TIME, System

phi, rise = dynamicsymbols("phi rise")
I_h, m, R, g = sp.symbols("I_h m R g", positive=True)

theta = rise + sp.pi / 2
# Along the hoop's own axes: in its plane away from the vertical, across its plane, upwards.
velocity = R * sp.Matrix([theta.diff(TIME) * sp.cos(theta), phi.diff(TIME) * sp.sin(theta), theta.diff(TIME) * sp.sin(theta)])

SYSTEM = System(
    coordinates={phi: "hoop", rise: "bead"},
    kinetic=I_h * phi.diff(TIME) ** 2 / 2 + m * velocity.dot(velocity) / 2,
    potential=-m * g * R * sp.cos(theta),
    parameters={I_h: (8.0, "kg m^2"), m: (2.0, "kg"), R: (2.0, "m"), g: (9.81, "m/s^2")},
    total_mass=m,
    gravity=g,
    ranges={phi.diff(TIME): (-5.0, 5.0), rise.diff(TIME): (-5.0, 5.0)},
)
