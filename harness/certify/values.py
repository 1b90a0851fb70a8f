"""Values of a function that ``harness.certify.language`` writes: an operator on them writes its instruction."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from llvmlite import ir

from harness.certify.numbers import LANES

if TYPE_CHECKING:
    from harness.certify.language import Writer

NUMBER, INTEGER = ir.DoubleType(), ir.IntType(64)
VECTOR, INTEGERS = ir.VectorType(NUMBER, LANES), ir.VectorType(INTEGER, LANES)
LANE = ir.IntType(32)
HALF_INTEGER = ir.IntType(32)
_ALIGNMENT = 8


class Value:
    """A number, four numbers, an integer or a flag of the function that is being written; ``raw`` is LLVM's."""

    def __init__(self, code: Writer, raw: Any) -> None:
        self.code, self.raw = code, raw

    def _with(self, other: Operand, of_numbers: str, of_integers: str, is_reversed: bool = False) -> Value:
        first, second = self.code.alike(self, other)
        name = of_integers if first.type in (INTEGER, INTEGERS) else of_numbers
        pair = (second, first) if is_reversed else (first, second)
        return Value(self.code, getattr(self.code.builder, name)(*pair))

    def __add__(self, other: Operand) -> Value:
        return self._with(other, "fadd", "add")

    def __sub__(self, other: Operand) -> Value:
        return self._with(other, "fsub", "sub")

    def __mul__(self, other: Operand) -> Value:
        return self._with(other, "fmul", "mul")

    def __truediv__(self, other: Operand) -> Value:
        return self._with(other, "fdiv", "")

    def __floordiv__(self, other: Operand) -> Value:
        """Of integers that are not negative."""
        return self._with(other, "", "udiv")

    def __mod__(self, other: int) -> Value:
        """Of integers, by a power of two: the remainder that is not negative."""
        first, last = self.code.alike(self, other - 1)
        return Value(self.code, self.code.builder.and_(first, last))

    __radd__, __rmul__ = __add__, __mul__

    def __rsub__(self, other: Operand) -> Value:
        return self._with(other, "fsub", "sub", is_reversed=True)

    def __rtruediv__(self, other: Operand) -> Value:
        return self._with(other, "fdiv", "", is_reversed=True)

    def __neg__(self) -> Value:
        builder = self.code.builder
        return Value(self.code, builder.neg(self.raw) if self.raw.type == INTEGER else builder.fneg(self.raw))

    def __abs__(self) -> Value:
        return self.code.call("fabs", self)

    def __and__(self, other: Value) -> Value:
        return Value(self.code, self.code.builder.and_(self.raw, other.raw))

    def __or__(self, other: Value) -> Value:
        return Value(self.code, self.code.builder.or_(self.raw, other.raw))

    def __invert__(self) -> Value:
        return Value(self.code, self.code.builder.not_(self.raw))

    def _compared(self, sign: str, other: Operand) -> Value:
        """False where a number is NaN."""
        first, second = self.code.alike(self, other)
        builder = self.code.builder
        compare = builder.icmp_signed if first.type in (INTEGER, INTEGERS) else builder.fcmp_ordered
        return Value(self.code, compare(sign, first, second))

    def __lt__(self, other: Operand) -> Value:
        return self._compared("<", other)

    def __le__(self, other: Operand) -> Value:
        return self._compared("<=", other)

    def __gt__(self, other: Operand) -> Value:
        return self._compared(">", other)

    def __ge__(self, other: Operand) -> Value:
        return self._compared(">=", other)

    def equals(self, other: Operand) -> Value:
        return self._compared("==", other)

    def differs(self, other: Operand) -> Value:
        """True where a number is NaN."""
        first, second = self.code.alike(self, other)
        return Value(self.code, self.code.builder.fcmp_unordered("!=", first, second))

    def integer(self) -> Value:
        """The whole number that this number is, lane by lane."""
        return Value(self.code, self.code.builder.fptosi(self.raw, INTEGERS if self.raw.type == VECTOR else INTEGER))

    def number(self) -> Value:
        """The number that this integer is."""
        return Value(self.code, self.code.builder.sitofp(self.raw, NUMBER))

    def lane(self, lane: int) -> Value:
        return Value(self.code, self.code.builder.extract_element(self.raw, ir.Constant(LANE, lane)))

    def total(self) -> Value:
        """The sum over the lanes."""
        return (self.lane(0) + self.lane(1)) + (self.lane(2) + self.lane(3))

    def any(self) -> Value:
        """Whether a flag is true in one of the lanes."""
        bits = self.code.builder.bitcast(self.raw, ir.IntType(LANES))
        return Value(self.code, self.code.builder.icmp_unsigned("!=", bits, ir.Constant(ir.IntType(LANES), 0)))


