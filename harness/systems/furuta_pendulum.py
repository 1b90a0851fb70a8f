"""Furuta's rotary pendulum with full inertia tensors: an arm turns in the horizontal plane, a pendulum swings at its end.

Zero: arm along +x, pendulum horizontal along +y. z points up; theta1 > 0 turns the arm about +z, swing > 0 turns
the pendulum about the arm, +x at zero, first upwards. The paper's theta2 = swing + pi/2 is zero where the
pendulum hangs. The pendulum's axes are the paper's: x along the pendulum away from the arm, z along the arm.
Of the arm only J1zz is felt.
Source: Cazzolato, Prime, On the dynamics of the Furuta pendulum, Journal of Control Science and Engineering
2011, 528341, sections 2 and 3; numbers of its table, but for larger dampers and for J2xx and
J2yy, which it takes as 0 and J2zz.
"""

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from harness import TIME, System

theta1, swing = dynamicsymbols("theta1 swing")
m1, m2, L1, l1, l2, J1zz, J2xx, J2yy, J2zz, b1, b2, g = sp.symbols("m1 m2 L1 l1 l2 J1zz J2xx J2yy J2zz b1 b2 g", positive=True)

theta2 = swing + sp.pi / 2
to_pendulum = sp.Matrix([[0, sp.sin(theta2), -sp.cos(theta2)], [0, sp.cos(theta2), sp.sin(theta2)], [1, 0, 0]])
spin1 = sp.Matrix([0, 0, theta1.diff(TIME)])
velocity1 = spin1.cross(sp.Matrix([l1, 0, 0]))
spin2 = to_pendulum * spin1 + sp.Matrix([0, 0, theta2.diff(TIME)])
velocity2 = to_pendulum * spin1.cross(sp.Matrix([L1, 0, 0])) + spin2.cross(sp.Matrix([l2, 0, 0]))

SYSTEM = System(
    coordinates={theta1: "arm", swing: "pendulum"},
    kinetic=m1 * velocity1.dot(velocity1) / 2
    + J1zz * spin1[2] ** 2 / 2
    + m2 * velocity2.dot(velocity2) / 2
    + spin2.dot(sp.diag(J2xx, J2yy, J2zz) * spin2) / 2,
    potential=g * m2 * l2 * (1 - sp.cos(theta2)),
    generalised_forces={theta1: -b1 * theta1.diff(TIME), swing: -b2 * theta2.diff(TIME)},
    parameters={
        m1: (0.3, "kg"),
        m2: (0.075, "kg"),
        L1: (0.278, "m"),
        l1: (0.15, "m"),
        l2: (0.148, "m"),
        J1zz: (0.0248, "kg m^2"),
        J2xx: (0.00024, "kg m^2"),
        J2yy: (0.00372, "kg m^2"),
        J2zz: (0.00386, "kg m^2"),
        b1: (0.002, "N m s"),
        b2: (0.0014, "N m s"),
        g: (9.81, "m/s^2"),
    },
    total_mass=m1 + m2,
    gravity=g,
)
