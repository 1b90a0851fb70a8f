"""Parallelogram of three equal cranks under one coupler: more pins than it needs, because its lengths fit.

Zero: every bar along +x, where the loops are open. x points right, z up; positive angles raise a bar's end, so all axes are -y.
The cranks turn on the ground at 0, e_0 and d_0, and their ends are pinned to the coupler at 0, e and d along it. As e = e_0 and d = d_0 the
coupler only translates: its moment of inertia is not felt and left out, and one row of the middle pin follows from the others.
The text's angles are absolute, while the coupler's joint turns it against the left crank. Cranks along the coupler are left out: there the
cranks could turn against one another.
Source: Hunt, Kinematic Geometry of Mechanisms, sections 1.6 and 2.1 (linkages with more freedom than constraints allow for); Norton,
Design of Machinery, 5th ed., section 2.12 (the parallelogram with a third crank).
"""

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from harness import TIME, Constraint, System

left, coupler, middle, right = dynamicsymbols("left coupler middle right")
a, e_0, d_0, e, d, m_l, m_m, m_r, m_c, g = sp.symbols("a e_0 d_0 e d m_l m_m m_r m_c g", positive=True)


def along(angle):
    return sp.Matrix([sp.cos(angle), sp.sin(angle)])


cranks = [(m_l, left, sp.zeros(2, 1)), (m_m, middle, sp.Matrix([e_0, 0])), (m_r, right, sp.Matrix([d_0, 0]))]
pins = [foot + a * along(angle) for _, angle, foot in cranks]
centre = pins[0] + d / 2 * along(coupler)

SYSTEM = System(
    coordinates={left: "left", coupler: "coupler", middle: "middle", right: "right"},
    measured_from={coupler: left},
    kinetic=sum(m * a**2 / 6 * angle.diff(TIME) ** 2 for m, angle, _ in cranks) + m_c * centre.diff(TIME).dot(centre.diff(TIME)) / 2,
    potential=sum(m * g * a / 2 * sp.sin(angle) for m, angle, _ in cranks) + m_c * g * centre[1],
    parameters={
        a: (0.8, "m"),
        e_0: (0.9, "m"),
        d_0: (1.6, "m"),
        e: (0.9, "m"),
        d: (1.6, "m"),
        m_l: (0.6, "kg"),
        m_m: (0.75, "kg"),
        m_r: (0.45, "kg"),
        m_c: (1.5, "kg"),
        g: (9.81, "m/s^2"),
    },
    total_mass=m_l + m_m + m_r + m_c,
    gravity=g,
    ranges={left: (0.5, 2.6)} | {q.diff(TIME): (-5.0, 5.0) for q in (left, coupler, middle, right)},
    constraints={
        "right_pin": Constraint(rows=pins[0] + d * along(coupler) - pins[2], determines=(coupler, right)),
        "middle_pin": Constraint(rows=pins[0] + e * along(coupler) - pins[1], determines=(middle,), redundant=(1,)),
    },
    assembly={left: 1.571, coupler: -1.571, middle: 1.571, right: 1.571},
)
