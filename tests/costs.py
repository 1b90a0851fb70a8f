"""What tests cost: ``pytest --costs file`` prints the processor seconds of each file of tests, ``--costs test`` those of each test.

The seconds are of the process that runs a test and of all that it started, with setup and teardown, whatever else the machine does. Nobody
waits for what outlives the process that started it, as the server of an engine outlives the worker of a command: its seconds are those when
it was last looked at.
"""

from __future__ import annotations

import threading
import time
from collections import defaultdict
from collections.abc import Iterator
from contextlib import suppress

import psutil
import pytest

_PROPERTY = "processor seconds"
LOOK_SECONDS = 0.25
# Of each descendant, by its number and when it began, when it was last looked at.
_SEEN: dict[tuple[int, float], float] = {}


def processor_seconds() -> float:
    """Processor seconds of this process, of those that it has waited for, and of those that it has begun."""
    this = psutil.Process()
    total = 0.0
    for process in (this, *this.children(recursive=True)):
        with suppress(psutil.NoSuchProcess):
            times = process.cpu_times()
            total += times.user + times.system + times.children_user + times.children_system
    return total


def _seen_seconds() -> float:
    """Processor seconds of this process, and of each descendant that was ever seen."""
    this = psutil.Process()
    for process in this.children(recursive=True):
        with suppress(psutil.NoSuchProcess):
            times = process.cpu_times()
            _SEEN[process.pid, process.create_time()] = times.user + times.system
    own = this.cpu_times()
    return own.user + own.system + sum(_SEEN.copy().values())


def _look() -> None:
    while True:
        time.sleep(LOOK_SECONDS)
        _seen_seconds()


def pytest_sessionstart() -> None:
    threading.Thread(target=_look, daemon=True).start()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    item.stash[_STARTED] = processor_seconds(), _seen_seconds()
    return (yield)


_STARTED = pytest.StashKey[tuple[float, float]]()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: pytest.CallInfo[None]) -> Iterator[None]:
    report = yield
    if call.when == "teardown":
        waited, seen = item.stash[_STARTED]
        # The first misses what nobody waits for, the second what ends between two looks.
        report.user_properties.append((_PROPERTY, max(processor_seconds() - waited, _seen_seconds() - seen)))
    return report


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    """The costs of what was run, the dearest first."""
    by_test = config.option.costs == "test"
    costs: dict[str, float] = defaultdict(float)
    for report in (report for reports in terminalreporter.stats.values() for report in reports):
        for name, value in getattr(report, "user_properties", ()):
            if name == _PROPERTY and report.when == "teardown":
                costs[report.nodeid if by_test else report.nodeid.partition("::")[0]] += value
    terminalreporter.section(f"processor seconds by {config.option.costs}")
    for name, value in sorted(costs.items(), key=lambda cost: -cost[1]):
        terminalreporter.write_line(f"{value:9.1f}  {name}")
    terminalreporter.write_line(f"{sum(costs.values()):9.1f}  of {len(costs)} {config.option.costs}s in all")
