"""Stack of three boxes on a level floor, each of which touches what is below with two edges. Their forces are not unique, but
their sum is the weight of what they carry.

Zero: boxes in touch, the first on the floor. z points up, and each coordinate is the gap below a box.
Source: Brogliato, Nonsmooth Mechanics, 3rd ed., section 5.1 (redundant unilateral constraints).
"""

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from harness import TIME, Contact, System

z1, z2, z3 = dynamicsymbols("z1 z2 z3")
m1, m2, m3, g = sp.symbols("m1 m2 m3 g", positive=True)
heights = {m1: z1, m2: z1 + z2, m3: z1 + z2 + z3}
gaps = {"first": z1, "second": z2, "third": z3}

SYSTEM = System(
    coordinates={z1: "first", z2: "second", z3: "third"},
    kinetic=sum(mass * height.diff(TIME) ** 2 / 2 for mass, height in heights.items()),
    potential=g * sum(mass * height for mass, height in heights.items()),
    contacts={f"{edge} edge of the {box}": Contact(gap=gap) for box, gap in gaps.items() for edge in ("left", "right")},
    parameters={m1: (1.0, "kg"), m2: (2.0, "kg"), m3: (4.0, "kg"), g: (9.81, "m/s^2")},
    total_mass=m1 + m2 + m3,
    gravity=g,
    ranges={**dict.fromkeys(gaps.values(), (0.1, 0.3)), **{z.diff(TIME): (-3.0, 3.0) for z in gaps.values()}},
)
