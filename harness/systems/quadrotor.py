"""Quadrotor as a free body under a wrench: thrust and moments are the applied forces of its free joint.

Zero: body axes along the axes of space. The frame is that of the rotors' plane, whose centre carries
the wrench; z points up. The centre of mass hangs h below it. J1, J2, J3 are the principal moments at the
centre of mass. The angles are Cardan angles xyz; zxz Euler angles cover the attitudes where they are
singular.
Source: Mahony, Kumar, Corke, Multirotor aerial vehicles, IEEE Robotics and Automation Magazine 19 (2012),
equations 1 to 4, with the centre of mass off the frame's origin as in Greenwood, Advanced Dynamics, 3.2.
"""

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from harness import TIME, Attitude, System, body_rates, rotation

x, y, z, roll, pitch, yaw = dynamicsymbols("x y z roll pitch yaw")
m, h, J1, J2, J3, g = sp.symbols("m h J1 J2 J3 g", positive=True)


def in_angles(sequence: str) -> System:
    """The quadrotor in the Euler angles of ``sequence``."""
    place, angles = (x, y, z), (roll, pitch, yaw)
    turn = body_rates(sequence, angles) * sp.Matrix(angles).diff(TIME)
    attitude = rotation(sequence, angles)
    hanging = sp.Matrix([0, 0, -h])
    # The velocity of the centre of mass in the body's frame.
    velocity = attitude.T * sp.Matrix(place).diff(TIME) + turn.cross(hanging)
    return System(
        coordinates=dict.fromkeys((*place, *angles), "body"),
        attitudes=(Attitude("body", angles, sequence, position=place),),
        kinetic=m * velocity.dot(velocity) / 2 + (J1 * turn[0] ** 2 + J2 * turn[1] ** 2 + J3 * turn[2] ** 2) / 2,
        potential=m * g * (z - h * attitude[2, 2]),
        parameters={
            m: (1.25, "kg"),
            h: (0.0625, "m"),
            J1: (0.015625, "kg m^2"),
            J2: (0.0234375, "kg m^2"),
            J3: (0.03125, "kg m^2"),
            g: (9.81, "m/s^2"),
        },
        total_mass=m,
        gravity=g,
        ranges={x: (-5.0, 5.0), y: (-5.0, 5.0), z: (-5.0, 5.0)},
    )


SYSTEM = in_angles("xyz")
ATLAS = (SYSTEM, in_angles("zxz"))
