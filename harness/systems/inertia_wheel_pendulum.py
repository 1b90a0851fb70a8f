"""Inertia wheel pendulum: a pendulum with a balanced wheel, turned by a motor, at its end.

Zero: pendulum hanging. x points right, z up; theta > 0 swings the pendulum towards +x, so both axes
are -y. The text measures the wheel's angle theta_r from the vertical too; the motor's joint turns by
theta_r - theta. The wheel is larger than that of the text's device, whose J_r is lost beside m_r l_r^2 in
engines that reckon in world coordinates.
Source: Block, Astrom, Spong, The Reaction Wheel Pendulum (2007), chapter 2.
"""

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from harness import TIME, System

theta, phi = dynamicsymbols("theta phi")
m_p, m_r, J_p, J_r, l_p, l_r, g = sp.symbols("m_p m_r J_p J_r l_p l_r g", positive=True)

theta_r = theta + phi
along = sp.Matrix([sp.sin(theta), -sp.cos(theta)])
pendulum, rotor = l_p * along, l_r * along
velocity_p, velocity_r = pendulum.diff(TIME), rotor.diff(TIME)
of_pendulum = m_p * velocity_p.dot(velocity_p) / 2 + J_p * theta.diff(TIME) ** 2 / 2
of_rotor = m_r * velocity_r.dot(velocity_r) / 2 + J_r * theta_r.diff(TIME) ** 2 / 2

SYSTEM = System(
    coordinates={theta: "pin", phi: "motor"},
    kinetic=of_pendulum + of_rotor,
    potential=m_p * g * pendulum[1] + m_r * g * rotor[1],
    parameters={
        m_p: (0.25, "kg"),
        m_r: (0.5, "kg"),
        J_p: (0.0015, "kg m^2"),
        J_r: (0.008, "kg m^2"),
        l_p: (0.125, "m"),
        l_r: (0.25, "m"),
        g: (9.81, "m/s^2"),
    },
    total_mass=m_p + m_r,
    gravity=g,
    ranges={theta.diff(TIME): (-5.0, 5.0)},
)
