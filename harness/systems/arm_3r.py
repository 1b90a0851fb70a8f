"""Planar three-link arm (3R) in the vertical plane.

Zero: all links along +x. x points right, z up; each angle is measured from the link before, as a motor
turns it, and positive angles bend upwards, so all axes are -y.
Velocities and the vertical go from link to link, each in the axes of its own link.
Source: Craig, Introduction to Robotics, section 3.4 (the planar 3R arm) and section 5.6 (velocity propagation
from link to link); Spong, Hutchinson, Vidyasagar, Robot Modeling and Control, section 7.2, for the energies.
"""

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from harness import TIME, System

q1, q2, q3 = dynamicsymbols("q1 q2 q3")
m1, m2, m3, l1, l2, lc1, lc2, lc3, I1, I2, I3, g = sp.symbols("m1 m2 m3 l1 l2 lc1 lc2 lc3 I1 I2 I3 g", positive=True)


def seen_from(angle, vector):
    """Components along and across a link that is turned by ``angle`` from the one before."""
    return sp.Matrix([[sp.cos(angle), sp.sin(angle)], [-sp.sin(angle), sp.cos(angle)]]) * vector


def across(distance, turn):
    return sp.Matrix([0, distance * turn.diff(TIME)])


turn1, turn2, turn3 = q1, q1 + q2, q1 + q2 + q3
elbow = seen_from(q2, across(l1, turn1))
wrist = seen_from(q3, elbow + across(l2, turn2))
up1 = seen_from(q1, sp.Matrix([0, 1]))
up2 = seen_from(q2, up1)
up3 = seen_from(q3, up2)
links = [
    (m1, I1, turn1, across(lc1, turn1), lc1 * up1[0]),
    (m2, I2, turn2, elbow + across(lc2, turn2), l1 * up1[0] + lc2 * up2[0]),
    (m3, I3, turn3, wrist + across(lc3, turn3), l1 * up1[0] + l2 * up2[0] + lc3 * up3[0]),
]

SYSTEM = System(
    coordinates={q1: "shoulder", q2: "elbow", q3: "wrist"},
    kinetic=sum(m * v.dot(v) / 2 + inertia * turn.diff(TIME) ** 2 / 2 for m, inertia, turn, v, _ in links),
    potential=sum(m * g * height for m, _, _, _, height in links),
    parameters={
        m1: (4.0, "kg"),
        m2: (2.5, "kg"),
        m3: (1.5, "kg"),
        l1: (0.4, "m"),
        l2: (0.3, "m"),
        lc1: (0.19, "m"),
        lc2: (0.14, "m"),
        lc3: (0.15, "m"),
        I1: (0.075, "kg m^2"),
        I2: (0.028, "kg m^2"),
        I3: (0.02, "kg m^2"),
        g: (9.81, "m/s^2"),
    },
    total_mass=m1 + m2 + m3,
    gravity=g,
    ranges={q.diff(TIME): (-5.0, 5.0) for q in (q1, q2, q3)},
)
