"""Slider-crank: a uniform crank, a uniform rod, and a slider on the horizontal line through the crank's pin.

Zero: crank and rod along +x and the slider on the crank's pin, where the loop is open. x points right, z up; positive angles raise a
bar's end, so both hinges' axes are -y, and the slider moves along +x. The text's angles are absolute, while the rod's joint turns it
against the crank. The loop is closed where the rod's end meets the slider, which stays on the right of the crank's end.
Source: Norton, Design of Machinery, 5th ed., sections 4.6 (position) and 14.4 (dynamics).
"""

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from harness import TIME, Constraint, System

crank, rod, slide = dynamicsymbols("crank rod slide")
a, b, m_a, m_b, m_s, g = sp.symbols("a b m_a m_b m_s g", positive=True)


def along(angle):
    return sp.Matrix([sp.cos(angle), sp.sin(angle)])


crank_end = a * along(crank)
bars = [(m_a, a, crank, a / 2 * along(crank)), (m_b, b, rod, crank_end + b / 2 * along(rod))]

SYSTEM = System(
    coordinates={crank: "crank", rod: "rod", slide: "slide"},
    measured_from={rod: crank},
    kinetic=sum(
        m * centre.diff(TIME).dot(centre.diff(TIME)) / 2 + m * length**2 / 24 * angle.diff(TIME) ** 2 for m, length, angle, centre in bars
    )
    + m_s * slide.diff(TIME) ** 2 / 2,
    potential=sum(m * g * centre[1] for m, _, _, centre in bars),
    parameters={
        a: (0.5, "m"),
        b: (1.3, "m"),
        m_a: (1.2, "kg"),
        m_b: (0.6, "kg"),
        m_s: (2.0, "kg"),
        g: (9.81, "m/s^2"),
    },
    total_mass=m_a + m_b + m_s,
    gravity=g,
    ranges={slide: (0.8, 1.8), crank.diff(TIME): (-5.0, 5.0), rod.diff(TIME): (-5.0, 5.0), slide.diff(TIME): (-2.5, 2.5)},
    constraints={"closure": Constraint(rows=crank_end + b * along(rod) - sp.Matrix([slide, 0]), determines=(rod, slide))},
    assembly={slide: 1.8},
)
