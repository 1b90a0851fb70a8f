"""The cross-check as a study: one certified batch for all subjects, and what a death costs."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from catalogue import BUILT_IN
from support import InThisProcess, changed_engine, completed, cross_checked, make_library

from harness.crosscheck.run import CrossCheck
from harness.crosscheck.settings import Settings
from harness.crosscheck.stages import compare_all
from harness.crosscheck.superfluous import find_superfluous
from harness.engines.files import engine_files
from harness.errors import InvalidInput
from harness.library import Library
from harness.programs.states import States
from harness.results.records import Record
from harness.study import run_study
from harness.truth.reference import ReferenceKernel
from harness.workers import Crash, Outcome, Task, Workers

SOUND = {"lagrange", "mujoco/mjcf", "mujoco/urdf", "pinocchio/mjcf", "pinocchio/urdf"}


def library(tmp_path: Path, names: tuple[str, ...] = ("bar_pendulum",), **bodies: str) -> Library:
    return Library.at(make_library(tmp_path / "library", names, {name: changed_engine(body) for name, body in bodies.items()}))


def by_subject(records: list[Record]) -> dict[str, Record]:
    return {record.subject: record for record in records}


def test_the_truth_of_a_batch_is_certified_once_for_all_subjects(monkeypatch: pytest.MonkeyPatch) -> None:
    certified: list[int] = []
    evaluate = ReferenceKernel.evaluate

    def counted(self: ReferenceKernel, states: Any, *parameters: Any) -> Any:
        certified.append(len(states))
        return evaluate(self, states, *parameters)

    monkeypatch.setattr(ReferenceKernel, "evaluate", counted)
    settings = Settings(library=BUILT_IN, names=["bar_pendulum"], states=300, examples=None)
    records, _ = cross_checked(settings)
    assert len(records) == 5 and {record.states for record in records} == {300}
    # Beside the states themselves: one state to compile with, the few of each examination for superfluous parts, and the worst
    # state of each subject.
    assert 300 <= sum(certified) <= 300 + 1 + 2 * 9 + 5


@pytest.mark.ci
def test_a_death_costs_the_subject_that_was_asked_and_names_its_state(tmp_path: Path) -> None:
    """The engine dies far from the sampled middle, so that the state must be looked for."""
    planted = library(tmp_path, dying="os.abort() if (q > 2.5).any() else None")
    with Workers(1, time_limit=60) as workers:
        records, study = cross_checked(Settings(library=planted, states=80, examples=None), workers)
    found = by_subject(records)
    assert {found[subject].verdict for subject in SOUND} == {"agrees"}
    assert {found[subject].states for subject in SOUND} == {80}
    dying = found["dying/mjcf"]
    assert dying.verdict == "error" and "SIGABRT" in dying.message
    assert dying.worst_state is not None and dying.worst_state["q"][0] > 2.5
    assert study.crashes == {("bar_pendulum", "dying/mjcf")} and study.crashed


@pytest.mark.ci
def test_two_subjects_that_die_are_both_set_aside(tmp_path: Path) -> None:
    planted = library(tmp_path, first="os.abort()", second="os._exit(5)")
    with Workers(1, time_limit=60) as workers:
        records, study = cross_checked(Settings(library=planted, states=40, examples=None), workers)
    found = by_subject(records)
    assert "SIGABRT" in found["first/mjcf"].message and "status 5" in found["second/mjcf"].message
    assert {found[subject].states for subject in SOUND} == {40}
    assert {what for _, what in study.crashes} == {"first/mjcf", "second/mjcf"}


@pytest.mark.ci
def test_an_exception_costs_the_subject_that_raised_it(tmp_path: Path) -> None:
    planted = library(tmp_path, raising="raise RuntimeError('no can do')")
    records, study = cross_checked(Settings(library=planted, states=40, examples=None))
    found = by_subject(records)
    assert (found["raising/mjcf"].verdict, found["raising/mjcf"].message) == ("error", "RuntimeError: no can do")
    assert {found[subject].verdict for subject in SOUND} == {"agrees"}
    assert not study.crashed and study.problems == []


@pytest.mark.ci
def test_an_engine_that_cannot_be_loaded_is_not_asked_again(tmp_path: Path) -> None:
    """Neither are its drawings made, which would ask it: it is among what crashed."""
    root = make_library(tmp_path / "library", ["bar_pendulum"], {"unlicensed": "raise RuntimeError('no licence')"})
    records, study = cross_checked(Settings(library=Library.at(root), states=8, examples=None))
    found = by_subject(records)
    unlicensed = {subject for subject in found if subject.startswith("unlicensed")}
    assert unlicensed and {found[subject].verdict for subject in found.keys() - unlicensed} == {"agrees"}
    assert all("no licence" in found[subject].message and found[subject].failed for subject in unlicensed)
    assert study.crashes == {("bar_pendulum", subject) for subject in unlicensed}


@pytest.mark.ci
def test_an_engine_that_is_not_installed_is_unsupported_and_is_not_asked(tmp_path: Path) -> None:
    lacking = changed_engine("raise RuntimeError('asked')") + "\nENGINE.requires = ('nowhere_at_all', 'nowhere-at-all')\n"
    root = make_library(tmp_path / "library", ["bar_pendulum"], {"lacking": lacking})
    subjects = ["lagrange", "lacking/mjcf"]
    records, study = cross_checked(Settings(library=Library.at(root), subjects=subjects, states=8, examples=None))
    found = by_subject(records)["lacking/mjcf"]
    assert found.verdict == "unsupported" and "nowhere-at-all" in found.message and not study.crashes


@pytest.mark.parametrize(("oldest", "verdict", "message"), [("0.1", "agrees", ""), ("99.0", "unsupported", "is older than 99.0")])
def test_a_version_elsewhere_is_asked_unless_it_is_too_old(
    oldest: str, verdict: str, message: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    files = dict(engine_files(BUILT_IN))
    files["mujoco"] = replace(files["mujoco"], elsewhere=True, oldest={"mjcf": oldest})
    monkeypatch.setattr("harness.crosscheck.loading.engine_files", lambda library: files)
    settings = Settings(library=BUILT_IN, names=["bar_pendulum"], subjects=["mujoco/mjcf"], states=8, examples=None)
    [record], _ = cross_checked(settings)
    assert record.verdict == verdict and message in record.message


def test_a_system_that_cannot_be_used_is_an_error_of_every_subject(tmp_path: Path) -> None:
    root = make_library(tmp_path / "library", ["bar_pendulum", "spring_damper"])
    (root / "systems" / "bar_pendulum.py").write_text("SYSTEM = length")
    records, study = cross_checked(Settings(library=Library.at(root), states=8, examples=None))
    broken = [record for record in records if record.system == "bar_pendulum"]
    assert {record.subject for record in broken} == SOUND and {record.verdict for record in broken} == {"error"}
    assert all("bar_pendulum.py:1: raises NameError: name 'length'" in record.message for record in broken)
    assert {record.verdict for record in records if record.system == "spring_damper"} == {"agrees"} and study.problems


@pytest.mark.parametrize(
    ("end", "message", "crashes", "faults"),
    [
        ({"crash": Crash("crashed by signal 9 (SIGKILL)", "", "")}, "crashed by signal 9 (SIGKILL)", {("bar_pendulum", None)}, []),
        ({"exception": ValueError("a bug")}, "ValueError: a bug", set(), ["bar_pendulum: the reference failed: ValueError: a bug"]),
        ({"exception": InvalidInput("file", None, "is wrong")}, "file: is wrong", set(), []),
    ],
    ids=["a death", "a fault of the harness", "a file to be mended"],
)
def test_what_ends_the_certification_is_nobodys_engine(
    end: dict[str, Any], message: str, crashes: set[tuple[str, None]], faults: list[str]
) -> None:
    class Dying(InThisProcess):
        def run(self, tasks: Any, further: Any = tuple) -> Iterator[Outcome]:
            for outcome in super().run(tasks, further):
                yield Outcome(outcome.task, **end) if outcome.task.function is compare_all else outcome

    records, study = cross_checked(Settings(library=BUILT_IN, names=["bar_pendulum"], states=40, examples=None), Dying())
    assert {record.message for record in records} == {f"the reference failed: {message}"}
    assert (study.crashes, study.faults) == (crashes, faults)


@pytest.mark.parametrize("dies_again", [True, False])
def test_a_death_among_quantities_that_are_asked_together_is_that_of_the_one_that_dies_alone(dies_again: bool) -> None:
    quantities = ["energy", "gravity", "reactions"]
    titles = ["mujoco/mjcf energy", "mujoco/mjcf gravity"]
    death, seen = "crashed by signal 11 (SIGSEGV)", list[Any]()

    class Dying(InThisProcess):
        def run(self, tasks: Any, further: Any = tuple) -> Iterator[Outcome]:
            for outcome in super().run(tasks, further):
                function = outcome.task.function
                is_each = isinstance(function, partial) and function.func is compare_all and function.keywords == {"each": True}
                kind = "each" if is_each else function
                seen.append(kind)
                notes = {compare_all: {"together": titles}} | ({"each": {"subject": titles[0]}} if dies_again else {})
                note = notes.get(kind) if seen.count(kind) == 1 else None
                yield Outcome(outcome.task, crash=Crash(death, json.dumps(note), "")) if note else outcome

    settings = Settings(library=BUILT_IN, names=["bar_pendulum"], subjects=["mujoco/mjcf"], states=40, examples=None)
    study = CrossCheck(settings, quantities)
    records = completed(study, Dying()).records
    wrong = {record.quantity: record.message for record in records if record.verdict != "agrees"}
    together = f"{death}, when several answers were asked for in one request, and not when each was"
    assert wrong == ({"energy": death} if dies_again else dict.fromkeys(quantities[:2], together))
    assert len(records) == 3 and study.crashes == {("bar_pendulum", "mujoco/mjcf")}


class CutOff(InThisProcess):
    """Workers on which every search for superfluous parts runs out of time."""

    def run(self, tasks: Any, further: Any = tuple) -> Iterator[Outcome]:
        for outcome in super().run(tasks, further):
            late = find_superfluous in outcome.task.arguments
            yield Outcome(outcome.task, crash=Crash("exceeded its time limit of 60 s; more", "", "")) if late else outcome


def test_a_search_for_superfluous_parts_that_is_cut_off_changes_no_verdict() -> None:
    records, study = cross_checked(Settings(library=BUILT_IN, names=["bar_pendulum"], states=40, examples=None), CutOff())
    assert {record.verdict for record in records} == {"agrees"} and all(record.as_expected for record in records)
    searched = {record.subject: record.message for record in records if record.message}
    assert set(searched) == {"mujoco/mjcf", "pinocchio/urdf"}
    assert set(searched.values()) == {"The search for superfluous parts was not finished: exceeded its time limit of 60 s; more."}
    assert not study.crashed and not study.crashes and study.problems == []


@pytest.mark.nightly
def test_an_engine_that_is_slow_with_changed_files_agrees(tmp_path: Path) -> None:
    """It takes 10 ms a state, and forever where gravity is not the system's, which only the search for superfluous parts asks."""
    body = "time.sleep(0.01 * len(q) if abs(model.loaded().gravity[2] + 9.81) < 1e-9 else 1000)"
    planted = library(tmp_path, slow=body)
    with Workers(1, time_limit=5) as workers:
        records, study = cross_checked(Settings(library=planted, states=20, subjects=["slow/mjcf"], examples=None), workers)
    [slow] = records
    assert (slow.verdict, slow.states) == ("agrees", 20) and not study.crashed
    assert slow.message.startswith("The search for superfluous parts was not finished: exceeded its time limit of 5 s")


