"""Finger of two phalanges that one tendon bends: it runs over a pulley at each joint, and a motor pulls it.

Zero: finger stretched along +x. x points right, z up; q1 > 0 bends the finger down, and q2 > 0 the outer phalanx further, so both axes are
+y. q2 is measured from the inner phalanx. The tendon of tension T has the moment arms r1 and r2; the motor, whose control is the tension,
winds it up, and can never push. Springs in the joints stretch the finger again, with dampers beside them.
Source: Murray, Li, Sastry, A Mathematical Introduction to Robotic Manipulation, section 6.4 (tendons: h = l + r1 theta1 + r2 theta2).
"""

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from harness import TIME, Actuator, System

q1, q2 = dynamicsymbols("q1 q2")
m1, m2, l1, lc1, lc2, I1, I2, g = sp.symbols("m1 m2 l1 lc1 lc2 I1 I2 g", positive=True)
r1, r2, k1, k2, c = sp.symbols("r1 r2 k1 k2 c", positive=True)
T, T_high = sp.symbols("T T_high", real=True)
T_low = sp.Symbol("T_low", real=True)

along_1 = sp.Matrix([sp.cos(q1), -sp.sin(q1)])
along_2 = sp.Matrix([sp.cos(q1 + q2), -sp.sin(q1 + q2)])
centre_1 = lc1 * along_1
centre_2 = l1 * along_1 + lc2 * along_2
velocity_1, velocity_2 = centre_1.diff(TIME), centre_2.diff(TIME)
turn_1, turn_2 = q1.diff(TIME), q1.diff(TIME) + q2.diff(TIME)

SYSTEM = System(
    coordinates={q1: "knuckle", q2: "middle"},
    kinetic=m1 * velocity_1.dot(velocity_1) / 2 + I1 * turn_1**2 / 2 + m2 * velocity_2.dot(velocity_2) / 2 + I2 * turn_2**2 / 2,
    potential=m1 * g * centre_1[1] + m2 * g * centre_2[1] + k1 * q1**2 / 2 + k2 * q2**2 / 2,
    generalised_forces={q1: -c * q1.diff(TIME), q2: -c * q2.diff(TIME)},
    actuators={"flexor": Actuator(control=T, force=T, moments={q1: r1, q2: r2}, control_range=(T_low, T_high))},
    parameters={
        m1: (0.06, "kg"),
        m2: (0.04, "kg"),
        l1: (0.05, "m"),
        lc1: (0.02, "m"),
        lc2: (0.018, "m"),
        I1: (1.2e-5, "kg m^2"),
        I2: (6e-6, "kg m^2"),
        r1: (0.012, "m"),
        r2: (0.008, "m"),
        k1: (0.05, "N m"),
        k2: (0.03, "N m"),
        c: (0.001, "N m s"),
        T_low: (0.0, "N"),
        T_high: (20.0, "N"),
        g: (9.81, "m/s^2"),
    },
    total_mass=m1 + m2,
    gravity=g,
    ranges={q1: (-0.3, 1.6), q2: (-0.1, 1.9)},
)
