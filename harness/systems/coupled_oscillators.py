"""Two masses on a smooth horizontal line, coupled by a spring and each tied to a wall by another.

Zero: equilibrium, where the three springs pull equally and are stretched by e1, e2 and e3. x points
right; x1 and x2 are the displacements of the left and the right mass.
Source: Taylor, Classical Mechanics, sections 11.1 to 11.3 (two masses and three springs).
"""

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from harness import TIME, System

x1, x2 = dynamicsymbols("x1 x2")
m1, m2, k1, k2, k3, e1, e2, e3 = sp.symbols("m1 m2 k1 k2 k3 e1 e2 e3", positive=True)

stretch_1, stretch_2, stretch_3 = e1 + x1, e2 + x2 - x1, e3 - x2

SYSTEM = System(
    coordinates={x1: "left", x2: "right"},
    kinetic=m1 * x1.diff(TIME) ** 2 / 2 + m2 * x2.diff(TIME) ** 2 / 2,
    potential=k1 * stretch_1**2 / 2 + k2 * stretch_2**2 / 2 + k3 * stretch_3**2 / 2,
    parameters={
        m1: (1.5, "kg"),
        m2: (0.7, "kg"),
        k1: (40.0, "N/m"),
        k2: (20.0, "N/m"),
        k3: (80.0, "N/m"),
        e1: (0.25, "m"),
        e2: (0.5, "m"),
        e3: (0.125, "m"),
    },
    total_mass=m1 + m2,
    ranges={x1: (-0.2, 0.2), x2: (-0.2, 0.2)},
)