Operand = Value | float


class Variable:
    """A place for a value that changes."""

    def __init__(self, code: Writer, initial: Value) -> None:
        self._code = code
        with code.builder.goto_entry_block():
            self._place = code.builder.alloca(initial.raw.type)
        self.value = initial

    @property
    def value(self) -> Value:
        return Value(self._code, self._code.builder.load(self._place))

    @value.setter
    def value(self, value: Operand) -> None:
        self._code.builder.store(self._code.constant(value, self._place.allocated_type), self._place)


class Array:
    """An array in memory; ``inner`` are its sizes but the first, which nothing asks for."""

    def __init__(self, code: Writer, pointer: Any, inner: Sequence[Value | int] = ()) -> None:
        self.code, self.pointer, self._inner = code, pointer, tuple(inner)

    def _place(self, indices: Sequence[Value | int]) -> Any:
        offset: Value | int = indices[0]
        for position, size in enumerate(self._inner[: len(indices) - 1]):
            offset = offset * size + indices[position + 1]
        for size in self._inner[len(indices) - 1 :]:
            offset = offset * size
        return self.code.builder.gep(self.pointer, [self.code.constant(offset, INTEGER)])

    def __getitem__(self, indices: Value | int | tuple[Value | int, ...]) -> Value:
        indices = indices if isinstance(indices, tuple) else (indices,)
        if isinstance(indices[0], Value) and indices[0].raw.type == INTEGERS:
            return self.code.gathered([self[(indices[0].lane(lane), *indices[1:])] for lane in range(LANES)])
        raw = self.code.builder.load(self._place(indices), align=_align(self.pointer))
        return Value(self.code, self.code.builder.sext(raw, INTEGER) if raw.type == HALF_INTEGER else raw)

    def __setitem__(self, indices: Value | int | tuple[Value | int, ...], value: Operand) -> None:
        place = self._place(indices if isinstance(indices, tuple) else (indices,))
        self.code.builder.store(self.code.constant(value, self.pointer.type.pointee), place, align=_align(self.pointer))

    def part(self, *indices: Value | int) -> Array:
        """The array at the first indices."""
        return Array(self.code, self._place(indices), self._inner[len(indices) :])

    def in_vectors(self, *inner: Value | int) -> Array:
        """The same numbers as an array of vectors of the given sizes but the first."""
        return Array(self.code, self.code.builder.bitcast(self.pointer, VECTOR.as_pointer()), inner)

    def in_numbers(self, *inner: Value | int) -> Array:
        """The same vectors as an array of numbers of the given sizes but the first."""
        return Array(self.code, self.code.builder.bitcast(self.pointer, NUMBER.as_pointer()), inner)


def _align(pointer: Any) -> int:
    return 4 if pointer.type.pointee == HALF_INTEGER else _ALIGNMENT


def select(flag: Value, first: Operand, second: Operand) -> Value:
    """``first`` where the flag is true, else ``second``; both are known."""
    code = flag.code
    kinds = [value.raw.type for value in (first, second) if isinstance(value, Value)] or [NUMBER]
    kind = next((kind for kind in kinds if isinstance(kind, ir.VectorType)), kinds[0])
    if isinstance(flag.raw.type, ir.VectorType) and not isinstance(kind, ir.VectorType):
        kind = ir.VectorType(kind, LANES)
    return Value(code, code.builder.select(flag.raw, code.constant(first, kind), code.constant(second, kind)))


def larger(first: Value, second: Operand) -> Value:
    """The larger one; NaN where either is, so that what is unknown is never passed over."""
    return _called("maximum", first, second)


def smaller(first: Value, second: Operand) -> Value:
    """The smaller one; NaN where either is."""
    return _called("minimum", first, second)


def fma(a: Value, b: Operand, c: Operand) -> Value:
    """a b + c, rounded once: an instruction of the processor, or the C library's function where it has none."""
    return _called("fma", a, b, c)


def _called(name: str, first: Value, *others: Operand) -> Value:
    code = first.code
    kinds = [value.raw.type for value in (first, *others) if isinstance(value, Value)]
    kind = VECTOR if VECTOR in kinds else NUMBER
    return code.call(name, *(Value(code, code.constant(value, kind)) for value in (first, *others)))


def root_of(value: Value) -> Value:
    return value.code.call("sqrt", value)


def floor(value: Value) -> Value:
    return value.code.call("floor", value)
