"""Sums of unknowns with coefficients that are instructions of a program, for linear equations that a program writes down."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from harness.robots.spatial import SpatialWriter, Three


@dataclass(frozen=True)
class Linear:
    """``constant`` plus the sum of unknowns, by their numbers, each times its coefficient; both are places of instructions."""

    constant: int
    terms: Mapping[int, int] = field(default_factory=dict)


# A vector along three axes.
Vector = list[Linear]


class LinearWriter:
    """Writes sums of unknowns by the operations of a program's writer."""

    def __init__(self, writer: SpatialWriter) -> None:
        self._writer = writer
        self.nothing = Linear(writer.zero)

    def known(self, values: Three) -> Vector:
        return [Linear(value) for value in values]

    def unknown(self, numbers: Sequence[int]) -> Vector:
        return [Linear(self._writer.zero, {number: self._writer.number(1)}) for number in numbers]

    def sum(self, first: Linear, *others: Linear) -> Linear:
        constant, terms = first.constant, dict(first.terms)
        for other in others:
            constant = self._writer.sum(constant, other.constant)
            for number, coefficient in other.terms.items():
                terms[number] = self._writer.sum(terms.get(number), coefficient)
        return Linear(constant, terms)

    def times(self, factor: int, one: Linear) -> Linear:
        terms = {number: self._writer.product(factor, coefficient) for number, coefficient in one.terms.items()}
        return Linear(self._writer.product(factor, one.constant), terms)

    def negative(self, one: Linear) -> Linear:
        return self.times(self._writer.number(-1), one)

    def added(self, first: Vector, *others: Vector) -> Vector:
        return [self.sum(*parts) for parts in zip(first, *others, strict=True)]

    def minus(self, values: Vector) -> Vector:
        return [self.negative(value) for value in values]

    def along(self, factor: Linear, direction: Three) -> Vector:
        return [self.times(component, factor) for component in direction]

    def dot(self, first: Three, second: Vector) -> Linear:
        return self.sum(*(self.times(a, b) for a, b in zip(first, second, strict=True)))

    def cross(self, first: Three, second: Vector) -> Vector:
        return [self.dot(row, second) for row in self._writer.skew(first)]

    def turned(self, matrix: Sequence[Three], values: Vector) -> Vector:
        return [self.dot(row, values) for row in matrix]
