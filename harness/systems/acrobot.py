"""Acrobot: a planar two-link robot in the vertical plane that hangs by its hands and is driven at the hip.

Zero: both links along +x. x points right, z up; q1 > 0 lifts the first link and q2 > 0 bends the
second one up from it, so both axes are -y. q2 is measured from the first link. Like every joint, the
shoulder takes an applied force too, which the robot leaves at zero.
Source: Spong, The swing up control problem for the Acrobot, IEEE Control Systems Magazine 15 (1995),
with its parameters; Spong, Hutchinson, Vidyasagar, Robot Modeling and Control, section 7.3.
"""

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from harness import TIME, System

q1, q2 = dynamicsymbols("q1 q2")
m1, m2, l1, lc1, lc2, I1, I2, g = sp.symbols("m1 m2 l1 lc1 lc2 I1 I2 g", positive=True)

along_1 = sp.Matrix([sp.cos(q1), sp.sin(q1)])
along_2 = sp.Matrix([sp.cos(q1 + q2), sp.sin(q1 + q2)])
centre_1 = lc1 * along_1
centre_2 = l1 * along_1 + lc2 * along_2
velocity_1, velocity_2 = centre_1.diff(TIME), centre_2.diff(TIME)
turn_1, turn_2 = q1.diff(TIME), q1.diff(TIME) + q2.diff(TIME)

SYSTEM = System(
    coordinates={q1: "shoulder", q2: "hip"},
    kinetic=m1 * velocity_1.dot(velocity_1) / 2 + I1 * turn_1**2 / 2 + m2 * velocity_2.dot(velocity_2) / 2 + I2 * turn_2**2 / 2,
    potential=m1 * g * centre_1[1] + m2 * g * centre_2[1],
    parameters={
        m1: (1.0, "kg"),
        m2: (1.0, "kg"),
        l1: (1.0, "m"),
        lc1: (0.5, "m"),
        lc2: (1.0, "m"),
        I1: (0.083, "kg m^2"),
        I2: (0.33, "kg m^2"),
        g: (9.81, "m/s^2"),
    },
    total_mass=m1 + m2,
    gravity=g,
    ranges={q1.diff(TIME): (-5.0, 5.0), q2.diff(TIME): (-5.0, 5.0)},
)
