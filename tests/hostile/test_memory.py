"""Memory: a cross-check keeps of each state what the record needs, not the state."""

from __future__ import annotations

import subprocess
import sys
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from catalogue import BUILT_IN
from support import InThisProcess, completed, given_out

from harness.crosscheck import hypothesis_search, stages, superfluous
from harness.crosscheck.run import CrossCheck
from harness.crosscheck.settings import Settings
from harness.truth.compare import Comparison
from harness.truth.sampling import generic_sample
from harness.workers import Outcome, Task

# Bytes for each state of a million, all subjects together.
ALLOWED = 300 * 2**20 / 1e6


def agreement(task: Task) -> Any:
    """What a worker would answer, at once and without an engine: at every state another small error."""
    if task.function is stages.compare_all:
        assignments, states = task.arguments
        errors = np.linspace(0, 1, len(states))
        agrees = np.full(len(states), "agrees")
        answers = (
            stages.Answers(Comparison(errors + 1, errors / 1e16, errors > 9, agrees, errors > 9, 0 * errors), [1e-6]) for _ in assignments
        )
        return 1e-6, 0.0, {str(assignment.subject): answer for assignment, answer in zip(assignments, answers, strict=True)}
    if task.function is hypothesis_search.search:
        assignments, examples, seed, _ = task.arguments
        states = generic_sample(assignments[0].mechanism, examples, seed)
        none = np.zeros(examples, dtype=bool)
        comparison = Comparison(*np.ones((2, examples)), none, np.full(examples, "agrees"), none, np.zeros(examples))
        return {str(assignment.subject): hypothesis_search.Found(states, comparison, None) for assignment in assignments}
    return [] if superfluous.find_superfluous in task.arguments else task.function(*task.arguments, lambda text: None)


class Agreeing(InThisProcess):
    def run(self, tasks: Any, further: Callable[[], Any] = tuple) -> Any:
        return (Outcome(task, value=agreement(task)) for task in given_out(tasks, further))


def cross_check(states: int) -> None:
    study = CrossCheck(Settings(library=BUILT_IN, names=["bar_pendulum"], states=states, examples=None))
    assert {record.states for record in completed(study, Agreeing()).records} == {states}


def peak(states: int) -> int:
    """Most bytes that a cross-check of five subjects allocates at once."""
    tracemalloc.start()
    try:
        cross_check(states)
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


@pytest.mark.ci
def test_memory_hardly_grows_with_the_states() -> None:
    cross_check(6000)
    assert (peak(24_000) - peak(12_000)) / 12_000 < ALLOWED / 4


MEASURED = """
import resource, sys
from harness.cli import main
import harness.api, harness.crosscheck.run, harness.results.records
peak = lambda: resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
before = peak()
try:
    main(["check", "simple_pendulum", "--states", sys.argv[1]])
except SystemExit as end:
    workers = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
    print(end.code, peak() - before, workers, file=sys.stderr)
"""


def measured(states: int, folder: Path) -> list[int]:
    """Exit status, peak resident memory of the harness above its imports, and of its workers in all [KiB]."""
    done = subprocess.run([sys.executable, "-c", MEASURED, str(states)], cwd=folder, capture_output=True, text=True, check=False)
    # What tells of progress stands before.
    return [int(word) for word in done.stderr.splitlines()[-1].split()]


@pytest.mark.nightly
def test_a_million_states_take_300_mebibytes(tmp_path: Path) -> None:
    few, many = (measured(states, tmp_path) for states in (4000, 1_000_000))
    assert few[0] == many[0] == 0
    assert many[1] < 300 * 1024
    assert many[2] - few[2] < 100 * 1024
