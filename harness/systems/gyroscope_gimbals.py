"""Heavy gyroscope in two gimbals that have inertia: outer gimbal, inner gimbal, symmetric rotor, overhung on its axle.

Zero: inner gimbal level, rotor axle along -y with the rotor's centre of mass h along it. z points up. The angles
are Euler's of the x convention: the outer gimbal turns by phi about +z, the inner one about the outer's +x so
that theta = tilt + pi/2 is the axle's angle from +z, the rotor by psi about its axle. The inner gimbal's axes x, y,
z are the line of nodes, the third one, and the axle. The gimbals are balanced: their masses are not felt and left
out, and of the outer one only the inertia about the vertical is felt. A and C are the rotor's inertias across and
about its axle at its centre of mass.
Source: Goldstein, Poole, Safko, Classical Mechanics, 3rd ed., sections 4.9 and 5.7 (the heavy symmetrical top);
Greenwood, Principles of Dynamics, chapter 8, for the gimbals.
"""

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from harness import TIME, System

phi, tilt, psi = dynamicsymbols("phi tilt psi")
I_o, I_x, I_y, I_z, A, C, h, m, g = sp.symbols("I_o I_x I_y I_z A C h m g", positive=True)

theta = tilt + sp.pi / 2
# Along the inner gimbal's axes, in which the symmetric rotor's inertia is constant too.
gimbal = sp.Matrix([theta.diff(TIME), phi.diff(TIME) * sp.sin(theta), phi.diff(TIME) * sp.cos(theta)])
rotor = gimbal + sp.Matrix([0, 0, psi.diff(TIME)])
velocity = gimbal.cross(sp.Matrix([0, 0, h]))

SYSTEM = System(
    coordinates={phi: "outer", tilt: "inner", psi: "spin"},
    kinetic=I_o * phi.diff(TIME) ** 2 / 2
    + gimbal.dot(sp.diag(I_x, I_y, I_z) * gimbal) / 2
    + m * velocity.dot(velocity) / 2
    + rotor.dot(sp.diag(A, A, C) * rotor) / 2,
    potential=m * g * h * sp.cos(theta),
    parameters={
        I_o: (0.03, "kg m^2"),
        I_x: (0.0125, "kg m^2"),
        I_y: (0.0185, "kg m^2"),
        I_z: (0.0095, "kg m^2"),
        A: (0.016, "kg m^2"),
        C: (0.025, "kg m^2"),
        h: (0.08, "m"),
        m: (4.0, "kg"),
        g: (9.81, "m/s^2"),
    },
    total_mass=m,
    gravity=g,
    ranges={psi.diff(TIME): (-50.0, 50.0)},
)
