"""A relative change of 1e-11 of any number in any model that enters the equations turns the check red, where data roundoff is less.

Every model of the library is walked, and the smallest change that is caught stands beside what the data
roundoff promises. By day a seeded few numbers of each model are walked, by night all of them.
"""

from __future__ import annotations

import contextlib
import functools
import itertools
import json
import math
import random
import re
from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace
from support import cross_checked, harness, make_library

from harness.arrays import Array
from harness.crosscheck import run
from harness.crosscheck.expected import AGREES
from harness.crosscheck.run import CrossCheck
from harness.crosscheck.settings import DEFAULT_STATES, Settings
from harness.diagnosis.faults import bench, campaign
from harness.diagnosis.faults.campaign import number_faults, smallest_changes
from harness.diagnosis.faults.reader import FURTHEST, RESOLUTION, Reader, require_sound, smallest_caught
from harness.diagnosis.faults.study import select_pairs
from harness.diagnosis.faults.summary import SmallestChange
from harness.engines import Subject, load_engine, select_subjects
from harness.errors import InvalidInput, InvalidModel
from harness.explain.changes import Change
from harness.explain.columns import watch
from harness.files.model_file import ModelFile, parse_model, read_model
from harness.lagrange.derivation import load_mechanism
from harness.library import Library
from harness.results.records import Record
from harness.truth.compare import compare
from harness.truth.reference import Reference, ReferenceKernel
from harness.truth.sampling import sample
from harness.verdict import gravest

LIBRARY = Library.built_in()


def _by_mechanism(pairs: list[tuple[str, Subject]]) -> list[list[tuple[str, Subject]]]:
    return [list(group) for _, group in itertools.groupby(pairs, key=lambda pair: pair[0])]


PAIRS, _ = select_pairs(LIBRARY, (), select_subjects(LIBRARY, (), native_only=True))
CHANGE = 1e-11
SAMPLED = DEFAULT_STATES - Settings(library=LIBRARY).searched


# Systems with a link so light that data roundoff hides a change of 1e-11 of its mass or moments. A change of a number moves the
# accelerations by that times |D_j|, and data roundoff is u times the sum of all |D_k|: what has less than 64 u / 1e-11 = 7.1e-4 of that
# sum is hidden. Links of loops are many and carry little each, as the arms of the governor with 5e-6 kg m^2.
LIGHT = {"stanford_arm", "andrews_squeezer", "bricard", "delta_robot", "flyball_governor"}
# What is granted to weight hides a change of 1e-11 of gravity in MuJoCo's soft slider-crank, which hardly feels it.
HARDLY_FALLING = {"slider_crank"}
# How many numbers of each model are walked by day.
FEW = 4
# One subject of every second mechanism by day, of every fourth the other one; each of all by night, where tests of one mechanism have
# their turn in the same night, and share what is found of it.
BY_DAY = [pairs[number % len(pairs)] for number, pairs in enumerate(_by_mechanism(PAIRS)[::2])]
BY_NIGHT = {pairs[0][0]: [subject for _, subject in pairs] for pairs in _by_mechanism(PAIRS)}
IN_TURN = pytest.mark.nightly(nights=16)
WALKS = [
    *(pytest.param(name, [subject], FEW, id=f"{name}-{subject}-few") for name, subject in BY_DAY),
    *(pytest.param(name, subjects, None, id=f"{name}-all", marks=IN_TURN) for name, subjects in BY_NIGHT.items()),
]


@functools.cache
def smallest(name: str, subject: Subject, most: int | None) -> list[SmallestChange]:
    """Of every live number of a model, or of ``most`` numbers that are drawn by a seed; of more where fewer than two of them live."""

    def drawn(model: ModelFile) -> list[Change]:
        numbers = [planted for planted in number_faults(model) if float(planted.places[0].found)]
        random.Random(f"{name} {subject}").shuffle(numbers)
        return numbers[:most]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(campaign, "number_faults", drawn)
        found = smallest_changes(LIBRARY, name, subject, SAMPLED, 0, lambda text: None)
    return found if most is None or len(found) >= 2 else smallest(name, subject, 2 * most if most < 50 else None)


def change_of(number: SmallestChange) -> float:
    """1e-11, or twice what data roundoff hides where that is more, as of the moments of the Stanford arm's light wrist.

    A change of exactly what it hides moves one state by 64 data roundoffs, which rounding lessens or adds to.
    """
    return max(CHANGE, 2.0 * number.theory)


def with_change(name: str, subject: Subject, number: SmallestChange) -> str:
    """The file with a number changed by ``change_of`` it, in the direction that physics allows."""
    model = read_model(LIBRARY.model_path(name, subject.format), subject.format)
    planted = next(one for one in number_faults(model) if (one.places[0], one.statement) == (number.place, number.statement))
    for size in (change_of(number), -change_of(number)):
        with contextlib.suppress(InvalidModel):
            return parse_model(model.path, planted.text(size), model.format).text
    raise AssertionError(number)


