"""Backward errors and verdicts: known errors give known numbers, planted engines get the verdict they deserve."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import sympy as sp
from catalogue import BUILT_IN
from sympy.physics.mechanics import dynamicsymbols

from harness.engines import load_engine
from harness.files.model_file import read_model
from harness.lagrange.derivation import load_mechanism
from harness.lagrange.system import TIME, System
from harness.library import Library
from harness.programs.kernels import Float64Kernel
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.numbers import UNIT_ROUNDOFF
from harness.programs.states import States
from harness.truth.compare import LEAST_DIGITS, Comparison, compare
from harness.truth.reference import Reference, ReferenceKernel, energy_norm
from harness.truth.sampling import generic_sample
from harness.verdict import AGREEMENT, SEVERITY, Verdict, gravest


def made_up(high: Any, sensitivity: float = 1.0, instability: float = 1e6, certified: bool = True, low: Any = None) -> Reference:
    """References in which nothing rounds: the energy norm is the plain one and the sensitivity a power of two."""
    high = np.atleast_2d(np.asarray(high, dtype=float))
    n, nv = high.shape
    return Reference(
        high=high,
        low=np.zeros((n, nv)) if low is None else np.atleast_2d(np.asarray(low, dtype=float)),
        radius=np.zeros(n),
        norm_factor=np.broadcast_to(np.eye(nv), (n, nv, nv)).copy(),
        sensitivity=np.full(n, sensitivity),
        share=np.zeros(n),
        instability=np.full(n, instability),
        condition=np.ones(n),
        certified=np.full(n, certified),
        bits=np.full(n, 128),
    )


def judge(reference: Reference, answer: Any, factorises: bool = True) -> tuple[str, float]:
    comparison = compare(reference, np.atleast_2d(np.asarray(answer, dtype=float)), factorises)
    return str(comparison.verdicts[0]), float(comparison.backward_error[0])


def up(value: float) -> float:
    return math.nextafter(value, math.inf)


@pytest.mark.parametrize("sensitivity", [1.0, 2.0**-20, 2.0**40])
@pytest.mark.parametrize("sign", [1, -1])
def test_boundary_of_agreement(sensitivity: float, sign: int) -> None:
    reference = made_up([0.0, sensitivity], sensitivity, instability=1e6 * sensitivity)
    edge = AGREEMENT * UNIT_ROUNDOFF * sensitivity
    assert judge(reference, [sign * edge, sensitivity]) == ("agrees", AGREEMENT)
    assert judge(reference, [sign * up(edge), sensitivity]) == ("unstable", up(AGREEMENT))


def test_boundary_of_instability() -> None:
    reference = made_up([0.0, 1.0], sensitivity=1.0, instability=1000.0)
    assert judge(reference, [1000.0 * UNIT_ROUNDOFF, 1.0]) == ("unstable", 1000.0)
    assert judge(reference, [up(1000.0 * UNIT_ROUNDOFF), 1.0]) == ("disagrees", up(1000.0))


def test_only_what_comes_from_a_factorisation_is_unstable() -> None:
    reference = made_up([0.0, 1.0], instability=1e6)
    assert judge(reference, [1e5 * UNIT_ROUNDOFF, 1.0]) == ("unstable", 1e5)
    assert judge(reference, [1e5 * UNIT_ROUNDOFF, 1.0], factorises=False) == ("disagrees", 1e5)


def test_an_answer_without_digits_is_not_unstable() -> None:
    reference = made_up([0.0, 1.0], instability=1e20)
    assert judge(reference, [LEAST_DIGITS, 1.0])[0] == "unstable"
    assert judge(reference, [up(LEAST_DIGITS), 1.0])[0] == "disagrees"
    assert judge(reference, [0.0, 0.0])[0] == "disagrees"


def test_what_agrees_is_not_asked_for_stability() -> None:
    assert judge(made_up([0.0], instability=1.0), [AGREEMENT * UNIT_ROUNDOFF])[0] == "agrees"
    assert judge(made_up([0.0], instability=1.0), [up(AGREEMENT * UNIT_ROUNDOFF)])[0] == "disagrees"


def test_errors_below_one_ulp_are_seen() -> None:
    """The low part counts: the float64 next to 1 + 2^-54 is 1, a quarter ulp away."""
    reference = made_up([1.0], low=[2.0**-54])
    assert judge(reference, [1.0]) == ("agrees", 0.5)
    assert judge(reference, [1.0 + 2.0**-52]) == ("agrees", 1.5)


def test_error_is_measured_in_the_energy_norm() -> None:
    reference = made_up([[0.0, 0.0]])
    assert judge(reference, [3 * UNIT_ROUNDOFF, 4 * UNIT_ROUNDOFF])[1] == 5.0
    reference.norm_factor[0] = [[2.0, 1.0], [0.0, 4.0]]
    assert judge(reference, [UNIT_ROUNDOFF, UNIT_ROUNDOFF])[1] == 5.0


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("certified", [True, False])
def test_what_is_not_finite_is_an_error(bad: float, certified: bool) -> None:
    verdict, error = judge(made_up([[0.0, 1.0]], certified=certified), [[0.0, bad]])
    assert verdict == "error"
    assert math.isnan(error)


def test_nothing_is_said_against_an_uncertified_reference() -> None:
    for answer in ([0.0], [1e6]):
        verdict, error = judge(made_up([0.0], certified=False), answer)
        assert verdict == "undecided"
        assert math.isnan(error)


def test_the_headline_of_answers_without_a_number_says_nothing_of_errors() -> None:
    assert compare(made_up([1.0]), np.array([[math.nan]]), True).headline == "the answer does not agree with the truth"
    assert compare(made_up([[1.0], [1.0]]), np.array([[math.nan]] * 2), True).headline == "0 of 2 answers agree with the truth"


def test_an_uncertified_reference_of_nan_is_undecided() -> None:
    reference = made_up([math.nan], sensitivity=math.nan, instability=math.nan, certified=False)
    assert judge(reference, [1.0])[0] == "undecided"


def test_relative_error_is_for_the_reader() -> None:
    comparison = compare(made_up([[4.0], [0.0], [5e-324]]), np.array([[5.0], [1.0], [1.0]]))
    assert comparison.relative_error[0] == 0.25
    assert np.isnan(comparison.relative_error[1:]).all()


def test_a_relative_error_says_nothing_beside_an_answer_of_about_zero() -> None:
    """Neither where the data leave open whether the answer is zero, nor where the answer is lost in one rounding of the error."""
    backward, relative = np.array([3.0, 0.5, 1e219, math.nan, 0.0]), np.array([1e-15, 0.75, 5e203, math.nan, 0.0])
    comparison = Comparison(backward, relative, np.zeros(5, dtype=bool), np.full(5, "agrees"), np.zeros(5, dtype=bool), np.zeros(5))
    assert [comparison.relative_error_at(index) for index in range(5)] == [1e-15, None, None, None, 0.0]


def test_answers_of_another_shape_are_refused() -> None:
    with pytest.raises(ValueError, match=r"\(1, 3\).*\(1, 2\)"):
        compare(made_up([[0.0, 1.0]]), np.zeros((1, 3)))


def comparison_of(rows: list[tuple[str, float]]) -> Comparison:
    errors = np.array([error for _, error in rows])
    none = np.zeros(len(rows), dtype=bool)
    return Comparison(errors, errors, none, np.array([verdict for verdict, _ in rows]), none, np.zeros(len(rows)))


def test_worst_is_the_gravest_then_the_largest() -> None:
    nan = math.nan
    assert comparison_of([("agrees", 3.0), ("agrees", 60.0), ("agrees", 5.0)]).worst == 1
    assert comparison_of([("agrees", 60.0), ("undecided", nan), ("agrees", 1.0)]).worst == 1
    assert comparison_of([("disagrees", 1e3), ("unstable", 1e9), ("disagrees", 1e4), ("disagrees", 1e2)]).worst == 2
    assert comparison_of([("disagrees", 1e9), ("error", nan), ("unstable", math.inf)]).worst == 1
    assert comparison_of([("disagrees", 1e9), ("disagrees", math.inf)]).worst == 1


def test_verdicts_ascend_as_documented() -> None:
    order = ["agrees", "explained", "undecided", "unsupported", "unstable", "misreads", "disagrees", "error"]
    assert sorted(SEVERITY, key=SEVERITY.__getitem__) == order == [verdict.value for verdict in Verdict]
    assert gravest(["agrees", "unstable", "undecided"]) == "unstable"
    assert gravest([]) == "agrees"


def test_judgements_are_joined_in_order() -> None:
    parts = [comparison_of([("agrees", 1.0)]), comparison_of([("error", math.nan), ("unstable", 70.0)])]
    joined = Comparison.concatenate(parts)
    assert joined.verdicts.tolist() == ["agrees", "error", "unstable"]
    assert joined.backward_error[[0, 2]].tolist() == [1.0, 70.0]


def scaled_condition(mass: Any) -> Any:
    scale = np.sqrt(np.diagonal(mass, axis1=1, axis2=2))
    return np.linalg.cond(mass / scale[:, :, None] / scale[:, None, :])


def test_the_correctly_rounded_answer_is_within_half_a_roundoff_or_so(built_in_mechanism: Mechanism) -> None:
    """Rounding moves qdd_i by u |qdd_i| at most, hence |qdd|_M by sqrt(kappa_s) u |qdd|_M, and the terms of qdd are
    proportional to inputs (tau, g, stiffness, damping, rates), hence |qdd|_M is at most the sensitivity."""
    states = generic_sample(built_in_mechanism, 64, 5)
    reference = ReferenceKernel(built_in_mechanism).evaluate(states)
    comparison = compare(reference, reference.high)
    mass = np.einsum("nki,nkj->nij", reference.norm_factor, reference.norm_factor)
    assert (energy_norm(reference.norm_factor, reference.high) <= reference.sensitivity).all()
    assert (comparison.backward_error <= np.sqrt(scaled_condition(mass))).all()
    assert np.median(comparison.backward_error) <= 0.5
    assert set(comparison.verdicts.tolist()) == {"agrees"}


@pytest.mark.parametrize("multiple", [30.0, 1000.0])
def test_a_known_multiple_of_the_data_roundoff_is_found_again(built_in_mechanism: Mechanism, multiple: float) -> None:
    states = generic_sample(built_in_mechanism, 32, 7)
    reference = ReferenceKernel(built_in_mechanism).evaluate(states)
    # Nothing is granted to an answer that fails.
    reference = replace(reference, share=np.zeros(len(states)))
    direction = np.ones_like(reference.high)
    direction *= (multiple * reference.data_roundoff / energy_norm(reference.norm_factor, direction))[:, None]
    answer = reference.high + (direction + reference.low)
    mass = np.einsum("nki,nkj->nij", reference.norm_factor, reference.norm_factor)
    # Two roundings on the way to the answer, each as the rounding of the correctly rounded answer.
    slack = 2 * np.sqrt(scaled_condition(mass)) + multiple * 1e-9
    assert (np.abs(compare(reference, answer).backward_error - multiple) <= slack).all()


@pytest.mark.parametrize(("name", "columns"), [("cart_double_pendulum", [0]), ("free_body", [0, 1, 2])])
def test_a_moving_base_changes_no_verdict_and_no_sensitivity(name: str, columns: list[int]) -> None:
    """No force depends on the velocity of the base, and engines work in the frame in which it moves."""
    mechanism = load_mechanism(BUILT_IN, name)
    states = generic_sample(mechanism, 64, 3)
    kernel = ReferenceKernel(mechanism)
    at_rest = kernel.evaluate(states)
    for speed in (1.0, 100.0, 1e4):
        moving = States(states.q, states.v.copy(), states.tau, states.time)
        moving.v[:, columns] += speed
        reference = kernel.evaluate(moving)
        assert (reference.sensitivity < 2 * at_rest.sensitivity).all() and (at_rest.sensitivity < 2 * reference.sensitivity).all()
        for engine, model_format in (("mujoco", "mjcf"), ("pinocchio", "urdf")):
            model = read_model(BUILT_IN.model_path(name, model_format), model_format)
            frame = load_engine(BUILT_IN, engine).linear_velocity_in_body
            if frame and mechanism.charts_in_body:
                continue
            answers = load_engine(BUILT_IN, engine).load(model, mechanism.joints, mechanism.gravity)
            comparison = compare(reference, answers.forward_dynamics(moving.q, moving.v, moving.tau))
            assert set(comparison.verdicts.tolist()) == {"agrees"}, (engine, speed)


def test_the_share_of_the_motion_is_granted_to_what_fails_without_it_alone() -> None:
    mechanism = load_mechanism(BUILT_IN, "arm_2r")
    states = generic_sample(mechanism, 64, 3)
    reference = ReferenceKernel(mechanism).evaluate(states)
    direction = np.ones_like(reference.high) / energy_norm(reference.norm_factor, np.ones_like(reference.high))[:, None]
    for size, granted in ((0.9 * AGREEMENT * reference.data_roundoff, False), (0.9 * AGREEMENT * reference.roundoff_with_share, True)):
        comparison = compare(reference, reference.high + (direction * size[:, None] + reference.low))
        assert set(comparison.verdicts.tolist()) == {"agrees"}
        needed = granted & (0.8 * reference.share > 0.2 * reference.sensitivity)
        assert comparison.granted[needed].all() and not (comparison.granted.any() and not granted)
    beyond = compare(reference, reference.high + direction * (1.2 * AGREEMENT * reference.roundoff_with_share)[:, None])
    assert not beyond.granted.any()
    assert beyond.backward_error == pytest.approx(1.2 * AGREEMENT * reference.roundoff_with_share / reference.data_roundoff, rel=0.05)


def straight_pendulum() -> System:
    """A light mass on a rod that carries a heavy one: straightened, its mass matrix is nearly singular."""
    theta, phi = dynamicsymbols("theta phi")
    m1, m2, l1, l2, g = sp.symbols("m1 m2 l1 l2 g", positive=True)
    one = l1 * sp.Matrix([sp.sin(theta), -sp.cos(theta)])
    two = one + l2 * sp.Matrix([sp.sin(theta + phi), -sp.cos(theta + phi)])
    first_velocity, second_velocity = one.diff(TIME), two.diff(TIME)
    return System(
        coordinates={theta: "a", phi: "b"},
        kinetic=m1 * first_velocity.dot(first_velocity) / 2 + m2 * second_velocity.dot(second_velocity) / 2,
        potential=m1 * g * one[1] + m2 * g * two[1],
        parameters={m1: (0.013, "kg"), m2: (77.7, "kg"), l1: (0.71, "m"), l2: (0.53, "m"), g: (9.81, "m/s^2")},
        total_mass=m1 + m2,
        gravity=g,
    )


@pytest.fixture(scope="module")
def ill_conditioned(mechanism_of: Callable[[System], Mechanism]) -> tuple[Any, Any, Reference]:
    """M, its right-hand side and the reference near the straight configuration."""
    mechanism = mechanism_of(straight_pendulum())
    source = np.random.default_rng(3)
    n = 50
    q = np.stack([source.uniform(-3, 3, n), source.uniform(-1e-3, 1e-3, n)], axis=1)
    states = States.at(q, source.uniform(-3, 3, (n, 2)), source.uniform(-3, 3, (n, 2)))
    terms = Float64Kernel(mechanism.program).terms(mechanism.inputs(states))
    force = states.tau + terms["passive"] - terms["velocity"] - terms["gravity"]
    return terms["mass"], force, ReferenceKernel(mechanism).evaluate(states)


def test_the_planted_case_is_ill_conditioned(ill_conditioned: tuple[Any, Any, Reference]) -> None:
    mass, _, reference = ill_conditioned
    assert scaled_condition(mass).min() > 1e4
    assert reference.certified.all()


def test_an_explicit_inverse_is_unstable(ill_conditioned: tuple[Any, Any, Reference]) -> None:
    mass, force, reference = ill_conditioned
    comparison = compare(reference, np.einsum("nij,nj->ni", np.linalg.inv(mass), force), factorises=True)
    assert comparison.verdicts[comparison.worst] == "unstable"
    assert set(comparison.verdicts.tolist()) <= {"agrees", "unstable"}


def test_a_mass_matrix_in_single_precision_disagrees(ill_conditioned: tuple[Any, Any, Reference]) -> None:
    mass, force, reference = ill_conditioned
    single = mass.astype(np.float32).astype(np.float64)
    comparison = compare(reference, np.linalg.solve(single, force[..., None])[..., 0])
    assert comparison.verdicts[comparison.worst] == "disagrees"
    assert (comparison.verdicts == "disagrees").mean() > 0.9


@pytest.mark.parametrize("term", ["gravity", "velocity", "damper"])
def test_an_engine_that_forgets_a_term_disagrees(term: str) -> None:
    mechanism = load_mechanism(Library.built_in(), "cart_pendulum")
    states = generic_sample(mechanism, 20, 1)
    parameters = {name: value for name, value, _ in mechanism.parameters}
    terms = Float64Kernel(mechanism.program).terms(mechanism.inputs(states))
    force = states.tau + terms["passive"] - terms["velocity"] - terms["gravity"]
    reference = ReferenceKernel(mechanism).evaluate(states)

    def verdicts(total: Any) -> list[str]:
        return compare(reference, np.linalg.solve(terms["mass"], total[..., None])[..., 0]).verdicts.tolist()

    assert set(verdicts(force)) == {"agrees"}
    damper = np.stack([np.zeros(20), parameters["c"] * states.v[:, 1]], axis=1)
    forgotten = {"gravity": terms["gravity"], "velocity": terms["velocity"], "damper": damper}[term]
    assert set(verdicts(force + forgotten)) == {"disagrees"}
