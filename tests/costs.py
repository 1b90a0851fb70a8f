"""What tests cost: ``pytest --costs file`` prints the processor seconds of each file of tests, ``--costs test`` those of each test.

The seconds are of the process that runs a test and of all that it started, with setup and teardown, whatever else the machine does.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from contextlib import suppress

import psutil
import pytest

_PROPERTY = "processor seconds"


def processor_seconds() -> float:
    """Processor seconds of this process, of those that it has waited for, and of those that it has begun."""
    this = psutil.Process()
    total = 0.0
    for process in (this, *this.children(recursive=True)):
        with suppress(psutil.NoSuchProcess):
            times = process.cpu_times()
            total += times.user + times.system + times.children_user + times.children_system
    return total


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    item.stash[_STARTED] = processor_seconds()
    return (yield)


_STARTED = pytest.StashKey[float]()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: pytest.CallInfo[None]) -> Iterator[None]:
    report = yield
    if call.when == "teardown":
        report.user_properties.append((_PROPERTY, processor_seconds() - item.stash[_STARTED]))
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
