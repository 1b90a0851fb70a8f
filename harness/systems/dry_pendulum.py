"""Bar on a fixed pin that rubs: viscous friction beside Coulomb's dry friction, the largest torque of which is tau_c.

Zero: bar hanging. x points right, z up; theta > 0 swings the bar towards +x, so the pin axis is -y.
The inertia I_O is the bar's about the pin. At rest the bar sticks as long as m g r_G |sin theta| <= tau_c; while it swings, dry friction is
-tau_c sign(theta').
Source: The Euler-Lagrange equations (chapter 7.9), example 2, for the bar; Greenwood, Principles of Dynamics, 2nd ed., section 3-4
(Coulomb friction).
"""

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from harness import TIME, System

theta = dynamicsymbols("theta")
I_O, m, r_G, c, tau_c, g = sp.symbols("I_O m r_G c tau_c g", positive=True)

SYSTEM = System(
    coordinates={theta: "pin"},
    kinetic=I_O * theta.diff(TIME) ** 2 / 2,
    potential=-m * g * r_G * sp.cos(theta),
    generalised_forces={theta: -c * theta.diff(TIME)},
    dry_friction={theta: tau_c},
    parameters={
        I_O: (1.625, "kg m^2"),
        m: (2.0, "kg"),
        r_G: (0.75, "m"),
        c: (0.3, "N m s"),
        tau_c: (6.5, "N m"),
        g: (9.81, "m/s^2"),
    },
    total_mass=m,
    gravity=g,
)
