"""Satellite with a reaction wheel on its z axis, floating without gravity.

Zero: body axes along the axes of space, wheel unturned. The wheel's centre of mass is the body's, whose
frame is that of its principal axes; a wheel turning with w > 0 turns about +z in the body. A, B, C are
the body's moments of inertia without the wheel, D and S the wheel's across and along its axis. The
angles are zxz Euler angles; Cardan angles xyz cover the attitudes where they are singular.
Source: Hughes, Spacecraft Attitude Dynamics, section 3.5 and chapter 6 (gyrostats).
"""

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from harness import TIME, Attitude, System, body_rates

x, y, z, a1, a2, a3, w = dynamicsymbols("x y z a1 a2 a3 w")
M, m, A, B, C, D, S = sp.symbols("M m A B C D S", positive=True)


def in_angles(sequence: str) -> System:
    """The satellite in the Euler angles of ``sequence``."""
    place, angles = (x, y, z), (a1, a2, a3)
    velocity = sp.Matrix(place).diff(TIME)
    turn = body_rates(sequence, angles) * sp.Matrix(angles).diff(TIME)
    of_body = A * turn[0] ** 2 + B * turn[1] ** 2 + C * turn[2] ** 2
    of_wheel = D * (turn[0] ** 2 + turn[1] ** 2) + S * (turn[2] + w.diff(TIME)) ** 2
    return System(
        coordinates=dict.fromkeys((*place, *angles), "body") | {w: "wheel"},
        attitudes=(Attitude("body", angles, sequence, position=place),),
        kinetic=(M + m) * velocity.dot(velocity) / 2 + (of_body + of_wheel) / 2,
        potential=sp.S.Zero,
        parameters={
            M: (40.0, "kg"),
            m: (5.0, "kg"),
            A: (4.0, "kg m^2"),
            B: (5.0, "kg m^2"),
            C: (6.0, "kg m^2"),
            D: (0.25, "kg m^2"),
            S: (0.5, "kg m^2"),
        },
        total_mass=M + m,
        ranges={x: (-2.0, 2.0), y: (-2.0, 2.0), z: (-2.0, 2.0)}
        | {coordinate.diff(TIME): (-2.0, 2.0) for coordinate in (*place, *angles)}
        | {w.diff(TIME): (-50.0, 50.0)},
    )


SYSTEM = in_angles("zxz")
ATLAS = (SYSTEM, in_angles("xyz"))
