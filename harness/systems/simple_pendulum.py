"""Point mass on a massless rod that swings about a fixed pin.

Zero: rod hanging. x points right, z up; theta > 0 swings the mass towards +x, so the pin axis is -y.
Source: Landau, Lifshitz, Mechanics, 3rd ed., section 11, problem 1.
"""

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from harness import TIME, System

theta = dynamicsymbols("theta")
m, L, g = sp.symbols("m L g", positive=True)

mass = L * sp.Matrix([sp.sin(theta), -sp.cos(theta)])
velocity = mass.diff(TIME)

SYSTEM = System(
    coordinates={theta: "pin"},
    kinetic=m * velocity.dot(velocity) / 2,
    potential=m * g * mass[1],
    parameters={m: (1.5, "kg"), L: (2.0, "m"), g: (9.81, "m/s^2")},
    total_mass=m,
    gravity=g,
    # A fall from the top reaches sqrt(4 g/L), 4.4 per second.
    ranges={theta.diff(TIME): (-5.0, 5.0)},
)
