"""Every way of computing accelerations gives the right ones, says what it cannot do, and is found by itself."""

from __future__ import annotations

import functools
import textwrap
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from studies import scene, silent

import harness.bench.methods
from harness.arrays import Array
from harness.bench import costs as bench_costs
from harness.bench.costs import Effort, acceleration_costs
from harness.bench.further_costs import exponent, growth, robot_growth
from harness.bench.methods import Method, Prepared, find_methods
from harness.bench.parts import BenchmarkSettings, _accelerations
from harness.crosscheck.scene import Scene
from harness.engines import Unsupported
from harness.files.model_file import parse_model
from harness.library import Library
from harness.programs.numbers import UNIT_ROUNDOFF
from harness.programs.states import States
from harness.results.benchmark import AccelerationCost
from harness.truth.compare import compare
from harness.truth.reference import Reference, ReferenceKernel
from harness.truth.sampling import generic_sample
from harness.verdict import AGREEMENT

LIBRARY = Library.built_in()
METHODS = {method.name: method for method in find_methods()}
# One of each kind: plain, one degree of freedom, springs and dampers in the URDF, a rotor's inertia, a ball and a free joint.
SYSTEMS = ("arm_2r", "simple_pendulum", "collar", "inertia_wheel_pendulum", "heavy_top", "free_body")
COUNT = 40
# Rounding units of what is not float64, relative to float64's.
PRECISION = {"heyoka float32": 2.0**29, "heyoka long double": 2.0**-11}


@functools.cache
def states(name: str) -> States:
    return generic_sample(scene(name).mechanism, COUNT, seed=3)


@functools.cache
def reference(name: str, in_body: bool) -> Reference:
    return ReferenceKernel(scene(name).mechanism, in_body).evaluate(states(name))


def costs(name: str, *methods: Method, count: int = COUNT, seconds: float = 0.0) -> list[AccelerationCost]:
    return acceleration_costs(scene(name), methods, Effort((count,), count, 3, seconds), silent)[0]


@pytest.mark.parametrize("name", SYSTEMS)
@pytest.mark.parametrize("method", METHODS.values(), ids=METHODS)
def test_accelerations_are_right(method: Method, name: str) -> None:
    prepared = method.prepare(scene(name), states(name))
    prepared.compute()
    found = prepared.accelerations()
    assert found.shape == states(name).v.shape
    errors = compare(reference(name, method.linear_velocity_in_body), found).backward_error
    bound = AGREEMENT * PRECISION.get(method.name, 1.0)
    # One chart of Euler angles loses digits near its singularity, and says so.
    assert (np.median(errors) if "one chart" in prepared.note else errors.max()) <= bound


@pytest.mark.parametrize("method", METHODS.values(), ids=METHODS)
def test_what_is_timed_covers_every_state_each_time(method: Method) -> None:
    """The answer of the last call, not one that preparing left behind."""
    prepared = method.prepare(scene("arm_2r"), states("arm_2r"))
    prepared.compute()
    first = np.array(prepared.accelerations())
    prepared.compute()
    assert np.isfinite(first).all()
    assert np.array_equal(first, prepared.accelerations())


@pytest.mark.parametrize("frame", [False, True])
def test_the_frame_of_a_free_joint_matters(frame: bool) -> None:
    """A method that declares the wrong frame is condemned."""
    method = METHODS["pinocchio aba" if frame else "mujoco batch"]
    assert method.linear_velocity_in_body is frame
    right, wrong = costs("free_body", method, replace(method, linear_velocity_in_body=not frame))
    assert right.backward_error is not None and right.backward_error <= AGREEMENT
    assert wrong.backward_error is not None and wrong.backward_error > 1e9


def test_it_is_said_who_goes_from_state_to_state() -> None:
    """A cost of Python's loop must not be taken for one of the engine."""
    loops = {name: method.loop for name, method in METHODS.items()}
    assert all(loops.values())
    assert {loops[name] for name in ("pinocchio aba", "mujoco mj_forward", "lambdify, one state at a time")} == {"Python"}
    assert (loops["mujoco batch"], loops["pinocchio abaInParallel"], loops["heyoka float64"]) == ("MuJoCo", "Pinocchio", "machine code")
    (cost,) = costs("arm_2r", METHODS["pinocchio aba"])
    assert cost.loop == "Python"


