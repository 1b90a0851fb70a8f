"""Values of a function that ``harness.programs.loops.language`` writes: an operator on them writes its instruction."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from llvmlite import ir

from harness.programs.numbers import LANES

if TYPE_CHECKING:
    from harness.programs.loops.language import Writer

NUMBER, INTEGER = ir.DoubleType(), ir.IntType(64)
VECTOR, INTEGERS = ir.VectorType(NUMBER, LANES), ir.VectorType(INTEGER, LANES)
LANE = ir.IntType(32)
HALF_INTEGER = ir.IntType(32)
_ALIGNMENT = 8


def _kind_of(*operands: Operand) -> Any:
    """The kind of the value which has lanes, else that of the first, else a number's."""
    kinds = [value.raw.type for value in operands if isinstance(value, Value)] or [NUMBER]
    return next((kind for kind in kinds if isinstance(kind, ir.VectorType)), kinds[0])


def _alike(first: Value, second: Operand) -> tuple[Any, Any]:
    """Both as LLVM's values of one kind."""
    kind = _kind_of(first, second)
    return first.code.constant(first, kind), first.code.constant(second, kind)


def _operator(of_numbers: str, of_integers: str, is_reversed: bool = False) -> Callable[[Value, Operand], Value]:
    """The operator that writes LLVM's instruction of one of these names."""

    def write(value: Value, other: Operand) -> Value:
        first, second = _alike(value, other)
        name = of_integers if first.type in (INTEGER, INTEGERS) else of_numbers
        pair = (second, first) if is_reversed else (first, second)
        return Value(value.code, getattr(value.code.builder, name)(*pair))

    return write


def _comparison(sign: str) -> Callable[[Value, Operand], Value]:
    """The comparison by a sign; false where a number is NaN."""

    def write(value: Value, other: Operand) -> Value:
        first, second = _alike(value, other)
        builder = value.code.builder
        compare = builder.icmp_signed if first.type in (INTEGER, INTEGERS) else builder.fcmp_ordered
        return Value(value.code, compare(sign, first, second))

    return write


def _function(name: str) -> Callable[..., Value]:
    """LLVM's function of a name, of a value and operands."""

    def call(first: Value, *others: Operand) -> Value:
        code, kind = first.code, _kind_of(first, *others)
        return code.call(name, *(Value(code, code.constant(value, kind)) for value in (first, *others)))

    return call


class Value:
    """A number, four numbers, an integer, or a flag or four of the function that is being written; ``raw`` is LLVM's.

    Flags are the results of comparisons. Integers are divided by ``//``, where they are not negative.
    """

    def __init__(self, code: Writer, raw: Any) -> None:
        self.code, self.raw = code, raw

    __add__ = __radd__ = _operator("fadd", "add")
    __sub__, __rsub__ = _operator("fsub", "sub"), _operator("fsub", "sub", is_reversed=True)
    __mul__ = __rmul__ = _operator("fmul", "mul")
    __truediv__, __rtruediv__ = _operator("fdiv", ""), _operator("fdiv", "", is_reversed=True)
    __floordiv__ = _operator("", "udiv")
    __lt__, __le__, __gt__, __ge__ = (_comparison(sign) for sign in ("<", "<=", ">", ">="))
    __and__, __or__ = _operator("and_", "and_"), _operator("or_", "or_")
    __abs__ = _function("fabs")

    def __mod__(self, other: int) -> Value:
        """Remainder of integers by a power of two, which is not negative."""
        return self & (other - 1)

    def __neg__(self) -> Value:
        builder = self.code.builder
        return Value(self.code, builder.neg(self.raw) if self.raw.type == INTEGER else builder.fneg(self.raw))

    def __invert__(self) -> Value:
        return Value(self.code, self.code.builder.not_(self.raw))

    def any(self) -> Value:
        """True where one of the lanes is."""
        bits = self.code.builder.bitcast(self.raw, ir.IntType(LANES))
        return Value(self.code, self.code.builder.icmp_unsigned("!=", bits, ir.Constant(ir.IntType(LANES), 0)))


Operand = Value | float
equals = _comparison("==")
# NaN where either is, so that what is unknown is never passed over.
larger, smaller = _function("maximum"), _function("minimum")
# a b + c, rounded once: an instruction of the processor, or the C library's function where it has none.
fma = _function("fma")
root_of, floor = _function("sqrt"), _function("floor")


def differs(value: Value, other: Operand) -> Value:
    """True where a number is NaN."""
    first, second = _alike(value, other)
    return Value(value.code, value.code.builder.fcmp_unordered("!=", first, second))


def as_integer(value: Value) -> Value:
    """The whole number that a number is, lane by lane."""
    return Value(value.code, value.code.builder.fptosi(value.raw, INTEGERS if value.raw.type == VECTOR else INTEGER))


def as_number(value: Value) -> Value:
    """The number that an integer is."""
    return Value(value.code, value.code.builder.sitofp(value.raw, NUMBER))


def lane_of(value: Value, lane: int) -> Value:
    return Value(value.code, value.code.builder.extract_element(value.raw, ir.Constant(LANE, lane)))


def sum_of_lanes(value: Value) -> Value:
    """The sum over the lanes."""
    return (lane_of(value, 0) + lane_of(value, 1)) + (lane_of(value, 2) + lane_of(value, 3))


def lane_numbers(code: Writer) -> Value:
    """The number of each lane."""
    return Value(code, ir.Constant(INTEGERS, list(range(LANES))))


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
            found = ir.Constant(ir.VectorType(self.pointer.type.pointee, LANES), ir.Undefined)
            for lane in range(LANES):
                part = self[(lane_of(indices[0], lane), *indices[1:])]
                found = self.code.builder.insert_element(found, part.raw, ir.Constant(LANE, lane))
            return Value(self.code, found)
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
    kind = _kind_of(first, second)
    if isinstance(flag.raw.type, ir.VectorType) and not isinstance(kind, ir.VectorType):
        kind = ir.VectorType(kind, LANES)
    return Value(code, code.builder.select(flag.raw, code.constant(first, kind), code.constant(second, kind)))
