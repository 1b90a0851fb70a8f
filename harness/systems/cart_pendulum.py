"""Pendulum on a sprung sliding cart with a damper in the pin: a tuned mass damper.

Zero: cart where its spring is relaxed, bar hanging. x points right, z up; theta > 0 swings the bar
towards +x, so the pin axis is -y.
Source: The Euler-Lagrange equations (chapter 7.9), example 4.
"""

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from harness import TIME, System

x, theta = dynamicsymbols("x theta")
M, m, L, k, c, g = sp.symbols("M m L k c g", positive=True)

centre = sp.Matrix([x + L / 2 * sp.sin(theta), -L / 2 * sp.cos(theta)])
velocity = centre.diff(TIME)
inertia = m * L**2 / 12

SYSTEM = System(
    coordinates={x: "slide", theta: "pin"},
    kinetic=M * x.diff(TIME) ** 2 / 2 + m * velocity.dot(velocity) / 2 + inertia * theta.diff(TIME) ** 2 / 2,
    potential=k * x**2 / 2 - m * g * L / 2 * sp.cos(theta),
    generalised_forces={theta: -c * theta.diff(TIME)},
    parameters={
        M: (10.0, "kg"),
        m: (1.0, "kg"),
        L: (0.6, "m"),
        k: (270.0, "N/m"),
        c: (0.2, "N m s"),
        g: (9.81, "m/s^2"),
    },
    total_mass=M + m,
    gravity=g,
    ranges={x: (-0.1, 0.1)},
    start={x: 0.03},
)
