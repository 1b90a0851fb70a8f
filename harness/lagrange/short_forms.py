"""Short forms of the expressions in equations of motion, most of which are polynomials in sines and cosines.

Such a polynomial can be written in powers of the sine and the cosine of each angle, where sin^2 + cos^2 = 1 leaves a choice for
every angle, or as a Fourier sum of sines and cosines of sums of angles. Which is shortest depends on the mechanism: the Fourier
sum of an arm holds cos(q2 + q3) where powers hold two products. So all of them are written down, in factors and by Horner's rule,
and the one that adds the fewest instructions to the program is taken. SymPy's ``simplify`` tries rewritings of every kind, takes
thirty times as long, and leaves most programs of the catalogue longer, by up to a third; it is for what is no such polynomial.

Source: Abramowitz, Stegun, Handbook of Mathematical Functions, 4.3.31 to 4.3.33 (products of sines and cosines); Knuth, The Art
of Computer Programming, volume 2, section 4.6.4 (Horner's rule).
"""

from __future__ import annotations

import itertools
import math
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import flint
import sympy as sp

from harness.lagrange.expressions import Assembler

# Of more angles, only the forms without any sin^2 and without any cos^2 are written down beside the Fourier sum.
MOST_ANGLES_WITH_ALL_CHOICES = 4
# A product of more terms is left as it is: nobody would wait for its factors, or read them.
MOST_TERMS = 200

# Exponents of the sines of all angles, and then those of their cosines.
Powers = tuple[int, ...]
# A sine or a cosine, and the whole multiples of the angles that it is taken of.
Harmonic = tuple[type[sp.Function], tuple[int, ...]]
# Of the product of two functions, that of the sum and of the difference of their angles, with the signs of both.
_PRODUCTS = {
    (sp.sin, sp.cos): (sp.sin, 1, 1),
    (sp.cos, sp.cos): (sp.cos, 1, 1),
    (sp.cos, sp.sin): (sp.sin, 1, -1),
    (sp.sin, sp.sin): (sp.cos, -1, 1),
}
# flint.fmpq and flint.fmpq_mpoly: rational numbers, and polynomials over them.
Coefficient = Any
Polynomial = Any
# A coefficient, and exponents of symbols, sines and cosines.
Term = tuple[Coefficient, dict[sp.Expr, int]]


def shortest(expressions: Sequence[sp.Expr]) -> list[sp.Expr]:
    """``expressions``, each rewritten so that one program of all of them has few instructions."""
    symbols = sorted({symbol for expression in expressions for symbol in expression.free_symbols}, key=str)
    program = Assembler(symbols)
    chosen = []
    for expression in expressions:
        chosen.append(min(_forms(expression), key=program.added_by))
        program.emit(chosen[-1])
    return chosen


def _forms(expression: sp.Expr) -> Iterator[sp.Expr]:
    """``expression`` as it is, and in other forms."""
    yield expression
    if not expression.args:
        return
    try:
        polynomial = _TrigonometricPolynomial(expression)
    except _TooManyTerms:
        return
    except _NoPolynomial:
        yield sp.simplify(expression)
    else:
        yield from map(_factored, polynomial.forms())


class _NoPolynomial(Exception):
    """An expression is no polynomial in symbols and in sines and cosines of sums of whole multiples of angles."""


class _TooManyTerms(Exception):
    """A polynomial has more than ``MOST_TERMS`` when it is multiplied out."""


