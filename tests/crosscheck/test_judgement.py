"""The verdict of a pair from its answers, and the first failure, which is the one that is told."""

from __future__ import annotations

import math
from collections import Counter

import numpy as np
import pytest

from harness.crosscheck.expected import Expectations
from harness.crosscheck.hypothesis_search import Found
from harness.crosscheck.judgement import Pair, SystemProgress, record_of
from harness.crosscheck.settings import Settings
from harness.engines import Subject
from harness.library import Library
from harness.programs.states import States
from harness.truth.compare import Comparison

AGREES, UNSTABLE, DISAGREES, UNDECIDED = "agrees", "unstable", "disagrees", "undecided"


@pytest.mark.parametrize("explained", [None, "mass explains all of it"])
@pytest.mark.parametrize(
    ("counts", "verdict"),
    [
        ({AGREES: 3}, AGREES),
        ({AGREES: 3, DISAGREES: 1}, DISAGREES),
        ({AGREES: 3, UNSTABLE: 1}, UNSTABLE),
        ({UNSTABLE: 3, DISAGREES: 1}, DISAGREES),
        ({AGREES: 3, "error": 1, DISAGREES: 2}, "error"),
        ({}, "error"),
    ],
)
def test_the_gravest_answer_decides_and_one_number_explains_no_lost_digits(
    counts: dict[str, int], verdict: str, explained: str | None
) -> None:
    pair = Pair(subject=Subject("mujoco", "mjcf"), counts=Counter(counts), explained=explained)
    assert pair.verdict == (DISAGREES if verdict == UNSTABLE and explained else verdict)


@pytest.mark.parametrize(
    ("how", "verdict"),
    [({}, "error"), ({"refused": True}, "error"), ({"unsupported": True}, "unsupported"), ({"misread": True}, "misreads")],
)
def test_the_first_failure_is_told(how: dict[str, bool], verdict: str) -> None:
    pair = Pair(subject=Subject("mujoco", "mjcf"), counts=Counter({AGREES: 3}))
    pair.fail("first", **how)
    pair.fail("second", unsupported=True)
    assert (pair.failure, pair.verdict) == ("first", verdict)
    assert {"refused": pair.refused, "unsupported": pair.unsupported, "misread": pair.misread} == {
        name: name in how for name in ("refused", "unsupported", "misread")
    }


def test_a_record_tells_quantiles_of_the_sample_and_the_worst_of_all_answers() -> None:
    draw = np.random.default_rng(0)
    pair, batches, samples = Pair(subject=Subject("mujoco", "mjcf")), [], []
    for number, (size, sampled) in enumerate([(900, slice(20, 900)), (0, slice(0)), (500, slice(0, 400)), (40, slice(0))]):
        errors = 10.0 ** draw.uniform(-3, 4, size)
        errors[:3] = math.nan
        verdicts = np.where(np.isnan(errors), "undecided", np.where(errors <= 64, "agrees", "disagrees"))
        verdicts[3:4] = "unstable"
        errors[3:4] = 1e9 + number
        granted, in_balls = draw.random((2, size)) < 0.2
        left_of_zero = np.where(draw.random(size) < 0.1, draw.random(size), 0.0)
        comparison = Comparison(errors, errors * 1e-16, granted, verdicts, in_balls, left_of_zero)
        states = States.at(*draw.normal(size=(3, size, 2)))
        pair.add(states, comparison, sampled)
        batches.append((states, comparison))
        samples.append(comparison[sampled])
    states, every = States.concatenate([one for one, _ in batches]), Comparison.concatenate([one for _, one in batches])
    sample = Comparison.concatenate(samples)
    record = record_of(Settings(library=Library.built_in()), Expectations(), SystemProgress("pendulum", {}), pair)

    known, among = (part.backward_error[~np.isnan(part.backward_error)] for part in (every, sample))
    assert (record.states, record.verdict, record.verdict_counts) == (1440, "disagrees", Counter(every.verdicts.tolist()))
    assert record.backward_error == known.max() == 1e9 + 3 and sum(record.distribution.values()) == len(known)
    assert (record.median_backward_error, record.percentile_99_backward_error) == (np.median(among), np.percentile(among, 99))
    agree = sample.verdicts[sample.verdicts != "undecided"] == "agrees"
    assert record.share == (~agree).sum() / len(agree)
    for (low, high), value in ((record.median_bounds, np.median(among)), (record.percentile_99_bounds, np.percentile(among, 99))):
        assert low in among and high in among and low <= value <= high
    assert (record.granted, record.in_balls) == (every.granted.sum(), every.in_balls.sum())
    zeros = every.left_of_zero[every.left_of_zero > 0]
    assert pair.left_of_zero == (len(zeros), zeros.max()) and f"at {len(zeros)} states" in record.message
    assert record.worst_state == states.as_json(int(np.nanargmax(every.backward_error)))
    gravest = int(np.nanargmax(np.where(every.verdicts == "disagrees", every.backward_error, np.nan)))
    assert record.representative is not None and record.representative.state == states.as_json(gravest)
    assert record.representative.backward_error == every.backward_error[gravest] and record.representative.is_alone


def test_a_record_without_a_sample_is_of_all_answers() -> None:
    pair = Pair(subject=Subject("mujoco", "mjcf"))
    errors = np.array([1.0, 2.0, 100.0])
    flags = np.zeros(3, dtype=bool)
    pair.add(
        States.at(*np.zeros((3, 3, 2))),
        Comparison(errors, errors, flags, np.array(["agrees", "agrees", "disagrees"]), flags, np.zeros(3)),
    )
    record = record_of(Settings(library=Library.built_in()), Expectations(), SystemProgress("pendulum", {}), pair)
    assert (record.median_backward_error, record.share) == (2.0, 1 / 3)


def test_a_record_tells_whence_its_states_came() -> None:
    """Of a search, those that were asked for and those that were not; what is stored stands first among the rest."""
    pair, flags = Pair(subject=Subject("mujoco", "mjcf"), stored=3), np.zeros(10, dtype=bool)
    for count in (10, 4):
        errors = np.ones(count)
        judged = Comparison(errors, errors, flags[:count], np.full(count, AGREES), flags[:count], np.zeros(count))
        pair.add(States.at(*np.zeros((3, count, 2))), judged)
    pair.found = Found(States.at(*np.zeros((3, 4, 2))), judged, None, added=1)
    record = record_of(Settings(library=Library.built_in()), Expectations(), SystemProgress("pendulum", {}), pair)
    assert record.origins == {"stored": 3, "sampled": 7, "searched": 3, "simplest": 1} and record.states == 14


def test_a_file_that_cannot_be_used_is_no_failure_of_the_engines_that_would_read_it() -> None:
    subjects = [Subject("mujoco", "mjcf"), Subject("pinocchio", "urdf")]
    progress = SystemProgress("pendulum", {str(one): Pair(subject=one) for one in subjects})
    progress.fail("a line is wrong")
    settings = Settings(library=Library.built_in())
    for pair in progress.pairs.values():
        record = record_of(settings, Expectations(), progress, pair)
        assert (record.verdict, record.message, record.failed, pair.refused) == ("error", "a line is wrong", False, True)
    crashed = Pair(subject=subjects[0])
    crashed.fail("it died")
    assert record_of(settings, Expectations(), progress, crashed).failed
