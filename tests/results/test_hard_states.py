"""Stored hard states: what is kept, what is refused, that every later run compares them, and the ranking of the worst."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import pytest
from support import cross_checked, make_library

from harness.crosscheck.run import CrossCheck
from harness.crosscheck.settings import Settings, stored_states
from harness.errors import InvalidInput
from harness.lagrange.derivation import load_mechanism
from harness.library import Library
from harness.results.hard_states import FoundState, as_text, keep, load_found, merged, path_of, worst_cases
from harness.results.records import Record, Representative
from harness.workers import Workers

FOUND = FoundState(
    state={"q": [0.123], "v": [0.0], "tau": [0.0]},
    subject="planted/mjcf",
    backward_error=1e5,
    digits_lost=5.0,
    verdict="disagrees",
    term="none",
    statement="planted",
    versions={"harness": "0"},
    date="2026-01-31",
)

# Right everywhere but at one state, which no sample meets.
ENGINE = """
import numpy as np
from harness.engines.adapters.mujoco import MujocoEngine
from harness.engines.adapters.mujoco.model import MujocoModel

class Model(MujocoModel):
    def forward_dynamics(self, q, v, tau):
        answer = super().forward_dynamics(q, v, tau)
        return np.where(q == 0.123, answer * (1 + 1e-9), answer)

class Engine(MujocoEngine):
    def load(self, source, joints, gravity):
        return Model(super().load(source, joints, gravity).model, joints)

