"""Stanford arm (RRPRRR): Scheinman's arm with a telescoping boom, and a three-axis wrist.

Zero: boom upright, its foot in the shoulder. z points up. Axes from the base: +z, +y, +z (slide), +z, +y, +z, so that
positive q2 tips the boom towards +x and positive q3 pushes the wrist out. d2 is the standard Denavit-Hartenberg
parameter of Paul, who has theta3 = 0 and d6 = 0; the height of the shoulder is not felt. Every link frame is parallel
to the base frame at zero; Paul's frames 1 and 4, with (x, y, z) along (x, -z, y), are turned by a quarter turn.
The moments of inertia are about the origins of the link frames, with no products there. Of link 1 only the moment
about the column is felt: its 9.29 kg are left out, and so are the actuators. Link 4 is flat, as its moments say: they are
2 to 1 to 1. The wrist's least moments make less than 1e-4 of the data roundoff.
Source: Paul, Robot Manipulators: Mathematics, Programming, and Control, 1981, tables 6.4 and 6.5, after Bejczy, Robot
arm dynamics and control, JPL TM 33-669, 1974; d2: Paul, Stanford AIM-177. Centres of mass in metres.
"""

import sympy as sp
from _serial_arm import Link, energies, table
from sympy.physics.mechanics import dynamicsymbols

from harness import TIME, System

q = dynamicsymbols("q1:7")
d2, g = sp.symbols("d2 g", positive=True)
m2, m3, m4, m5, m6 = masses = sp.symbols("m2:7", positive=True)
y2, z3, y4, z4, z5, z6 = sp.symbols("y2 z3 y4 z4 z5 z6", real=True)
Izz1 = sp.Symbol("Izz1", positive=True)
I2, I3, I4, I5, I6 = (sp.symbols(f"Ixx{i} Iyy{i} Izz{i}", positive=True) for i in range(2, 7))

LINKS = [
    Link(joint="revolute", axis="z", inertia=(0, 0, Izz1)),
    Link(joint="revolute", axis="y", offset=(0, d2, 0), mass=m2, centre=(0, y2, 0), inertia_at_origin=I2),
    Link(joint="prismatic", axis="z", mass=m3, centre=(0, 0, z3), inertia_at_origin=I3),
    Link(joint="revolute", axis="z", mass=m4, centre=(0, y4, z4), inertia_at_origin=I4),
    Link(joint="revolute", axis="y", mass=m5, centre=(0, 0, z5), inertia_at_origin=I5),
    Link(joint="revolute", axis="z", mass=m6, centre=(0, 0, z6), inertia_at_origin=I6),
]
kinetic, potential = energies(dict(zip(q, LINKS, strict=True)), g)

SYSTEM = System(
    coordinates={position: f"joint{i}" for i, position in enumerate(q, 1)},
    kinetic=kinetic,
    potential=potential,
    parameters={
        d2: (0.154, "m"),
        **table("kg", masses, (5.01, 4.25, 1.08, 0.63, 0.51)),
        **table("m", (y2, z3, y4, z4, z5, z6), (-0.1054, -0.6447, -0.0054, -0.0092, 0.0566, 0.1554)),
        Izz1: (0.255, "kg m^2"),
        **table("kg m^2", I2, (0.108, 0.018, 0.1)),
        **table("kg m^2", I3, (2.51, 2.51, 0.006)),
        **table("kg m^2", I4, (0.002, 0.001, 0.001)),
        **table("kg m^2", I5, (0.003, 0.003, 0.0004)),
        **table("kg m^2", I6, (0.013, 0.013, 0.0003)),
        g: (9.81, "m/s^2"),
    },
    total_mass=sum(masses),
    gravity=g,
    ranges={
        q[2]: (0.15, 1.12),
        **{position.diff(TIME): (-2.0, 2.0) if i < 2 else (-3.0, 3.0) for i, position in enumerate(q) if i != 2},
        q[2].diff(TIME): (-0.5, 0.5),
    },
)
