"""Numerical loops written in Python's operators and ``for``, as instructions for LLVM.

A function is written by running it once on a ``Writer``: an operator on a ``Value`` writes its instruction, and the body of
``for i in code.range(n)`` runs once and is written as the body of a loop. Operations on numbers have no flags, so that nothing is
contracted, reassociated or left out: a proof about roundings holds for the machine code.

Writing some thousand instructions takes a twentieth of a second, where a compiler of Python takes ten to infer their types.

Source: LLVM Language Reference Manual, sections Floating-Point Environment and Fast-Math Flags.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import AbstractContextManager
from typing import Any

from llvmlite import ir

from harness.programs.loops.values import (
    HALF_INTEGER,
    INTEGER,
    INTEGERS,
    LANE,
    NUMBER,
    VECTOR,
    Array,
    Operand,
    Value,
    Variable,
    larger,
)
from harness.programs.numbers import LANES

# Arguments by the kind that a signature names.
_ARGUMENTS = {"integer": INTEGER, "number": NUMBER}
_ARRAYS = {"numbers": NUMBER, "integers": INTEGER, "vectors": VECTOR, "halves": HALF_INTEGER}
_ARGUMENTS |= {kind: element.as_pointer() for kind, element in _ARRAYS.items()}


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
            single = self.builder.insert_element(ir.Constant(kind, ir.Undefined), value.raw, ir.Constant(LANE, 0))
            return self.builder.shuffle_vector(single, single, ir.Constant(ir.VectorType(LANE, LANES), [0] * LANES))
        return value.raw

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

    def total(self, terms: Iterable[Value], first: Operand = 0.0) -> Value:
        """``first`` and the sum of terms, as a generator expression over ``range`` writes them; of the kind of ``first``."""
        found = self.variable(first)
        for term in terms:
            found.value += term
        return found.value

    def largest(self, terms: Iterable[Value], first: Operand = 0.0) -> Value:
        """The largest of ``first`` and of terms as ``total`` takes them; NaN where one of them is."""
        found = self.variable(first)
        for term in terms:
            found.value = larger(found.value, term)
        return found.value

    def perform(self, name: str, *arguments: Value | Array) -> None:
        """Call a function of the module that is written already."""
        raws = [argument.raw if isinstance(argument, Value) else argument.pointer for argument in arguments]
        self.builder.call(self.module.globals[name], raws)

    def when(self, flag: Value) -> AbstractContextManager[Any]:
        """Context whose code is done where the flag is true."""
        then: AbstractContextManager[Any] = self.builder.if_then(flag.raw)
        return then

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
