"""Block on a rough incline: it sticks while mu >= tan(alpha), and slides with g (sin(alpha) - mu cos(alpha)) where mu is less.

Zero: centre of the block in the surface of the incline, edges along it. x points right, z up; the incline falls to the right and is a
3-4-5 triangle, so tan(alpha) = 3/4. s > 0 moves the block down it, n > 0 away from it, and theta > 0 tips it down, about +y. The block
touches with both of its lower edges; between contacts it flies.
Source: Greenwood, Principles of Dynamics, 2nd ed., section 3-4 (Coulomb friction), for the threshold; Pfeiffer, Glocker, Multibody Dynamics
with Unilateral Contacts, section 5.3, for contacts that part, stick or slide.
"""

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from harness import TIME, Contact, System

s, n, theta = dynamicsymbols("s n theta")
m, b, h, mu, alpha, g = sp.symbols("m b h mu alpha g", positive=True)


def edge(side: int) -> Contact:
    """The lower edge on one side, 1 for that down the incline."""
    along = s + side * b * sp.cos(theta) - h * sp.sin(theta)
    return Contact(gap=n - h * sp.cos(theta) - side * b * sp.sin(theta), slip=along.diff(TIME), friction=mu)


SYSTEM = System(
    coordinates={s: "slide", n: "lift", theta: "tip"},
    kinetic=m * (s.diff(TIME) ** 2 + n.diff(TIME) ** 2) / 2 + m * (b**2 + h**2) / 6 * theta.diff(TIME) ** 2,
    potential=m * g * (n * sp.cos(alpha) - s * sp.sin(alpha)),
    contacts={"lower edge": edge(1), "upper edge": edge(-1)},
    parameters={m: (3.0, "kg"), b: (0.4, "m"), h: (0.2, "m"), mu: (0.5, "1"), alpha: (0.6435011087932844, "rad"), g: (9.81, "m/s^2")},
    total_mass=m,
    gravity=g,
    ranges={s: (-1.0, 1.0), n: (0.2, 1.0), s.diff(TIME): (-1.0, 1.0), n.diff(TIME): (-1.0, 1.0), theta.diff(TIME): (-3.0, 3.0)},
)
