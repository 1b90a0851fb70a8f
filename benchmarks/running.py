"""Processes that measure suites, of this state of the code or of another one."""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import msgspec

from benchmarks.benchmark import chosen, suites
from benchmarks.history import REPOSITORY, Measured


def measure_suite(suite: str, names: Sequence[str], most_rounds: int | None, tree: Path, say: Callable[[str], None]) -> list[Measured]:
    """Measure benchmarks of a suite in a process of its own, whose code is that in ``tree``.

    A benchmark that raises, or at which the process dies, is a failure with its last words; those after it have none.
    """
    found: dict[str, Measured] = {}
    command = [sys.executable, "-m", "benchmarks.running", json.dumps([suite, list(names), most_rounds])]
    environment = {**os.environ, "PYTHONPATH": str(tree), "PYTHONUNBUFFERED": "1"}
    with tempfile.TemporaryFile() as said:
        with subprocess.Popen(command, cwd=tree, env=environment, stdout=subprocess.PIPE, stderr=said) as process:
            assert process.stdout is not None
            for line in process.stdout:
                measured = msgspec.json.decode(line, type=Measured)
                found[measured.name] = measured
                say(measured.name)
        said.seek(0)
        words = said.read().decode(errors="replace").strip().splitlines()
    lost = f"its process ended with status {process.returncode}: {words[-1] if words else 'without a word'}"
    return [found.get(name) or Measured(name, failure=lost) for name in names]


def measure(patterns: Sequence[str], most_rounds: int | None, trees: Sequence[Path], say: Callable[[str], None]) -> list[list[Measured]]:
    """What is measured of each tree: suites in turns, so that all trees meet the same machine, half of the rounds forth and half back."""
    answers: list[list[Measured]] = [[] for _ in trees]
    for suite in suites():
        names = [benchmark.name for benchmark in chosen(patterns, suite)]
        if not names:
            continue
        gathered = [measure_suite(suite, names, most_rounds, tree, say) for tree in trees]
        if len(trees) > 1:
            again = [measure_suite(suite, names, most_rounds, tree, say) for tree in reversed(trees)]
            gathered = [list(map(_joined, first, second)) for first, second in zip(gathered, reversed(again), strict=True)]
        for answer, measured in zip(answers, gathered, strict=True):
            answer += measured
    return answers


def _joined(first: Measured, second: Measured) -> Measured:
    """The rounds of both."""
    if first.failure or second.failure:
        return first if first.failure else second
    return msgspec.structs.replace(first, values=first.values + second.values, besides=first.besides + second.besides)


@contextlib.contextmanager
def checkout(commit: str) -> Iterator[Path]:
    """A folder with the code at ``commit`` and today's benchmarks.

    Raises:
        subprocess.CalledProcessError: git does not know the commit.
    """
    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder, "tree")
        git = ["git", "-C", str(REPOSITORY), "worktree"]
        subprocess.run([*git, "add", "--quiet", "--detach", str(tree), commit], check=True, capture_output=True, text=True)
        try:
            shutil.rmtree(tree / "benchmarks", ignore_errors=True)
            shutil.copytree(REPOSITORY / "benchmarks", tree / "benchmarks", ignore=shutil.ignore_patterns("__pycache__"))
            yield tree
        finally:
            subprocess.run([*git, "remove", "--force", str(tree)], check=False, capture_output=True)


def _answer(suite: str, names: Sequence[str], most_rounds: int | None) -> None:
    """Print what each benchmark measures as a line of JSON."""
    for benchmark in chosen(names, suite):
        try:
            measured = benchmark.measured(most_rounds)
        except Exception as error:
            measured = Measured(benchmark.name, failure=f"{type(error).__name__}: {error}".splitlines()[0])
        print(msgspec.json.encode(measured).decode(), flush=True)


if __name__ == "__main__":
    _answer(*json.loads(sys.argv[1]))
