"""Timing: what is measured, when it stops, and what it leaves behind; by a clock that the test moves."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable

import pytest

from harness.bench.costs import measure

Timed = Callable[..., tuple[list[float], int]]


@pytest.fixture
def timed(monkeypatch: pytest.MonkeyPatch) -> Timed:
    """Times of calls that take so long each, the last over and over, and how many calls there were."""

    def measured(durations: list[float], minimum_count: int, minimum_seconds: float) -> tuple[list[float], int]:
        now, calls = 100.0, 0

        def work() -> None:
            nonlocal now, calls
            now, calls = now + durations[min(calls, len(durations) - 1)], calls + 1

        monkeypatch.setattr(time, "perf_counter", lambda: now)
        return measure(work, minimum_count, minimum_seconds), calls

    return measured


def test_the_warm_up_does_not_count(timed: Timed) -> None:
    assert timed([50.0, 1.0, 3.0, 2.0], 3, 0.0) == ([1.0, 3.0, 2.0], 4)


def test_both_minima_are_met(timed: Timed) -> None:
    assert [len(timed([0.25], count, 2.0)[0]) for count in (2, 12)] == [8, 12]


@pytest.mark.parametrize("is_on", [True, False])
def test_what_the_function_raises_is_passed_on_and_the_collector_is_as_it_was(is_on: bool) -> None:
    calls: list[bool] = []

    def fails_when_timed() -> None:
        calls.append(gc.isenabled())
        if len(calls) == 2:
            raise RuntimeError("broken")

    assert gc.isenabled()
    try:
        if not is_on:
            gc.disable()
        with pytest.raises(RuntimeError, match="broken"):
            measure(fails_when_timed, minimum_count=1, minimum_seconds=0.0)
        assert calls == [is_on, False] and gc.isenabled() == is_on
    finally:
        gc.enable()


def test_a_real_clock_sees_real_time() -> None:
    times = measure(lambda: time.sleep(0.01), minimum_count=3, minimum_seconds=0.0)
    assert len(times) == 3 and min(times) >= 0.01
