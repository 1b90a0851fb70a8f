"""Bead on the brachistochrone, the cycloid that a rim point of a rolling wheel describes: the wheel and its carriage are massless.

The wheel of radius R hangs under the x axis and rolls along its underside; x points right, z up. phi, the angle of the text, is what
the wheel has rolled since the bead was in a cusp, at the top of the rim; it carries the bead down and towards +x, so the wheel's axis is
-y. The path is lowest at phi = pi. In the cusps, phi = 0 and 2 pi, rolling moves no mass: the states keep away from them. Where the bead
is lowest, hub and wheel move it along one line, so that the mass matrix of the tree without the rolling is singular there.
Zero of the joints: a quarter turn after the cusp, bead at the height of the hub, where it is not: MuJoCo takes the inertias there.
Source: The Euler-Lagrange equations (chapter 7.9), on the brachistochrone; Taylor, Classical Mechanics, example 6.2
and problem 6.25, the tautochrone.
"""

import math

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from harness import TIME, Constraint, System

way, turn = dynamicsymbols("way turn")
m, R, g = sp.symbols("m R g", positive=True)

phi = turn + sp.pi / 2
hub = sp.Matrix([way, -R])
bead = hub + R * sp.Matrix([-sp.sin(phi), sp.cos(phi)])
velocity = bead.diff(TIME)

SYSTEM = System(
    coordinates={way: "rail", turn: "wheel"},
    kinetic=m * velocity.dot(velocity) / 2,
    potential=m * g * bead[1],
    parameters={m: (16.0, "kg"), R: (2.0, "m"), g: (9.81, "m/s^2")},
    total_mass=m,
    gravity=g,
    ranges={way: (-4.0, 9.0), turn: (0.3 - math.pi / 2, 5.9 - math.pi / 2)},
    constraints={"wheel": Constraint(rows=[turn - way / R], determines=[way])},
)
