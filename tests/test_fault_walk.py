"""A relative change of 1e-11 of any number in any model that enters the equations turns the check red.

Every model of the library is walked, number by number, and the smallest change that is caught stands
beside what the data roundoff promises.
"""

from __future__ import annotations

import functools
import json
import math
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from support import InThisProcess

from harness import tasks
from harness.attributes import scaled
from harness.cli import main
from harness.compare import compare
from harness.engines import Subject, is_native, subjects
from harness.fault_walk import Caught, walk, walkable
from harness.library import Library
from harness.models import read_model
from harness.records import Record
from harness.reference import Reference
from harness.run import DEFAULT_STATES, CrossCheck, Settings

LIBRARY = Library.built_in()
PAIRS = walkable(LIBRARY, (), ())
IDENTIFIERS = [f"{name}-{subject}" for name, subject in PAIRS]
CHANGE = 1e-11
SAMPLED = DEFAULT_STATES - Settings(library=LIBRARY).searched


@functools.cache
def walked(name: str, subject: Subject) -> list[Caught]:
    return walk(LIBRARY, name, subject, SAMPLED, 0, lambda text: None)


def check(name: str, subject: Subject, path: Path) -> tuple[CrossCheck, Record]:
    settings = Settings(library=LIBRARY, names=[name], subjects=[str(subject)], stand_ins={subject.format: path}, examples=None)
    cross_check = CrossCheck(settings, InThisProcess())
    (record,) = cross_check.records()
    assert (record.system, record.subject) == (name, str(subject))
    return cross_check, record


@pytest.fixture(autouse=True)
def without_superfluous_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every changed model would be searched for them again."""
    monkeypatch.setattr(tasks, "find_superfluous", lambda assignment, note: [])


@pytest.mark.parametrize(("name", "subject"), PAIRS, ids=IDENTIFIERS)
def test_what_is_caught_is_what_theory_promises(name: str, subject: Subject) -> None:
    numbers = walked(name, subject)
    # Mass, and whatever brings the mechanism back: nothing here moves by less than two numbers.
    assert len(numbers) >= 2
    assert [number for number in numbers if not number.ratio >= 0.1 or not number.as_promised] == []


@pytest.mark.parametrize(("name", "subject"), PAIRS, ids=IDENTIFIERS)
def test_a_change_of_1e_11_of_any_live_number_turns_the_check_red(name: str, subject: Subject, tmp_path: Path) -> None:
    numbers = walked(name, subject)
    hardest = max(number.smallest for number in numbers)
    # What the sampled states alone catch needs no run of its own; the hardest goes all the way, to the search and the record.
    path = LIBRARY.model_path(name, subject.format)
    text = read_model(path, subject.format).text
    changed = tmp_path / path.name
    for number in numbers:
        if number.smallest <= CHANGE and number.smallest < hardest:
            continue
        changed.write_text(scaled(text, number.changed, 1 + CHANGE))
        cross_check, record = check(name, subject, changed)
        assert not cross_check.problems
        assert record.verdict in ("disagrees", "unstable"), number
        assert not record.as_expected, number


def test_nearly_every_number_is_seen_to_the_tenth_digit() -> None:
    smallest = np.array([number.smallest for name, subject in PAIRS for number in walked(name, subject)])
    assert len(smallest) > 600
    assert (smallest < 1e-10).mean() >= 0.95


def test_a_blunt_check_is_told_by_its_ratio(monkeypatch: pytest.MonkeyPatch) -> None:
    """The check accepts a hundred times what the data roundoff of the states allows: no number reaches theory."""
    from harness import fault_walk

    accepted = compare

    def blunt(reference: Reference, accelerations: np.ndarray) -> object:
        middle = reference.high + reference.low
        return accepted(reference, middle + (accelerations - middle) / 100)

    monkeypatch.setattr(fault_walk, "compare", blunt)
    for subject in subjects(LIBRARY):
        if subject.format != "equations" and is_native(LIBRARY, subject):
            numbers = walk(LIBRARY, "cart_pendulum", subject, 64, 0, lambda text: None)
            assert all(number.ratio > 10 for number in numbers)


def test_a_number_that_is_never_caught_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    from harness import fault_walk

    monkeypatch.setattr(fault_walk.FaultWalk, "_is_caught", lambda *arguments: False)
    numbers = walk(LIBRARY, "simple_pendulum", Subject("mujoco", "mjcf"), 16, 0, lambda text: None)
    assert numbers
    assert all(math.isinf(number.smallest) for number in numbers)


def test_the_unchanged_models_agree() -> None:
    """What the runs of the changed models are told from."""
    for name, subject in PAIRS:
        if name == "cart_pendulum":
            cross_check, record = check(name, subject, LIBRARY.model_path(name, subject.format))
            assert record.as_expected
            assert not cross_check.problems


def test_the_command_prints_each_number_and_writes_json(tmp_path: Path) -> None:
    path = tmp_path / "faults.json"
    done = CliRunner().invoke(main, ["faults", "spring_damper", "--smallest", "--states", "64", "--json", str(path)])
    assert done.exit_code == 0, done.output
    rows = json.loads(path.read_text())["faults"]
    assert {row["element"] for row in rows} == {"joint", "inertial", "mass", "dynamics", "springStiffness"}
    assert all(0 < row["smallest"] <= 10 * row["theory"] for row in rows)
    assert f"{len(rows)} live numbers; 100.0% caught below 1e-10" in done.output
    assert re.search(r"spring_damper\.urdf:\d+ +springStiffness +80 ", done.output)


def test_a_model_that_cannot_be_read_is_exit_status_2_and_costs_its_subject_only(tmp_path: Path) -> None:
    for folder in ("systems", "mjcf", "urdf"):
        (tmp_path / folder).mkdir()
    shutil.copy(LIBRARY.system_path("spring_damper"), tmp_path / "systems")
    shutil.copy(LIBRARY.model_path("spring_damper", "urdf"), tmp_path / "urdf")
    done = CliRunner().invoke(main, ["faults", "--smallest", "--states", "16", "--library", str(tmp_path)])
    assert done.exit_code == 2
    assert "spring_damper.xml" in done.output
    assert "pinocchio/urdf" in done.output
