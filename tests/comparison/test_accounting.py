"""Readings together: those that cancel, those that matter only beside others, and those that do not hold."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import pytest
from comparison.robots import FILES, meant_by

from harness.comparison import judgement
from harness.engines.request import EngineAnswers
from harness.explain import as_read
from harness.explain.as_read import fold
from harness.explain.changes.readings import Law, Reading, readings_of, with_joints
from harness.explain.meant import read_as
from harness.files.tree import Joint
from harness.library import Stance
from harness.report.comparison import subject_lines
from harness.results.comparison import SubjectRecord
from harness.results.readings import reading_line
from harness.verdict import AGREEMENT, Verdict


def planted(name: str, change: Callable[[Joint], Joint]) -> Reading:
    declared = Law(name, "joints", lambda robot: with_joints(robot.tree, change))
    [reading] = readings_of("pinocchio", {("urdf",): {declared: (f"Pinocchio {name}", "leave it out", "planted by a test")}})
    return reading


STRONGER = planted("doubles damping", lambda joint: replace(joint, damping=joint.damping * 2))
WEAKER = planted("halves damping", lambda joint: replace(joint, damping=joint.damping / 2))
# No joint of the file has a reference; beside the reading that gives it one, its sign matters.
TURNED = planted("gives a reference", lambda joint: replace(joint, reference=joint.damping))
BACKWARDS = planted("turns references round", lambda joint: replace(joint, reference=-joint.reference) if joint.reference else joint)


def judged(hold: Sequence[Reading], declared: Sequence[Reading], monkeypatch: pytest.MonkeyPatch) -> SubjectRecord:
    """An engine with these readings, judged by those that are declared."""
    found = meant_by(FILES / "arm.urdf")
    truth = read_as(found, fold(found.robot, hold).robot).truth
    answers = EngineAnswers(dict(zip(found.robot.joints, truth.high.T[:, :, None], strict=True)))
    monkeypatch.setattr(as_read, "find_readings", lambda *_: list(declared))
    return judgement.judge(found, answers, "pinocchio", Stance.PLAIN)


def test_readings_that_cancel_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    record = judged([STRONGER, WEAKER], [STRONGER, WEAKER], monkeypatch)
    assert (record.verdict, record.explained, record.cancels) == (Verdict.AGREES, True, True)
    assert all(reading.alone and reading.alone > 1e-3 for reading in record.readings) and len(record.readings) == 2
    assert "  together they cancel: the answer is that of the file" in subject_lines(record)


@pytest.mark.ci
def test_a_reading_that_matters_only_beside_another_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    record = judged([TURNED, BACKWARDS], [TURNED, BACKWARDS], monkeypatch)
    assert record.explained and record.verdict == Verdict.DISAGREES and record.left is not None and record.left <= AGREEMENT
    first, second = record.readings
    assert first.alone and first.beside is None
    assert second.alone is not None and second.alone <= 1e-12 < (second.beside or 0.0) and second.lines
    assert "beside the other readings alone): leave it out" in reading_line(second) and "beside" not in reading_line(first)
    assert not judged([TURNED, BACKWARDS], [TURNED], monkeypatch).explained


@pytest.mark.parametrize("hold", [[TURNED], [STRONGER], []])
def test_readings_that_do_not_hold_are_named(hold: list[Reading], monkeypatch: pytest.MonkeyPatch) -> None:
    record = judged(hold, [STRONGER, TURNED], monkeypatch)
    assert not record.explained
    gone = [one.name for one in (STRONGER, TURNED) if one not in hold]
    assert record.rest[0].startswith(f"without the reading {' and '.join(map(repr, gone))}".replace("'", '"'))
