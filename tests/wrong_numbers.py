"""A mechanism's model with one wrong number, and what a check and a diagnosis are to make of it."""

from __future__ import annotations

from dataclasses import replace

from catalogue import CALLED_HERE

from harness.crosscheck.assignment import Assignment
from harness.diagnosis.subject import Scope, diagnose_subject
from harness.engines import Subject
from harness.explain.result import Finding
from harness.truth.sampling import sample


def with_change(name: str, subject: Subject, old: str, new: str) -> Assignment:
    """A mechanism in a subject whose model has ``new`` in the one place where it has ``old``."""
    own = Assignment.of(CALLED_HERE, name, subject)
    assert own.model is not None and own.model.text.count(old) == 1
    return replace(own, model=own.model.with_text(own.model.text.replace(old, new)))


def assert_red_and_named(assignment: Assignment, states: int, attribute: str, value: str) -> None:
    """Hold that some of the states disagree, and that a diagnosis names the attribute with the value that is right."""
    truth = assignment.truth
    asked = truth.asked_at(sample(assignment.mechanism, states, 1))
    assert "disagrees" in assignment.judge(asked, truth.evaluate(asked)).verdicts
    found = diagnose_subject(assignment, Scope(seed=1, evaluations=400), lambda stage: None).model
    assert found is not None and found.finding == Finding.EXPLAINED and found.first is not None
    assert value in found.first_line and attribute in found.first_line
