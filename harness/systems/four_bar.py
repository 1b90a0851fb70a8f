"""Four-bar linkage of uniform bars: a crank that turns fully, a coupler, and a follower that rocks.

Zero: every bar along +x, where the loop is open. x points right, z up; positive angles raise a bar's end, so all axes are -y.
The crank turns on the origin and the follower on (d, 0); the text's angles are absolute, while the coupler's joint turns it against the
crank. The loop is closed where the coupler's end meets the follower's, on the branch whose coupler lies above the diagonal.
Source: Norton, Design of Machinery, 5th ed., sections 2.12 (Grashof), 4.5 (position), 6.7 and 7.3 (rates, accelerations).
"""

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from harness import TIME, Constraint, System

crank, coupler, follower = dynamicsymbols("crank coupler follower")
a, b, c, d, m_a, m_b, m_c, g = sp.symbols("a b c d m_a m_b m_c g", positive=True)


def along(angle):
    return sp.Matrix([sp.cos(angle), sp.sin(angle)])


crank_end, pivot = a * along(crank), sp.Matrix([d, 0])
bars = [
    (m_a, a, crank, a / 2 * along(crank)),
    (m_b, b, coupler, crank_end + b / 2 * along(coupler)),
    (m_c, c, follower, pivot + c / 2 * along(follower)),
]

SYSTEM = System(
    coordinates={crank: "crank", coupler: "coupler", follower: "follower"},
    measured_from={coupler: crank},
    kinetic=sum(
        m * centre.diff(TIME).dot(centre.diff(TIME)) / 2 + m * length**2 / 24 * angle.diff(TIME) ** 2 for m, length, angle, centre in bars
    ),
    potential=sum(m * g * centre[1] for m, _, _, centre in bars),
    parameters={
        a: (0.6, "m"),
        b: (1.5, "m"),
        c: (1.3, "m"),
        d: (2.0, "m"),
        m_a: (0.5, "kg"),
        m_b: (1.2, "kg"),
        m_c: (0.9, "kg"),
        g: (9.81, "m/s^2"),
    },
    total_mass=m_a + m_b + m_c,
    gravity=g,
    ranges={q.diff(TIME): (-5.0, 5.0) for q in (crank, coupler, follower)},
    constraints={"closure": Constraint(rows=crank_end + b * along(coupler) - pivot - c * along(follower), determines=(coupler, follower))},
    assembly={coupler: 0.927, follower: 1.966},
)