@pytest.mark.ci
def test_a_system_that_hangs_delays_no_other(tmp_path: Path) -> None:
    """Every record of the other system is there before the time limit of the hanging one has passed."""
    planted = library(
        tmp_path, ("bar_pendulum", "spring_damper"), hanging="time.sleep(1000) if len(q) and model.loaded().gravity[2] else None"
    )
    study, limit = CrossCheck(Settings(library=planted, states=40, examples=None)), 25.0
    complete: dict[str, float] = {}
    with Workers(2, time_limit=limit) as workers:
        started = time.monotonic()
        for part in run_study(study, workers):
            [record] = part.value.records
            complete[record.system] = time.monotonic() - started
            if list(complete) == ["spring_damper"] and sum(r.system == "spring_damper" for r in study.result().records) == 6:
                break
    assert list(complete) == ["spring_damper"] and complete["spring_damper"] < limit


def test_tasks_of_a_system_share_a_worker() -> None:
    study = CrossCheck(Settings(library=BUILT_IN, names=["collar", "bar_pendulum"], states=40, examples=None))
    given: list[Task] = []

    class Watching(InThisProcess):
        def run(self, tasks: Any, further: Any = tuple) -> Iterator[Outcome]:
            for outcome in super().run(tasks, further):
                given.append(outcome.task)
                yield outcome

    completed(study, Watching())
    assert {task.affinity for task in given} == {"collar", "bar_pendulum"}
    assert len({(id(task.key[0]), task.affinity) for task in given}) == 2


