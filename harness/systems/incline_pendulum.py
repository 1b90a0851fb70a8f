"""Cart sliding down a smooth incline, with a point mass on a massless rod swinging from it.

Zero: cart at the origin, rod hanging. x points right, z up; the incline falls to the right by alpha, and
s > 0 moves the cart down it. theta > 0 swings the mass towards +x, so the pin axis is -y. The incline is
a 3-4-5 triangle: the slope's direction is (4/5, 0, -3/5).
Source: Landau, Lifshitz, Mechanics, 3rd ed., section 5, problem 2, its line of support tilted by alpha;
Taylor, Classical Mechanics, section 9.1 (pendulum in an accelerating car).
"""

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from harness import TIME, System

s, theta = dynamicsymbols("s theta")
M, m, L, alpha, g = sp.symbols("M m L alpha g", positive=True)

cart = s * sp.Matrix([sp.cos(alpha), -sp.sin(alpha)])
mass = cart + L * sp.Matrix([sp.sin(theta), -sp.cos(theta)])
velocity_c, velocity_m = cart.diff(TIME), mass.diff(TIME)

SYSTEM = System(
    coordinates={s: "slide", theta: "pin"},
    kinetic=M * velocity_c.dot(velocity_c) / 2 + m * velocity_m.dot(velocity_m) / 2,
    potential=M * g * cart[1] + m * g * mass[1],
    parameters={
        M: (3.0, "kg"),
        m: (2.0, "kg"),
        L: (1.5, "m"),
        alpha: (0.6435011087932844, "rad"),
        g: (9.81, "m/s^2"),
    },
    total_mass=M + m,
    gravity=g,
    ranges={s: (-2.0, 2.0), s.diff(TIME): (-5.0, 5.0)},
)
