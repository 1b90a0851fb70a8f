"""SCARA arm (RRRP): three parallel vertical hinges, and a quill that slides vertically and carries a wide load.

Zero: both links along +x, quill at the top. z points up; every axis is +z, so that theta4 > 0 raises the quill. Of
the inertia only the moments about z are felt. Velocities are written in the links' own frames, where theta1 does
not appear.
Source: Murray, Li, Sastry, A Mathematical Introduction to Robotic Manipulation, section 4.3, dynamics of the SCARA
manipulator. Lengths and stroke: AdeptOne; masses and moments of inertia are this file's own.
"""

import sympy as sp
from _serial_arm import Link, energies
from sympy.physics.mechanics import dynamicsymbols

from harness import TIME, System

theta1, theta2, theta3, theta4 = dynamicsymbols("theta1:5")
m1, m2, m3, m4, l1, l2, r1, r2, Iz1, Iz2, Iz3, Iz4, g = sp.symbols("m1:5 l1:3 r1:3 Iz1:5 g", positive=True)

kinetic, potential = energies(
    {
        theta1: Link(joint="revolute", axis="z", mass=m1, centre=(r1, 0, 0), inertia=(0, 0, Iz1)),
        theta2: Link(joint="revolute", axis="z", offset=(l1, 0, 0), mass=m2, centre=(r2, 0, 0), inertia=(0, 0, Iz2)),
        theta3: Link(joint="revolute", axis="z", offset=(l2, 0, 0), mass=m3, inertia=(0, 0, Iz3)),
        theta4: Link(joint="prismatic", axis="z", mass=m4, inertia=(0, 0, Iz4)),
    },
    g,
)

SYSTEM = System(
    coordinates={theta1: "shoulder", theta2: "elbow", theta3: "wrist", theta4: "quill"},
    kinetic=kinetic,
    potential=potential,
    parameters={
        m1: (12.0, "kg"),
        m2: (8.0, "kg"),
        m3: (2.5, "kg"),
        m4: (4.0, "kg"),
        l1: (0.425, "m"),
        l2: (0.375, "m"),
        r1: (0.19, "m"),
        r2: (0.16, "m"),
        Iz1: (0.21, "kg m^2"),
        Iz2: (0.11, "kg m^2"),
        Iz3: (0.03, "kg m^2"),
        Iz4: (0.22, "kg m^2"),
        g: (9.81, "m/s^2"),
    },
    total_mass=m1 + m2 + m3 + m4,
    gravity=g,
    ranges={
        theta4: (-0.195, 0.0),
        **dict.fromkeys((theta.diff(TIME) for theta in (theta1, theta2, theta3)), (-3.0, 3.0)),
        theta4.diff(TIME): (-0.5, 0.5),
    },
)
