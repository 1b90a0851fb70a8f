"""Planar two-link arm on servos: a position servo with damping holds the shoulder, a velocity servo drives the elbow.

Zero: both links along +x. x points right, z up; q1 > 0 lifts the upper arm and q2 > 0 bends the forearm up from it, so both axes are -y.
q2 is measured from the upper arm. Controls are the angle u that the shoulder is to have and the rate w that the elbow is to have. Both are
held in their ranges, and so are the torques that the motors give.
Source: Spong, Hutchinson, Vidyasagar, Robot Modeling and Control, chapter 7 (the arm), and chapter 6 (a torque proportional to the error of
the angle, with damping; saturation of actuators).
"""

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from harness import TIME, Actuator, System

q1, q2 = dynamicsymbols("q1 q2")
m1, m2, l1, lc1, lc2, I1, I2, g = sp.symbols("m1 m2 l1 lc1 lc2 I1 I2 g", positive=True)
k_p, k_d, k_v = sp.symbols("k_p k_d k_v", positive=True)
u, w, u_low, u_high, w_low, w_high = sp.symbols("u w u_low u_high w_low w_high", real=True)
T1_low, T1_high, T2_low, T2_high = sp.symbols("T1_low T1_high T2_low T2_high", real=True)

along_1 = sp.Matrix([sp.cos(q1), sp.sin(q1)])
along_2 = sp.Matrix([sp.cos(q1 + q2), sp.sin(q1 + q2)])
centre_1 = lc1 * along_1
centre_2 = l1 * along_1 + lc2 * along_2
velocity_1, velocity_2 = centre_1.diff(TIME), centre_2.diff(TIME)
turn_1, turn_2 = q1.diff(TIME), q1.diff(TIME) + q2.diff(TIME)

SYSTEM = System(
    coordinates={q1: "shoulder", q2: "elbow"},
    kinetic=m1 * velocity_1.dot(velocity_1) / 2 + I1 * turn_1**2 / 2 + m2 * velocity_2.dot(velocity_2) / 2 + I2 * turn_2**2 / 2,
    potential=m1 * g * centre_1[1] + m2 * g * centre_2[1],
    actuators={
        "angle": Actuator(
            control=u,
            force=k_p * (u - q1) - k_d * q1.diff(TIME),
            moments={q1: 1},
            control_range=(u_low, u_high),
            force_range=(T1_low, T1_high),
        ),
        "rate": Actuator(
            control=w,
            force=k_v * (w - q2.diff(TIME)),
            moments={q2: 1},
            control_range=(w_low, w_high),
            force_range=(T2_low, T2_high),
        ),
    },
    parameters={
        m1: (2.0, "kg"),
        m2: (1.2, "kg"),
        l1: (0.5, "m"),
        lc1: (0.25, "m"),
        lc2: (0.2, "m"),
        I1: (0.045, "kg m^2"),
        I2: (0.02, "kg m^2"),
        k_p: (60.0, "N m"),
        k_d: (4.0, "N m s"),
        k_v: (1.5, "N m s"),
        u_low: (-1.0, "rad"),
        u_high: (0.9, "rad"),
        w_low: (-4.0, "rad/s"),
        w_high: (3.0, "rad/s"),
        T1_low: (-40.0, "N m"),
        T1_high: (50.0, "N m"),
        T2_low: (-6.0, "N m"),
        T2_high: (5.0, "N m"),
        g: (9.81, "m/s^2"),
    },
    total_mass=m1 + m2,
    gravity=g,
    ranges={q1: (-1.6, 1.6), q2: (-2.5, 2.5), q1.diff(TIME): (-5.0, 5.0), q2.diff(TIME): (-5.0, 5.0)},
)