def check(name: str, subject: Subject, path: Path) -> tuple[CrossCheck, Record]:
    settings = Settings(library=LIBRARY, names=[name], subjects=[str(subject)], stand_ins={subject.format: path}, examples=None)
    [record], cross_check = cross_checked(settings)
    assert (record.system, record.subject) == (name, str(subject))
    return cross_check, record


@pytest.fixture(autouse=True)
def without_superfluous_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every changed model would be searched for them again."""
    monkeypatch.setattr(run, "find_superfluous", lambda assignment: [])


@pytest.mark.ci
@pytest.mark.parametrize(("name", "subjects", "most"), WALKS)
def test_what_is_caught_is_what_theory_says(name: str, subjects: list[Subject], most: int | None) -> None:
    for subject in subjects:
        numbers = smallest(name, subject, most)
        # Mass, and whatever brings the mechanism back: nothing here moves by less than two numbers, but for what falls freely.
        assert len(numbers) >= (1 if name == "bouncing_ball" else 2)
        assert [number for number in numbers if not number.ratio >= 0.1 or not number.as_in_theory] == []


@pytest.mark.parametrize(("name", "subjects", "most"), WALKS)
def test_a_change_of_any_live_number_turns_the_check_red(name: str, subjects: list[Subject], most: int | None, tmp_path: Path) -> None:
    for subject in subjects:
        numbers = smallest(name, subject, most)
        hardest = max(number.smallest for number in numbers)
        # What the sampled states alone catch needs no run of its own; the hardest goes all the way, to the search and the record.
        changed = tmp_path / LIBRARY.model_path(name, subject.format).name
        for number in numbers:
            if number.smallest <= change_of(number) and number.smallest < hardest:
                continue
            changed.write_text(with_change(name, subject, number))
            cross_check, record = check(name, subject, changed)
            assert not cross_check.problems
            assert record.verdict == "disagrees", number
            assert not record.as_expected, number


@IN_TURN
@pytest.mark.parametrize("name", BY_NIGHT)
def test_data_roundoff_hides_a_change_of_1e_11_of_the_lightest_links_alone(name: str) -> None:
    hidden = [number for subject in BY_NIGHT[name] for number in smallest(name, subject, None) if number.theory > CHANGE]
    assert bool(hidden) == (name in LIGHT | HARDLY_FALLING)
    assert name not in HARDLY_FALLING or {number.place.attribute for number in hidden} == {"gravity"}


@IN_TURN
@pytest.mark.parametrize("name", BY_NIGHT)
def test_what_is_granted_to_motion_and_weight_hides_no_further_link(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without the share the same systems hide a change of 1e-11: it is the data's own roundoff."""
    with_share = Reader.theory

    def without_share(reader: Reader, slope: Array | None) -> float:
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(Reference, "roundoff_with_share", Reference.data_roundoff)
            return with_share(reader, slope)

    monkeypatch.setattr(Reader, "theory", without_share)
    monkeypatch.setattr(bench, "smallest_caught", lambda theory, catches: theory)

    def hides(subject: Subject) -> bool:
        found = smallest_changes(LIBRARY, name, subject, SAMPLED, 0, lambda text: None)
        return any(number.theory > CHANGE for number in found)

    assert any(map(hides, BY_NIGHT[name])) == (name in LIGHT)


@pytest.mark.ci
@pytest.mark.parametrize("pairs", [pytest.param(BY_DAY, id="few"), pytest.param(PAIRS, id="all", marks=pytest.mark.nightly)])
def test_nearly_every_number_is_seen_to_the_tenth_digit(pairs: list[tuple[str, Subject]]) -> None:
    sizes = np.array([number.smallest for name, subject in pairs for number in smallest(name, subject, FEW)])
    assert len(sizes) > 2 * len(pairs) - 1
    assert (sizes < 1e-10).mean() >= 0.95


def test_a_number_that_is_never_caught_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Reader, "catches", lambda *arguments: False)
    numbers = smallest_changes(LIBRARY, "simple_pendulum", Subject("mujoco", "mjcf"), 16, 0, lambda text: None)
    assert numbers
    assert all(math.isinf(number.smallest) for number in numbers)


@pytest.mark.parametrize("theory", [1e-12, 1e-300])
def test_the_search_ends_whatever_is_caught(theory: float) -> None:
    asked: list[float] = []

    def catches(size: float) -> bool:
        asked.append(size)
        assert len(asked) < 100, size
        return True

    assert smallest_caught(theory, catches) == theory / FURTHEST
    assert min(asked) > 0


@pytest.mark.parametrize("threshold", [1e-15, 1e-12, 0.9e-12, 3e-9])
def test_the_search_finds_the_smallest_size_that_is_caught(threshold: float) -> None:
    assert threshold <= smallest_caught(1e-12, lambda size: size >= threshold) <= RESOLUTION * threshold


