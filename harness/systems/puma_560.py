"""PUMA 560 arm (6R) with the inertial parameters that Armstrong, Khatib and Burdick measured.

Zero: upper arm horizontal along +x, forearm and wrist upwards. z points up. Axes from the waist: +z, +y, +y, +z, +y,
+z, so that positive q2 and q3 lower what follows. a2, a3, d2, d3, d4 are the paper's modified Denavit-Hartenberg
parameters (Craig's). Every link frame is parallel to the base frame at zero; the paper's frames 2, 3 and 5, with
(x, y, z) along (x, -z, y), are turned by a quarter turn, frames 1, 4 and 6 are as published.
Of link 1 only the moment about the waist was measured and is felt: it has no mass. The paper's Izz of link 3, 0.086,
exceeds the sum of its other two moments, which no body can have; 0.066 is the value of Corke's Robotics Toolbox
(puma560akb). Motors and gears are left out; the paper's would add to the diagonal of M alone. At higher rates of the
first three joints than here, nothing would be seen of the moments of link 4.
Source: Armstrong, Khatib, Burdick, The explicit dynamic model and inertial parameters of the PUMA 560 arm, ICRA 1986,
tables 4 to 6.
"""

import sympy as sp
from _serial_arm import Link, energies, table
from sympy.physics.mechanics import dynamicsymbols

from harness import TIME, System

q = dynamicsymbols("q1:7")
a2, a3, d2, d3, d4 = sp.symbols("a2 a3 d2 d3 d4", real=True)
m2, m3, m4, m5, m6 = masses = sp.symbols("m2:7", positive=True)
x2, y2, z2, y3, z3, z4, z6 = sp.symbols("x2 y2 z2 y3 z3 z4 z6", real=True)
Izz1, g = sp.symbols("Izz1 g", positive=True)
I2, I3, I4, I5, I6 = (sp.symbols(f"Ixx{i} Iyy{i} Izz{i}", positive=True) for i in range(2, 7))

LINKS = [
    Link(joint="revolute", axis="z", inertia=(0, 0, Izz1)),
    Link(joint="revolute", axis="y", offset=(0, d2, 0), mass=m2, centre=(x2, y2, z2), inertia=I2),
    Link(joint="revolute", axis="y", offset=(a2, d3, 0), mass=m3, centre=(0, y3, z3), inertia=I3),
    Link(joint="revolute", axis="z", offset=(a3, 0, d4), mass=m4, centre=(0, 0, z4), inertia=I4),
    Link(joint="revolute", axis="y", mass=m5, inertia=I5),
    Link(joint="revolute", axis="z", mass=m6, centre=(0, 0, z6), inertia=I6),
]
kinetic, potential = energies(dict(zip(q, LINKS, strict=True)), g)

SYSTEM = System(
    coordinates={angle: f"joint{i}" for i, angle in enumerate(q, 1)},
    kinetic=kinetic,
    potential=potential,
    parameters={
        **table("m", (a2, a3, d2, d3, d4), (0.4318, -0.0203, 0.2435, -0.0934, 0.4331)),
        **table("kg", masses, (17.4, 4.8, 0.82, 0.34, 0.09)),
        **table("m", (x2, y2, z2), (0.068, -0.016, -0.006)),
        **table("m", (y3, z3, z4, z6), (0.014, 0.07, -0.019, 0.032)),
        Izz1: (0.35, "kg m^2"),
        **table("kg m^2", I2, (0.13, 0.539, 0.524)),
        **table("kg m^2", I3, (0.066, 0.066, 0.0125)),
        **table("kg m^2", I4, (1.8e-3, 1.8e-3, 1.3e-3)),
        **table("kg m^2", I5, (0.3e-3, 0.4e-3, 0.3e-3)),
        **table("kg m^2", I6, (0.15e-3, 0.15e-3, 0.04e-3)),
        g: (9.81, "m/s^2"),
    },
    total_mass=sum(masses),
    gravity=g,
    ranges={angle.diff(TIME): (-0.5, 0.5) if i < 3 else (-3.0, 3.0) for i, angle in enumerate(q)},
)
