"""Thin uniform disc that rolls on a horizontal plane without slipping, free to lean and to turn.

Zero: disc upright over the origin, heading along x. z points up; x and y are the way of the centre, whose height is R cos(lean). The disc
yaws about the vertical, leans about its heading, to the right where lean > 0, and spins about its axle, forward where spin > 0: the
axes of the three turns are +z, +x and +y. The point of the rim that touches the plane is at rest: two rows, since its vertical rate is
zero by the height. Flat on the plane, at lean = +-pi/2, yaw and spin are one turn: the states keep away from there. No engine has
rolling, so there are no models.
Source: Neimark, Fufaev, Dynamics of Nonholonomic Systems, chapter 2; Greenwood, Advanced Dynamics, section 4.3;
Routh, Advanced Rigid Dynamics, 6th ed., articles 241 to 244.
"""

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from harness import TIME, Constraint, System

x, y, yaw, lean, spin = dynamicsymbols("x y yaw lean spin")
m, R, g = sp.symbols("m R g", positive=True)

# Axes of the leaning frame, which does not spin: the heading, the axle, and what points from the contact to the centre.
heading = sp.Matrix([sp.cos(yaw), sp.sin(yaw), 0])
level = sp.Matrix([-sp.sin(yaw), sp.cos(yaw), 0])
vertical = sp.Matrix([0, 0, 1])
axle = sp.cos(lean) * level + sp.sin(lean) * vertical
upward = sp.cos(lean) * vertical - sp.sin(lean) * level

rates = sp.Matrix([lean.diff(TIME), spin.diff(TIME) + yaw.diff(TIME) * sp.sin(lean), yaw.diff(TIME) * sp.cos(lean)])
turn = rates[0] * heading + rates[1] * axle + rates[2] * upward
velocity = sp.Matrix([x, y, R * sp.cos(lean)]).diff(TIME)
contact = velocity + turn.cross(-R * upward)
across, about = m * R**2 / 4, m * R**2 / 2

SYSTEM = System(
    coordinates={x: "x", y: "y", yaw: "yaw", lean: "lean", spin: "spin"},
    kinetic=m * velocity.dot(velocity) / 2 + rates.dot(sp.diag(across, about, across) * rates) / 2,
    potential=m * g * R * sp.cos(lean),
    parameters={m: (2.0, "kg"), R: (0.5, "m"), g: (9.81, "m/s^2")},
    total_mass=m,
    gravity=g,
    ranges={x: (-5.0, 5.0), y: (-5.0, 5.0), lean: (-1.2, 1.2), lean.diff(TIME): (-3.0, 3.0), yaw.diff(TIME): (-5.0, 5.0)},
    constraints={"contact": Constraint(rows=contact[:2], determines=[x, y])},
)