@pytest.mark.ci
def test_what_lost_digits_before_shows_nothing() -> None:
    """Straight chains are beyond a factorisation of M: those states are known, and no number is caught at them."""
    numbers = smallest_changes(LIBRARY, "chain_6", Subject("mujoco", "mjcf"), SAMPLED, 0, lambda text: None)
    assert len(numbers) >= 12
    # A state of the chain that agrees only just is driven beyond by less than theory asks of a sound one.
    assert all(number.smallest > 1e-17 and number.as_in_theory for number in numbers)


def test_lost_digits_are_right_only_as_far_as_they_are_expected() -> None:
    subject, mechanism = Subject("mujoco", "mjcf"), load_mechanism(LIBRARY, "chain_6")
    states = sample(mechanism, SAMPLED, 0)
    model = read_model(LIBRARY.model_path("chain_6", "mjcf"), "mjcf")
    healthy = watch(load_engine(LIBRARY, "mujoco"), mechanism, model, states).healthy
    reference = ReferenceKernel(mechanism).evaluate(states)
    comparison = compare(reference, healthy, factorises=True)
    assert gravest(comparison.verdicts.tolist()) == "unstable"
    require_sound(model.path, "chain_6", subject, comparison, replace(AGREES, verdict="unstable", backward_error=2000.0))
    for expected in (AGREES, replace(AGREES, verdict="unstable", backward_error=65.0), replace(AGREES, verdict="disagrees")):
        with pytest.raises(InvalidInput, match="make 'harness check chain_6' green first"):
            require_sound(model.path, "chain_6", subject, comparison, expected)
    only_lost = comparison[np.flatnonzero(comparison.verdicts == "unstable")]
    with pytest.raises(InvalidInput, match="agrees at none of"):
        require_sound(model.path, "chain_6", subject, only_lost, replace(AGREES, verdict="unstable"))


@pytest.mark.parametrize(
    "options", [["--kind", "damping"], ["--size", "1e-6"], ["--diagnoses", "4"], ["--every-diagnosis"], ["--kind", "axis", "--size", "1"]]
)
def test_what_only_a_campaign_does_is_refused_beside_smallest(options: list[str]) -> None:
    done = harness("faults", "spring_damper", "--smallest", *options)
    assert done.returncode == 2
    assert all(option in done.stderr for option in options if option.startswith("--"))
    assert "drop" in done.stderr


@pytest.mark.parametrize("options", [[], ["--smallest"]])
def test_a_system_without_a_model_says_why_in_one_line(options: list[str]) -> None:
    done = harness("faults", "rolling_disc", *options)
    # Where nothing was planted nothing was caught.
    assert done.returncode == 1, done
    _, line = done.stdout.splitlines()
    assert line.startswith("rolling_disc: no ") and "mjcf" in line and "urdf" in line
    assert "a disc that rolls freely ties rates" in line


@pytest.mark.parametrize("options", [[], ["--smallest"]])
def test_a_library_whose_check_is_red_is_exit_status_2(options: list[str], tmp_path: Path) -> None:
    """A mass that both models have wrong: no fault beside it could be told from it."""
    library = make_library(tmp_path / "wrong", ["double_pendulum"])
    for path in (library / "mjcf/double_pendulum.xml", library / "urdf/double_pendulum.urdf"):
        text = path.read_text()
        assert re.search('mass(?: value)?="1.25"', text)
        path.write_text(re.sub('(mass(?: value)?)="1.25"', r'\1="2.5"', text))
    done = harness("faults", *options, "--states", "32", "--workers", "1", "--library", str(library))
    assert done.returncode == 2, done
    assert "'disagrees' before any fault is planted" in done.stderr
    assert "make 'harness check double_pendulum' green first" in done.stderr
    assert "no model was" not in done.stdout + done.stderr


@pytest.mark.ci
def test_the_command_prints_each_number_and_writes_json(tmp_path: Path) -> None:
    path = tmp_path / "faults.json"
    done = harness("faults", "spring_damper", "--smallest", "--states", "64", "--json", str(path))
    assert done.returncode == 0, done
    rows = json.loads(path.read_text())["faults"]
    assert {row["element"] for row in rows} == {"joint", "inertial", "mass", "dynamics", "springStiffness"}
    assert all(0 < row["smallest"] <= 10 * row["theory"] for row in rows)
    assert f"{len(rows)} live numbers; 100.0% caught below 1e-10" in done.stdout
    assert re.search(r"spring_damper\.urdf:\d+ +springStiffness +80 ", done.stdout)


def test_a_model_that_cannot_be_read_is_exit_status_2_and_costs_its_subject_only(tmp_path: Path) -> None:
    library = make_library(tmp_path / "library", ["spring_damper"])
    (library / "mjcf/spring_damper.xml").unlink()
    done = harness("faults", "--smallest", "--states", "16", "--library", str(library))
    assert done.returncode == 2
    assert "spring_damper.xml" in done.stderr
    assert "pinocchio/urdf" in done.stdout
