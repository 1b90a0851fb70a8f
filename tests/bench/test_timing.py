"""Timing: what is measured, when it stops, and what it leaves behind; by a clock that the test moves."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Iterator

import pytest

from harness.bench.costs import measure


class Clock:
    """A clock that stands still but for ``work``."""

    def __init__(self, durations: Iterator[float]) -> None:
        self.now, self.calls, self._durations = 100.0, 0, durations

    def work(self) -> None:
        self.calls += 1
        self.now += next(self._durations)


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Callable[[list[float]], Clock]:
    def make(durations: list[float]) -> Clock:
        # A long run keeps the last duration.
        made = Clock(iter([*durations, *[durations[-1]] * 10_000]))
        monkeypatch.setattr(time, "perf_counter", lambda: made.now)
        return made

    return make


def test_the_warm_up_does_not_count(clock: Callable[[list[float]], Clock]) -> None:
    made = clock([50.0, 1.0, 3.0, 2.0])
    assert measure(made.work, minimum_count=3, minimum_seconds=0.0) == [1.0, 3.0, 2.0]
    assert made.calls == 4


def test_both_minima_are_met(clock: Callable[[list[float]], Clock]) -> None:
    assert len(measure(clock([0.25]).work, minimum_count=2, minimum_seconds=2.0)) == 8
    assert len(measure(clock([0.25]).work, minimum_count=12, minimum_seconds=2.0)) == 12


def test_what_the_function_raises_is_passed_on_and_the_collector_works_again() -> None:
    calls: list[bool] = []

    def fails_when_timed() -> None:
        calls.append(gc.isenabled())
        if len(calls) == 2:
            raise RuntimeError("broken")

    assert gc.isenabled()
    with pytest.raises(RuntimeError, match="broken"):
        measure(fails_when_timed, minimum_count=1, minimum_seconds=0.0)
    assert calls == [True, False]
    assert gc.isenabled()


def test_a_collector_that_was_off_stays_off() -> None:
    gc.disable()
    try:
        measure(lambda: None, minimum_count=1, minimum_seconds=0.0)
        assert not gc.isenabled()
    finally:
        gc.enable()


def test_a_real_clock_sees_real_time() -> None:
    times = measure(lambda: time.sleep(0.01), minimum_count=3, minimum_seconds=0.0)
    assert len(times) == 3 and min(times) >= 0.01
