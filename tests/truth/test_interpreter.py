"""Accelerations, sensitivities and derivatives of the compiled loop against balls, over the catalogue and its hard cases."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import flint
import numpy as np
import pytest
import sympy as sp
from catalogue import BUILT_IN

from harness.arrays import Array
from harness.crosscheck.assignment import Assignment, truth_of
from harness.engines import Subject
from harness.files.model_file import read_model
from harness.hard.cases import POINTS, hard_cases
from harness.hard.truths import plain_point
from harness.lagrange.derivation import load_mechanism
from harness.lagrange.expressions import assemble
from harness.programs.kernels import BallKernel
from harness.programs.loops import encoding, interpreter
from harness.programs.loops.encoding import Encoded, encode
from harness.programs.loops.interpreter import Filtered, derivatives, evaluate
from harness.programs.mechanisms.kernel import Charts
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.numbers import SMALLEST_SCALE
from harness.programs.program import StraightLineProgram, right_hand_side, upper_triangle
from harness.programs.states import States
from harness.truth.balls import columns_in_balls
from harness.truth.compare import DOUBLE_DOUBLE
from harness.truth.reference import PRECISIONS, Reference, ReferenceKernel, energy_norm
from harness.truth.sampling import sample

BITS = 1000


def encoded(program: StraightLineProgram) -> Encoded:
    found = encode(program)
    assert found is not None
    return found


def enclosed(program: StraightLineProgram, inputs: Array, found: Filtered) -> list[bool]:
    """Whether each state's exact accelerations are within the loop's bounds; True where a bound is no number."""
    nv = found.high.shape[1]
    pairs = upper_triangle(nv)
    with flint.ctx.workprec(BITS):
        evaluate_exactly = BallKernel(program, 0).bind(())
        results = []
        for index, row in enumerate(inputs.tolist()):
            values = evaluate_exactly(*row)
            entries = dict(zip(pairs, values, strict=False))
            mass = flint.arb_mat([[entries[min(i, j), max(i, j)] for j in range(nv)] for i in range(nv)])
            terms = {name: values[len(pairs) + k * nv :][:nv] for k, name in enumerate(("velocity", "gravity", "passive"))}
            applied = [flint.arb(value) for value in row[program.inputs.index("t") - nv :][:nv]]
            bounded = np.isfinite(found.radius[index])
            if not bounded.any():
                results.append(True)
                continue
            solution = mass.solve(flint.arb_mat([[entry] for entry in right_hand_side(terms, applied)]))
            errors = [abs(solution[i, 0] - found.high[index, i] - flint.arb(found.low[index, i])) for i in range(nv)]
            results.append(all(not bounded[i] or bool(error <= flint.arb(found.radius[index, i])) for i, error in enumerate(errors)))
    return results


def by_chart(mechanism: Mechanism, states: States) -> list[tuple[StraightLineProgram, Array]]:
    """The programs of a mechanism, each with the inputs at the states at which it is the most regular one."""
    charts = Charts(mechanism.charts(linear_velocity_in_body=False))
    inputs = mechanism.inputs(states).T
    return [(charts.programs[number], inputs[chosen]) for number, chosen in charts.split(states.q)]


def hard_point(name: str, place: int) -> tuple[Mechanism, States]:
    """One point of a case, and its states; other points are neither derived nor certified for it."""
    point = plain_point(hard_cases()[name], place)
    return point.mechanism, point.states


def scales_of(inputs: Array) -> Array:
    return np.maximum(np.abs(inputs), SMALLEST_SCALE)


def test_exact_accelerations_are_within_their_bounds(built_in_mechanism: Mechanism) -> None:
    for program, inputs in by_chart(built_in_mechanism, sample(built_in_mechanism, 12, 5)):
        found = evaluate(encoded(program), inputs, scales_of(inputs))
        assert np.isfinite(found.radius).all()
        assert all(enclosed(program, inputs, found))


def test_sensitivities_are_within_their_doubt_of_those_in_balls(built_in_mechanism: Mechanism) -> None:
    for program, inputs in by_chart(built_in_mechanism, sample(built_in_mechanism, 2, 5)):
        found = evaluate(encoded(program), inputs, scales_of(inputs))
        for index, row in enumerate(inputs):
            _, exact = columns_in_balls(program, row.tolist(), scales_of(row).tolist(), PRECISIONS)
            assert abs(found.sensitivity[index] - exact) <= found.doubt[index] + 1e-9 * exact
        assert (found.doubt <= 1e-6 * found.sensitivity).all()


@pytest.mark.parametrize("name", hard_cases())
def test_hard_points_are_within_their_bounds(name: str) -> None:
    # The first point, which is the hardest of most cases, at which bounds matter most; the night takes all of them.
    mechanism, states = hard_point(name, 0)
    for program, inputs in by_chart(mechanism, states[:3]):
        assert all(enclosed(program, inputs, evaluate(encoded(program), inputs, scales_of(inputs))))


@pytest.mark.nightly(nights=4)
@pytest.mark.parametrize("name", hard_cases())
def test_every_hard_point_is_within_its_bounds(name: str) -> None:
    for place in range(POINTS):
        mechanism, states = hard_point(name, place)
        for program, inputs in by_chart(mechanism, states):
            assert all(enclosed(program, inputs, evaluate(encoded(program), inputs, scales_of(inputs))))


@pytest.mark.parametrize("force", [5e-324, -5e-324, 1.5e-323, 1e-310])
def test_what_sinks_below_the_smallest_numbers_is_within_its_bound(force: float) -> None:
    mechanism = load_mechanism(BUILT_IN, "double_pendulum")
    states = States.at([[0.0, 0.0]] * 2, [[0.0, 0.0]] * 2, [[force, 0.0], [0.0, force]])
    for program, inputs in by_chart(mechanism, states):
        assert all(enclosed(program, inputs, evaluate(encoded(program), inputs, scales_of(inputs))))


def test_a_number_that_is_wrong_by_twice_its_bound_is_seen() -> None:
    """As wrong as a constant of the program may be, and a bound that does not say so."""
    mechanism = load_mechanism(BUILT_IN, "arm_3r")
    [(program, inputs)] = by_chart(mechanism, sample(mechanism, 20, 5))
    sound = encoded(program)
    place = int(np.argmax(sound.constants[:, 2] >= 0))
    wrong = sound.constants.copy()
    wrong[place, 1] += 1e-29 * wrong[place, 0]
    found = evaluate(replace(sound, constants=wrong), inputs, scales_of(inputs))
    assert not all(enclosed(program, inputs, found))
    wrong[place, 2] += 2e-29 * abs(wrong[place, 0])
    assert all(enclosed(program, inputs, evaluate(replace(sound, constants=wrong), inputs, scales_of(inputs))))


def test_the_loop_and_balls_give_one_reference(built_in_mechanism: Mechanism, monkeypatch: pytest.MonkeyPatch) -> None:
    assert_one_reference(built_in_mechanism, sample(built_in_mechanism, 6, 7), monkeypatch)


def assert_one_reference(mechanism: Mechanism, states: States, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every number that a verdict or a backward error is made of, to more digits than are printed."""
    fast = ReferenceKernel(mechanism).evaluate(states)
    monkeypatch.setattr("harness.truth.reference.encoded", lambda program: None)
    exact = ReferenceKernel(mechanism).evaluate(states)
    assert (fast.bits == DOUBLE_DOUBLE).all() and (exact.bits >= PRECISIONS[0]).all()
    assert fast.certified.all() and exact.certified.all()
    difference = energy_norm(exact.norm_factor, (fast.high - exact.high) + (fast.low - exact.low))
    assert (difference <= fast.radius + exact.radius + 2.0**-104 * exact.size).all()
    for name in ("norm_factor", "sensitivity", "share", "instability"):
        expected = getattr(exact, name)
        np.testing.assert_allclose(getattr(fast, name), expected, rtol=1e-8, atol=1e-12 * np.abs(expected).max(), err_msg=name)


