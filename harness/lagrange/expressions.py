"""SymPy expressions: written as straight-line programs, and differentiated, each shared part once for all variables.

``Expr.diff`` walks an expression anew for every variable. The energies of a long chain hold thousands of
terms, few of which depend on any one coordinate; here the gradient of every subexpression is kept, and a
part that depends on no variable costs one look.

Source: Griewank, Walther, Evaluating Derivatives, 2nd ed., sections 3.1 and 7.1 (sparse forward mode).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction

import sympy as sp

from harness.programs.program import UNARY, StraightLineProgram
from harness.programs.terms import Builder, Term

# Functions of one argument whose derivative is ``fdiff``; SymPy itself differentiates whatever is not here.
_PLAIN_FUNCTIONS = tuple(getattr(sp, name) for name in UNARY - {"neg", "sqrt"})


def assemble(inputs: Sequence[sp.Symbol], outputs: Mapping[str, Sequence[sp.Expr]]) -> StraightLineProgram:
    """Write SymPy expressions over ``inputs`` as one program with shared subexpressions.

    Raises:
        ValueError: an expression holds a function or symbol that no kernel can evaluate.
    """
    flat = [expression for expressions in outputs.values() for expression in expressions]
    replacements, reduced = sp.cse(flat, order="none")
    assembler = Assembler(inputs)
    for symbol, expression in replacements:
        assembler.known[symbol] = assembler.emit(expression)
    results = iter([assembler.emit(expression) for expression in reduced])
    return assembler.builder.program({name: [next(results) for _ in expressions] for name, expressions in outputs.items()})


class Assembler:
    """Writes expressions instruction by instruction as they stand, without any identity."""

    def __init__(self, inputs: Sequence[sp.Symbol]) -> None:
        self.builder = Builder(inputs)
        self.known: dict[sp.Expr, Term] = dict(zip(inputs, self.builder.inputs, strict=True))

    def emit(self, expression: sp.Expr) -> Term:
        if expression not in self.known:
            self.known[expression] = self._emit(expression)
        return self.known[expression]

    def added_by(self, expression: sp.Expr) -> int:
        """Number of instructions that ``emit`` would add for ``expression``."""
        before, known = len(self.builder.instructions), dict(self.known)
        self.emit(expression)
        added = len(self.builder.instructions) - before
        self.builder.forget(before)
        self.known = known
        return added

    def _rational(self, value: sp.Rational) -> Term:
        return self.builder.number(Fraction(value.p, value.q))

    def _emit(self, expression: sp.Expr) -> Term:
        if expression.is_Rational or expression.is_Float:
            # A float in a system file means exactly the float64 it is.
            return self._rational(expression if expression.is_Rational else sp.Rational(float(expression)))
        if expression is sp.pi:
            return self.builder.add("pi")
        if expression is sp.E:
            return self.builder.add("exp", self._rational(sp.S.One))
        if expression.is_Add:
            return self._sum(expression)
        if expression.is_Mul:
            return self._product(expression)
        if expression.is_Pow:
            return self._power(*expression.args)
        name = type(expression).__name__
        if name in UNARY | {"atan2"} and expression.is_Function:
            return self.builder.add(name, *map(self.emit, expression.args))
        raise ValueError(
            f"no kernel can evaluate {expression} ({name}); write it with + - * / powers, sqrt, trigonometric or exponential functions"
        )

    def _sum(self, expression: sp.Expr) -> Term:
        total: Term | None = None
        for term in sorted(expression.args, key=lambda term: bool(term.could_extract_minus_sign())):
            is_negative = term.could_extract_minus_sign()
            value = self.emit(-term if is_negative else term)
            if total is None:
                total = self.builder.add("neg", value) if is_negative else value
            else:
                total = self.builder.add("sub" if is_negative else "add", total, value)
        assert total is not None
        return total

    def _product(self, expression: sp.Expr) -> Term:
        coefficient, factors = expression.as_coeff_mul()
        upper, lower = [], []
        for factor in factors:
            base, exponent = factor.as_base_exp()
            if exponent.is_Rational and exponent.is_negative:
                lower.append(base**-exponent)
            else:
                upper.append(factor)
        if not coefficient.is_Rational:
            upper.append(coefficient)
            coefficient = type(expression)()
        value = self._multiplied(abs(coefficient.p), upper) or self.builder.number(1)
        divisor = self._multiplied(coefficient.q, lower)
        if divisor is not None:
            value = self.builder.add("div", value, divisor)
        return self.builder.add("neg", value) if coefficient.is_negative else value

    def _multiplied(self, number: int, factors: Iterable[sp.Expr]) -> Term | None:
        """A whole number times the product of factors; None for 1 alone."""
        value: Term | None = None
        for factor in factors:
            value = self.emit(factor) if value is None else self.builder.add("mul", value, self.emit(factor))
        if number == 1:
            return value
        literal = self.builder.number(number)
        return literal if value is None else self.builder.add("mul", literal, value)

    def _power(self, base: sp.Expr, exponent: sp.Expr) -> Term:
        if exponent.is_Rational and exponent.is_negative:
            return self.builder.add("div", self._rational(sp.S.One), self.emit(base**-exponent))
        if base is sp.E:
            return self.builder.add("exp", self.emit(exponent))
        value = self.emit(base)
        if exponent == 2:
            return self.builder.add("mul", value, value)
        if exponent.is_Integer:
            return self.builder.add("integer_power", value, int(exponent))
        if exponent.is_Rational and exponent.q == 2:
            root = self.builder.add("sqrt", value)
            return root if exponent.p == 1 else self.builder.add("integer_power", root, int(exponent.p))
        return self.builder.add("pow", value, self.emit(exponent))


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
