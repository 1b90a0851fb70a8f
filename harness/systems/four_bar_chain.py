"""Row of n four-bars side by side, of equal uniform bars: n + 1 cranks on the ground and n couplers between their ends.

Zero: every bar along +x, where the loops are open. x points right, z up; positive angles raise a bar's end, so all axes are -y.
The cranks stand L apart on the ground. Each coupler is pinned to the end of the crank before it, and meets the end of the next one, where
the loop is closed. The text's angles are absolute, while a coupler's joint turns it against its crank. Couplers only translate: their
moments of inertia are not felt and left out. Where all bars are in line the mechanism has n + 1 degrees of freedom in place of one;
the ranges keep away from there.
Source: Gonzalez, Dopico, Lugris, Cuadrado, A benchmarking system for MBS simulation software, Multibody System Dynamics 16 (2006); IFToMM
library of computational benchmark problems, A02 (n = 2); Bayo, Avello, Singularity-free augmented Lagrangian algorithms, Nonlinear
Dynamics 5 (1994).
"""

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from harness import TIME, Constraint, System

SIZES = (2, 5, 10)

m, L, g = sp.symbols("m L g", positive=True)


def along(angle):
    return sp.Matrix([sp.cos(angle), sp.sin(angle)])


def system(n: int) -> System:
    """The row of ``n`` four-bars."""
    cranks = [dynamicsymbols(f"crank_{i}") for i in range(n + 1)]
    couplers = [dynamicsymbols(f"coupler_{i}") for i in range(1, n + 1)]
    links = list(zip(cranks, couplers, cranks[1:], strict=False))
    # From the foot of the crank before: the feet's places cancel in every row.
    centres = [L * along(before) + L / 2 * along(coupler) for before, coupler, _ in links]
    rows = [L * (along(before) + along(coupler) - along(after)) - sp.Matrix([L, 0]) for before, coupler, after in links]
    joints = [cranks[0], *(q for _, coupler, after in links for q in (coupler, after))]
    return System(
        coordinates={q: q.func.__name__ for q in joints},
        measured_from=dict(zip(couplers, cranks, strict=False)),
        kinetic=sum(m * L**2 / 6 * crank.diff(TIME) ** 2 for crank in cranks)
        + sum(m * centre.diff(TIME).dot(centre.diff(TIME)) / 2 for centre in centres),
        potential=m * g * (sum(L / 2 * sp.sin(crank) for crank in cranks) + sum(centre[1] for centre in centres)),
        parameters={m: (1.0, "kg"), L: (1.0, "m"), g: (9.81, "m/s^2")},
        total_mass=(2 * n + 1) * m,
        gravity=g,
        ranges={cranks[0]: (0.5, 2.6)} | {q.diff(TIME): (-5.0, 5.0) for q in joints},
        constraints={
            f"closure_{i}": Constraint(rows=row, determines=(coupler, after))
            for i, (row, (_, coupler, after)) in enumerate(zip(rows, links, strict=True), start=1)
        },
        assembly={q: 1.571 if q in cranks else -1.571 for q in joints},
    )
