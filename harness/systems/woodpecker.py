"""Woodpecker toy: a sleeve on a pole carries a bird by a spring, and the bird pecks its way down. While its weight cants the sleeve, an
edge jams on the pole; when the bird swings back the sleeve comes free and both fall, until an edge jams again or the beak strikes.

The text takes the height of the sleeve's centre and small angles, and neglects all horizontal motion. Here the height is that of the joint
between sleeve and bird, which does not move sideways, and angles are not small; to first order both are the same. The sleeve weighs a
fifteenth of the bird, so that in the text's coordinates the mass matrix, scaled, has a condition number of 73; and of 513 or 316 where the
bird hangs from the sleeve by a relative angle, the height being that of the sleeve or of the joint. With the height of the joint, and the
sleeve's angle relative to the bird, it has 8.

Zero: joint at the origin, l_M to the right of the axis of the pole, bird and sleeve level, spring relaxed. x points right, z up; angles
lift the right side, so the axis of both turns is -y. The sleeve's centre is l_M to the left of the joint, the bird's l_G to its right.
Edges of the sleeve and beak touch the pole from the right, each by a ball of radius r that ends where the text has a point.
Source: Glocker, Dynamik von Starrkoerpersystemen mit Reibung und Stoessen, dissertation, TU Muenchen (1995), pages 162 ff., with its
numbers; Pfeiffer, Glocker, Multibody Dynamics with Unilateral Contacts; Leine, van Campen, Glocker, Nonlinear dynamics and modeling of
various wooden toys with impact and friction, Journal of Vibration and Control 9 (2003).
"""

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from harness import TIME, Contact, System

z, phi_S, chi = dynamicsymbols("z phi_S chi")
phi_M = phi_S + chi
m_M, m_S, J_M, J_S, c_phi = sp.symbols("m_M m_S J_M J_S c_phi", positive=True)
r_0, r_M, h_M, l_M, l_G, h_S, l_S, r, mu, g = sp.symbols("r_0 r_M h_M l_M l_G h_S l_S r mu g", positive=True)


def point(angle: sp.Expr, along: sp.Expr, above: sp.Expr = sp.S.Zero) -> sp.Matrix:
    """The point of a body at an angle that is so far from the joint, along the body and perpendicular to it."""
    return sp.Matrix([0, z]) + sp.Matrix([along * sp.cos(angle) - above * sp.sin(angle), along * sp.sin(angle) + above * sp.cos(angle)])


def touching(angle: sp.Expr, along: sp.Expr, above: sp.Expr) -> Contact:
    """The pole and a ball of a body, which ends to the left where the text has its point."""
    centre = point(angle, along + r, above)
    return Contact(gap=centre[0] + l_M - r_0 - r, slip=centre[1].diff(TIME) - r * angle.diff(TIME), friction=mu)


sleeve, bird = point(phi_M, -l_M), point(phi_S, l_G)
bodies = {m_M: sleeve, m_S: bird}

SYSTEM = System(
    coordinates={z: "slide", phi_S: "swing", chi: "spring"},
    kinetic=sum(mass * centre.diff(TIME).dot(centre.diff(TIME)) / 2 for mass, centre in bodies.items())
    + J_M * phi_M.diff(TIME) ** 2 / 2
    + J_S * phi_S.diff(TIME) ** 2 / 2,
    potential=g * sum(mass * centre[1] for mass, centre in bodies.items()) + c_phi * chi**2 / 2,
    contacts={
        "beak": touching(phi_S, l_G - l_S, h_S),
        "lower edge": touching(phi_M, r_M - l_M, -h_M),
        "upper edge": touching(phi_M, r_M - l_M, h_M),
    },
    parameters={
        m_M: (0.0003, "kg"),
        m_S: (0.0045, "kg"),
        J_M: (5e-9, "kg m^2"),
        J_S: (7e-7, "kg m^2"),
        c_phi: (0.0056, "N m/rad"),
        r_0: (0.0025, "m"),
        r_M: (0.0031, "m"),
        h_M: (0.0058, "m"),
        l_M: (0.01, "m"),
        l_G: (0.015, "m"),
        h_S: (0.02, "m"),
        l_S: (0.0201, "m"),
        r: (0.0001, "m"),
        mu: (0.3, "1"),
        g: (9.81, "m/s^2"),
    },
    total_mass=m_M + m_S,
    gravity=g,
    ranges={z: (-0.05, 0.05), phi_S: (-1.0, 1.0), chi: (-1.0, 1.0), z.diff(TIME): (-1.0, 1.0)},
)
