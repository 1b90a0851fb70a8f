"""Bead on the brachistochrone, the cycloid that a rim point of a rolling wheel describes: the wheel and its carriage are massless.

Zero: bead in the cusp at the origin, at the top of the wheel's rim. x points right, z up; the wheel of radius R hangs under the x axis
and rolls along its underside: slide is the way of its hub, and phi > 0 carries the bead down and towards +x, so the axis is -y. The
path is lowest at phi = pi. In the cusps, phi = 0 and 2 pi, rolling moves no mass: the states keep away from them. Where the bead is
lowest, hub and wheel move it along one line, so that the mass matrix of the tree without the rolling is singular there.
Source: The Euler-Lagrange equations (chapter 7.9), on the brachistochrone; Taylor, Classical Mechanics, example 6.2
and problem 6.25, the tautochrone.
"""

import math

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from harness import TIME, Constraint, System

slide, phi = dynamicsymbols("slide phi")
m, R, g = sp.symbols("m R g", positive=True)

hub = sp.Matrix([slide, -R])
bead = hub + R * sp.Matrix([-sp.sin(phi), sp.cos(phi)])
velocity = bead.diff(TIME)

SYSTEM = System(
    coordinates={slide: "rail", phi: "wheel"},
    kinetic=m * velocity.dot(velocity) / 2,
    potential=m * g * bead[1],
    parameters={m: (16.0, "kg"), R: (2.0, "m"), g: (9.81, "m/s^2")},
    total_mass=m,
    gravity=g,
    ranges={slide: (0.0, 12.0), phi: (0.3, 5.9)},
    constraints={"wheel": Constraint(rows=[phi - slide / R], determines=[slide])},
    assembly={phi: math.pi, slide: 2 * math.pi},
)