def reference_at(mechanism: Mechanism, states: States) -> Reference:
    return ReferenceKernel(mechanism).evaluate(states)


def documented_by_mujoco(name: str) -> Mechanism:
    """A mechanism whose constraints give, by the law that MuJoCo documents."""
    read = read_model(BUILT_IN.model_path(name, "mjcf"), "mjcf")
    return truth_of(Assignment(BUILT_IN, Subject("mujoco", "mjcf"), load_mechanism(BUILT_IN, name), read)).mechanism


@pytest.mark.parametrize("name", ["four_bar", "limited_pendulum", "dry_pendulum", "bricard"])
def test_the_loop_that_eliminates_nothing_and_balls_that_do_give_one_reference(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    mechanism = documented_by_mujoco(name)
    assert mechanism.stiffened is not None
    assert_one_reference(mechanism, sample(mechanism, 12, 7), monkeypatch)


def test_sensitivities_beside_another_matrix_are_within_their_doubt() -> None:
    """Of what is solved by an inverse of that matrix and measured by M."""
    mechanism = documented_by_mujoco("four_bar")
    assert mechanism.stiffened is not None
    inputs = mechanism.inputs(sample(mechanism, 3, 5)).T
    found = evaluate(encoded(mechanism.stiffened), inputs, scales_of(inputs))
    doubt = found.doubt + found.spread * 1e4 * found.sensitivity
    for index, row in enumerate(inputs):
        _, exact = columns_in_balls(mechanism.program, row.tolist(), scales_of(row).tolist(), PRECISIONS)
        assert 0 < abs(found.sensitivity[index] - exact) <= doubt[index]
    assert (doubt <= 1e-3 * found.sensitivity).all() and (found.spread > 0).all()


@pytest.mark.ci
@pytest.mark.parametrize("engine", ["lagrange", "mujoco"])
def test_double_double_decides_the_states_of_many_loops(engine: str) -> None:
    """Balls take 40 times as long. Elimination from the last row, which suits a tree, sent 39 % of MuJoCo's states there."""
    name = "four_bar_chain_10"
    read = read_model(BUILT_IN.model_path(name, "mjcf"), "mjcf")
    assignment = Assignment(BUILT_IN, Subject(engine, "mjcf"), load_mechanism(BUILT_IN, name), read)
    certified = truth_of(assignment).evaluate(sample(assignment.mechanism, 128, 5))
    assert (certified.bits == DOUBLE_DOUBLE).all()


def test_states_that_double_double_cannot_decide_go_to_balls() -> None:
    mechanism, states = hard_point("massless_knee", 0)
    reference = reference_at(mechanism, states)
    assert (reference.bits > DOUBLE_DOUBLE).any() and reference.certified.all()


def test_rest_without_forces_is_exactly_zero() -> None:
    mechanism = load_mechanism(BUILT_IN, "spring_damper")
    reference = reference_at(mechanism, States.at([[0.0]], [[0.0]], [[0.0]]))
    assert reference.bits[0] == DOUBLE_DOUBLE
    assert reference.high[0, 0] == reference.low[0, 0] == reference.radius[0] == 0.0


def test_states_that_are_not_finite_are_marked() -> None:
    mechanism = load_mechanism(BUILT_IN, "cart_pendulum")
    good = sample(mechanism, 3, 1)
    bad = good.q.copy()
    bad[1, 0] = np.nan
    reference = reference_at(mechanism, replace(good, q=bad))
    assert reference.certified.tolist() == [True, False, True]


def test_powers_tangents_angles_and_pi_are_interpreted_and_other_functions_are_not() -> None:
    a, b = sp.symbols("a b", positive=True)
    # Of what has a sign, SymPy makes angles arctangents.
    x = sp.Symbol("q", real=True)
    names = x, *sp.symbols("v tau t")
    values = np.array([[0.3, 0.2, 0.1, 0.0, 0.6, 0.7]])

    def program_of(term: sp.Expr) -> StraightLineProgram:
        return assemble([*names, a, b], {"mass": [1 + a], "velocity": [sp.S.Zero], "gravity": [sp.S.Zero], "passive": [term]})

    for term in (
        sp.tan(a * b),
        a**5,
        a**-3,
        sp.sqrt(a) ** 3,
        sp.pi * a,
        -a / b,
        sp.Rational(1, 3) * a,
        sp.sin(a) + sp.cos(a),
        b**7 - a**2,
        sp.atan(a / b),
        sp.atan2(a, x),
        sp.atan2(a, -x) * b,
        sp.atan2(-x, -b),
        sp.atan2(x - a, x**3) / a,
    ):
        program = program_of(term)
        found = evaluate(encoded(program), values, scales_of(values))
        assert enclosed(program, values, found) == [True] and np.isfinite(found.radius).all(), term
        _, exact = columns_in_balls(program, values[0].tolist(), scales_of(values)[0].tolist(), PRECISIONS)
        assert found.sensitivity[0] == pytest.approx(exact, rel=1e-12), term
        assert abs(found.sensitivity[0] - exact) <= found.doubt[0] + 1e-15 * exact, term
    for term in (sp.exp(a), sp.log(a), sp.tanh(a), a**b, sp.asin(a)):
        assert encode(program_of(term)) is None


def test_derivatives_do_not_depend_on_the_loop(monkeypatch: pytest.MonkeyPatch) -> None:
    mechanism = load_mechanism(BUILT_IN, "arm_3r")
    states = sample(mechanism, 5, 3)
    inputs, accelerations = mechanism.inputs(states).T, np.random.default_rng(0).standard_normal((5, 3))
    [(chart, _)] = ReferenceKernel(mechanism).by_chart(states)
    fast = chart.derivatives(inputs, accelerations)
    assert (fast == derivatives(encoded(mechanism.program), inputs, accelerations)[0]).all()
    monkeypatch.setattr("harness.truth.reference.encoded", lambda program: None)
    [(chart, _)] = ReferenceKernel(mechanism).by_chart(states)
    np.testing.assert_allclose(chart.derivatives(inputs, accelerations), fast, rtol=1e-12, atol=1e-12)


def test_every_operation_has_a_code_of_its_own() -> None:
    codes = [value for name, value in vars(encoding).items() if name.isupper() and isinstance(value, int) and not name.startswith("_")]
    assert sorted(codes) == list(range(8))


_LOAD = """
import sys
from harness.programs.loops import interpreter
interpreter.loop("evaluate"), interpreter.loop("derive"), interpreter.loop("measure")
print("harness.programs.loops.loops" in sys.modules)
"""


@pytest.mark.ci
def test_machine_code_is_made_once_and_is_not_read_where_it_is_damaged(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HEYOKA_CACHE_DIR", str(tmp_path))
    is_made = [subprocess.run([sys.executable, "-c", _LOAD], capture_output=True, text=True, check=True).stdout.strip() for _ in range(2)]
    assert is_made == ["True", "False"]
    [entry] = tmp_path.glob("certify-*")
    content = entry.read_text()
    assert interpreter.kept() is not None
    entry.write_text(content[: len(content) // 2] + "AAAA" + content[len(content) // 2 + 4 :])
    assert interpreter.kept() is None


@pytest.mark.parametrize("name", ["arm_2r", "cart_pendulum", "stanford_arm"])
def test_what_bounds_the_error_of_a_derivative_is_no_smaller_than_the_derivative(name: str) -> None:
    """It is the sum of the absolute values of all that the derivative is the sum of."""
    mechanism = load_mechanism(BUILT_IN, name)
    states = sample(mechanism, 8, 3)
    reference = ReferenceKernel(mechanism).evaluate(states)
    found, sizes = derivatives(encoded(mechanism.program), mechanism.inputs(states).T, reference.high)
    assert (np.abs(found).max(axis=1) <= sizes * (1 + 1e-9)).all() and (np.abs(found) > 0).any(axis=(0, 1)).sum() > 3
