"""Numerical loops written in Python's operators and ``for``, as instructions for LLVM.

A function is written by running it once on a ``Writer``: an operator on a ``Value`` writes its instruction, and the body of
``for i in code.range(n)`` runs once and is written as the body of a loop. Operations on numbers have no flags, so that nothing is
contracted, reassociated or left out: a proof about roundings holds for the machine code.

Writing some thousand instructions takes a twentieth of a second, where a compiler of Python takes ten to infer their types.

Source: LLVM Language Reference Manual, sections Floating-Point Environment and Fast-Math Flags.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

from llvmlite import ir

from harness.certify.numbers import LANES as LANES

NUMBER, INTEGER = ir.DoubleType(), ir.IntType(64)
VECTOR, INTEGERS = ir.VectorType(NUMBER, LANES), ir.VectorType(INTEGER, LANES)
_LANE = ir.IntType(32)
_HALF_INTEGER = ir.IntType(32)
# Arguments by the kind that a signature names.
_ARGUMENTS = {"integer": INTEGER, "number": NUMBER}
_ARRAYS = {"numbers": NUMBER, "integers": INTEGER, "vectors": VECTOR, "halves": _HALF_INTEGER}
_ARGUMENTS |= {kind: element.as_pointer() for kind, element in _ARRAYS.items()}
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
        return Value(self.code, self.code.builder.extract_element(self.raw, ir.Constant(_LANE, lane)))

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
        return Value(self.code, self.code.builder.sext(raw, INTEGER) if raw.type == _HALF_INTEGER else raw)

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
    return 4 if pointer.type.pointee == _HALF_INTEGER else _ALIGNMENT


class Writer:
    """Writes one function without a result; ``signature`` gives the kind of each argument."""

    def __init__(self, module: Any, name: str, signature: Mapping[str, str]) -> None:
        self.module = module
        kinds = [_ARGUMENTS[kind] for kind in signature.values()]
        self._function = ir.Function(module, ir.FunctionType(ir.VoidType(), kinds), name)
        self._arguments = dict(zip(signature, self._function.args, strict=True))
        for argument in self._function.args:
            if isinstance(argument.type, ir.PointerType):
                # Arrays do not overlap.
                argument.add_attribute("noalias")
        self.builder = ir.IRBuilder(self._function.append_basic_block())

    def argument(self, name: str) -> Value:
        return Value(self, self._arguments[name])

    def array(self, name: str, *inner: Value | int) -> Array:
        """The array argument of the given sizes but the first."""
        return Array(self, self._arguments[name], inner)

    # Values.

    def constant(self, value: Operand, kind: Any) -> Any:
        """LLVM's value of a kind."""
        if not isinstance(value, Value):
            number = int(value) if kind in (INTEGER, INTEGERS) else float(value)
            return ir.Constant(kind, [number] * LANES if isinstance(kind, ir.VectorType) else number)
        if isinstance(kind, ir.VectorType) and not isinstance(value.raw.type, ir.VectorType):
            single = self.builder.insert_element(ir.Constant(kind, ir.Undefined), value.raw, ir.Constant(_LANE, 0))
            return self.builder.shuffle_vector(single, single, ir.Constant(ir.VectorType(_LANE, LANES), [0] * LANES))
        return value.raw

    def alike(self, first: Value, second: Operand) -> tuple[Any, Any]:
        """Both as LLVM's values of one kind, that of the one which has lanes, else that of the first."""
        kinds = [value.raw.type for value in (first, second) if isinstance(value, Value)]
        kind = next((kind for kind in kinds if isinstance(kind, ir.VectorType)), kinds[0])
        return self.constant(first, kind), self.constant(second, kind)

    def gathered(self, parts: Sequence[Value]) -> Value:
        """One value of the lanes given."""
        found = ir.Constant(ir.VectorType(parts[0].raw.type, LANES), ir.Undefined)
        for lane, part in enumerate(parts):
            found = self.builder.insert_element(found, part.raw, ir.Constant(_LANE, lane))
        return Value(self, found)

    def number(self, value: float) -> Value:
        return Value(self, ir.Constant(NUMBER, value))

    def lanes(self, value: Operand) -> Value:
        """A number in all lanes."""
        return Value(self, self.constant(value, VECTOR))

    def variable(self, initial: Operand) -> Variable:
        """A place whose kind is that of its first value."""
        return Variable(self, initial if isinstance(initial, Value) else self.number(initial))

    def table(self, name: str, rows: Any) -> Array:
        """Constants, (n, k), that stand in the machine code."""
        kind = ir.ArrayType(NUMBER, rows.size)
        if name not in self.module.globals:
            constant = ir.GlobalVariable(self.module, kind, name)
            constant.global_constant, constant.linkage = True, "internal"
            constant.initializer = ir.Constant(kind, rows.ravel().tolist())
        start = self.builder.bitcast(self.module.globals[name], NUMBER.as_pointer())
        return Array(self, start, rows.shape[1:])

    def call(self, name: str, *arguments: Value) -> Value:
        """A function of LLVM's that rounds once, such as fabs, sqrt, floor and fma."""
        kind = arguments[0].raw.type
        name = f"llvm.{name}.{f'v{LANES}f64' if kind == VECTOR else 'f64'}"
        function = self.module.globals.get(name) or ir.Function(self.module, ir.FunctionType(kind, [kind] * len(arguments)), name)
        return Value(self, self.builder.call(function, [argument.raw for argument in arguments]))

    # What is done, and how often.

    def range(self, start: Value | int, stop: Value | int | None = None) -> Iterator[Value]:
        """The integers from ``start``, or 0, up to ``stop``, for a ``for`` without break; its body is written once."""
        first, end = (0, start) if stop is None else (start, stop)
        index = Variable(self, Value(self, self.constant(first, INTEGER)))
        head, body, after = (self._function.append_basic_block() for _ in range(3))
        self.builder.branch(head)
        self.builder.position_at_end(head)
        self.builder.cbranch((index.value < end).raw, body, after)
        self.builder.position_at_end(body)
        now = index.value
        yield now
        index.value = now + 1
        self.builder.branch(head)
        self.builder.position_at_end(after)

    def perform(self, name: str, *arguments: Value | Array) -> None:
        """Call a function of the module that is written already."""
        raws = [argument.raw if isinstance(argument, Value) else argument.pointer for argument in arguments]
        self.builder.call(self.module.globals[name], raws)

    @contextmanager
    def when(self, flag: Value) -> Iterator[None]:
        with self.builder.if_then(flag.raw):
            yield

    def choose(self, key: Value, cases: Mapping[int, Callable[[], None]], otherwise: Callable[[], None]) -> None:
        """Do what stands in ``cases`` at the key."""
        last, after = self._function.append_basic_block(), self._function.append_basic_block()
        switch = self.builder.switch(key.raw, last)
        for number, case in [*cases.items(), (None, otherwise)]:
            block = last if number is None else self._function.append_basic_block()
            if number is not None:
                switch.add_case(ir.Constant(INTEGER, number), block)
            self.builder.position_at_end(block)
            case()
            self.builder.branch(after)
        self.builder.position_at_end(after)


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


# What writes a function, and its signature.
Function = tuple[Callable[[Writer], None], Mapping[str, str]]


def module_of(functions: Mapping[str, Function], parts: Mapping[str, Function] | None = None) -> str:
    """LLVM's text of a module of functions by their names, which may perform ``parts``."""
    module = ir.Module()
    for name, (write, signature) in {**(parts or {}), **functions}.items():
        code = Writer(module, name, signature)
        write(code)
        code.builder.ret_void()
        if name not in functions:
            module.globals[name].linkage = "internal"
    return str(module)
