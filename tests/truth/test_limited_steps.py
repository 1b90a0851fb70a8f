"""Steps with limits on, by the rule that Drake documents: one joint in closed form, with 50 digits."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import mpmath
import numpy as np
import pytest
from catalogue import BUILT_IN
from mpmath import mpf

from harness.crosscheck import assignment as assignment_module
from harness.crosscheck.assignment import Assignment
from harness.engines import Subject
from harness.engines.adapters.drake import step_law
from harness.files.rules import ConstraintLaw
from harness.programs.states import States
from harness.storage import Kept
from harness.truth.compare import Certified, compare
from harness.truth.quantities import Truth
from harness.truth.sampling import sample
from harness.verdict import AGREEMENT

DIGITS = 50
# Of the bar and its pin.
MASS, ARM, INERTIA, DAMPER, LOW, HIGH, STEP = mpf(2), mpf("0.75"), mpf("1.625"), mpf(0.3), mpf(0), mpf(1.2), mpf(0.001)


def assigned(engine: str, model_format: str) -> Assignment:
    return Assignment.of(BUILT_IN, "limited_pendulum", Subject(engine, model_format)).about("steps")


def states_of(truth: Truth, assignment: Assignment) -> States:
    return truth.asked_at(sample(assignment.mechanism, 48, 5))


def step(q: float, v: float, tau: float, gravity: float) -> tuple[mpf, mpf, bool]:
    """v' and q', and whether a limit pushes."""
    metric = INERTIA + STEP * DAMPER
    after = mpf(v) + STEP * (mpf(tau) - DAMPER * mpf(v) - MASS * mpf(gravity) * ARM * mpmath.sin(mpf(q))) / metric
    # Rounded as the numbers of a law are.
    regular = max(mpf(0.1 * 0.1 / (4 * np.pi * np.pi)) / metric, mpf(1 / (0.001 * 1e12 * 2 * 0.001)))
    for sign, distance in ((1, mpf(q) - LOW), (-1, HIGH - mpf(q))):
        wanted = -distance * mpf(1 / (0.001 * 2 * 0.001)) / mpf(1 / 0.001)
        if wanted > sign * after:
            after = (metric * after + sign * wanted / regular) / (metric + 1 / regular)
            return after, mpf(q) + STEP * after, True
    return after, mpf(q) + STEP * after, False


def answers(states: States, gravity: float) -> np.ndarray:
    """(n, 2, 2), rounded to float64."""
    found = np.zeros((len(states), 2, 2))
    with mpmath.workdps(DIGITS):
        for number, (q, v, tau) in enumerate(zip(states.q[:, 0], states.v[:, 0], states.tau[:, 0], strict=True)):
            after, there, _ = step(float(q), float(v), float(tau), gravity)
            found[number, 0, 0], found[number, 1, 1] = float(after), float(there)
    return found


@pytest.mark.parametrize("model_format", ["urdf", "mjcf"])
def test_the_certified_step_is_the_closed_form(model_format: str) -> None:
    assignment = assigned("drake", model_format)
    truth = assignment.truth
    states = states_of(truth, assignment)
    certified, pushed = truth.evaluate(states), 0
    assert certified.certified.all()
    with mpmath.workdps(DIGITS):
        for number, (q, v, tau) in enumerate(zip(states.q[:, 0], states.v[:, 0], states.tau[:, 0], strict=True)):
            after, there, pushes = step(float(q), float(v), float(tau), assignment.mechanism.gravity)
            pushed += pushes
            for block, place, own in ((0, 0, after), (1, 1, there)):
                found = mpf(float(certified.high[number, block, place])) + mpf(float(certified.low[number, block, place]))
                # A limit takes 1 / h, which is rounded.
                rounding = mpf(2) ** -52 * (abs(mpf(float(v))) + abs(own)) if pushes else 0
                assert abs(found - own) <= mpf(2) ** -90 * max(1, abs(own)) + rounding
    assert 0 < pushed < len(states)


def error(certified: Certified, states: States, gravity: float) -> float:
    return float(compare(certified, answers(states, gravity), factorises=True).backward_error.max())


def _with(change: Callable[[ConstraintLaw], ConstraintLaw]) -> Callable[[float], ConstraintLaw]:
    own = step_law.limit
    return lambda length: change(own(length))


FAULTS: dict[str, Callable[[ConstraintLaw], ConstraintLaw]] = {
    "none": lambda law: law,
    "stiffness": lambda law: replace(law, stiffness=law.stiffness * (1 + 1e-9)),
    "step": lambda law: replace(law, damping=law.damping * (1 + 1e-9)),
    "near-rigid threshold": lambda law: replace(law, of_step=law.of_step and replace(law.of_step, near_rigid=1e-3)),
    "a limit that gives way": lambda law: replace(law, force_range=(0.0, 1e3)),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_in_the_law_is_seen(fault: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(step_law, "limit", _with(FAULTS[fault]))
    monkeypatch.setattr(assignment_module, "_TRUTHS", Kept(4))
    assignment = assigned("drake", "urdf")
    states = states_of(assignment.truth, assignment)
    assert (error(assignment.truth.evaluate(states), states, assignment.mechanism.gravity) <= AGREEMENT) == (fault == "none")


def test_steps_of_engines_without_limits_in_their_rules_are_smooth() -> None:
    assignment = assigned("mujoco", "mjcf")
    assert assignment.mechanism.bounded is None and assigned("drake", "mjcf").mechanism.bounded is not None
    states = sample(assignment.mechanism, 4, 5)
    assert assignment.truth.asked_at(states) is states
