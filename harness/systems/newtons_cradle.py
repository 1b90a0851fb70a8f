"""Newton's cradle of three balls, on a line: one hits two that are at rest in touch. Momentum and energy do not decide how they part, for
there are more balls than laws: each outcome on an arc keeps both, from all the speed in the last ball to both of them at 2/3 of it.

Zero: balls in touch. x points right; the first coordinate is the first ball's place, and each other the gap before a ball.
Source: Brogliato, Nonsmooth Mechanics, 3rd ed., section 6.1 (multiple impacts); Ivanov, On multiple impact, Journal of Applied Mathematics
and Mechanics 59 (1995).
"""

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from harness import TIME, Contact, System

x, left, right = dynamicsymbols("x left right")
m = sp.Symbol("m", positive=True)
balls = [x, x + left, x + left + right]

SYSTEM = System(
    coordinates={x: "first", left: "second", right: "third"},
    kinetic=sum(m * ball.diff(TIME) ** 2 / 2 for ball in balls),
    potential=0,
    contacts={"left": Contact(gap=left), "right": Contact(gap=right)},
    parameters={m: (0.5, "kg")},
    total_mass=3 * m,
    ranges={x: (-1.0, 1.0), left: (0.1, 0.5), right: (0.1, 0.5), **{q.diff(TIME): (-3.0, 3.0) for q in (x, left, right)}},
)
