"""Bricard's mechanism: five equal rods of square section and the ground, on six hinges along edges of a cube, with one freedom too many.

Zero: the rods lie along edges of a cube of side L with corners at the origin and (L, -L, -L); the fixed edge runs from (0, -L, 0) to the
origin. z points up. Hinge i starts rod i, at right angles to both rods that it joins: the axes are +z, +y, +x, +z, +y. The sixth
hinge, at (0, -L, 0) about +x, closes the loop: two points of its axis, L apart, are held. Counting constraints leaves no freedom,
and the symmetry leaves one: two of the six rows follow from the others.
Source: Gonzalez, Dopico, Lugris, Cuadrado, A benchmarking system for MBS simulation software, Multibody System Dynamics 16 (2006); IFToMM
library of computational benchmark problems, A04; Chen, You, Tarnai, Threefold-symmetric Bricard linkages for deployable structures, Int.
J. Solids and Structures 42 (2005).
"""

import sympy as sp
from _serial_arm import AXES, Link, energies
from sympy.physics.mechanics import dynamicsymbols

from harness import TIME, Constraint, System

joints = dynamicsymbols("q1:6")
m, L, w, g = sp.symbols("m L w g", positive=True)

axes = ("z", "y", "x", "z", "y")
rods = [L * sp.Matrix(edge) for edge in ((1, 0, 0), (0, 0, -1), (0, -1, 0), (-1, 0, 0), (0, 0, 1))]
starts = [sp.zeros(3, 1), *rods[:-1]]


def rod(axis, start, edge):
    # Square prism: about its own length, and across it.
    moments = [m * w**2 / 6 if component else m * (L**2 + w**2) / 12 for component in edge]
    return Link(joint="revolute", axis=axis, offset=tuple(start), mass=m, centre=tuple(edge / 2), inertia=tuple(moments))


def of_last(point):
    """The place of a point of the last rod, given from its start."""
    for q, axis, start in reversed(list(zip(joints, axes, starts, strict=True))):
        point = start + turned(point, axis, q)
    return point


def turned(vector, axis, q):
    """Rodrigues' formula about a coordinate axis."""
    along = AXES[axis].dot(vector) * AXES[axis]
    return along + sp.cos(q) * (vector - along) + sp.sin(q) * AXES[axis].cross(vector)


kinetic, potential = energies({q: rod(*parts) for q, *parts in zip(joints, axes, starts, rods, strict=True)}, g)
hinge, beside = sp.Matrix([0, -L, 0]), L * AXES["x"]

SYSTEM = System(
    coordinates={q: f"hinge_{number}" for number, q in enumerate(joints, start=1)},
    kinetic=kinetic,
    potential=potential,
    parameters={m: (1.0, "kg"), L: (1.0, "m"), w: (0.1, "m"), g: (9.81, "m/s^2")},
    total_mass=5 * m,
    gravity=g,
    # Within the symmetric branch, from -30 to 210 degrees, and away from the cube, where half an ulp of an angle is nothing beside L.
    ranges={joints[0]: (0.2, 2.5)} | {q.diff(TIME): (-5.0, 5.0) for q in joints},
    constraints={
        "hinge": Constraint(rows=of_last(rods[-1]) - hinge, determines=joints[1:4]),
        "hinge_axis": Constraint(rows=of_last(rods[-1] + beside) - hinge - beside, determines=joints[4:], redundant=(0, 2)),
    },
)
