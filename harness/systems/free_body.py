"""Free rigid body with three different moments of inertia: the tennis racket, thrown in the air.

Zero: body axes along the axes of space, centre of mass at the origin. The body's frame is that of its
principal axes; z points up. The text's angles are zxz Euler angles, which are singular where the body's
z axis is vertical; Cardan angles xyz cover those attitudes.
Source: Goldstein, Poole, Safko, Classical Mechanics, 3rd ed., sections 4.4, 4.9 and 5.6.
"""

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from harness import TIME, Attitude, System, body_rates

x, y, z, a1, a2, a3 = dynamicsymbols("x y z a1 a2 a3")
m, A, B, C, g = sp.symbols("m A B C g", positive=True)


def in_angles(sequence: str) -> System:
    """The body in the Euler angles of ``sequence``."""
    place, angles = (x, y, z), (a1, a2, a3)
    velocity = sp.Matrix(place).diff(TIME)
    turn = body_rates(sequence, angles) * sp.Matrix(angles).diff(TIME)
    return System(
        coordinates=dict.fromkeys((*place, *angles), "body"),
        attitudes=(Attitude("body", angles, sequence, position=place),),
        kinetic=m * velocity.dot(velocity) / 2 + (A * turn[0] ** 2 + B * turn[1] ** 2 + C * turn[2] ** 2) / 2,
        potential=m * g * z,
        parameters={
            m: (0.5, "kg"),
            A: (0.25, "kg m^2"),
            B: (0.375, "kg m^2"),
            C: (0.5, "kg m^2"),
            g: (9.81, "m/s^2"),
        },
        total_mass=m,
        gravity=g,
        ranges={x: (-2.0, 2.0), y: (-2.0, 2.0), z: (-2.0, 2.0)},
    )


SYSTEM = in_angles("zxz")
ATLAS = (SYSTEM, in_angles("xyz"))
