"""The answer of a diagnosis: who is at fault, and what to write in which line."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from support_results import RECORD

from harness.results.cross_check import Cause
from harness.results.detail import Detail
from harness.results.diagnosis_conclusion import conclude_diagnosis
from harness.results.readings import Effect

AT_FAULT = "the mjcf model is at fault"
FIRST = {"line": 23, "element": "inertial", "attribute": "mass", "tag": '<inertial mass="2.01">', "shown": "2.0", "explains": True}


def cause(first: dict[str, Any] | None = None, **given: Any) -> Cause:
    explaining = [first] if first and first["explains"] else []
    text = ["it explains it", "runner-up: line 20"]
    side = {"file": "a.xml", "first": first, "explaining": explaining, "text": text, "remarks": text[1:]}
    found = {"terms": {"sentences": ["gravity is wrong"]}, "model": side, "textbook": None}
    about = {"system": "arm", "subject": "mujoco/mjcf", "inference": AT_FAULT, "first_line": "no number explains it"}
    return Cause(**{**about, "found": found, **given})


@pytest.mark.parametrize(
    ("causes", "sentence"),
    [
        ([cause(FIRST)], f'arm: {AT_FAULT}. Write 2.0 in <inertial mass="2.01">, a.xml:23: that explains every answer.'),
        ([cause(FIRST | {"explains": False})], f"arm: {AT_FAULT}. no number explains it."),
        ([cause(first_line=AT_FAULT, found=None)], f"arm: {AT_FAULT}. mass of elbow is 2.01, but 2."),
        (
            [cause(FIRST), cause(FIRST, inference="pinocchio is at fault")],
            f'arm: {AT_FAULT}. Write 2.0 in <inertial mass="2.01">, a.xml:23: that explains every answer. 1 more cause below.',
        ),
        ([], "arm: nothing is wrong with mujoco/mjcf."),
    ],
)
def test_the_sentence_names_the_party_the_line_and_what_to_write(causes: list[Cause], sentence: str) -> None:
    said = conclude_diagnosis("arm", [RECORD], causes, "nothing is wrong with mujoco/mjcf", ["mass of elbow is 2.01, but 2"])
    assert said == sentence


def test_what_readers_make_of_a_file_is_said_with_what_to_do() -> None:
    reading = Effect(name="d", sentence="It applies no damping", concerns="joints", lines=(3,), alone=0.5, source="s", remedy="add -d v")
    record = replace(RECORD, readings=[reading])
    said = conclude_diagnosis("r.urdf", [record, record], [], "nothing is wrong")
    assert said == "r.urdf: nothing is wrong. It applies no damping (50 % of qdd): add -d v."


def test_remarks_are_told_where_all_is_told() -> None:
    assert cause(FIRST).told_in_full(Detail.BRIEF) == ["", "mujoco/mjcf", "  gravity is wrong", "  it explains it"]
    assert cause(FIRST).told_in_full(Detail.VERBOSE)[-1] == "  runner-up: line 20"
