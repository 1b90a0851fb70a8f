"""Rimless wheel: a hub with eight equal spokes that walks down a rough incline from foot to foot, the simplest of passive walkers.

In a step it turns about one foot as an inverted pendulum. At its end the next foot strikes, and the angular momentum about that foot is
kept. Gravity adds the same energy in each step, and an impact takes the same part of what there is; so all walks that go on approach one
limit cycle.

Zero: hub in the surface of the incline, the first spoke along its normal. x points right, z up; the incline falls to the right by 4.35
degrees, with the sine 237/3125. s > 0 moves the hub down it, n > 0 away from it, and theta > 0 rolls the wheel down, about +y. Feet are
numbered in the order in which they strike then; each is a ball of radius r about the end of a spoke of length l.
Source: McGeer, Passive dynamic walking, International Journal of Robotics Research 9 (1990), the rimless wheel; Coleman, Chatterjee, Ruina,
Motions of a rimless spoked wheel, Dynamics and Stability of Systems 12 (1997).
"""

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from harness import TIME, Contact, System

SPOKES = 8

s, n, theta = dynamicsymbols("s n theta")
m, inertia, length, r, mu, gamma, g = sp.symbols("m J l r mu gamma g", positive=True)


def foot(number: int) -> Contact:
    """The foot of a spoke, whose angle from the normal is ``lean``."""
    lean = theta - 2 * sp.pi * number / SPOKES
    height = length * sp.cos(lean) + r
    return Contact(gap=n - height, slip=s.diff(TIME) - height * theta.diff(TIME), friction=mu)


SYSTEM = System(
    coordinates={s: "slide", n: "lift", theta: "turn"},
    kinetic=m * (s.diff(TIME) ** 2 + n.diff(TIME) ** 2) / 2 + inertia * theta.diff(TIME) ** 2 / 2,
    potential=m * g * (n * sp.cos(gamma) - s * sp.sin(gamma)),
    contacts={f"foot {number}": foot(number) for number in range(SPOKES)},
    parameters={
        m: (4.0, "kg"),
        inertia: (0.5, "kg m^2"),
        length: (0.5, "m"),
        r: (0.02, "m"),
        mu: (0.8, "1"),
        gamma: (0.0759128903766287, "rad"),
        g: (9.81, "m/s^2"),
    },
    total_mass=m,
    gravity=g,
    ranges={s: (-1.0, 1.0), n: (0.6, 1.0), s.diff(TIME): (-1.0, 1.0), n.diff(TIME): (-1.0, 1.0), theta.diff(TIME): (-3.0, 3.0)},
)
