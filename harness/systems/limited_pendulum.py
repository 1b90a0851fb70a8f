"""Bar on a fixed pin between two rigid stops: as a door, it leans against the first where it hangs.

Zero: bar hanging, at the lower stop. x points right, z up; theta > 0 swings the bar towards +x, so the pin axis is -y.
Between the stops the bar is free. At a stop, where it does not move away, the stop's torque is what keeps it from being passed, and 0 where
nothing is to be kept; the impact that ends a rate is no acceleration. The sampled range ends short of the upper stop: exactly there half an
ulp of the angle decides whether there is a torque.
Source: Pfeiffer, Glocker, Multibody Dynamics with Unilateral Contacts, sections 5.2 and 5.3 (the complementarity of a gap's acceleration
and its force), for the stops; The Euler-Lagrange equations (chapter 7.9), example 2, for the bar.
"""

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from harness import TIME, System

theta = dynamicsymbols("theta")
I_O, m, r_G, c, g, highest = sp.symbols("I_O m r_G c g highest", positive=True)
lowest = sp.Symbol("lowest", real=True)

SYSTEM = System(
    coordinates={theta: "pin"},
    kinetic=I_O * theta.diff(TIME) ** 2 / 2,
    potential=-m * g * r_G * sp.cos(theta),
    generalised_forces={theta: -c * theta.diff(TIME)},
    limits={theta: (lowest, highest)},
    parameters={
        I_O: (1.625, "kg m^2"),
        m: (2.0, "kg"),
        r_G: (0.75, "m"),
        c: (0.3, "N m s"),
        g: (9.81, "m/s^2"),
        lowest: (0.0, "rad"),
        highest: (1.2, "rad"),
    },
    total_mass=m,
    gravity=g,
    ranges={theta: (0.0, 1.1)},
)
