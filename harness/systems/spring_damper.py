"""Mass on a spring and a damper, moving on a smooth horizontal line.

Zero: spring relaxed. x points right. The external force of the text is the applied force tau of the
joint.
Source: The Euler-Lagrange equations (chapter 7.9), example 3.
"""

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from harness import TIME, System

x = dynamicsymbols("x")
m, k, c = sp.symbols("m k c", positive=True)

SYSTEM = System(
    coordinates={x: "slide"},
    kinetic=m * x.diff(TIME) ** 2 / 2,
    potential=k * x**2 / 2,
    generalised_forces={x: -c * x.diff(TIME)},
    parameters={m: (1.5, "kg"), k: (80.0, "N/m"), c: (0.7, "N s/m")},
    total_mass=m,
    ranges={x: (-0.5, 0.5)},
)
