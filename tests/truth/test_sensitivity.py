"""The sensitivity of accelerations to their data against difference quotients of 800 bits; derivatives that float64 gets wrong."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import sympy as sp
from catalogue import BUILT_IN
from sympy.physics.mechanics import dynamicsymbols

from harness.arrays import Array
from harness.hard.cases import hard_cases
from harness.hard.truths import truth_along
from harness.lagrange.derivation import load_mechanism
from harness.lagrange.expressions import assemble
from harness.lagrange.system import TIME, System
from harness.programs.kernels import BallKernel
from harness.programs.loops.encoding import encode
from harness.programs.loops.interpreter import derivatives
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.numbers import SMALLEST_SCALE
from harness.programs.program import StraightLineProgram, upper_triangle
from harness.programs.states import States
from harness.truth.balls import columns_in_balls
from harness.truth.compare import DOUBLE_DOUBLE
from harness.truth.reference import PRECISIONS, ReferenceKernel
from harness.truth.sampling import sample

# To three digits, to which a backward error is read.
NEAR = 2.0**-9
# Tried one after the other; bars whose masses differ by 1e12 take the second. The step of a difference quotient, relative to the
# input, is a quarter of the bits: its error of second order and its rounding leave half of them.
BITS = (800, 3200)
# Cases of short programs and few degrees of freedom; by night all of them.
QUICK = ["collapsed_spring", "balanced_springs", "spherical_pole", "vanishing_cart"]

x, theta = dynamicsymbols("x theta")
m, force = sp.symbols("m force", positive=True)


class Exact:
    """A mechanism's accelerations in balls of many bits at any inputs, parameters included, by one of its programs."""

    def __init__(self, program: StraightLineProgram) -> None:
        self.nv = len(program.outputs["velocity"])
        self.applied = program.inputs.index("t") - self.nv
        self._kernel = BallKernel(program, 0)

    def equations(self, inputs: list[Any]) -> tuple[Any, Any]:
        """M and tau + passive - velocity - gravity, as ``arb_mat``."""
        import flint

        values = self._outputs(*inputs)
        pairs = upper_triangle(self.nv)
        entries = dict(zip(pairs, values, strict=False))
        vectors = np.reshape(values[len(pairs) : len(pairs) + 3 * self.nv], (3, self.nv))
        total = [inputs[self.applied + i] + vectors[2, i] - vectors[0, i] - vectors[1, i] for i in range(self.nv)]
        mass = flint.arb_mat([[entries[min(i, j), max(i, j)] for j in range(self.nv)] for i in range(self.nv)])
        return mass, flint.arb_mat([[entry] for entry in total])

    def sensitivity(self, inputs: list[float]) -> float:
        """sum over inputs of |dqdd/dz z|_M, by central differences."""
        import flint

        for bits in BITS:
            with flint.ctx.workprec(bits):
                # What is constant has the digits of this precision.
                self._outputs = self._kernel.bind(())
                total = self._sensitivity(inputs, flint.arb(2) ** (-bits // 4))
                if total.rad() < total * 1e-9:
                    return float(total)
        raise AssertionError(inputs)

    def _sensitivity(self, inputs: list[float], step: Any) -> Any:
        """From M dqdd = df - dM qdd, for all inputs at once."""
        import flint

        exact = [flint.arb(value) for value in inputs]
        mass, force = self.equations(exact)
        accelerations, sides = mass.solve(force), []
        for place, value in enumerate(inputs):
            change = flint.arb(max(abs(value), SMALLEST_SCALE)) * step
            there, behind = (
                self.equations([*exact[:place], moved, *exact[place + 1 :]]) for moved in (exact[place] + change, exact[place] - change)
            )
            side = (there[1] - behind[1]) - (there[0] - behind[0]) * accelerations
            sides.append([entry * (1 / (2 * step)) for entry in side.entries()])
        slopes = mass.solve(flint.arb_mat(sides).transpose())
        squares = [sum(map(operator.mul, *columns)) for columns in zip(_columns(slopes), _columns(mass * slopes), strict=True)]
        # What is certain of no sign is from 0 to its upper end.
        return sum(square.sqrt() if square > 0 else flint.arb(0).union(abs(square).upper().sqrt()) for square in squares)


def _columns(matrix: Any) -> list[list[Any]]:
    return [list(column) for column in zip(*matrix.table(), strict=True)]


def charts_and_inputs(mechanism: Mechanism, states: States, parameters: Array) -> list[tuple[StraightLineProgram, list[float]]]:
    """The program of the chart of each state, and its inputs there."""
    kernel = ReferenceKernel(mechanism)
    inputs = mechanism.inputs(states, parameters)
    found = {}
    for chart, chosen in kernel.by_chart(states):
        found.update({index: (chart.program, inputs[:, index].tolist()) for index in chosen.tolist()})
    return [found[index] for index in range(len(states))]


def assert_case_is_exact(name: str, every: int = 1) -> None:
    """At all states of one point in ``every``, beginning with the hardest; each must be certified."""
    evaluators: dict[str, Exact] = {}
    for one in truth_along(name, False)[::every]:
        reference, states, mechanism = one.reference, one.states, one.mechanism
        assert reference is not None
        parameters = np.tile(mechanism.parameter_values, (len(states), 1))
        for index, (program, inputs) in enumerate(charts_and_inputs(mechanism, states, parameters)):
            exact = evaluators.setdefault(program.key, Exact(program))
            assert reference.certified[index], states.as_json(index)
            assert reference.sensitivity[index] == pytest.approx(exact.sensitivity(inputs), rel=NEAR), states.as_json(index)


@pytest.mark.parametrize("name", QUICK)
def test_sensitivity_is_exact_along_hard_cases(name: str) -> None:
    assert_case_is_exact(name, every=4)


@pytest.mark.nightly(nights=4)
@pytest.mark.parametrize("name", [name for name, case in hard_cases().items() if case.opened is None])
def test_sensitivity_is_exact_along_every_hard_case(name: str) -> None:
    assert_case_is_exact(name)


def test_a_derivative_in_doubt_is_computed_in_balls(monkeypatch: pytest.MonkeyPatch) -> None:
    """With a bound of the roundings that nothing satisfies, the loop's sensitivities are those of balls."""
    mechanism = load_mechanism(BUILT_IN, "cart_pendulum")
    kernel, states = ReferenceKernel(mechanism), sample(mechanism, 5, 1)
    sound = kernel.evaluate(states)
    assert (sound.bits == DOUBLE_DOUBLE).all()
    monkeypatch.setattr("harness.truth.reference.MOST_DOUBT", 0.0)
    found = kernel.evaluate(states)
    assert (found.bits == PRECISIONS[0]).all()
    np.testing.assert_allclose(found.sensitivity, sound.sensitivity, rtol=1e-9)


def one_slide(applied: sp.Expr, mechanism_of: Callable[[System], Mechanism], values: dict[sp.Symbol, float]) -> Mechanism:
    return mechanism_of(
        System(
            coordinates={x: "a"},
            kinetic=m * x.diff(TIME) ** 2 / 2,
            potential=0,
            generalised_forces={x: applied},
            parameters={m: (1.0, "kg"), **{symbol: (value, "N") for symbol, value in values.items()}},
            total_mass=m,
        )
    )


def test_a_derivative_that_every_precision_of_the_machine_takes_for_zero_is_seen(mechanism_of: Callable[[System], Mechanism]) -> None:
    """d/dforce of force (1 - cos x) is x^2/2 = 5e-25, half as much as x times the slope by x; float64 and long double have 0."""
    mechanism = one_slide(force * (1 - sp.cos(x)), mechanism_of, {force: 1e30})
    reference = ReferenceKernel(mechanism).evaluate(States.at([[1e-12]], [[0.0]], [[0.0]]))
    assert reference.certified.all()
    # By x, by the force, and by the mass, which divides all of it.
    assert reference.sensitivity[0] == pytest.approx(1e30 * (1e-24 + 0.5e-24 + 0.5e-24), rel=NEAR)


def test_where_the_equations_have_no_derivative_nothing_is_certified(mechanism_of: Callable[[System], Mechanism]) -> None:
    """A chord has none at angle 0, though the force is a number there; beside 0 it has."""
    mechanism = one_slide(force * sp.sqrt(2 - 2 * sp.cos(x)), mechanism_of, {force: 3.0})
    reference = ReferenceKernel(mechanism).evaluate(States.at([[0.0], [1e-200]], [[0.0]] * 2, [[1.0]] * 2))
    assert reference.certified.tolist() == [False, True]
    assert math.isnan(reference.sensitivity[0])


def test_balls_give_the_columns_of_the_loop(plain_mechanism: Mechanism) -> None:
    """Where the loop is trusted, both ways to the derivatives and to the sensitivity give the same."""
    states, program = sample(plain_mechanism, 2, 3), plain_mechanism.program
    reference = ReferenceKernel(plain_mechanism).evaluate(states)
    inputs = plain_mechanism.inputs(states)
    encoded = encode(program)
    assert encoded is not None
    columns, _ = derivatives(encoded, inputs.T, reference.high)
    for index in range(len(states)):
        scales = np.maximum(np.abs(inputs[:, index]), SMALLEST_SCALE)
        found, total = columns_in_balls(program, inputs[:, index].tolist(), scales.tolist(), PRECISIONS)
        assert total == pytest.approx(reference.sensitivity[index], rel=NEAR)
        assert np.abs(found - columns[index] * scales).max() <= 1e-8 * np.abs(found).max()


def test_reverse_mode_knows_every_function() -> None:
    """Forces of one slide in every function there is; a base below zero may have a constant exponent."""
    a, b = sp.symbols("a b", positive=True)
    functions = [sp.sqrt, sp.sin, sp.cos, sp.tan, sp.asin, sp.acos, sp.atan, sp.sinh, sp.cosh, sp.tanh, sp.exp, sp.log]
    terms = [function(a * b) for function in functions] + [a**b, a**-3, sp.atan2(a, b), a / b, a - b, (-a) ** 3, sp.pi * a]
    names = sp.symbols("q v tau t")
    values = [0.3, 0.2, 0.1, 0.0, 0.6, 0.7]
    for term in terms:
        outputs = {"mass": [1 + a], "velocity": [sp.S.Zero], "gravity": [sp.S.Zero], "passive": [term]}
        program = assemble([*names, a, b], outputs)
        _, total = columns_in_balls(program, values, values, PRECISIONS)
        assert total == pytest.approx(Exact(program).sensitivity([*values[:3], SMALLEST_SCALE, *values[4:]]), rel=1e-5), term
