"""Equations of motion as people write them: plain text, and presentation MathML."""

from __future__ import annotations

import re
from collections.abc import Iterator

import sympy as sp
from sympy.printing.mathml import mathml

from harness.lagrange.equations import EquationsOfMotion

_ACCENTS = {"dot": ("'", "\u02d9"), "ddot": ("''", "\u00a8")}
_ACCENTED = re.compile(r"\\(d?dot)\{(\w+)\}")
_ACCENTED_MATHML = re.compile(r"<mi>\\(d?dot)\{(\w+)\}</mi>")


def printed(equations: EquationsOfMotion) -> tuple[str, str]:
    """The equations as plain text, a line each, and as one ``<math>`` element each.

    ``q'`` is a rate and ``q''`` an acceleration; inertia comes first, the applied force tau stands on the
    right. Behind them stand the rows that constraints keep at zero, each with its multiplier lambda in the others.
    """
    written = list(rows(equations))
    text = "\n".join(f"{sp.sstr(row.lhs, order='none')} = {sp.sstr(row.rhs)}" for row in written)
    blocks = (_accented(mathml(row, printer="presentation")) for row in written)
    elements = (f'<math xmlns="http://www.w3.org/1998/Math/MathML" display="block">{block}</math>' for block in blocks)
    return _ACCENTED.sub(lambda match: match[2] + _ACCENTS[match[1]][0], text), "\n".join(elements)


def rows(equations: EquationsOfMotion) -> Iterator[sp.Eq]:
    """The equations as SymPy equalities, one per coordinate: inertia and the rest on the left, the applied force on the right.

    Then one per row of a constraint that is not redundant.
    """
    names = [q.name for q in equations.coordinates]
    dotted = dict(zip(equations.rates, (sp.Symbol(rf"\dot{{{name}}}") for name in names), strict=True))
    accelerations = [sp.Symbol(rf"\ddot{{{name}}}") for name in names]
    owners = [owner for owner, _ in equations.constraint_rows]
    multipliers = [sp.Symbol(f"lambda_{owner}_{owners[:place].count(owner) + 1}") for place, owner in enumerate(owners)]
    jacobian = equations.constraint_jacobian
    for i, name in enumerate(names):
        inertia = [equations.mass_matrix[i, j] * acceleration for j, acceleration in enumerate(accelerations)]
        rest = sp.Add.make_args(sp.expand(-equations.right_hand_side[i]).xreplace(dotted))
        held = [jacobian[row, i].xreplace(dotted) * multiplier for row, multiplier in enumerate(multipliers)]
        terms = [term for term in (*inertia, *rest, *held) if term != 0]
        yield sp.Eq(sp.Add(*terms, evaluate=False), sp.Symbol(f"tau_{name}"), evaluate=False)
    for _, row in equations.constraint_rows:
        yield sp.Eq(row.xreplace(dotted), sp.S.Zero, evaluate=False)


def _accented(text: str) -> str:
    def replace(match: re.Match[str]) -> str:
        base = mathml(sp.Symbol(match[2]), printer="presentation")
        return f"<mover>{base}<mo>{_ACCENTS[match[1]][1]}</mo></mover>"

    return _ACCENTED_MATHML.sub(replace, text)