class _TrigonometricPolynomial:
    """A sum over products of symbols, each with a polynomial in the sines and cosines of ``angles``.

    Raises:
        _NoPolynomial: the expression is none.
        _TooManyTerms: it is a long one.
    """

    def __init__(self, expression: sp.Expr) -> None:
        self.units = _units(expression)
        self.angles = [angle * unit for angle, unit in self.units.items()]
        self.symbols = sorted(_symbols_outside(expression), key=str)
        n = len(self.angles)
        self._ring = _ring(len(self.symbols) + 2 * n)
        generators = self._ring.gens()
        self._of_symbol = dict(zip(self.symbols, generators, strict=False))
        self._sines, self._cosines = generators[len(self.symbols) :][:n], generators[len(self.symbols) :][n:]
        # Of each product of symbols, by its exponents, the coefficients of the products of sines and cosines.
        self.parts: dict[tuple[int, ...], dict[Powers, Coefficient]] = defaultdict(dict)
        for exponents, coefficient in self._written(expression).to_dict().items():
            self.parts[exponents[: len(self.symbols)]][exponents[len(self.symbols) :]] = coefficient

    def forms(self) -> Iterator[list[Term]]:
        """The terms of the Fourier sum, of the two shortest choices of powers, and of the shortest form of each part."""
        of_parts = [[self._fourier_sum(part), *self._in_powers(part)] for part in self.parts.values()]
        yield self._joined(forms[0] for forms in of_parts)
        yield self._joined(min(forms, key=_size) for forms in of_parts)
        choices = [self._joined(forms) for forms in zip(*(forms[1:] for forms in of_parts), strict=True)]
        yield from sorted(choices, key=_size)[:2]

    def _joined(self, forms: Iterable[list[Term]]) -> list[Term]:
        """One sum of the forms of all parts."""
        symbols = [dict(zip(self.symbols, exponents, strict=True)) for exponents in self.parts]
        return [(coefficient, {**of_part, **powers}) for of_part, form in zip(symbols, forms, strict=True) for coefficient, powers in form]

    def _in_powers(self, part: Mapping[Powers, Coefficient]) -> Iterator[list[Term]]:
        """A part in powers of sines and cosines, for every choice of which square is replaced at each angle."""
        n = len(self.angles)
        functions = [sp.sin(angle) for angle in self.angles] + [sp.cos(angle) for angle in self.angles]
        choices = itertools.product((0, n), repeat=n) if n <= MOST_ANGLES_WITH_ALL_CHOICES else [(0,) * n, (n,) * n]
        for choice in choices:
            reduced = part
            for angle, first in enumerate(choice):
                reduced = _without_square(reduced, first + angle, n - first + angle)
            yield [(coefficient, dict(zip(functions, powers, strict=True))) for powers, coefficient in reduced.items()]

    def _fourier_sum(self, part: Mapping[Powers, Coefficient]) -> list[Term]:
        total: dict[Harmonic, Coefficient] = defaultdict(int)
        for powers, coefficient in part.items():
            for harmonic, share in _harmonics(powers).items():
                total[harmonic] += coefficient * share
        terms = []
        for (function, multiples), coefficient in total.items():
            value = function(sum(multiple * angle for multiple, angle in zip(multiples, self.angles, strict=True)))
            # SymPy writes sin(-x) as -sin(x).
            sign, factor = value.as_coeff_Mul()
            terms.append((coefficient * _coefficient(sign), {factor: 1}))
        return terms

    def _written(self, expression: sp.Expr) -> Polynomial:
        if expression.is_Rational:
            return self._ring.constant(_coefficient(expression))
        if expression in self._of_symbol:
            return self._of_symbol[expression]
        if expression.is_Add:
            return sum(map(self._written, expression.args), self._ring.constant(0))
        if expression.is_Mul or expression.is_Pow:
            base, exponent = expression.as_base_exp()
            factors = map(self._written, expression.args) if expression.is_Mul else [self._written(base)] * int(exponent)
            product = self._ring.constant(1)
            for factor in factors:
                product *= factor
                if len(product) > MOST_TERMS:
                    raise _TooManyTerms
            return product
        sine, cosine = self._of_sum(expression.args[0])
        return sine if isinstance(expression, sp.sin) else cosine

    def _of_sum(self, argument: sp.Expr) -> tuple[Polynomial, Polynomial]:
        """Sine and cosine of a sum of whole multiples of angles, by the angle addition formulas."""
        sine, cosine = self._ring.constant(0), self._ring.constant(1)
        multiples = argument.as_coefficients_dict()
        for place, (angle, unit) in enumerate(self.units.items()):
            multiple = int(multiples.get(angle, 0) / unit)
            s, c = self._sines[place] * (1 if multiple > 0 else -1), self._cosines[place]
            for _ in range(abs(multiple)):
                sine, cosine = sine * c + cosine * s, cosine * c - sine * s
        return sine, cosine


def _units(expression: sp.Expr) -> dict[sp.Expr, sp.Rational]:
    """The angles of which sines and cosines are taken, each with the rational number of which all its multiples are whole ones."""
    denominators: dict[sp.Expr, int] = {}
    for function in expression.atoms(sp.sin, sp.cos):
        for angle, multiple in function.args[0].as_coefficients_dict().items():
            if angle.is_number or not multiple.is_Rational:
                raise _NoPolynomial
            denominators[angle] = math.lcm(denominators.get(angle, 1), int(multiple.q))
    return {angle: sp.Rational(1, denominators[angle]) for angle in sorted(denominators, key=str)}


