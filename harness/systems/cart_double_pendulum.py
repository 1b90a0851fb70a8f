"""Two uniform bars standing one on the other on a sliding cart: the double inverted pendulum.

Zero: spring relaxed, both bars upright. x points right, z up; positive angles tip the bars towards
+x, so both pins turn about +y. The text measures both angles, theta1 and theta2, from the vertical; the
upper pin turns by their difference. The text's cart is free; here a spring k centres it, as on the cart
of chapter 7.9, for engines that reckon in world coordinates lose digits with the distance of a free one.
Source: Bogdanov, Optimal Control of a Double Inverted Pendulum on a Cart, OGI School of Science and
Engineering, technical report CSE-04-006 (2004), section 2.
"""

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from harness import TIME, System

x, q1, q2 = dynamicsymbols("x q1 q2")
m0, m1, m2, L1, L2, k, g = sp.symbols("m0 m1 m2 L1 L2 k g", positive=True)

theta1, theta2 = q1, q1 + q2
along_1, along_2 = (sp.Matrix([sp.sin(theta), sp.cos(theta)]) for theta in (theta1, theta2))
foot = sp.Matrix([x, 0])
centre_1 = foot + L1 / 2 * along_1
centre_2 = foot + L1 * along_1 + L2 / 2 * along_2
velocity_1, velocity_2 = centre_1.diff(TIME), centre_2.diff(TIME)
I1, I2 = m1 * L1**2 / 12, m2 * L2**2 / 12
of_bar_1 = m1 * velocity_1.dot(velocity_1) / 2 + I1 * theta1.diff(TIME) ** 2 / 2
of_bar_2 = m2 * velocity_2.dot(velocity_2) / 2 + I2 * theta2.diff(TIME) ** 2 / 2

SYSTEM = System(
    coordinates={x: "slide", q1: "lower", q2: "upper"},
    kinetic=m0 * x.diff(TIME) ** 2 / 2 + of_bar_1 + of_bar_2,
    potential=k * x**2 / 2 + m1 * g * centre_1[1] + m2 * g * centre_2[1],
    parameters={
        m0: (1.5, "kg"),
        m1: (0.75, "kg"),
        m2: (0.375, "kg"),
        L1: (0.5, "m"),
        L2: (1.0, "m"),
        k: (150.0, "N/m"),
        g: (9.81, "m/s^2"),
    },
    total_mass=m0 + m1 + m2,
    gravity=g,
    ranges={x: (-0.5, 0.5), x.diff(TIME): (-5.0, 5.0), q1.diff(TIME): (-5.0, 5.0), q2.diff(TIME): (-5.0, 5.0)},
)