@pytest.mark.ci
def test_numbers_do_not_depend_on_the_workers(tmp_path: Path) -> None:
    settings = Settings(library=BUILT_IN, names=["collar", "chain_3"], states=120, examples=None)
    here, _ = cross_checked(settings)
    with Workers(2, time_limit=60) as workers:
        there, _ = cross_checked(settings, workers)
    for one, other in zip(*(sorted(records, key=lambda record: (record.system, record.subject)) for records in (here, there)), strict=True):
        assert (one.system, one.subject, one.backward_error, json.dumps(one.worst_state)) == (
            other.system, other.subject, other.backward_error, json.dumps(other.worst_state)
        )  # fmt: skip
        assert np.isfinite(one.backward_error or 0)


def test_energies_that_depend_on_time_are_compared_at_other_times(tmp_path: Path) -> None:
    """At t = 0 the spring of the models is right."""
    library = make_library(tmp_path / "library", ["spring_damper"])
    system = library / "systems" / "spring_damper.py"
    system.write_text(system.read_text().replace("k * x**2 / 2", "k * x**2 / 2 * sp.cos(TIME)"))
    settings = Settings(library=Library.at(library), states=40, subjects=["lagrange", "mujoco/mjcf"], examples=None)
    found = by_subject(cross_checked(settings)[0])
    assert {subject: record.verdict for subject, record in found.items()} == {"lagrange": "agrees", "mujoco/mjcf": "disagrees"}
    worst = found["mujoco/mjcf"].worst_state
    assert worst is not None and 0 < worst["time"][0] < 10
    [again] = cross_checked(replace(settings, subjects=["mujoco/mjcf"], state=States.at(**worst)))[0]
    assert again.backward_error == pytest.approx(found["mujoco/mjcf"].backward_error, rel=1e-3)


