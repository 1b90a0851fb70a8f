"""Heavy symmetric top on a ball joint.

Zero: the top's axis, its body z axis, upright. The pivot is the origin; z points up. I1 and I3 are the
moments of inertia at the pivot, across the axis and along it; the centre of mass lies L up the axis.
The text's angles are zxz Euler angles, which are singular where the axis is vertical; Cardan angles xyz
cover those attitudes.
Source: Goldstein, Poole, Safko, Classical Mechanics, 3rd ed., section 5.7 (Lagrangian 5.52).
"""

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from harness import TIME, Attitude, System, body_rates, rotation

phi, theta, psi = dynamicsymbols("phi theta psi")
m, L, I1, I3, g = sp.symbols("m L I1 I3 g", positive=True)


def top(sequence: str, kinetic: sp.Expr, height: sp.Expr) -> System:
    """The top in the Euler angles of ``sequence``."""
    angles = (phi, theta, psi)
    return System(
        coordinates=dict.fromkeys(angles, "pivot"),
        attitudes=(Attitude("pivot", angles, sequence),),
        kinetic=kinetic,
        potential=m * g * height,
        parameters={m: (2.0, "kg"), L: (0.25, "m"), I1: (0.25, "kg m^2"), I3: (0.125, "kg m^2"), g: (9.81, "m/s^2")},
        total_mass=m,
        gravity=g,
    )


precession, nutation, spin = phi.diff(TIME), theta.diff(TIME), psi.diff(TIME)
SYSTEM = top(
    "zxz",
    kinetic=I1 * (nutation**2 + precession**2 * sp.sin(theta) ** 2) / 2 + I3 * (spin + precession * sp.cos(theta)) ** 2 / 2,
    height=L * sp.cos(theta),
)

cardan = (phi, theta, psi)
turn = body_rates("xyz", cardan) * sp.Matrix(cardan).diff(TIME)
ATLAS = (
    SYSTEM,
    top("xyz", kinetic=I1 * (turn[0] ** 2 + turn[1] ** 2) / 2 + I3 * turn[2] ** 2 / 2, height=L * rotation("xyz", cardan)[2, 2]),
)
