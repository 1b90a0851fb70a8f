"""Straight-line programs: right for any expression, exact as JSON, and safe to read from anywhere."""

from __future__ import annotations

import copy
import json
from fractions import Fraction
from typing import Any

import flint
import mpmath
import msgspec
import numpy as np
import pytest
import sympy as sp
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from support import program_from

from harness.lagrange.derivation import load_mechanism
from harness.lagrange.expressions import assemble
from harness.library import Library
from harness.programs.kernels import BallKernel, Float64Kernel
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.program import OUTPUTS, StraightLineProgram
from harness.truth.sampling import generic_sample

X, Y, P = INPUTS = sp.symbols("x y p", real=True)
LITERALS = [sp.Integer(0), sp.Integer(3), sp.Integer(-2), sp.Rational(1, 3), sp.Rational(-7, 5), sp.Float(0.1), sp.Float(-2.5), sp.pi]


def _grow(inner: st.SearchStrategy[sp.Expr]) -> st.SearchStrategy[sp.Expr]:
    # Arguments of roots and logarithms are kept positive, denominators away from nought: everything stays real.
    positive = inner.map(lambda e: e**2 + sp.Rational(1, 2))
    between = inner.map(lambda e: 2 + sp.sin(e))
    return st.one_of(
        st.lists(inner, min_size=2, max_size=4).map(lambda terms: sp.Add(*terms)),
        st.lists(inner, min_size=2, max_size=3).map(lambda factors: sp.Mul(*factors)),
        st.tuples(inner, inner).map(lambda pair: pair[0] - pair[1]),
        st.tuples(inner, positive).map(lambda pair: pair[0] / pair[1]),
        st.tuples(inner, st.sampled_from([2, 3])).map(lambda pair: pair[0] ** pair[1]),
        st.tuples(positive, st.sampled_from([-1, -2, -3])).map(lambda pair: pair[0] ** pair[1]),
        st.tuples(positive, st.sampled_from(["1/2", "3/2", "-1/2", "-5/2"])).map(lambda pair: pair[0] ** sp.Rational(pair[1])),
        st.tuples(between, st.sampled_from(["1/3", "-2/3", "7/5"])).map(lambda pair: pair[0] ** sp.Rational(pair[1])),
        st.tuples(between, inner.map(sp.sin)).map(lambda pair: pair[0] ** pair[1]),
        st.sampled_from([sp.sin, sp.cos, sp.tanh, sp.atan]).flatmap(lambda function: inner.map(function)),
        inner.map(lambda e: sp.tan(sp.sin(e))),
        inner.map(lambda e: sp.exp(-sp.cos(e))),
        inner.map(lambda e: sp.asin(sp.cos(e) / 2) + sp.acos(sp.sin(e) / 3)),
        inner.map(lambda e: sp.sinh(sp.sin(e)) - sp.cosh(sp.cos(e))),
        positive.map(sp.log),
        st.tuples(inner, positive).map(lambda pair: sp.atan2(*pair)),
    )


# SymPy writes atan2 of two numbers with a complex logarithm, which is no expression of a mechanism.
expressions = st.recursive(st.sampled_from([X, Y, P, *LITERALS]), _grow, max_leaves=8).filter(lambda e: not e.has(sp.I))
# Small and large enough to matter, and no intermediate result of a short expression leaves float64's normal range.
numbers = st.one_of(st.just(0.0), st.floats(1e-3, 10.0), st.floats(-10.0, -1e-3))


def as_program(*outputs: sp.Expr) -> StraightLineProgram:
    """Four expressions as the program of a system of one degree of freedom, so that every kernel takes it."""
    return assemble(INPUTS, {name: [output] for name, output in zip(OUTPUTS, outputs, strict=True)})


def balls(program: StraightLineProgram, values: list[float], bits: int, parameters: int = 1) -> list[Any]:
    previous, flint.ctx.prec = flint.ctx.prec, bits
    try:
        return list(BallKernel(program, parameters).bind(values[len(values) - parameters :])(*values[: len(values) - parameters]))
    finally:
        flint.ctx.prec = previous


def fraction(number: Any) -> Fraction:
    """An exact binary number of Arb or mpmath as a fraction."""
    if isinstance(number, flint.arb):
        mantissa, exponent = number.man_exp()
    else:
        sign, mantissa, exponent, _ = number._mpf_
        mantissa = -mantissa if sign else mantissa
    return Fraction(int(mantissa)) * Fraction(2) ** int(exponent)


