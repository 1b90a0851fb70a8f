"""Derivatives of large SymPy expressions, each shared part differentiated once for all variables.

``Expr.diff`` walks an expression anew for every variable. The energies of a long chain hold thousands of
terms, few of which depend on any one coordinate; here the gradient of every subexpression is kept, and a
part that depends on no variable costs one look.

Source: Griewank, Walther, Evaluating Derivatives, 2nd ed., sections 3.1 and 7.1 (sparse forward mode).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import sympy as sp

from harness.programs.program import UNARY

# Functions of one argument whose derivative is ``fdiff``; SymPy itself differentiates whatever is not here.
_PLAIN_FUNCTIONS = tuple(getattr(sp, name) for name in UNARY - {"neg", "sqrt"})


class SymbolicDerivatives:
    """Derivatives of expressions of ``variables``, remembered for every subexpression seen.

    Each variable is given with its own derivatives by name, as {x: {x: 1}, y: {y: 1}} for a gradient, or
    {x: {t: x_dot}, y: {t: y_dot}} for a derivative along a motion.
    """

    def __init__(self, variables: Mapping[sp.Symbol, Mapping[sp.Symbol, sp.Expr]]) -> None:
        self._variables = {variable: dict(derivatives) for variable, derivatives in variables.items()}
        self._known: dict[sp.Expr, dict[sp.Symbol, sp.Expr]] = dict(self._variables)

    @classmethod
    def by(cls, variables: Iterable[sp.Symbol]) -> SymbolicDerivatives:
        """Partial derivatives by each of ``variables``."""
        return cls({variable: {variable: sp.S.One} for variable in variables})

    def of(self, expression: sp.Expr) -> Mapping[sp.Symbol, sp.Expr]:
        """Derivatives of ``expression`` by name; it holds no variable with a derivative that is not there."""
        found = self._known.get(expression)
        if found is None:
            found = self._known[expression] = self._of(expression)
        return found

    def _of(self, expression: sp.Expr) -> dict[sp.Symbol, sp.Expr]:
        if not expression.args:
            return {}
        if expression.is_Add:
            return _summed([self.of(term) for term in expression.args])
        if expression.is_Mul:
            return self._of_product(expression)
        if expression.is_Pow and not self.of(expression.exp):
            base, exponent = expression.args
            return self._chain(exponent * base ** (exponent - 1), base) if self.of(base) else {}
        if isinstance(expression, _PLAIN_FUNCTIONS):
            return self._chain(expression.fdiff(1), expression.args[0]) if self.of(expression.args[0]) else {}
        depends = expression.free_symbols
        return _summed([self._chain(expression.diff(variable), variable) for variable in self._variables if variable in depends])

    def _of_product(self, product: sp.Expr) -> dict[sp.Symbol, sp.Expr]:
        factors = product.args
        moving = [place for place, factor in enumerate(factors) if self.of(factor)]
        return _summed([self._chain(sp.Mul(*factors[:place], *factors[place + 1 :]), factors[place]) for place in moving])

    def _chain(self, outer: sp.Expr, inner: sp.Expr) -> dict[sp.Symbol, sp.Expr]:
        return {name: outer if derivative is sp.S.One else outer * derivative for name, derivative in self.of(inner).items()}


def _summed(parts: Sequence[Mapping[sp.Symbol, sp.Expr]]) -> dict[sp.Symbol, sp.Expr]:
    """Sums of the parts' derivatives by name."""
    terms: dict[sp.Symbol, list[sp.Expr]] = {}
    for part in parts:
        for name, derivative in part.items():
            terms.setdefault(name, []).append(derivative)
    return {name: sp.Add(*derivatives) for name, derivatives in terms.items()}
