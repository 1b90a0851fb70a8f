"""Collar on a smooth circular guide, held by a spring whose anchor lies off the circle.

Zero: collar at the guide's rightmost point. The guide's centre is the origin; x points right, z up;
theta > 0 lowers the collar, so its axis is +y. The spring is anchored at x = -d and has the free
length d.
Source: The Euler-Lagrange equations (chapter 7.9), example 1.
"""

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from harness import TIME, System

theta = dynamicsymbols("theta")
m, r, d, k, g = sp.symbols("m r d k g", positive=True)

spring_length = sp.sqrt(d**2 + 2 * d * r * sp.cos(theta) + r**2)

SYSTEM = System(
    coordinates={theta: "guide"},
    kinetic=m * r**2 * theta.diff(TIME) ** 2 / 2,
    potential=m * g * r * (1 - sp.sin(theta)) + k * (spring_length - d) ** 2 / 2,
    parameters={
        m: (2.0, "kg"),
        r: (1.5, "m"),
        d: (2.5, "m"),
        k: (120.0, "N/m"),
        g: (9.81, "m/s^2"),
    },
    total_mass=m,
    gravity=g,
)