def with_mpmath(expression: sp.Expr, values: list[float]) -> Fraction:
    """The value to far more than 60 digits, whatever cancels; by SymPy's printer, not by our program."""
    with mpmath.workdps(300):
        value = sp.lambdify(INPUTS, expression, modules="mpmath")(*map(mpmath.mpf, values))
        return fraction(mpmath.mpf(value))


@pytest.mark.ci
@settings(max_examples=60)
@given(st.tuples(*[expressions] * 4), st.tuples(*[numbers] * 3).map(list))
def test_balls_hold_the_value_mpmath_finds(outputs: tuple[sp.Expr, ...], values: list[float]) -> None:
    program = as_program(*outputs)
    for ball, expression in zip(balls(program, values, 128), outputs, strict=True):
        expected = with_mpmath(expression, values)
        assert ball.is_finite(), expression
        assert abs(fraction(ball.mid()) - expected) <= fraction(ball.rad()) + abs(expected) / 10**60 + Fraction(1, 10**200), expression
        # A ball that holds everything is right and useless; nothing here cancels all of 128 bits.
        assert fraction(ball.rad()) <= (1 + abs(expected)) / 2**20, expression


@pytest.mark.ci
@settings(max_examples=20)
@given(st.tuples(*[expressions] * 4), st.lists(st.tuples(*[numbers] * 3).map(list), min_size=1, max_size=5))
def test_float64_kernel_rounds_as_its_operations_do(outputs: tuple[sp.Expr, ...], batch: list[list[float]]) -> None:
    """A ball evaluation at 53 bits bounds what rounding every operation once does; the machine may round a few times."""
    program = as_program(*outputs)
    everything = StraightLineProgram(program.inputs, program.instructions, {"all": tuple(range(len(program.instructions)))})
    for values in batch:
        for ball in balls(everything, values, 128):
            magnitude = abs(fraction(ball.mid()))
            assume(magnitude == 0 or Fraction(2) ** -900 < magnitude < Fraction(2) ** 900)
    terms = Float64Kernel(program).terms(np.ascontiguousarray(np.array(batch).T))
    for column, values in enumerate(batch):
        for name, ball, expression in zip(OUTPUTS, balls(program, values, 53), outputs, strict=True):
            found = float(terms[name][column].item())
            assert abs(Fraction(found) - with_mpmath(expression, values)) <= 16 * fraction(ball.rad()) + Fraction(2) ** -1000, expression


@pytest.mark.ci
@settings(max_examples=30)
@given(st.tuples(*[expressions] * 4))
def test_json_gives_the_same_program_back_in_which_no_instruction_is_computed_twice(outputs: tuple[sp.Expr, ...]) -> None:
    program = as_program(*outputs)
    assert program_from(json.loads(json.dumps(msgspec.to_builtins(program)))) == program
    assert len(set(program.instructions)) == len(program.instructions)


def test_a_shared_subexpression_appears_once_across_outputs() -> None:
    shared = sp.sin(X + Y) / sp.sqrt(1 + P**2)
    program = assemble(INPUTS, {"a": [shared, 2 * shared], "b": [sp.cos(shared) + shared, sp.tan(shared)]})
    operations = [instruction[0] for instruction in program.instructions]
    assert [operations.count(name) for name in ("sin", "sqrt", "div", "cos")] == [1, 1, 1, 1]


def test_floats_mean_the_float64_they_are() -> None:
    program = assemble([X], {"a": [sp.Float(0.1) * X]})
    (ball,) = balls(program, [1.0], 128, parameters=0)
    assert ball.is_exact()
    assert fraction(ball.mid()) == Fraction(0.1)


@pytest.mark.parametrize(
    "expression",
    [sp.besselj(0, X), sp.I * X, sp.Symbol("unknown") * X, sp.Function("f")(X), sp.oo, sp.nan, sp.Derivative(sp.Function("f")(X), X)],
)
def test_what_no_kernel_evaluates_is_refused(expression: sp.Expr) -> None:
    with pytest.raises(ValueError, match="no kernel can evaluate"):
        assemble([X], {"a": [expression]})


VALID: dict[str, Any] = {
    "inputs": ["x", "y"],
    "instructions": [
        ["input", 0],
        ["input", 1],
        ["rational", "-7", "5"],
        ["mul", 0, 2],
        ["integer_power", 3, -2],
        ["sin", 4],
        ["pi"],
        ["atan2", 5, 6],
    ],
    "outputs": {"a": [7, 4], "b": []},
}


