"""SymPy expressions as straight-line programs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction

import sympy as sp

from harness.programs.program import UNARY, StraightLineProgram
from harness.programs.terms import Builder, Term


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
        """How many instructions ``emit`` would add for ``expression``."""
        before, known = len(self.builder.instructions), dict(self.known)
        self.emit(expression)
        added = len(self.builder.instructions) - before
        self.builder.forget(before)
        self.known = known
        return added

    def _rational(self, value: sp.Rational) -> Term:
        return self.builder.number(Fraction(value.p, value.q))

    def _emit(self, expression: sp.Expr) -> Term:
        if expression.is_Rational:
            return self._rational(expression)
        if expression.is_Float:
            # A float in a system file means exactly the float64 it is.
            return self._rational(sp.Rational(float(expression)))
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
        if isinstance(expression, sp.exp):
            return self.builder.add("exp", self.emit(expression.args[0]))
        name = type(expression).__name__
        if name in UNARY and expression.is_Function:
            return self.builder.add(name, self.emit(expression.args[0]))
        if name == "atan2":
            return self.builder.add("atan2", *(self.emit(argument) for argument in expression.args))
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
        numerator, denominator = abs(coefficient.p), coefficient.q
        value = self._chain(upper) if upper else None
        if numerator != 1 or value is None:
            literal = self.builder.number(numerator)
            value = literal if value is None else self.builder.add("mul", literal, value)
        divisor = self._chain(lower) if lower else None
        if denominator != 1:
            literal = self.builder.number(denominator)
            divisor = literal if divisor is None else self.builder.add("mul", literal, divisor)
        if divisor is not None:
            value = self.builder.add("div", value, divisor)
        return self.builder.add("neg", value) if coefficient.is_negative else value

    def _chain(self, factors: Sequence[sp.Expr]) -> Term:
        value = self.emit(factors[0])
        for factor in factors[1:]:
            value = self.builder.add("mul", value, self.emit(factor))
        return value

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
