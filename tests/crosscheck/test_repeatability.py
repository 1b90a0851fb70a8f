"""Engines whose answers are no function of the state, or feel no digit beyond float32: each is named."""

from __future__ import annotations

from pathlib import Path

import pytest
from support import changed_engine, cross_checked, harness, make_library

from harness.crosscheck.settings import Settings
from harness.explain.pattern import infer_from_records
from harness.library import Library
from harness.results.records import Record

ANSWERS = {
    "noisy": "a = exact(q, v, tau); return a * (1 + 1e-15 * random.normal(size=a.shape))",
    "late": "kept.append(exact(q, v, tau)); return kept[-2 if len(kept) > 1 and kept[-2].shape == kept[-1].shape else -1]",
    "warm": "a = exact(q, v, tau); return a + 1e-9 * np.roll(a, 1, axis=0)",
    "crowded": "return exact(q, v, tau) * (1 + 1e-9 * (len(q) > 1))",
    "single": "return exact(q, v, tau).astype(np.float32)",
    "cast": "return exact(*(x.astype(np.float32).astype(np.float64) for x in (q, v, tau)))",
    "constant": "return np.ones_like(v) / 3",
    "old": "import mujoco; return mujoco.batches",
    "reusing": "a = exact(q, v, tau); kept[:] = kept if kept and kept[0].shape == a.shape else [a]; kept[0][:] = a; return kept[0]",
}
MESSAGES = {
    "noisy": ("error", "answers differ from call to call at the same states: noise"),
    "late": ("error", "returns the answer of the call before"),
    "warm": ("error", "the answer depends on the batch"),
    "crowded": ("error", "the answer depends on the batch"),
    "single": ("disagrees", "answers have the precision of float32: every one of them is a number of float32"),
    "cast": ("disagrees", "answers have the precision of float32: they are the same, bit by bit, where q, v and tau are rounded"),
    "old": ("error", "AttributeError: module 'mujoco' has no attribute 'batches'"),
}


@pytest.fixture(scope="module")
def records(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Record]:
    """By subject."""
    engines = {name: changed_engine(answer) for name, answer in ANSWERS.items()}
    root = make_library(tmp_path_factory.mktemp("repeatability") / "library", ["bar_pendulum"], engines)
    subjects = ["lagrange", *(f"{name}/mjcf" for name in (*ANSWERS, "mujoco", "pinocchio"))]
    found, _ = cross_checked(Settings(library=Library.at(root), subjects=subjects, states=40, examples=None))
    return {record.subject: record for record in found}


@pytest.mark.ci
@pytest.mark.parametrize(("name", "expected"), MESSAGES.items(), ids=list(MESSAGES))
def test_what_is_wrong_with_an_engine_is_named(records: dict[str, Record], name: str, expected: tuple[str, str]) -> None:
    record = records[f"{name}/mjcf"]
    assert (record.verdict, record.failed) == (expected[0], expected[0] == "error")
    assert expected[1] in record.message


def test_engines_that_answer_what_they_are_asked_are_not_suspected(records: dict[str, Record]) -> None:
    for subject in ("lagrange", "mujoco/mjcf", "pinocchio/mjcf", "reusing/mjcf"):
        assert (records[subject].verdict, records[subject].message) == ("agrees", "")
    assert (records["constant/mjcf"].verdict, records["constant/mjcf"].message) == ("disagrees", "")


def test_what_failed_is_named_and_blamed_for_no_dynamics(records: dict[str, Record]) -> None:
    shown = [record for record in records.values() if record.failed or record.verdict == "agrees"]
    inference = infer_from_records(shown)["bar_pendulum"]
    assert inference.party == "failure"
    assert "old gave no answers to judge (old/mjcf: AttributeError: module 'mujoco' has no attribute 'batches')" in inference.sentence
    assert "late gave no answers" in inference.sentence and "at fault" not in inference.sentence
    blamed = infer_from_records([*shown, records["single/mjcf"]])["bar_pendulum"]
    assert blamed.party == "engine single" and "old gave no answers" in blamed.sentence


@pytest.mark.ci
def test_a_replay_of_one_state_is_held_against_itself(tmp_path: Path) -> None:
    root = make_library(tmp_path / "library", ["bar_pendulum"], {"noisy": changed_engine(ANSWERS["noisy"])})
    state = '{"q": [0.3], "v": [1.0], "tau": [0.2]}'
    done = harness("check", "bar_pendulum", "--library", str(root), "--subject", "noisy/mjcf", "--state", state)
    assert done.returncode == 1
    assert "answers differ from call to call" in done.stdout
    assert "noisy gave no answers to judge" in done.stdout
