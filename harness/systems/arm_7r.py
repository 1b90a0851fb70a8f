"""Seven-joint anthropomorphic arm with alternating axes, in the manner of the KUKA LBR, with a wide load in its hand.

Zero: arm stretched upwards. x points forwards, z up. Axes from the shoulder: +z, +y, +z, -y, +z, +y, +z, so that
positive q2 and q6 tip what follows forwards and positive q4 backwards. Shoulder, elbow and wrist are points: the
axes of joints 1 to 3, 3 to 5 and 5 to 7 intersect. Every link frame is parallel to the base frame at zero. Link 1 turns
about the vertical alone, which feels Izz1 and y1 only.
Source: Siciliano, Sciavicco, Villani, Oriolo, Robotics: Modelling, Planning and Control, section 2.9 (DLR manipulator),
for the axes; rates: KUKA, LBR iiwa brochure. Lengths, masses and inertia are this file's own.
"""

import sympy as sp
from _serial_arm import Link, energies, table
from sympy.physics.mechanics import dynamicsymbols

from harness import TIME, System

q = dynamicsymbols("q1:8")
g = sp.Symbol("g", positive=True)
masses = m1, m2, m3, m4, m5, m6, m7 = sp.symbols("m1:8", positive=True)
d3, d4, d5, d6, d7 = sp.symbols("d3:8", positive=True)
y1, x2, y2, z2, y3, z3, x4, y4, z4, y5, z5, x6, y6, z6, z7 = sp.symbols("y1 x2 y2 z2 y3 z3 x4 y4 z4 y5 z5 x6 y6 z6 z7", real=True)
Izz1 = sp.Symbol("Izz1", positive=True)
I2, I3, I4, I5, I6, I7 = (sp.symbols(f"Ixx{i} Iyy{i} Izz{i}", positive=True) for i in range(2, 8))

LINKS = [
    Link(joint="revolute", axis="z", mass=m1, centre=(0, y1, 0), inertia=(0, 0, Izz1)),
    Link(joint="revolute", axis="y", mass=m2, centre=(x2, y2, z2), inertia=I2),
    Link(joint="revolute", axis="z", offset=(0, 0, d3), mass=m3, centre=(0, y3, z3), inertia=I3),
    Link(joint="revolute", axis="-y", offset=(0, 0, d4), mass=m4, centre=(x4, y4, z4), inertia=I4),
    Link(joint="revolute", axis="z", offset=(0, 0, d5), mass=m5, centre=(0, y5, z5), inertia=I5),
    Link(joint="revolute", axis="y", offset=(0, 0, d6), mass=m6, centre=(x6, y6, z6), inertia=I6),
    Link(joint="revolute", axis="z", offset=(0, 0, d7), mass=m7, centre=(0, 0, z7), inertia=I7),
]
kinetic, potential = energies(dict(zip(q, LINKS, strict=True)), g)

SYSTEM = System(
    coordinates={angle: f"joint{i}" for i, angle in enumerate(q, 1)},
    kinetic=kinetic,
    potential=potential,
    parameters={
        **table("kg", masses, (6.0, 6.5, 4.5, 4.0, 3.0, 2.5, 3.5)),
        **table("m", (d3, d4, d5, d6, d7), (0.18, 0.2, 0.16, 0.19, 0.09)),
        **table("m", (y1, y3, z3, y5, z5, z7), (-0.06, 0.05, 0.12, -0.04, 0.1, 0.06)),
        **table("m", (x2, y2, z2), (0.05, 0.07, 0.08)),
        **table("m", (x4, y4, z4), (0.04, -0.05, 0.07)),
        **table("m", (x6, y6, z6), (0.03, 0.04, 0.05)),
        Izz1: (0.05, "kg m^2"),
        **table("kg m^2", I2, (0.07, 0.045, 0.06)),
        **table("kg m^2", I3, (0.05, 0.055, 0.03)),
        **table("kg m^2", I4, (0.04, 0.025, 0.035)),
        **table("kg m^2", I5, (0.03, 0.035, 0.02)),
        **table("kg m^2", I6, (0.03, 0.025, 0.035)),
        **table("kg m^2", I7, (0.04, 0.05, 0.06)),
        g: (9.81, "m/s^2"),
    },
    total_mass=sum(masses),
    gravity=g,
    ranges={angle.diff(TIME): (-top, top) for angle, top in zip(q, (1.48, 1.48, 1.75, 1.31, 2.27, 2.36, 2.36), strict=True)},
)