def test_long_double_is_judged_beyond_float64() -> None:
    (cost,) = costs("arm_2r", METHODS["heyoka long double"])
    assert cost.backward_error is not None and cost.backward_error < 0.1


@pytest.mark.parametrize("fault", [1e-8, 1e-12])
def test_a_planted_error_is_measured(fault: float) -> None:
    def prepare(scene: Scene, states: States) -> Prepared:
        honest = METHODS["heyoka float64"].prepare(scene, states)
        return Prepared(honest.compute, lambda: honest.accelerations() * (1 + fault))

    (cost,) = costs("arm_2r", Method("planted", "equations", prepare))
    expected = compare(reference("arm_2r", False), reference("arm_2r", False).high * (1 + fault)).backward_error
    assert cost.backward_error == pytest.approx(expected.max(), rel=0.1)
    assert cost.relative_error == pytest.approx(fault, rel=0.1)
    assert cost.relative_error is not None and cost.relative_error > 100 * UNIT_ROUNDOFF


def test_answers_that_are_not_finite_are_counted() -> None:
    def prepare(scene: Scene, states: States) -> Prepared:
        found: Array = np.array(reference("arm_2r", False).high)
        found[[1, 4]] = np.nan, np.inf
        return Prepared(lambda: None, lambda: found, "planted")

    (cost,) = costs("arm_2r", Method("planted", "equations", prepare))
    assert cost.note == f"planted; 2 of {COUNT} answers are not finite"
    assert cost.backward_error is not None and cost.backward_error < 1


def test_what_a_method_cannot_do_is_its_note() -> None:
    def refuse(scene: Scene, states: States) -> Prepared:
        raise Unsupported("too round")

    without_mjcf = replace(scene("arm_2r"), models={"urdf": scene("arm_2r").models["urdf"]})
    methods = [Method("planted", "urdf", refuse), METHODS["mujoco batch"], METHODS["pinocchio aba"]]
    refused, missing, done = acceleration_costs(without_mjcf, methods, Effort((COUNT,), COUNT, 3, 0.0), silent)[0]
    assert (refused.note, refused.states, refused.seconds_per_state, refused.backward_error) == ("too round", 0, None, None)
    assert missing.note == "arm_2r has no MJCF model" and missing.seconds_per_state is None
    assert done.note == "" and done.seconds_per_state is not None


