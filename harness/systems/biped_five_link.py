"""Five-link planar biped (RABBIT) in single support: its stance foot is a pin at the origin.

Zero: standing upright, stance leg and torso straight up, swing leg hanging straight down. x points
forward, z up; each joint turns the link that follows it from the one before, from the foot up to the torso
and down the swing leg, and a positive angle turns it clockwise seen from the right, so all axes are +y.
The book's absolute angles are sums of these. Centres of mass are p_t from the knee, p_f and p_T from the hip.
Source: Westervelt, Grizzle, Chevallereau, Choi, Morris, Feedback Control of Dynamic Bipedal Robot
Locomotion, chapters 3 and 6; numbers: Westervelt, Grizzle, Koditschek, Hybrid zero dynamics of planar
biped walkers, IEEE Transactions on Automatic Control 48 (2003).
"""

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from harness import TIME, System

q1, q2, q3, q4, q5 = dynamicsymbols("q1 q2 q3 q4 q5")
m_t, m_f, m_T, L_t, L_f, p_t, p_f, p_T, I_t, I_f, I_T, g = sp.symbols("m_t m_f m_T L_t L_f p_t p_f p_T I_t I_f I_T g", positive=True)


def up(angle):
    return sp.Matrix([sp.sin(angle), sp.cos(angle)])


shin, thigh, torso = q1, q1 + q2, q1 + q2 + q3
swing_thigh, swing_shin = torso + q4, torso + q4 + q5
knee = L_t * up(shin)
hip = knee + L_f * up(thigh)
swing_knee = hip - L_f * up(swing_thigh)
links = [
    (m_t, I_t, shin, (L_t - p_t) * up(shin)),
    (m_f, I_f, thigh, knee + (L_f - p_f) * up(thigh)),
    (m_T, I_T, torso, hip + p_T * up(torso)),
    (m_f, I_f, swing_thigh, hip - p_f * up(swing_thigh)),
    (m_t, I_t, swing_shin, swing_knee - p_t * up(swing_shin)),
]

SYSTEM = System(
    coordinates={q1: "stance_foot", q2: "stance_knee", q3: "stance_hip", q4: "swing_hip", q5: "swing_knee"},
    kinetic=sum(m * c.diff(TIME).dot(c.diff(TIME)) / 2 + inertia * angle.diff(TIME) ** 2 / 2 for m, inertia, angle, c in links),
    potential=sum(m * g * centre[1] for m, _, _, centre in links),
    parameters={
        m_t: (3.2, "kg"),
        m_f: (6.8, "kg"),
        m_T: (20.0, "kg"),
        L_t: (0.4, "m"),
        L_f: (0.4, "m"),
        p_t: (0.128, "m"),
        p_f: (0.163, "m"),
        p_T: (0.2, "m"),
        I_t: (0.93, "kg m^2"),
        I_f: (1.08, "kg m^2"),
        I_T: (2.22, "kg m^2"),
        g: (9.81, "m/s^2"),
    },
    total_mass=2 * m_t + 2 * m_f + m_T,
    gravity=g,
    ranges={q1: (-1.0, 1.0), q2: (-2.5, 2.5), q3: (-2.5, 2.5), q4: (-2.5, 2.5), q5: (-2.5, 2.5)}
    | {q.diff(TIME): (-5.0, 5.0) for q in (q1, q2, q3, q4, q5)},
)
