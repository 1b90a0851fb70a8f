"""Plugin of pytest that says which tests run a line, what each takes, and which fails: what ``mutation.py`` chooses tests by.

Under ``coverage run``, the context of a line is the node id of the test that runs it, with its fixtures and with the processes that it
starts, those that outlive it included. The names that coverage finds by itself know neither the cases of a test nor its fixtures.
"""

from __future__ import annotations

import json
import os
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from costs import processor_seconds
from coverage import Coverage

# A file that gets a line for each test; a file that holds the node ids that are to be run, the first one first.
OUTCOMES, ORDER = "HARNESS_TEST_OUTCOMES", "HARNESS_TEST_ORDER"
_OUTCOME = pytest.StashKey[dict[str, Any]]()


def save_in_killed_processes() -> None:
    """Have a process that the harness ends by a signal save its coverage before it answers; ``sitecustomize`` of the copy calls this."""
    if "COVERAGE_PROCESS_CONFIG" not in os.environ or "HARNESS_WORKER" not in os.environ:
        return
    write, saved = os.write, 0.0

    def saving(descriptor: int, content: Any) -> int:
        nonlocal saved
        # A worker's sign that its task is done; servers of engines answer thousands of times.
        if (current := Coverage.current()) is not None and (content == b"!" or time.monotonic() > saved + 1.0):
            current.save()
            saved = time.monotonic()
        return write(descriptor, content)

    os.write = saving  # type: ignore[assignment]


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    if ORDER in os.environ:
        places = {name: place for place, name in enumerate(Path(os.environ[ORDER]).read_text(encoding="utf-8").splitlines())}
        items.sort(key=lambda item: places.get(item.nodeid, len(places)))


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    outcome = item.stash[_OUTCOME] = {"test": item.nodeid, "outcome": "passed"}
    if (current := Coverage.current()) is not None:
        current.switch_context(item.nodeid)
        current.config.context = item.nodeid
        os.environ["COVERAGE_PROCESS_CONFIG"] = current.config.serialize()
    # Where the process ends in the middle of it.
    _write({"test": item.nodeid, "outcome": "begun"})
    started = processor_seconds()
    result = yield
    _write({**outcome, "seconds": processor_seconds() - started})
    return result


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_makereport(item: pytest.Item) -> Iterator[None]:
    report = yield
    if report.outcome != "passed" and item.stash[_OUTCOME]["outcome"] != "failed":
        crash = getattr(report.longrepr, "reprcrash", None)
        item.stash[_OUTCOME] |= {"outcome": report.outcome, "words": str(crash.message if crash else report.longrepr)[:300]}
    return report


def _write(outcome: dict[str, Any]) -> None:
    if OUTCOMES in os.environ:
        with Path(os.environ[OUTCOMES]).open("a", encoding="utf-8") as stream:
            print(json.dumps(outcome), file=stream, flush=True)
