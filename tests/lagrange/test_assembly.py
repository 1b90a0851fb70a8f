"""The equations by derivatives of programs are those that SymPy derives."""

from __future__ import annotations

import functools

import flint
import numpy as np
import pytest
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from harness.lagrange.assembly import lagrange_program, program_of
from harness.lagrange.derivation import load_atlas, load_mechanism
from harness.lagrange.equations import derive
from harness.lagrange.expressions import assemble
from harness.lagrange.system import TIME, System
from harness.library import Library
from harness.programs.derivatives import along, gradient
from harness.programs.evaluation import jacobians
from harness.programs.kernels import BallKernel
from harness.programs.program import UNARY, StraightLineProgram
from harness.programs.terms import Builder, matrix
from harness.truth.sampling import generic_sample

LIBRARY = Library.built_in()
x, y = sp.symbols("x y")
FUNCTIONS = [getattr(sp, name)(x / 3 + y) for name in sorted(UNARY - {"neg"})]
EXPRESSIONS = [
    *FUNCTIONS,
    -x,
    x - y,
    x * y,
    x / y,
    x**2,
    x**5,
    x**-3,
    x**y,
    sp.atan2(x, y),
    2 * (x + y) / 7,
    x * (x * y - 1) * sp.cos(x * y),
]


def in_balls(program: StraightLineProgram, row: list[float]) -> list[flint.arb]:
    with flint.ctx.workprec(200):
        return list(BallKernel(program, 0).bind(())(*row))


@functools.cache
def programs_by_either_way(name: str) -> list[tuple[StraightLineProgram, StraightLineProgram]]:
    """By calculus and by SymPy: of each chart of a system, and of each frame for the linear velocity of a free joint."""
    charts, free = load_atlas(LIBRARY.system_path(name))[0], bool(load_mechanism(LIBRARY, name).charts_in_body)
    programs = []
    for system in charts:
        equations = derive(system)
        for in_body in sorted({False, free}):
            by_calculus = lagrange_program(system, in_body)
            assert by_calculus is not None
            programs.append((by_calculus, program_of(system, equations, in_body)))
    return programs


@pytest.mark.ci
def test_programs_by_either_way_certify_the_same_terms(built_in_name: str) -> None:
    mechanism = load_mechanism(LIBRARY, built_in_name)
    for by_calculus, by_sympy in programs_by_either_way(built_in_name):
        assert by_calculus.inputs == by_sympy.inputs
        assert list(by_calculus.outputs) == list(by_sympy.outputs)
        for row in mechanism.inputs(generic_sample(mechanism, 4, seed=1)).T.tolist():
            first, second = in_balls(by_calculus, row), in_balls(by_sympy, row)
            largest = max(float(abs(value)) for value in second)
            for one, other in zip(first, second, strict=True):
                assert one.overlaps(other)
                assert float((one - other).abs_upper()) <= 2.0**-120 * largest


@pytest.mark.parametrize("name", ["puma_560", *(pytest.param(name, marks=pytest.mark.nightly) for name in ("arm_7r", "stanford_arm"))])
def test_calculus_needs_at_most_two_thirds_of_the_instructions_of_sympy(name: str) -> None:
    by_calculus, by_sympy = programs_by_either_way(name)[0]
    assert len(by_calculus.instructions) <= len(by_sympy.instructions) * 2 / 3


@pytest.mark.parametrize("expression", EXPRESSIONS, ids=str)
def test_gradients_and_derivatives_along_a_motion(expression: sp.Expr) -> None:
    program = assemble([x, y], {"f": [expression]})
    builder = Builder(program.inputs)
    (term,) = builder.append(program)["f"]
    first, second = builder.inputs
    slopes = gradient(term, [first, second])
    rates = along([term], {first: builder.number(3), second: builder.number(-2)})
    values = in_balls(builder.program({"gradient": slopes, "along": rates}), [0.375, 0.625])
    expected = jacobians(program, np.array([[0.375], [0.625]]))["f"][0, :, 0]
    assert [float(value) for value in values[:2]] == pytest.approx(expected, rel=1e-14)
    assert float(values[2]) == pytest.approx(3 * expected[0] - 2 * expected[1], rel=1e-13, abs=1e-14)


def test_numbers_are_worked_out_while_a_program_is_written() -> None:
    builder = Builder([x, y])
    f, g = builder.inputs
    before = len(builder.instructions)
    half = builder.add("div", f, builder.number(2))
    assert 2 * half is f
    assert 0 * g is builder.number(2) + builder.number(-2) is g - g
    negative = -f
    assert -negative is 1 * f is f + 0 is f
    assert {instruction[0] for instruction in builder.instructions[before:]} == {"rational", "div", "neg"}


def test_vectors_of_terms_are_numpy_arrays() -> None:
    builder = Builder([x, y])
    f, g = builder.inputs
    square = matrix([[f, g], [-g, f]])
    program = builder.program({"found": [*(square @ builder.vector([1, 2])), *(square.T @ square).flat, *(f * square[0] / 2)]})
    values = [float(value) for value in in_balls(program, [0.375, 0.625])]
    expected = np.array([[0.375, 0.625], [-0.625, 0.375]])
    assert values == [*(expected @ [1, 2]), *(expected.T @ expected).flat, *(0.375 * expected[0] / 2)]


def test_a_kinetic_energy_whose_rates_cancel_by_algebra_alone_is_left_to_sympy() -> None:
    q = dynamicsymbols("q")
    rate, m = q.diff(TIME), sp.Symbol("m", positive=True)
    kinetic = m * rate**2 / 2 + m * ((rate + 1) ** 3 - rate**3 - 3 * rate**2 - 3 * rate - 1) / 6
    system = System(coordinates={q: "slide"}, kinetic=kinetic, potential=0, parameters={m: (2.0, "kg")}, total_mass=m, ranges={q: (-1, 1)})
    assert lagrange_program(system) is None
    assert sp.simplify(derive(system).mass_matrix[0] - m) == 0
