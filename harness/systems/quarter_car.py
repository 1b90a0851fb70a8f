"""Quarter car: the body on its suspension spring and damper, the wheel on its tyre, on level ground.

Zero: tyre and suspension unloaded. z points up; z_u lifts the wheel and z_r the body above it. The text
counts the body's height z_s from the ground, z_s = z_u + z_r; the suspension's joint carries z_r.
Source: Rajamani, Vehicle Dynamics and Control, 2nd ed., chapter 10 (passive automotive suspensions).
"""

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from harness import TIME, System

z_u, z_r = dynamicsymbols("z_u z_r")
m_s, m_u, k_s, b_s, k_t, g = sp.symbols("m_s m_u k_s b_s k_t g", positive=True)

z_s = z_u + z_r

SYSTEM = System(
    coordinates={z_u: "tyre", z_r: "suspension"},
    kinetic=m_s * z_s.diff(TIME) ** 2 / 2 + m_u * z_u.diff(TIME) ** 2 / 2,
    potential=k_s * (z_s - z_u) ** 2 / 2 + k_t * z_u**2 / 2 + m_s * g * z_s + m_u * g * z_u,
    generalised_forces={z_r: -b_s * z_r.diff(TIME)},
    parameters={
        m_s: (250.0, "kg"),
        m_u: (45.0, "kg"),
        k_s: (16000.0, "N/m"),
        b_s: (1000.0, "N s/m"),
        k_t: (160000.0, "N/m"),
        g: (9.81, "m/s^2"),
    },
    total_mass=m_s + m_u,
    gravity=g,
    ranges={z_u: (-0.05, 0.02), z_r: (-0.3, 0.05), z_u.diff(TIME): (-2.0, 2.0), z_r.diff(TIME): (-2.0, 2.0)},
)
