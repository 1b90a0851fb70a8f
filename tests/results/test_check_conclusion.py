"""The first line of a check answers its question, and counts nobody who was not asked."""

from __future__ import annotations

from dataclasses import replace

import pytest
from support_results import RECORD

from harness.results.check_conclusion import MOST_ROWS, conclusion, engine_lines, first_rows, was_compared, with_short_names
from harness.results.cross_check import CrossCheckResult
from harness.results.detail import Detail
from harness.results.readings import Effect
from harness.results.records import Record

AGREEING = replace(RECORD, verdict="agrees", backward_error=1.5)
SOFT = replace(AGREEING, subject="mujoco/urdf", from_rigid=0.02)
KNOWN = replace(AGREEING, system="chain_12", verdict="unstable", expected="unstable", expected_reason="long", expected_link="a page")
SILENT = replace(
    AGREEING,
    quantity="steps",
    verdict="unsupported",
    expected="unsupported",
    states=0,
    backward_error=None,
    message="not offered: no steps",
)
DAMPING = Effect(
    name="joint damping", sentence="ABA applies no damping", concerns="joints", lines=(4,), alone=0.472, source="", remedy="add -d v to tau"
)
REFUSED = replace(RECORD, verdict="error", states=0, backward_error=None, message="a.xml:3: friction is none that the system has\nmore")
FAILED = replace(REFUSED, failed=True, message="it died")
EXPLAINED = replace(
    AGREEING, system="robots/panda.urdf", subject="pinocchio/urdf", verdict="explained", expected="explained", readings=[DAMPING]
)


@pytest.mark.parametrize(
    ("records", "said"),
    [
        ([AGREEING], "arm_2r: mujoco/mjcf agrees"),
        ([AGREEING, SOFT], "arm_2r: both subjects agree (1 soft, as documented)"),
        ([AGREEING, KNOWN], "2 pairs: 1 agrees, 1 differs for a known reason, 0 unexpectedly"),
        ([AGREEING, KNOWN, RECORD], "3 pairs: 1 agrees, 1 differs for a known reason, 1 unexpectedly: arm_2r mujoco/mjcf disagrees"),
        ([RECORD], "arm_2r: 1 subject: none agrees, 1 differs unexpectedly: mujoco/mjcf disagrees"),
        ([AGREEING, SILENT], "arm_2r: mujoco/mjcf agrees; 1 further one is not offered"),
        ([SILENT], "nothing was compared: arm_2r mujoco/mjcf steps: not offered: no steps; name another subject or quantity"),
        (
            [REFUSED, replace(REFUSED, subject="pinocchio/mjcf"), replace(FAILED, subject="mujoco/urdf")],
            "arm_2r: 3 subjects: none agrees, 3 differ unexpectedly: mujoco/urdf gives no answer; "
            "mujoco/mjcf and pinocchio/mjcf are not asked, a.xml:3: friction is none that the system has",
        ),
        ([], "nothing was compared; name another subject or quantity"),
    ],
)
def test_the_conclusion_counts_what_was_answered(records: list[Record], said: str) -> None:
    assert conclusion(records) == said


def test_a_file_s_conclusion_names_what_the_engine_makes_of_it_and_what_to_do() -> None:
    said = "panda.urdf: 1 subject: none agrees, 1 is explained by how the engine reads the file"
    found = CrossCheckResult(records=[EXPLAINED])
    assert found.conclusion() == f"{said}. ABA applies no damping (47 % of qdd): add -d v to tau."


def test_files_go_by_the_shortest_names_that_tell_them_apart() -> None:
    other = replace(EXPLAINED, system="old/panda.urdf")
    assert [one.system for one in with_short_names([EXPLAINED, other, AGREEING])] == ["robots/panda.urdf", "old/panda.urdf", "arm_2r"]


def test_where_nothing_was_compared_nothing_is_as_expected() -> None:
    assert not was_compared([SILENT]) and was_compared([RECORD]) and was_compared([AGREEING, SILENT])
    assert not CrossCheckResult(records=[SILENT]).as_expected and not CrossCheckResult().as_expected
    assert CrossCheckResult(records=[AGREEING, SILENT]).as_expected


def test_of_many_records_those_are_shown_that_are_no_plain_agreement_and_a_line_for_each_engine() -> None:
    many = [replace(AGREEING, system=f"arm_{number}") for number in range(MOST_ROWS)]
    assert first_rows([*many[1:], KNOWN], Detail.BRIEF) == [*sorted(many[1:], key=lambda one: one.system), KNOWN]
    assert first_rows([*many, KNOWN, SILENT], Detail.BRIEF) == [KNOWN]
    assert len(first_rows([*many, KNOWN, SILENT], Detail.ALL)) == MOST_ROWS + 2
    assert engine_lines([*many, KNOWN]) == ["mujoco: right on 30 of 31 MJCF mechanisms; loses digits on chain_12"]


def test_what_is_wrong_beside_the_accelerations_is_in_the_sentence() -> None:
    wrong = replace(RECORD, quantity="energy")
    found = CrossCheckResult(records=[AGREEING, wrong, SILENT])
    assert found.conclusion() == "arm_2r: mujoco/mjcf agrees; 1 of 1 answers for further quantities differs unexpectedly."
