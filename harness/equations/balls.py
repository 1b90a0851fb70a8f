"""Programs in ball arithmetic: values of all instructions, and the solution of M x = b.

Source: Johansson, Arb: efficient arbitrary-precision midpoint-radius interval arithmetic, IEEE Trans. Comput. 66 (2017).
"""

from __future__ import annotations

import operator
from collections.abc import Sequence
from typing import Any

from harness.equations.evaluation import Arithmetic
from harness.equations.program import upper_triangle


def _literal(numerator: int, denominator: int) -> Any:
    import flint

    return flint.arb(flint.fmpq(numerator, denominator))


def _pi() -> Any:
    import flint

    return flint.arb.pi()


# At the working precision in force.
BALLS = Arithmetic(_literal, _pi, operator.pow, lambda name, value, *others: getattr(value, name)(*others))


def mass_matrix(upper: Sequence[Any], nv: int) -> Any:
    """M as ``arb_mat`` of its upper triangle by rows."""
    import flint

    entries = dict(zip(upper_triangle(nv), upper, strict=True))
    return flint.arb_mat([[entries[min(i, j), max(i, j)] for j in range(nv)] for i in range(nv)])


def solved(mass: Any, force: Sequence[Any]) -> list[Any]:
    """The solution of M x = force; all indeterminate where M is not certainly regular."""
    import flint

    try:
        solution = mass.solve(flint.arb_mat([[entry] for entry in force]))
    except ZeroDivisionError:
        return [flint.arb.nan()] * len(force)
    return [solution[place, 0] for place in range(len(force))]