def test_the_program_that_the_errors_vary_is_valid() -> None:
    program = program_from(VALID)
    assert json.loads(json.dumps(msgspec.to_builtins(program))) == VALID
    angle, power = balls(program, [0.75, 2.0], 128, parameters=0)
    with mpmath.workdps(60):
        expected_power = (mpmath.mpf(-21) / 20) ** -2
        expected_angle = mpmath.atan2(mpmath.sin(expected_power), mpmath.pi)
    for ball, expected in ((angle, expected_angle), (power, expected_power)):
        assert abs(fraction(ball.mid()) - fraction(expected)) <= fraction(ball.rad()) + Fraction(1, 10**58)


@pytest.mark.parametrize(
    "instruction",
    [
        [], ["eval", 0], ["__import__('os')", 0], [["sin"], 0], [{}, 0], [None], "pi", {"pi": 0}, None, 3,
        ["input"], ["input", 2], ["input", -1], ["input", "0"], ["input", 0.0], ["input", True],
        ["sin", 8], ["sin", 3, 3], ["sin", -1], ["add", 0], ["add", 0, None], ["add", 0, 99], ["pow", 0, 1.5], ["pi", 0],
        ["rational", "1", "0"], ["rational", "1", "-2"], ["rational", 1, 2], ["rational", "1.5", "1"], ["rational", "", "1"],
        ["rational", "007", "1"], ["rational", "--5", "1"], ["rational", "\u0663", "1"], ["rational", "1_0", "1"], ["rational", " 1", "1"],
        ["rational", "1", "9" * 5000], ["rational", "9" * 5000, "1"],
        ["integer_power", 0, 0.5], ["integer_power", 0, "2"], ["integer_power", 8, 2], ["integer_power", 0, True],
    ],
    ids=lambda value: repr(value)[:30],
)  # fmt: skip
def test_a_malformed_instruction_is_refused(instruction: Any) -> None:
    instructions = [*VALID["instructions"], instruction]
    with pytest.raises(ValueError):
        program_from(VALID | {"instructions": instructions})


@pytest.mark.parametrize(
    "data",
    [
        None, [], "program", 3, {}, {"inputs": [], "instructions": []}, VALID | {"inputs": "xy"}, VALID | {"inputs": {"x": 0, "y": 0}},
        VALID | {"inputs": [1, 2]}, VALID | {"inputs": None}, VALID | {"instructions": {}}, VALID | {"instructions": "pi"},
        VALID | {"instructions": 5}, VALID | {"outputs": []}, VALID | {"outputs": {"a": [8]}}, VALID | {"outputs": {"a": [-1]}},
        VALID | {"outputs": {"a": 3}}, VALID | {"outputs": {"a": [1.0]}}, VALID | {"outputs": {"a": {}}}, VALID | {"outputs": {"a": [[0]]}},
        VALID | {"outputs": None}, VALID | {"instructions": VALID["instructions"][::-1]},
    ],
    ids=lambda value: repr(value)[:40],
)  # fmt: skip
def test_a_malformed_program_is_refused(data: Any) -> None:
    with pytest.raises(ValueError):
        program_from(data)


junk = st.recursive(
    st.one_of(
        st.none(),
        st.booleans(),
        st.integers(),
        st.integers(-3, 12),
        st.floats(),
        st.text(max_size=8),
        st.sampled_from(["sin", "rational", "input", 10**400, "9" * 5000]),
    ),
    lambda inner: st.one_of(st.lists(inner, max_size=4), st.dictionaries(st.text(max_size=6), inner, max_size=4)),
    max_leaves=6,
)


