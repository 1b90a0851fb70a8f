"""Equations of motion as people write them: plain text, and presentation MathML."""

from __future__ import annotations

import re

import sympy as sp
from sympy.printing.mathml import mathml

from harness.lagrange import EquationsOfMotion

# Longer equations are left out: nobody reads them, and they would swamp a report.
MOST_OPERATIONS_SHOWN = 400
_ACCENTS = {"dot": ("'", "\u02d9"), "ddot": ("''", "\u00a8")}
_ACCENTED = re.compile(r"\\(d?dot)\{(\w+)\}")
_ACCENTED_MATHML = re.compile(r"<mi>\\(d?dot)\{(\w+)\}</mi>")


def equation_rows(equations: EquationsOfMotion) -> list[sp.Eq]:
    r"""One equation per coordinate, inertia first, with tau on the right; rates are named ``\dot{q}``."""
    names = [q.name for q in equations.coordinates]
    dotted = dict(zip(equations.rates, (sp.Symbol(rf"\dot{{{name}}}") for name in names), strict=True))
    accelerations = [sp.Symbol(rf"\ddot{{{name}}}") for name in names]
    rows = []
    for i, name in enumerate(names):
        inertia = sum((sp.simplify(equations.mass_matrix[i, j]) * a for j, a in enumerate(accelerations)), sp.S.Zero)
        rest = sp.expand(sp.simplify(-equations.right_hand_side[i])).xreplace(dotted)
        rows.append(
            sp.Eq(
                sp.Add(*inertia.args, *rest.args, evaluate=False) if inertia.is_Add and rest.is_Add else inertia + rest,
                sp.Symbol(f"tau_{name}"),
                evaluate=False,
            )
        )
    return rows


def as_text(equations: EquationsOfMotion) -> str:
    """The equations as plain text, ``q'`` for a rate and ``q''`` for an acceleration; "" where too long to read."""
    if _too_long(equations):
        return ""
    rows = (f"{sp.sstr(row.lhs, order='none')} = {sp.sstr(row.rhs)}" for row in equation_rows(equations))
    return _ACCENTED.sub(lambda match: match[2] + _ACCENTS[match[1]][0], "\n".join(rows))


def as_mathml(equations: EquationsOfMotion) -> str:
    """The equations as one ``<math>`` element each; "" where too long to read."""
    if _too_long(equations):
        return ""
    return "\n".join(
        f'<math xmlns="http://www.w3.org/1998/Math/MathML" display="block">{_accented(mathml(row, printer="presentation"))}</math>'
        for row in equation_rows(equations)
    )


def _accented(text: str) -> str:
    def replace(match: re.Match[str]) -> str:
        base = mathml(sp.Symbol(match[2]), printer="presentation")
        return f"<mover>{base}<mo>{_ACCENTS[match[1]][1]}</mo></mover>"

    return _ACCENTED_MATHML.sub(replace, text)


def _too_long(equations: EquationsOfMotion) -> bool:
    return bool(sp.count_ops(equations.mass_matrix) + sp.count_ops(equations.right_hand_side) > MOST_OPERATIONS_SHOWN)
