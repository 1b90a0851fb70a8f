"""Watt's straight-line linkage: two rockers of one length, and a coupler between their ends, which carries a load at its middle.

Zero: every bar along +x, where the loop is open. x points right, z up; hinges are about -y, so that positive angles raise a bar's end;
the coupler's is measured from the left rocker. The linkage works about where both rockers are level, the right one towards -x, and the
coupler hangs upright between them, its middle in the origin: that moves along Watt's curve, which is nearly upright there.
Source: Norton, Design of Machinery, 5th ed., section 3.8 (approximate straight-line linkages); Lockwood, A Book of Curves, on
Watt's curve.
"""

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from harness import TIME, Constraint, System

left, coupler, right = dynamicsymbols("left coupler right")
r, c, m_l, m_c, m_r, load, g = sp.symbols("r c m_l m_c m_r m g", positive=True)


def along(angle):
    return sp.Matrix([sp.cos(angle), sp.sin(angle)])


pivots = sp.Matrix([-r, c / 2]), sp.Matrix([r, -c / 2])
hanging = left + coupler
joint = pivots[0] + r * along(left)
middle = joint + c / 2 * along(hanging)
ends = joint + c * along(hanging), pivots[1] + r * along(right)
bars = [
    (m_l, m_l * r**2 / 12, left, pivots[0] + r / 2 * along(left)),
    (m_c + load, m_c * c**2 / 12, hanging, middle),
    (m_r, m_r * r**2 / 12, right, pivots[1] + r / 2 * along(right)),
]

SYSTEM = System(
    coordinates={left: "left", coupler: "coupler", right: "right"},
    kinetic=sum(m * at.diff(TIME).dot(at.diff(TIME)) / 2 + inertia * angle.diff(TIME) ** 2 / 2 for m, inertia, angle, at in bars),
    potential=sum(m * g * at[1] for m, _, _, at in bars),
    parameters={r: (1.0, "m"), c: (0.5, "m"), g: (9.81, "m/s^2")}
    | {m_l: (1.2, "kg"), m_c: (0.6, "kg"), m_r: (0.9, "kg"), load: (4.0, "kg")},
    total_mass=m_l + m_c + m_r + load,
    gravity=g,
    ranges={left: (-0.4, 0.4), left.diff(TIME): (-5.0, 5.0)},
    constraints={"closure": Constraint(rows=ends[0] - ends[1], determines=[coupler, right])},
    assembly={coupler: -1.571, right: 3.142},
)
