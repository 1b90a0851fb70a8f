"""Derivatives that share their parts are those that SymPy finds one by one."""

from __future__ import annotations

import random

import pytest
import sympy as sp

from harness.lagrange.expressions import SymbolicDerivatives

x, y, z = VARIABLES = sp.symbols("x y z", real=True)
a, t = sp.symbols("a t", positive=True)
EXPRESSIONS = {
    "constant": a + 2,
    "variable": y,
    "sum": x + 2 * y - a * x,
    "product": a * x * y**2 * sp.sin(x - y),
    "power": (x * y + 2) ** sp.Rational(-3, 2),
    "power in the exponent": (2 + sp.sin(x)) ** (y * z),
    "quotient": sp.cos(x) / (2 + sp.sin(y)),
    "nested": sp.exp(-sp.cos(x * sp.sin(y + z))) * sp.tan(sp.sin(x) / 2),
    "inverse": sp.asin(x / 20) + sp.acos(y / 20) + sp.atan(x * y) + sp.log(2 + x**2),
    "hyperbolic": sp.sinh(x) * sp.cosh(y) - sp.tanh(z),
    "two arguments": sp.atan2(x + y, 3 + z**2),
    "left to SymPy": sp.Abs(x) * y + sp.sign(z),
    "cancelling": (x + y) ** 2 - x**2 - 2 * x * y - y**2,
}
POINT = {x: 0.7, y: -0.4, z: 1.3, a: 2.1, t: 0.6}


def value(expression: sp.Expr) -> float:
    return float(sp.N(expression.subs(POINT), 30))


@pytest.mark.parametrize("expression", EXPRESSIONS.values(), ids=EXPRESSIONS)
def test_a_gradient_and_a_derivative_along_a_motion(expression: sp.Expr) -> None:
    gradient = SymbolicDerivatives.by(VARIABLES).of(expression)
    slopes = {variable: value(expression.diff(variable)) for variable in VARIABLES}
    assert {variable: value(slope) for variable, slope in gradient.items()} == pytest.approx(
        {variable: slopes[variable] for variable in expression.free_symbols & set(VARIABLES)}, abs=1e-14
    )
    rates = {x: sp.cos(t), y: a, z: x * y}
    along = SymbolicDerivatives({variable: {t: rate} for variable, rate in rates.items()} | {t: {t: sp.S.One}})
    slope = sum(slopes[variable] * value(rate) for variable, rate in rates.items())
    assert value(along.of(expression).get(t, sp.S.Zero)) == pytest.approx(slope, abs=1e-14)
    assert value(along.of(expression * t)[t]) == pytest.approx(slope * POINT[t] + value(expression), abs=1e-14)


def test_every_part_is_differentiated_once(monkeypatch: pytest.MonkeyPatch) -> None:
    shared = sp.sin(x * y)
    terms = [random.Random(k).randint(2, 9) * shared * sp.cos(k * z) for k in range(1, 30)]
    derivatives, walked = SymbolicDerivatives.by(VARIABLES), []
    original = SymbolicDerivatives._of
    monkeypatch.setattr(SymbolicDerivatives, "_of", lambda self, expression: walked.append(expression) or original(self, expression))
    derivatives.of(sp.Add(*terms))
    derivatives.of(sp.Add(*terms[::2]))
    assert len(walked) == len(set(walked))
    assert walked.count(shared) == 1
