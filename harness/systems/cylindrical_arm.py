"""Cylindrical arm (RPP): a turning column, a carriage that climbs it, and an arm that slides out of the carriage.

Zero: carriage at the foot of the column, arm along +x with its tip on the column's axis. z points up; theta > 0
turns the arm from +x to +y about +z, z > 0 lifts, r > 0 pushes the arm's tip out. The carriage's centre of mass is
at the distance b from the column's axis, the arm's lies a behind its tip. Of the inertia only the moments about z
are felt, and not the mass of the column, which has none.
Source: Spong, Hutchinson, Vidyasagar, Robot Modeling and Control, section 3.2 (three-link cylindrical robot);
Craig, Introduction to Robotics, 3rd ed., section 6.9, the RP manipulator, whose equations these are when it lies
flat on a lift. All values are this file's own.
"""

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from harness import TIME, System

theta, z, r = dynamicsymbols("theta z r")
m2, m3, I1, I2, I3, a, b, g = sp.symbols("m2:4 I1:4 a b g", positive=True)

outwards = sp.Matrix([sp.cos(theta), sp.sin(theta), 0])
lift = sp.Matrix([0, 0, z])
carriage = b * outwards + lift
arm = (r - a) * outwards + lift
velocity_2, velocity_3 = carriage.diff(TIME), arm.diff(TIME)

SYSTEM = System(
    coordinates={theta: "column", z: "carriage", r: "arm"},
    kinetic=(I1 + I2 + I3) * theta.diff(TIME) ** 2 / 2 + m2 * velocity_2.dot(velocity_2) / 2 + m3 * velocity_3.dot(velocity_3) / 2,
    potential=(m2 + m3) * g * z,
    parameters={
        m2: (15.0, "kg"),
        m3: (6.0, "kg"),
        I1: (0.45, "kg m^2"),
        I2: (0.3, "kg m^2"),
        I3: (0.65, "kg m^2"),
        a: (0.55, "m"),
        b: (0.08, "m"),
        g: (9.81, "m/s^2"),
    },
    total_mass=m2 + m3,
    gravity=g,
    ranges={
        z: (0.0, 0.8),
        r: (0.35, 1.0),
        theta.diff(TIME): (-2.0, 2.0),
        z.diff(TIME): (-0.5, 0.5),
        r.diff(TIME): (-0.5, 0.5),
    },
)