def _symbols_outside(expression: sp.Expr) -> set[sp.Symbol]:
    """The symbols of a polynomial that stand outside its sines and cosines, pi and e among them.

    Raises:
        _NoPolynomial: it is none.
    """
    if expression.is_Symbol or isinstance(expression, sp.NumberSymbol):
        return {expression}
    if expression.is_Rational or isinstance(expression, (sp.sin, sp.cos)):
        return set()
    whole_power = expression.is_Pow and expression.exp.is_Integer and expression.exp.is_positive
    if not (expression.is_Add or expression.is_Mul or whole_power):
        raise _NoPolynomial
    parts = (expression.base,) if whole_power else expression.args
    return set[sp.Symbol]().union(*map(_symbols_outside, parts))


def _without_square(part: Mapping[Powers, Coefficient], place: int, other: int) -> dict[Powers, Coefficient]:
    """A part where the square of the function at ``place`` stands as 1 - the square of that at ``other``."""
    total: dict[Powers, Coefficient] = defaultdict(int)
    for powers, coefficient in part.items():
        squares, left = divmod(powers[place], 2)
        for count in range(squares + 1):
            replaced = list(powers)
            replaced[place], replaced[other] = left, powers[other] + 2 * count
            total[tuple(replaced)] += coefficient * (-1) ** count * math.comb(squares, count)
    return {powers: coefficient for powers, coefficient in total.items() if coefficient}


def _harmonics(powers: Powers) -> dict[Harmonic, Coefficient]:
    """The Fourier sum of a product of powers of sines and cosines."""
    n, half = len(powers) // 2, flint.fmpq(1, 2)
    total: dict[Harmonic, Coefficient] = {(sp.cos, (0,) * n): flint.fmpq(1)}
    for place, exponent in enumerate(powers):
        for _ in range(exponent):
            product: dict[Harmonic, Coefficient] = defaultdict(int)
            for (function, multiples), share in total.items():
                of_both, *signs = _PRODUCTS[function, sp.cos if place >= n else sp.sin]
                for step, sign in zip((1, -1), signs, strict=True):
                    product[of_both, tuple(k + step * (at == place % n) for at, k in enumerate(multiples))] += sign * half * share
            total = product
    return total


def _size(terms: Sequence[Term]) -> tuple[int, int]:
    return len(terms), sum(sum(powers.values()) for _, powers in terms)


def _factored(terms: Sequence[Term]) -> sp.Expr:
    """The sum of ``terms`` in factors, and their sums by Horner's rule."""
    generators = sorted({factor for _, powers in terms for factor, exponent in powers.items() if exponent}, key=str)
    total: dict[Powers, Coefficient] = defaultdict(flint.fmpq)
    for coefficient, powers in terms:
        total[tuple(powers.get(generator, 0) for generator in generators)] += coefficient
    return _nested(_ring(len(generators)).from_dict(total), generators)


def _nested(polynomial: Polynomial, generators: Sequence[sp.Expr]) -> sp.Expr:
    content, factors = polynomial.factor()
    if polynomial.is_constant():
        return _rational(content)
    if content != 1 or len(factors) > 1 or factors[0][1] > 1:
        return sp.Mul(_rational(content), *(_nested(factor, generators) ** int(exponent) for factor, exponent in factors))
    terms = polynomial.to_dict()
    occurrences = [sum(exponent > 0 for exponent in exponents) for exponents in zip(*terms, strict=True)]
    if max(occurrences) < 2:
        return sp.Add(*(sp.Mul(_rational(value), *map(sp.Pow, generators, powers)) for powers, value in terms.items()))
    place = occurrences.index(max(occurrences))
    inside = polynomial.context().from_dict({powers: value for powers, value in terms.items() if powers[place]})
    return _nested(inside, generators) + _nested(polynomial - inside, generators)


def _ring(count: int) -> Any:
    """The ring of polynomials in ``count`` generators."""
    return flint.fmpq_mpoly_ctx.get([("x", count)] if count else [], "lex")


def _coefficient(value: sp.Rational) -> Coefficient:
    return flint.fmpq(int(value.p), int(value.q))


def _rational(coefficient: Coefficient) -> sp.Rational:
    return sp.Rational(int(coefficient.p), int(coefficient.q))
