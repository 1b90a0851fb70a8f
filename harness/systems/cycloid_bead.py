"""Bead on a smooth wire bent into the brachistochrone, the cycloid that a rim point of a rolling wheel describes.

Zero: bead at rest in the cusp at the origin. x points right, z up; phi is the angle the wheel of radius R has rolled
along the underside of the x axis, so it carries the bead down and towards +x; the wire is lowest at phi = pi. In the
cusps, phi = 0 and 2 pi, phi moves no mass: the states keep away from them. Rolling ties the wheel's turn to its way,
which no open tree of joints does: there are no models of it.
Source: The Euler-Lagrange equations (chapter 7.9), on the brachistochrone; Taylor, Classical Mechanics, example 6.2
and problem 6.25, the tautochrone.
"""

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from harness import TIME, System

phi = dynamicsymbols("phi")
m, R, g = sp.symbols("m R g", positive=True)

bead = R * sp.Matrix([phi - sp.sin(phi), sp.cos(phi) - 1])
velocity = bead.diff(TIME)

SYSTEM = System(
    coordinates={phi: "wheel"},
    kinetic=m * velocity.dot(velocity) / 2,
    potential=m * g * bead[1],
    parameters={m: (0.5, "kg"), R: (0.4, "m"), g: (9.81, "m/s^2")},
    total_mass=m,
    gravity=g,
    ranges={phi: (0.3, 5.9)},
)