def test_an_error_of_a_method_costs_its_own_entry_and_is_not_swallowed(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(scene: Scene, states: States) -> Prepared:
        raise ZeroDivisionError("planted")

    planted, sound = Method("planted", "equations", fail), METHODS["heyoka float64"]
    failed, done = acceleration_costs(scene("arm_2r"), [planted, sound], Effort((COUNT,), COUNT, 3, 0.0), silent)[0]
    assert (failed.failed, failed.note, failed.seconds_per_state) == (True, "ZeroDivisionError: planted", None)
    assert not done.failed and done.seconds_per_state is not None
    monkeypatch.setattr("harness.bench.parts.find_methods", lambda of: [planted])
    settings = BenchmarkSettings(library=Library.built_in())
    assert _accelerations(settings, scene("arm_2r"), silent).problems == ["arm_2r, planted: ZeroDivisionError: planted"]
    with pytest.raises(RuntimeError, match="planted: ZeroDivisionError"):
        growth(Library.built_in(), [planted], [1], Effort((COUNT,), COUNT, 3, 0.0), silent)


def test_cost_is_per_state_and_notes_say_what_runs() -> None:
    notes: list[str] = []
    method = replace(METHODS["heyoka float64"], most_states=8)
    (cost,) = acceleration_costs(scene("arm_2r"), [method], Effort((COUNT,), COUNT, 3, 0.01), notes.append)[0]
    assert notes == ["arm_2r: heyoka float64"]
    assert cost.states == 8 and cost.threads == 1 and cost.repetitions >= bench_costs.MINIMUM_COUNT
    assert cost.fastest is not None and cost.seconds_per_state is not None and cost.slowest is not None
    assert 0 < cost.fastest <= cost.seconds_per_state <= cost.slowest and cost.fastest < 1e-3


def test_all_stages_needs_stages_to_be_off() -> None:
    model = scene("arm_2r").models["mjcf"]
    text = "\n".join(line for line in model.text.splitlines() if "<flag" not in line)
    bare = replace(scene("arm_2r"), models={"mjcf": parse_model(model.path, text, "mjcf")})
    with pytest.raises(Unsupported, match="switches no stage off"):
        METHODS["mujoco batch, all stages on"].prepare(bare, states("arm_2r"))


def test_equations_too_long_for_lambdify_are_refused_before_they_are_derived(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("harness.bench.methods.equations.MOST_INSTRUCTIONS_PRINTED", 10)
    with pytest.raises(Unsupported, match="up to 10"):
        METHODS["lambdify, numpy batch"].prepare(scene("arm_2r"), states("arm_2r"))


def test_a_new_file_is_a_new_method(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "planted_methods.py").write_text(
        textwrap.dedent("""
        from harness.bench.methods import Method
        from harness.bench.methods.equations import METHODS
        PLANTED = Method("a planted method", "equations", METHODS[3].prepare)
        """)
    )
    monkeypatch.setattr(harness.bench.methods, "__path__", [*harness.bench.methods.__path__, str(tmp_path)])
    names = [method.name for method in find_methods()]
    assert names == sorted({*METHODS, "a planted method"})


@pytest.mark.parametrize("power", [1.0, 2.0, 3.0])
def test_exponent_of_what_a_call_hides(power: float) -> None:
    sizes = (1, 2, 4, 8, 16, 32)
    seconds = [5e-7 + 1e-7 * size**power for size in sizes]
    found = exponent(sizes, seconds)
    # What is left of the call's own cost bends the slope; over all sizes it would bend more.
    assert found is not None and power - 0.3 <= found <= power
    assert np.polyfit(np.log(sizes), np.log(seconds), 1)[0] < found - 0.09 * power


def test_no_exponent_from_too_little() -> None:
    assert exponent((1, 2, 4), (1.0, 1.1, 1.2)) is None
    assert exponent((1, 2, 4), (1.0, 1.5, 4.0)) is None
    assert exponent((1, 2), (None, None)) is None
    assert exponent((1, 2, 4, 8), (1.0, None, 4.0, 16.0)) == pytest.approx(2.0)
    # A larger size that is as cheap as the smallest is noise, and so is all before it.
    assert exponent((1, 2, 4, 8, 16), (1.0, 9.0, 1.0, 8.0, 16.0)) == pytest.approx(1.0)


@pytest.mark.ci
def test_growth_of_a_robot() -> None:
    found = robot_growth((1, 2), 0, 0.0, silent)
    assert found.sizes == [7, 14] and all(found.seconds_per_state)
    # Certified far below a data roundoff.
    assert all(radius is not None and 0 < radius < 2.0**-20 for radius in found.backward_errors)


def test_growth_over_a_family() -> None:
    methods = [METHODS["pinocchio aba"], METHODS["heyoka float64"]]
    found = growth(LIBRARY, methods, (1, 3), Effort((64,), 64, 0, 0.0), silent)
    assert [(entry.family, entry.method, entry.expected) for entry in found] == [
        (("chain"), method.name, method.growth) for method in methods
    ]
    for entry in found:
        assert entry.sizes == [1, 3]
        assert all(error is not None and error <= AGREEMENT for error in entry.backward_errors)
        assert all(seconds is not None and seconds > 0 for seconds in entry.seconds_per_state)


def test_a_size_that_a_method_cannot_do_is_none() -> None:
    def refuse(scene: Scene, states: States) -> Prepared:
        if scene.mechanism.name == "chain_3":
            raise Unsupported("too long")
        return METHODS["heyoka float64"].prepare(scene, states)

    (entry,) = growth(LIBRARY, [Method("planted", "equations", refuse)], (1, 3), Effort((64,), 64, 0, 0.0), silent)
    assert entry.sizes == [1, 3] and entry.seconds_per_state[0] is not None and entry.backward_errors[0] is not None
    assert (entry.seconds_per_state[1], entry.backward_errors[1], entry.exponent) == (None, None, None)
