"""Constraints in a cross-check: whose truth is which, what a model leaves open, and what its readers need of a file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from catalogue import BUILT_IN

from harness.crosscheck import superfluous as superfluous_parts
from harness.crosscheck.assignment import Assignment, load_audited, reference_kernel_of, truth_of
from harness.crosscheck.stages import Answers, compare_all
from harness.crosscheck.superfluous import superfluous
from harness.diagnosis.subject import Scope, diagnose_subject
from harness.engines import Subject, gaps_of
from harness.errors import InvalidModel
from harness.programs.states import States
from harness.truth.quantities.accelerations import beside_gaps, remark_on
from harness.truth.sampling import generic_sample

PINOCCHIO, MUJOCO = Subject("pinocchio", "urdf"), Subject("mujoco", "mjcf")


def silent(text: str) -> None:
    """Nobody reads what a crash would leave behind."""


def four_bar(folder: Path, subject: Subject, old: str = "", new: str = "") -> Assignment:
    """The subject on the four-bar, whose file is changed."""
    text = BUILT_IN.model_path("four_bar", subject.format).read_text()
    assert old in text
    path = folder / f"four_bar.{subject.format}"
    path.write_text(text.replace(old, new, 1))
    return Assignment.of(BUILT_IN, "four_bar", subject, path)


def asked(assignment: Assignment, count: int = 24) -> Answers:
    states = generic_sample(assignment.mechanism, count, seed=4)
    return compare_all([assignment], states, silent)[2][str(assignment.subject)]


@pytest.mark.parametrize("subject", [PINOCCHIO, MUJOCO], ids=str)
def test_a_subject_agrees_with_its_own_truth(tmp_path: Path, subject: Subject) -> None:
    assignment = four_bar(tmp_path, subject)
    truth, found = truth_of(assignment), asked(assignment)
    assert found.comparison is not None and set(found.comparison.verdicts) == {"agrees"}, found.failure
    assert (truth.rigid is None) == (subject == PINOCCHIO)
    # At the default softness four-bars are some hundredths of their acceleration from rigid.
    assert (
        (0 < len(found.from_rigid) < 24 and 1e-3 < np.median(found.from_rigid) < 1e-1)
        if truth.rigid is not None
        else not len(found.from_rigid)
    )


def test_a_softer_file_is_another_problem_and_farther_from_rigid(tmp_path: Path) -> None:
    plain = asked(four_bar(tmp_path, MUJOCO))
    soft = asked(four_bar(tmp_path, MUJOCO, '<connect name="closure"', '<connect name="closure" solimp="0.5 0.5"'))
    assert soft.comparison is not None and set(soft.comparison.verdicts) == {"agrees"}
    # (1 - d) / d is nine times as large.
    assert np.median(soft.from_rigid) > 3 * np.median(plain.from_rigid)


# The place of the follower's pin is in no Jacobian.
PINS = {"urdf": ('xyz="2 0 0"', 'xyz="2.0000000001 0 0"'), "mjcf": ('pos="2 0 0"', 'pos="2.0000000001 0 0"')}


@pytest.mark.ci
@pytest.mark.parametrize("subject", [PINOCCHIO, MUJOCO], ids=str)
def test_a_loop_that_closes_elsewhere_is_told_with_its_line(tmp_path: Path, subject: Subject) -> None:
    assignment = four_bar(tmp_path, subject, *PINS[subject.format])
    found = asked(assignment)
    assert found.comparison is not None and set(found.comparison.verdicts) == {"disagrees"}
    assert "Constraint 'closure' is open by 1e-10" in found.remark
    assert assignment.model is not None
    line = next(n for n, text in enumerate(assignment.model.text.splitlines(), 1) if "2.0000000001" in text)
    diagnosis = diagnose_subject(assignment, Scope(seed=0, evaluations=600), silent).model
    assert diagnosis is not None and diagnosis.explaining and diagnosis.tried[0].place.line == line


def test_rigid_accelerations_alone_would_not_tell(tmp_path: Path) -> None:
    assignment = four_bar(tmp_path, PINOCCHIO, *PINS["urdf"])
    states = generic_sample(assignment.mechanism, 8, seed=1)
    model = load_audited(assignment)
    reference = reference_kernel_of(assignment).evaluate(states)
    gaps = gaps_of(model, states)
    assert np.abs(gaps["closure"]).max() == pytest.approx(1e-10, rel=1e-4)
    beside = beside_gaps(reference, assignment.mechanism, states, gaps)
    assert beside.high.shape == (8, 3 + 3) and (beside.high[:, 3:] == 0).all()
    np.testing.assert_array_equal(beside.size, reference.size)


def test_rows_without_any_roundoff_count_only_where_they_are_open() -> None:
    """Where all coordinates are zero, a row that is a sum of their multiples is exactly zero."""
    assignment = Assignment.of(BUILT_IN, "rolling_disc_on_incline", MUJOCO)
    still = States.at(*np.zeros((3, 1, 2)))
    found = compare_all([assignment], still, silent)[2][str(MUJOCO)]
    assert found.comparison is not None and set(found.comparison.verdicts) == {"agrees"}
    [name] = gaps_of(load_audited(assignment), still)
    opened = {name: np.full((1, 1), 1e-12)}
    assert "is open by 1e-12" in remark_on(assignment.mechanism, still, opened)


@pytest.mark.ci
def test_a_body_that_only_another_reader_needs_is_not_superfluous(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """MuJoCo does without a body for the ground; Pinocchio reads the first body of the world alone."""
    monkeypatch.setattr(superfluous_parts, "read_entry", lambda path: None)
    monkeypatch.setattr(superfluous_parts, "write_entry", lambda path, text: None)
    assignment = four_bar(tmp_path, MUJOCO)
    assert superfluous(assignment) == []
    monkeypatch.setattr(superfluous_parts, "_other_readers", lambda subject: [])
    assert [part.why for part in superfluous(assignment)] == ["moves nothing; remove it and keep what is inside"]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('<connect name="closure"', '<connect name="closing"', "has no constraint 'closure', which the system needs"),
        (
            "</equality>",
            '<joint name="more" joint1="crank" joint2="follower"/></equality>',
            "constraint 'more' ties joints, but the system has 'closure' only",
        ),
    ],
    ids=["another name", "one more"],
)
def test_a_file_has_the_constraints_of_its_system(tmp_path: Path, old: str, new: str, message: str) -> None:
    assignment = four_bar(tmp_path, MUJOCO, old, new)
    with pytest.raises(InvalidModel, match=message):
        load_audited(assignment)
    assert message in asked(assignment).failure
