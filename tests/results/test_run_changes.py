"""Two runs held against each other: each kind of change is told, and what is worse counts."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from support_results import RECORD

from harness.results.records import Record
from harness.results.trend import RunChange, run_changes

GOOD = replace(
    RECORD, verdict="agrees", backward_error=2.0, message="", median_backward_error=1.2, median_bounds=[1.17, 1.23],
    percentile_99_backward_error=1.9, percentile_99_bounds=[1.8, 2.0], fastest_seconds_per_state=1e-6,
)  # fmt: skip
OTHERS = [replace(GOOD, system=f"system_{place}") for place in range(5)]


def changed(now: Record | None, before: Record | None = GOOD) -> list[RunChange]:
    first, second = ([*OTHERS, *([one] if one is not None else [])] for one in (before, now))
    found = run_changes(first, second)
    assert {one.system for one in found} <= {"arm_2r"}
    return found


def test_one_run_twice_has_no_changes() -> None:
    assert changed(GOOD) == []
    assert run_changes([], []) == []


@pytest.mark.parametrize(
    ("fields", "what", "is_worse"),
    [
        ({"verdict": "disagrees"}, ["verdict"], True),
        ({"verdict": "unstable", "expected": "unstable"}, ["verdict"], True),
        ({"verdict": "misreads", "expected": "misreads"}, ["verdict"], True),
        ({"verdict": "agrees", "expected": "unstable"}, ["verdict"], True),
        ({"expected_median_backward_error": 1.0}, ["verdict"], True),
        ({"median_backward_error": 2.4, "median_bounds": [2.34, 2.46]}, ["median backward error"], True),
        ({"median_backward_error": 0.6, "median_bounds": [0.58, 0.62]}, ["median backward error"], False),
        ({"median_backward_error": 1.3, "median_bounds": [1.27, 1.33]}, [], False),
        # A sample that is so small may have another median.
        ({"median_backward_error": 2.4, "median_bounds": [1.0, 4.0]}, [], False),
        ({"backward_error": 60.0}, ["worst backward error"], False),
        ({"backward_error": 4.0}, [], False),
        ({"message": "12 of 300 answers are not finite."}, ["message"], False),
        ({"fastest_seconds_per_state": 3e-6}, ["time per state"], False),
        ({"fastest_seconds_per_state": 1.5e-6}, [], False),
    ],
)
def test_each_change_is_told(fields: dict[str, Any], what: list[str], is_worse: bool) -> None:
    found = changed(replace(GOOD, **fields))
    assert [one.what for one in found] == what
    assert any(one.is_worse for one in found) == is_worse


def test_what_becomes_better_is_not_worse() -> None:
    bad = replace(GOOD, verdict="disagrees", backward_error=1e9)
    found = changed(GOOD, before=bad)
    assert [(one.what, one.before, one.now) for one in found if one.what == "verdict"] == [
        ("verdict", "disagrees (expected agrees)", "agrees")
    ]
    assert not any(one.is_worse for one in found)


def test_what_came_and_went_is_told() -> None:
    assert [(one.what, one.is_worse) for one in changed(None)] == [("went", False)]
    assert [(one.what, one.is_worse) for one in changed(GOOD, before=None)] == [("came", False)]
    assert [(one.what, one.is_worse) for one in changed(replace(GOOD, verdict="error"), before=None)] == [("came", True)]


def test_the_numbers_of_a_message_are_no_change() -> None:
    first, second = (replace(GOOD, message=f"accelerations are {size} of their size from rigid ones") for size in ("0.014", "1.5e-2"))
    assert changed(second, before=first) == []


def test_a_slower_machine_is_no_change() -> None:
    slower = [replace(one, fastest_seconds_per_state=5e-6) for one in OTHERS]
    assert run_changes(OTHERS, slower) == []


def test_quantities_are_told_apart() -> None:
    reactions = replace(GOOD, quantity="reactions")
    [found] = changed(replace(reactions, verdict="disagrees"), before=reactions)
    assert found.subject == "mujoco/mjcf reactions"
