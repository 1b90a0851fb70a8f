"""Stiff flyball governor: two arms with balls hinged to a turning shaft, a slider on the shaft, springs with dampers for coupler rods.

Zero: arms hanging, slider at the foot of the shaft. z points up along the shaft; right > 0 swings its arm towards +x of the shaft and
left > 0 the other towards -x, so their axes are -y and +y; the slider moves along +z. The arms are hinged e beside the shaft at the
height L; each spring leads from the middle of an arm to the slider, e beside the shaft. Shaft, arms and slider are square prisms;
of the shaft and the slider only the inertias about the shaft are felt, and of the shaft no mass.
Source: Gonzalez, Dopico, Lugris, Cuadrado, A benchmarking system for MBS simulation software, Multibody System Dynamics 16 (2006); IFToMM
library of computational benchmark problems, A05.
"""

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from harness import TIME, System

psi, right, left, s = dynamicsymbols("psi right left s")
L, e, w, m_b, m_r, m_s, J, J_s, k, c, l_0, g = sp.symbols("L e w m_b m_r m_s J J_s k c l_0 g", positive=True)


def in_space(across, up):
    """A point of the turning plane of shaft and arms."""
    return sp.Matrix([across * sp.cos(psi), across * sp.sin(psi), up])


def of_arm(side, angle, distance):
    return in_space(side * (e + distance * sp.sin(angle)), L - distance * sp.cos(angle))


arms = [(1, right), (-1, left)]
points = [(m, of_arm(side, angle, distance)) for side, angle in arms for m, distance in ((m_r, L / 2), (m_b, L))]
points.append((m_s, in_space(0, s)))
# Components across an arm in and out of the plane, and along it.
turns = [(angle.diff(TIME), psi.diff(TIME) * sp.sin(angle), psi.diff(TIME) * sp.cos(angle)) for _, angle in arms]
across, along = m_r * (L**2 + w**2) / 12, m_r * w**2 / 6
springs = [of_arm(side, angle, L / 2) - in_space(side * e, s) for side, angle in arms]
lengths = [sp.sqrt(spring.dot(spring)) for spring in springs]

SYSTEM = System(
    coordinates={psi: "shaft", right: "right", left: "left", s: "slide"},
    kinetic=sum(m * point.diff(TIME).dot(point.diff(TIME)) / 2 for m, point in points)
    + sum(across * (out**2 + inward**2) / 2 + along * twist**2 / 2 for out, inward, twist in turns)
    + (J + J_s) * psi.diff(TIME) ** 2 / 2,
    potential=sum(m * g * point[2] for m, point in points) + sum(k * (length - l_0) ** 2 / 2 for length in lengths),
    generalised_forces={q: -sum(c * length.diff(TIME) * length.diff(q) for length in lengths) for q in (right, left, s)},
    parameters={
        L: (1.0, "m"),
        e: (0.05, "m"),
        w: (0.01, "m"),
        m_b: (5.0, "kg"),
        m_r: (0.3, "kg"),
        m_s: (3.0, "kg"),
        J: (0.000005, "kg m^2"),
        J_s: (0.005, "kg m^2"),
        k: (8e5, "N/m"),
        c: (4e4, "N s/m"),
        l_0: (0.5, "m"),
        g: (9.81, "m/s^2"),
    },
    total_mass=2 * m_b + 2 * m_r + m_s,
    gravity=g,
    ranges={right: (0.4, 1.4), left: (0.4, 1.4), s: (0.2, 0.8)}
    | {psi.diff(TIME): (-10.0, 10.0), right.diff(TIME): (-2.0, 2.0), left.diff(TIME): (-2.0, 2.0), s.diff(TIME): (-2.0, 2.0)},
)
