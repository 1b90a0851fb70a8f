"""Tippe top: a sphere whose centre of mass lies below its centre. Spun fast on a rough floor it turns over, and spins on its head.

However its one point rubs, a rigid top keeps Jellett's integral J = -L . r, of its angular momentum L about the centre of mass and the
way r from there to the point: the force acts at r, so L' . r = 0, and L . r' = 0, for r moves as the axis e3 does, r = a e3 - R z, and
L lies in the plane of omega and e3.

Zero: axes of the body along those of space, centre of mass at the origin. z points up; the centre of the sphere is a distance a along the
body's z axis. I1 and I3 are the moments of inertia across this axis and along it. The contact is that of smooth surfaces, for friction has
two directions here. The text's angles are zxz Euler angles, which are singular where the axis is vertical; Cardan angles xyz cover those
attitudes.
Source: Cohen, The tippe top revisited, American Journal of Physics 45 (1977); Bou-Rabee, Marsden, Romero, Tippe top inversion as a
dissipation-induced instability, SIAM Journal on Applied Dynamical Systems 3 (2004).
"""

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from harness import TIME, Attitude, Contact, System, body_rates, rotation

x, y, z, a1, a2, a3 = dynamicsymbols("x y z a1 a2 a3")
m, R, a, I1, I3, g = sp.symbols("m R a I1 I3 g", positive=True)


def in_angles(sequence: str) -> System:
    """The top in the Euler angles of ``sequence``."""
    place, angles = (x, y, z), (a1, a2, a3)
    velocity = sp.Matrix(place).diff(TIME)
    turn = body_rates(sequence, angles) * sp.Matrix(angles).diff(TIME)
    return System(
        coordinates=dict.fromkeys((*place, *angles), "body"),
        attitudes=(Attitude("body", angles, sequence, position=place),),
        kinetic=m * velocity.dot(velocity) / 2 + (I1 * (turn[0] ** 2 + turn[1] ** 2) + I3 * turn[2] ** 2) / 2,
        potential=m * g * z,
        contacts={"floor": Contact(gap=z + a * rotation(sequence, angles)[2, 2] - R)},
        parameters={
            m: (2.0, "kg"),
            R: (0.2, "m"),
            a: (0.06, "m"),
            I1: (0.04, "kg m^2"),
            I3: (0.032, "kg m^2"),
            g: (9.81, "m/s^2"),
        },
        total_mass=m,
        gravity=g,
        ranges={x: (-0.1, 0.1), y: (-0.1, 0.1), z: (0.3, 0.5)},
    )


SYSTEM = in_angles("zxz")
ATLAS = (SYSTEM, in_angles("xyz"))
