"""Translational oscillator with a rotating actuator (TORA): a sprung cart carries an unbalanced rotor, in a horizontal plane.

Zero: cart at the wall, eccentric mass at -y from its axle. x points away from the wall along the cart's line, z
up; theta > 0 turns the rotor about +z, first towards +x. The paper's q = x - d is the extension of the spring,
whose free length is d. Gravity does no work in the plane. The paper's disturbance force F and control torque N
are the applied forces of the two joints.
Source: Bupp, Bernstein, Coppola, A benchmark problem for nonlinear control design, International Journal of
Robust and Nonlinear Control 8 (1998), section 2; numbers of its experimental testbed, but for d.
"""

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from harness import TIME, System

x, theta = dynamicsymbols("x theta")
M, m, e, J, k, d = sp.symbols("M m e J k d", positive=True)

q = x - d
eccentric_mass = sp.Matrix([q + e * sp.sin(theta), -e * sp.cos(theta)])
velocity = eccentric_mass.diff(TIME)

SYSTEM = System(
    coordinates={x: "slide", theta: "axle"},
    kinetic=M * q.diff(TIME) ** 2 / 2 + m * velocity.dot(velocity) / 2 + J * theta.diff(TIME) ** 2 / 2,
    potential=k * q**2 / 2,
    parameters={
        M: (1.3608, "kg"),
        m: (0.096, "kg"),
        e: (0.0592, "m"),
        J: (0.0002175, "kg m^2"),
        k: (186.3, "N/m"),
        d: (0.125, "m"),
    },
    total_mass=M + m,
    ranges={x: (0.1, 0.15), x.diff(TIME): (-0.5, 0.5)},
)
