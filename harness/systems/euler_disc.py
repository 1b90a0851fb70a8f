"""Euler's disc: a thin uniform disc that rolls on its rim on a rough floor while it falls over, between contacts a free body.

The rim rubs in two directions. Steadily, at a constant lean, the disc yaws at a rate W and turns about its axle at a rate w; its centre
goes about a circle of the radius R w / W, and the moments of the forces about the centre give

    3/2 R W w cos(lean) - 1/4 R W^2 sin(lean) cos(lean) + g sin(lean) = 0.

With w = 0 the centre is at rest, W^2 = 4 g / (R cos(lean)), and nothing rubs. Other steady motions take a coefficient of friction of
R W |w| / g.

Zero: disc upright, its centre at the origin, heading along x. z points up. The disc yaws about the vertical, leans about its heading, to
the right where lean > 0, and spins about its axle, forward where spin > 0: the axes of the three turns are +z, +x and +y. A turn about the
axle is spin' + yaw' sin(lean). The slips are those of the point of the rim that is lowest, along the heading and across it.
Source: Moffatt, Euler's disk and its finite-time singularity, Nature 404 (2000); Le Saux, Leine, Glocker, Dynamics of a rolling disk in the
presence of dry friction, Journal of Nonlinear Science 15 (2005); Routh, Advanced Rigid Dynamics, 6th ed., articles 241 to 244.
"""

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from harness import TIME, Contact, System

x, y, z, yaw, lean, spin = dynamicsymbols("x y z yaw lean spin")
m, R, mu, g = sp.symbols("m R mu g", positive=True)

# Axes of the leaning frame, which does not spin: the heading, the axle, and what points from the rim's lowest point to the centre.
heading = sp.Matrix([sp.cos(yaw), sp.sin(yaw), 0])
level = sp.Matrix([-sp.sin(yaw), sp.cos(yaw), 0])
vertical = sp.Matrix([0, 0, 1])
axle = sp.cos(lean) * level + sp.sin(lean) * vertical
upward = sp.cos(lean) * vertical - sp.sin(lean) * level

rates = sp.Matrix([lean.diff(TIME), spin.diff(TIME) + yaw.diff(TIME) * sp.sin(lean), yaw.diff(TIME) * sp.cos(lean)])
turn = rates[0] * heading + rates[1] * axle + rates[2] * upward
velocity = sp.Matrix([x, y, z]).diff(TIME)
rim = velocity + turn.cross(-R * upward)
across, about = m * R**2 / 4, m * R**2 / 2

SYSTEM = System(
    coordinates={x: "x", y: "y", z: "z", yaw: "yaw", lean: "lean", spin: "spin"},
    kinetic=m * velocity.dot(velocity) / 2 + rates.dot(sp.diag(across, about, across) * rates) / 2,
    potential=m * g * z,
    contacts={"rim": Contact(gap=z - R * sp.cos(lean), slip=(rim.dot(heading), rim.dot(level)), friction=mu)},
    parameters={m: (80.0, "kg"), R: (0.5, "m"), mu: (0.5, "1"), g: (9.81, "m/s^2")},
    total_mass=m,
    gravity=g,
    ranges={x: (-0.5, 0.5), y: (-0.5, 0.5), z: (0.6, 1.0), lean: (0.2, 1.2)}
    | {rate.diff(TIME): (-3.0, 3.0) for rate in (x, y, z, yaw, lean)},
)