ENGINE = Engine()
"""


@pytest.fixture
def library(tmp_path: Path) -> Library:
    root = make_library(tmp_path / "mine", ["bar_pendulum"], {"planted": ENGINE})
    return Library.at(root)


@pytest.fixture(scope="module")
def workers() -> Iterator[Workers]:
    with Workers(1) as pool:
        yield pool


def compared(library: Library, workers: Workers, **settings: Any) -> tuple[Record, CrossCheck]:
    [record], study = cross_checked(Settings(library=library, subjects=["planted/mjcf"], states=40, examples=None, **settings), workers)
    return record, study


def test_what_is_kept_reads_back(library: Library) -> None:
    infinite = replace(FOUND, verdict="unstable", backward_error=float("inf"), state={"q": [5e-324], "v": [1 / 3], "tau": [-0.0]})
    crash = replace(FOUND, verdict="error", backward_error=None)
    assert keep(library, "bar_pendulum", [FOUND, infinite, crash]) == path_of(library, "bar_pendulum")
    again = load_found(library, "bar_pendulum")
    assert sorted(again, key=lambda one: one.verdict) == [FOUND, crash, infinite]
    before = path_of(library, "bar_pendulum").read_bytes()
    assert keep(library, "bar_pendulum", [FOUND]) is None
    assert path_of(library, "bar_pendulum").read_bytes() == before


def test_of_a_subject_verdict_and_term_the_worst_stays() -> None:
    worse, milder = replace(FOUND, backward_error=2e5), replace(FOUND, backward_error=9e4)
    other_term, other_subject = replace(FOUND, term="velocity"), replace(FOUND, subject="mujoco/mjcf")
    agreeing = replace(FOUND, verdict="agrees", backward_error=3.0)
    assert merged([FOUND], [milder]) == [FOUND]
    assert merged([FOUND], [worse]) == [worse]
    assert merged([FOUND], [agreeing]) == [FOUND]
    assert merged([], [agreeing]) == []
    assert set(map(str, merged([FOUND], [other_term, other_subject]))) == set(map(str, [FOUND, other_term, other_subject]))
    assert merged([FOUND, other_term], [other_subject]) == merged([other_subject], [other_term, FOUND])


GOOD = json.loads(as_text([FOUND]))[0]
BROKEN = {
    "no JSON": ("[\n{,", 2, "is not JSON"),
    "no list": ("{}", None, "holds no list"),
    "no object": ("[3]", None, "entry 1"),
    "a field missing": (json.dumps([GOOD, {key: value for key, value in GOOD.items() if key != "term"}]), None, "entry 2"),
    "a field too many": (json.dumps([GOOD | {"extra": 1}]), None, "extra"),
    "no verdict": (json.dumps([GOOD | {"verdict": "bad"}]), None, "expected one of agrees"),
    "a text for a number": (json.dumps([GOOD | {"digits_lost": "many"}]), None, "Expected `float`, got `str` - at `\\$.digits_lost`"),
    "NaN in the state": (json.dumps([GOOD | {"state": {"q": [float("nan")], "v": [0.0], "tau": [0.0]}}]), None, "finite"),
    "an error that is no number": (json.dumps([GOOD | {"backward_error": "nan"}]), None, '"backward_error" or "digits_lost" is no number'),
    "digits that are no number": (json.dumps([GOOD | {"digits_lost": "nan"}]), None, '"backward_error" or "digits_lost" is no number'),
    "no tau": (json.dumps([GOOD | {"state": {"q": [0.0], "v": [0.0]}}]), None, "tau"),
    "no date": (json.dumps([GOOD | {"date": "yesterday"}]), None, "entry 1"),
}


@pytest.mark.parametrize("what", BROKEN)
def test_a_broken_file_is_refused_with_its_place(library: Library, what: str) -> None:
    text, line, words = BROKEN[what]
    path = path_of(library, "bar_pendulum")
    path.parent.mkdir()
    path.write_text(text)
    with pytest.raises(InvalidInput, match=words) as caught:
        load_found(library, "bar_pendulum")
    assert (caught.value.path, caught.value.line) == (path, line)
    with pytest.raises(InvalidInput):
        keep(library, "bar_pendulum", [FOUND])
    assert path.read_text() == text


def test_a_file_that_is_no_text_is_refused(library: Library) -> None:
    path = path_of(library, "bar_pendulum")
    path.parent.mkdir()
    path.write_bytes(as_text([FOUND]).encode("utf-16"))
    with pytest.raises(InvalidInput, match=r"cannot be read: .*; expected a list of objects with "):
        load_found(library, "bar_pendulum")
    path.unlink()
    path.mkdir()
    with pytest.raises(InvalidInput, match=r"cannot be read: .*directory"):
        load_found(library, "bar_pendulum")


def test_a_state_of_another_size_is_refused(library: Library) -> None:
    keep(library, "bar_pendulum", [replace(FOUND, state={"q": [0.0, 1.0], "v": [0.0], "tau": [0.0]})])
    with pytest.raises(InvalidInput, match=r"has 2, 1 and 1 numbers .* expected 1, 1 and 1"):
        stored_states(library, load_mechanism(library, "bar_pendulum"))


def test_a_library_that_cannot_be_written_says_so(library: Library) -> None:
    path_of(library, "bar_pendulum").parent.write_text("a file where the folder should be")
    with pytest.raises(InvalidInput, match="cannot be written"):
        keep(library, "bar_pendulum", [FOUND])


@pytest.mark.ci
def test_a_stored_state_is_compared_in_every_later_run(library: Library, workers: Workers) -> None:
    """The planted engine is wrong at that state alone, so only the replay can see it."""
    record, _ = compared(library, workers)
    assert record.verdict == "agrees"
    keep(library, "bar_pendulum", [FOUND, replace(FOUND, subject="mujoco/mjcf")])
    replayed, check = compared(library, workers)
    assert (replayed.verdict, replayed.states) == ("disagrees", record.states + 1)
    assert replayed.worst_state == FOUND.state
    assert not check.problems
    # The replay of another state is about that state alone.
    states = stored_states(library, load_mechanism(library, "bar_pendulum"))
    assert states is not None
    alone, _ = compared(library, workers, state=replace(states, q=states.q + 1))
    assert (alone.verdict, alone.states) == ("agrees", 1)


@pytest.mark.ci
def test_a_broken_file_costs_the_record_and_is_told(library: Library, workers: Workers) -> None:
    path = path_of(library, "bar_pendulum")
    path.parent.mkdir()
    path.write_text("[")
    record, check = compared(library, workers)
    assert record.verdict == "error"
    assert str(path) in record.message
    assert [problem.path for problem in check.problems] == [path]


def record_of(system: str, subject: str, verdict: str, error: float | None, state: bool = True) -> Record:
    return Record(
        system=system,
        subject=subject,
        states=10,
        verdict=verdict,
        expected="agrees",
        backward_error=error,
        relative_error=None,
        worst_state=FOUND.state if state else None,
        seconds_per_state=None,
        message="",
        replay=f"harness check {system}",
    )


def test_the_ranking_puts_the_gravest_and_worst_first_once_per_system() -> None:
    dead = Representative(state=FOUND.state, backward_error=None, replay="harness check e --state there", is_alone=True)
    records = [
        record_of("a", "mujoco/mjcf", "unstable", 2e6),
        record_of("b", "mujoco/mjcf", "disagrees", 70.0),
        record_of("c", "mujoco/mjcf", "unstable", 1e6),
        record_of("d", "mujoco/mjcf", "undecided", None),
        replace(record_of("e", "mujoco/mjcf", "error", 50.0), representative=dead),
        record_of("f", "mujoco/mjcf", "error", None, state=False),
        record_of("a", "pinocchio/urdf", "agrees", 2.0),
    ]
    ranking = worst_cases(records)
    assert [case.system for case in ranking if case.subject == "mujoco/mjcf"] == ["e", "b", "a", "c"]
    assert [(case.system, case.subject) for case in ranking[4:]] == [("a", "pinocchio/urdf")]
    e, c = ranking[0], ranking[3]
    assert (e.backward_error, e.state, e.replay) == (None, FOUND.state, dead.replay)
    assert (c.reproducer, c.replay, c.backward_error) == ("", "harness check c", 1e6)
    assert [case.system for case in worst_cases(records, most=1)] == ["e", "a"]
    assert worst_cases(reversed(records)) == ranking


def test_a_case_is_at_a_state_that_has_its_verdict() -> None:
    """The largest error of a pendulum with limits is where none pushes, so that the answer there agrees."""
    explained = Representative(state={"q": [1.3], "v": [0.0], "tau": [0.0]}, backward_error=0.7, replay="there", is_alone=True)
    record = record_of("a", "pinocchio/mjcf", "explained", 1.2)
    [case] = worst_cases([replace(record, representative=explained)])
    assert (case.state, case.backward_error, case.replay) == (explained.state, 0.7, "there")
    # A simpler state than the worst, which has the verdict too, hides no larger error.
    [case] = worst_cases([replace(record, representative=replace(explained, is_alone=False))])
    assert (case.state, case.backward_error, case.replay) == (FOUND.state, 1.2, "harness check a")


def test_plain_data_is_what_the_file_holds() -> None:
    assert json.loads(as_text([FOUND])) == [asdict(FOUND)]
