"""The verdict of a pair from its answers, and the first failure, which is the one that is told."""

from __future__ import annotations

from collections import Counter

import pytest

from harness.crosscheck.judgement import Pair
from harness.engines import Subject

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
