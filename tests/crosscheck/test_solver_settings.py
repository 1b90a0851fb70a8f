"""The settings of an engine's solver of constraints stand beside its verdict: those that the harness chooses, and where it stops."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from studies import silent
from support import call_engines_here

from harness.crosscheck.assignment import Assignment, load_audited
from harness.crosscheck.stages import Answers, compare_all
from harness.engines import Subject, load_engine
from harness.engines.adapters.mujoco.model import MujocoModel
from harness.engines.elsewhere import interpreter
from harness.files.model_file import parse_model
from harness.library import Library
from harness.truth.sampling import sample
from harness.verdict import Verdict

LIBRARY = Library.built_in()


def asked(assignment: Assignment, states: int = 24) -> Answers:
    return compare_all([assignment], sample(assignment.mechanism, states, seed=0), silent)[2][assignment.title]


@pytest.mark.parametrize("name", ["four_bar", "delta_robot"])
def test_pinocchio_is_asked_by_its_defaults_too(name: str) -> None:
    """A planar loop that a point closes has a redundant row, on which the defaults answer NaN; that of the delta robot has none."""
    found = asked(Assignment.of(LIBRARY, name, Subject("pinocchio", "urdf")))
    assert found.comparison is not None and set(found.comparison.verdicts) == {"agrees"}
    said = "answers nothing finite at 24 of 24" if name == "four_bar" else "agrees at"
    own = "constraintDynamics with mu = 1e-12, accuracy 0, up to 100 iterations"
    assert found.remark.startswith(f"Solved by {own}; by its defaults (mu = 0")
    assert said in found.remark


@pytest.mark.ci
def test_the_same_model_by_its_defaults_is_asked_where_the_model_is(monkeypatch: pytest.MonkeyPatch) -> None:
    """The next model of a file may be loaded by another process."""
    own = Assignment.of(LIBRARY, "delta_robot", Subject("pinocchio", "urdf"))
    model: Any = load_audited(own)
    states = sample(own.mechanism, 1, seed=0)
    asked_at = states.q, states.v, states.tau
    usual, _, _ = model.by_default()
    expected = usual.forward_dynamics(*asked_at)
    monkeypatch.setattr(interpreter, "_RUNNING", {})
    load_engine(LIBRARY, "pinocchio").load(own.model, own.mechanism.joints, own.mechanism.gravity)
    usual, _, _ = model.by_default()
    np.testing.assert_array_equal(usual.forward_dynamics(*asked_at), expected)


def firm() -> Assignment:
    own = Assignment.of(LIBRARY, "four_bar", Subject("mujoco", "mjcf"))
    assert own.model is not None
    text = own.model.text.replace("<connect ", '<connect solimp="0.9999 0.9999" ')
    return replace(own, model=parse_model(own.model.path, text, "mjcf"))


def test_a_solver_that_stops_early_is_explained_with_what_to_set() -> None:
    found = asked(firm())
    assert found.comparison is not None and "explained" in found.comparison.verdicts and "disagrees" not in found.comparison.verdicts
    assert "stops its solver up to" in found.remark and "documents: set <option iterations=" in found.remark


def test_what_the_end_does_not_mend_is_red(monkeypatch: pytest.MonkeyPatch) -> None:
    call_engines_here(monkeypatch)
    monkeypatch.setattr(MujocoModel, "to_the_end", lambda model, tolerance=0.0: (model, ""))
    found = asked(firm())
    assert found.comparison is not None and Verdict.DISAGREES.value in found.comparison.verdicts