@pytest.mark.ci
def test_an_engine_without_memory_says_what_leaves_it_more(tmp_path: Path) -> None:
    planted = library(tmp_path, hungry="raise MemoryError")
    records, _ = cross_checked(Settings(library=planted, states=40, examples=None))
    assert by_subject(records)["hungry/mjcf"].message.startswith("MemoryError: --memory-limit (pytest: --harness-memory-limit) allows more")


@pytest.mark.ci
def test_a_record_has_the_componentwise_error_where_it_is_asked_for_or_may_matter(tmp_path: Path) -> None:
    """An answer off by 1e-9 is beyond agreement by the norm, and by components no nearer; a sound one is certainly near."""
    settings = Settings(
        library=library(tmp_path, wrong="return exact(q, v, tau) * (1 + 1e-9)"),
        subjects=["mujoco/mjcf", "wrong/mjcf"],
        states=20,
        examples=None,
    )
    sound, wrong = cross_checked(settings)[0]
    assert sound.verdict == "agrees" and sound.componentwise_error is None
    assert wrong.componentwise_error is not None and wrong.backward_error is not None
    # One degree of freedom: the answer's own rounding is all that a component may have beyond the norm.
    assert 0.4 * wrong.backward_error < wrong.componentwise_error <= 1.001 * wrong.backward_error
    asked = cross_checked(replace(settings, componentwise=True))[0]
    assert all(record.componentwise_error for record in asked)
    assert "componentwise" in wrong.explanation and "componentwise" not in sound.explanation


def test_what_fails_while_it_is_measured_costs_the_number_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*arguments: Any) -> float:
        raise RuntimeError("the solver gave up")

    monkeypatch.setattr("harness.crosscheck.side_tasks.componentwise_error", fail)
    settings = Settings(library=library(tmp_path), subjects=["mujoco/mjcf"], states=20, examples=None, componentwise=True)
    records, study = cross_checked(settings)
    assert [(record.verdict, record.componentwise_error) for record in records] == [("agrees", None)]
    assert study.problems == [] and study.faults == []


@pytest.mark.ci
def test_a_record_says_what_its_model_asks_for_and_how_far_from_rigid_it_is() -> None:
    """Of a subject without a model, what the models of the mechanism would ask for; rolling is the mechanism's own."""
    names = ["four_bar", "rolling_disc", "simple_pendulum.mimic"]
    records, _ = cross_checked(Settings(library=BUILT_IN, names=names, states=20, examples=None))
    found = {(record.system, record.subject): record for record in records}
    assert {record.system: record.features for record in records} == {
        "four_bar": ["loops"], "rolling_disc": ["rolling"], "simple_pendulum.mimic": ["mimic joints"],
    }  # fmt: skip
    assert found["four_bar", "lagrange"].features == ["loops"] and found["four_bar", "lagrange"].from_rigid is None
    soft = found["four_bar", "mujoco/mjcf"].from_rigid
    assert soft is not None and 1e-4 < soft < 1.0 and f"{soft:.2g} of their size" in found["four_bar", "mujoco/mjcf"].message
    assert found["four_bar", "pinocchio/urdf"].from_rigid is None