def places(data: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    keys = data.keys() if isinstance(data, dict) else range(len(data)) if isinstance(data, list) else ()
    return [path, *(place for key in keys for place in places(data[key], (*path, key)))]


def replaced(data: Any, path: tuple[Any, ...], value: Any) -> Any:
    if not path:
        return value
    changed = copy.copy(data)
    changed[path[0]] = replaced(data[path[0]], path[1:], value)
    return changed


@pytest.mark.ci
@given(st.sampled_from(places(VALID)), junk)
@example(("instructions", 2, 1), "007")
@example(("instructions", 2, 1), "\u0663")
@example(("inputs",), "xy")
@settings(max_examples=200)
def test_a_damaged_program_is_refused_or_sound(place: tuple[Any, ...], value: Any) -> None:
    try:
        program = program_from(replaced(VALID, place, value))
    except ValueError:
        return
    assert program_from(msgspec.to_builtins(program)) == program
    # Whatever is accepted is compiled to source and run.
    if any(program.outputs.values()):
        assert len(balls(program, [0.5] * len(program.inputs), 64, parameters=0)) == sum(map(len, program.outputs.values()))


UNFIT: dict[str, tuple[tuple[Any, ...], Any]] = {
    "joints or ranges do not fit the coordinates": (("joints",), ["cart"]),
    "an attitude does not fit the coordinates": (("attitudes",), [0]),
    "the start does not fit the coordinates": (("start",), [[0.0, 0.0]]),
    "the loads do not fit the coordinates": (("static_loads",), [1.0]),
    "there is not one energy program for each chart": (("energy_programs",), []),
    "the program's outputs do not fit the coordinates": (("program", "outputs", "gravity"), [0]),
    "the program's inputs do not fit coordinates and parameters": (("parameters",), []),
    "an energy program does not fit its chart": (("energy_programs", 0, "outputs", "forces"), [0]),
    "the constraints do not fit the coordinates": (("constraints", "redundant"), []),
}


@pytest.mark.parametrize("problem", UNFIT)
def test_a_part_of_a_mechanism_that_does_not_fit_the_others_is_refused_by_name(problem: str) -> None:
    """The parts of one system are of one size; any other file of a cache is damaged."""
    valid = json.loads(load_mechanism(Library.built_in(), "four_bar" if "constraints" in problem else "cart_pendulum").to_json())
    assert Mechanism.from_json(json.dumps(valid)).name
    with pytest.raises(ValueError, match=problem):
        Mechanism.from_json(json.dumps(replaced(valid, *UNFIT[problem])))


@pytest.mark.ci
@given(st.data())
@settings(max_examples=150)
def test_a_damaged_mechanism_is_refused_or_sound(data: st.DataObject) -> None:
    valid = json.loads(load_mechanism(Library.built_in(), "cart_pendulum").to_json())
    place = data.draw(st.sampled_from([path for path in places(valid) if path[:1] != ("program",)]))
    damaged = replaced(valid, place, data.draw(junk))
    try:
        mechanism = Mechanism.from_json(json.dumps(damaged))
    except ValueError:
        return
    assert Mechanism.from_json(mechanism.to_json()).nv == 2
    assert all(isinstance(name, str) for name in (mechanism.name, mechanism.description, *mechanism.coordinates, *mechanism.joints))
    assert len(mechanism.joints) == len(mechanism.position_ranges) == len(mechanism.rate_ranges) == 2


def test_inputs_that_only_turn_are_told_from_those_that_do_not() -> None:
    a, b, c, d, e, k = sp.symbols("a b c d e k", real=True)
    torque = sp.sin(a + 2 * b - sp.pi) * k + sp.cos(c / 2) + d * sp.cos(d)
    program = assemble([a, b, c, d, e, k], {"torque": [torque], "position": [a - 3 * e]})
    # c turns by halves, d and k stand outside, and so do a and e in the second output.
    assert [program.inputs[place] for place in program.turning] == ["b"]
    assert assemble([a, b], {"slope": [sp.tan(a - b)]}).turning == [0, 1]


@pytest.mark.parametrize("name", Library.built_in().system_names())
def test_a_full_turn_of_a_turning_input_changes_no_output(name: str) -> None:
    mechanism = load_mechanism(Library.built_in(), name)
    kernel = BallKernel(mechanism.program, len(mechanism.parameters)).bind(mechanism.parameter_values)
    states = generic_sample(mechanism, 1, seed=5)
    row = [flint.arb(value) for value in (*states.q[0], *states.v[0], *states.tau[0], 0.0)]
    before = kernel(*row)
    for place in mechanism.program.turning:
        if place < mechanism.nq:
            after = kernel(*row[:place], row[place] + 2 * flint.arb.pi(), *row[place + 1 :])
            assert all(first.overlaps(second) for first, second in zip(before, after, strict=True))


@pytest.mark.parametrize("name", ["acrobot", "arm_3r"])
def test_a_state_alone_is_rounded_as_it_is_among_others(name: str) -> None:
    """What a replay computes of one state is what the batch computed, to the last bit."""
    mechanism = load_mechanism(Library.built_in(), name)
    states, kernel = generic_sample(mechanism, 64, 0), Float64Kernel(mechanism.program)
    together = kernel.accelerations(mechanism.inputs(states))
    alone = [kernel.accelerations(mechanism.inputs(states[place : place + 1])) for place in range(64)]
    assert np.array_equal(together, np.hstack(alone))
    assert kernel.accelerations(mechanism.inputs(states[:0])).shape == (mechanism.nv, 0)
