"""Two planar fingers of two links that hold a bar, each with its tip pinned to an end: what is held closes a loop of seven joints.

Zero: fingers straight up from their bases at x = -+b, bar level over the origin; the loops are open there. x points right, z up; x and z
are the way of the bar's centre. Hinges are about -y, so that positive angles turn a link from +x towards +z, and what stands towards
-x; each finger's second link is measured from its first. The elbows stand out to the sides. All are uniform bars.
Source: Murray, Li, Sastry, A Mathematical Introduction to Robotic Manipulation, sections 5.5 (planar two-fingered hand) and 6.3.
"""

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from harness import TIME, Constraint, System

x, z, tilt = dynamicsymbols("x z tilt")
fingers = [dynamicsymbols("left1 left2"), dynamicsymbols("right1 right2")]
b, L1, L2, m1, m2, L, m, g = sp.symbols("b L1 L2 m1 m2 L m g", positive=True)


def along(angle):
    return sp.Matrix([sp.cos(angle), sp.sin(angle)])


def up(angle):
    return along(angle + sp.pi / 2)


bars, grips = [(m, m * L**2 / 12, tilt, sp.Matrix([x, z]))], []
for side, (first, second) in zip((-1, 1), fingers, strict=True):
    base = sp.Matrix([side * b, 0])
    elbow = base + L1 * up(first)
    bars.append((m1, m1 * L1**2 / 12, first, base + L1 / 2 * up(first)))
    bars.append((m2, m2 * L2**2 / 12, first + second, elbow + L2 / 2 * up(first + second)))
    grips.append(elbow + L2 * up(first + second) - sp.Matrix([x, z]) - side * L / 2 * along(tilt))

SYSTEM = System(
    coordinates={x: "bar_x", z: "bar_z", tilt: "bar_tilt"} | {q: q.name for finger in fingers for q in finger},
    kinetic=sum(m_i * at.diff(TIME).dot(at.diff(TIME)) / 2 + inertia * angle.diff(TIME) ** 2 / 2 for m_i, inertia, angle, at in bars),
    potential=sum(m_i * g * at[1] for m_i, _, _, at in bars),
    parameters={b: (0.2, "m"), L1: (0.3, "m"), L2: (0.2, "m"), L: (0.4, "m"), g: (9.81, "m/s^2")}
    | {m1: (0.4, "kg"), m2: (0.3, "kg"), m: (0.6, "kg")},
    total_mass=m + 2 * m1 + 2 * m2,
    gravity=g,
    ranges={x: (-0.08, 0.08), z: (0.22, 0.38), tilt: (-0.3, 0.3), x.diff(TIME): (-1.0, 1.0), z.diff(TIME): (-1.0, 1.0)},
    constraints={
        "left_grip": Constraint(rows=grips[0], determines=fingers[0]),
        "right_grip": Constraint(rows=grips[1], determines=fingers[1]),
    },
    assembly={z: 0.3} | {fingers[0][0]: 0.68, fingers[0][1]: -1.91, fingers[1][0]: -0.68, fingers[1][1]: 1.91},
)
