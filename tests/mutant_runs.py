"""Runs of pytest for ``mutation.py``: once with coverage and without a mutant, then with each mutant in a copy of the repository."""

from __future__ import annotations

import contextlib
import hashlib
import importlib.util
import json
import math
import os
import resource
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property, partial
from itertools import accumulate
from pathlib import Path
from typing import Any

import covering
from coverage import CoverageData

TESTS = Path(__file__).resolve().parent
# What a mutant may take: so many times the processor seconds of its tests without it, and as many to start. What waits may be waiting for
# a processor, and does so for so many times as long, and as many seconds [s].
TIMES, STARTING, WAITING, AT_LEAST = 4, 30, 10, 600
# How long servers of engines may take to end after the tests [s].
ENDING = 20
# Of pytest: tests failed, their collection was broken off by an error in a file or in a hook, and it was asked for what there is not.
FAILED, BROKEN_OFF, BROKEN_HOOK, NOT_FOUND = 1, 2, 3, 4
IGNORED = shutil.ignore_patterns("__pycache__", ".mypy_cache", ".ruff_cache", ".git", ".venv", ".mutation")


@dataclass(frozen=True)
class Run:
    """What tests made of a mutant.

    Attributes:
        asked: node ids of those that pytest was given. test: the one that failed, or at which pytest ended. said: what it said.
    """

    asked: set[str]
    killed: bool = False
    how: str = ""
    test: str | None = None
    said: str = ""


@dataclass(frozen=True)
class Recording:
    """The tests of a stage without any mutant: processor seconds of those that passed, and what lines each runs."""

    root: Path
    repository: Path
    _known: dict[Path, dict[int, list[str]]] = field(default_factory=dict)

    @property
    def machine_code(self) -> Path:
        """The folder of what the tests compiled."""
        return self.root / "machine_code"

    @cached_property
    def seconds(self) -> dict[str, float]:
        outcomes = [json.loads(line) for line in (self.root / "outcomes").read_text(encoding="utf-8").splitlines()]
        return {one["test"]: one["seconds"] for one in outcomes if one["outcome"] == "passed"}

    @cached_property
    def _data(self) -> CoverageData:
        data = CoverageData(str(self.root / "coverage"))
        data.read()
        return data

    def tests_of(self, path: Path, line: int | None) -> dict[str, float]:
        """Seconds of tests, the likeliest to see a change first: those that run its line, none where that runs at import, by what they
        cost; those in the same files, which share fixtures with them; those that run anything of its module, or lie in a file that names
        it; and, of a line that runs before any test, those that run anything of its folder."""
        module, by_line = _module(path, self.repository), self._by_line(path)
        contexts = by_line.get(line, []) if line else [""]
        files = {_file(test) for test in contexts} if line else set()
        touching = {test for test in self.seconds if module in _text(self.repository / _file(test))}.union(*by_line.values())
        folder = path.parent.glob("*.py") if "" in contexts else ()
        beside = {test for one in folder for tests in self._by_line(one).values() for test in tests}
        parts = (contexts if line else [], {test for test in self.seconds if _file(test) in files}, touching, beside)
        return {test: self.seconds[test] for part in parts for test in in_order(self._passed(part))}

    def _by_line(self, path: Path) -> dict[int, list[str]]:
        if path not in self._known:
            measured = [name for name in self._data.measured_files() if name.endswith(f"/{_in_package(path)}")]
            self._known[path] = self._data.contexts_by_lineno(measured[0]) if measured else {}
        return self._known[path]

    def _passed(self, tests: Iterable[str]) -> dict[str, float]:
        return {test: self.seconds[test] for test in tests if test in self.seconds}


def recorded(repository: Path, results: Path, tests: str, modules: list[Path]) -> Recording:
    """The recording of a stage; made anew where modules that are to be changed are others than those that it was made of.

    Raises:
        SystemExit: pytest could not run the tests.
    """
    root = results / digest(tests)[:12]
    made_of = root / "made_of.json"
    sources = {_in_package(path): digest(path.read_text(encoding="utf-8")) for path in modules}
    if made_of.exists() and sources.items() <= json.loads(made_of.read_text()).items():
        return Recording(root, repository)
    shutil.rmtree(root, ignore_errors=True)
    root.mkdir(parents=True)
    with Copy(repository) as copy:
        status = copy.pytest(shlex.split(tests), root, "-m", "coverage", "run", "--data-file", str(root / "coverage"))
        if status not in (0, FAILED):
            raise SystemExit(f"pytest {tests}: status {status} without any mutant; {root / 'output'} says why")
        combine = [sys.executable, "-m", "coverage", "combine", "-q", "--data-file", str(root / "coverage")]
        subprocess.run(combine, cwd=copy.root, check=True, env=copy.environment)
        (root / "machine_code").mkdir()
        for file in (copy.root / ".cache" / "machine_code").glob("*"):
            shutil.copy(file, root / "machine_code")
        every = {_in_package(path): digest(path.read_text(encoding="utf-8")) for path in (repository / "harness").rglob("*.py")}
    made_of.write_text(json.dumps(every))
    return Recording(root, repository)


@dataclass
class Copy:
    """A copy of a repository in which one module at a time is another.

    Attributes:
        machine_code: the folder that a run begins with a copy of, None for none.
    """

    repository: Path
    machine_code: Path | None = None
    _stack: contextlib.ExitStack = field(default_factory=contextlib.ExitStack)

    def __enter__(self) -> Copy:
        self.root = Path(self._stack.enter_context(tempfile.TemporaryDirectory())).resolve()
        for path in self.repository.iterdir():
            if path.name in ("benchmarks", "harness", "tests"):
                shutil.copytree(path, self.root / path.name, ignore=IGNORED)
            elif path.name not in IGNORED(str(self.repository), [path.name]):
                (self.root / path.name).symlink_to(path)
        hook = self.root / ".hook"
        hook.mkdir()
        (hook / "sitecustomize.py").write_text("import covering\n\ncovering.save_in_killed_processes()\n")
        search = os.pathsep.join(map(str, (self.root, hook, TESTS)))
        self.environment = os.environ | {"PYTHONPATH": search, "HARNESS_CACHE": str(self.root / ".cache")}
        # Options of the run that this one is part of are not for the tests of a mutant, which may not know them.
        for name in ("HEYOKA_CACHE_DIR", "PYTEST_ADDOPTS"):
            self.environment.pop(name, None)
        return self

    def __exit__(self, *exception: object) -> None:
        self._stack.close()

    @contextlib.contextmanager
    def with_text(self, path: Path, text: str) -> Iterator[None]:
        self._place, self._changed = self.root / path.relative_to(self.repository), _module(path, self.repository)
        self._original = self._place.read_bytes()
        self._write(text.encode())
        try:
            yield
        finally:
            self._write(self._original)

    def _write(self, content: bytes) -> None:
        """Write the module. Python takes the code of another mutant of the same second and length for its own, where that is cached."""
        self._place.write_bytes(content)
        Path(importlib.util.cache_from_source(str(self._place))).unlink(missing_ok=True)

    def run(self, tests: Mapping[str, float], budget: float) -> Run:
        """Run tests of which the processor seconds are known, in their order, until one fails; as many as the budget allows."""
        if not tests:
            return Run(set())
        chosen = [test for test, sum_ in zip(tests, accumulate(tests.values()), strict=True) if sum_ <= budget] or list(tests)[:1]
        with tempfile.TemporaryDirectory() as folder:
            results = Path(folder)
            (results / "order").write_text("\n".join(chosen), encoding="utf-8")
            (results / "arguments").write_text("\n".join(chosen), encoding="utf-8")
            limit = TIMES * sum(tests[test] for test in chosen) + STARTING
            try:
                status = self.pytest(["-x", f"@{results / 'arguments'}"], results, seconds=limit)
                if status == NOT_FOUND:
                    # Pytest runs nothing where it lacks one of the names, as those of a file that cannot be collected.
                    (results / "arguments").write_text("\n".join(dict.fromkeys(map(_file, chosen))), encoding="utf-8")
                    collected = self.pytest(["--collect-only", f"@{results / 'arguments'}"], results, seconds=limit)
                    status = BROKEN_OFF if collected == BROKEN_OFF else NOT_FOUND
                    there = set(_text(results / "output").splitlines())
                    if not collected and (left := [test for test in chosen if test in there]):
                        chosen = left
                        (results / "arguments").write_text("\n".join(chosen), encoding="utf-8")
                        status = self.pytest(["-x", f"@{results / 'arguments'}"], results, seconds=limit)
            except subprocess.TimeoutExpired:
                return Run(set(chosen), how="waits without end")
            outcomes = [json.loads(line) for line in _text(results / "outcomes").splitlines()]
            last = outcomes[-1] if outcomes else {}
            killed, how = self._how(status, results)
        return Run(set(chosen), killed, how, last.get("test"), last.get("words", ""))

    def _how(self, status: int, results: Path) -> tuple[bool, str]:
        """Whether the end of pytest kills, and how."""
        if status in (-signal.SIGXCPU, -signal.SIGKILL):
            return True, "processor limit"
        if status < 0:
            return True, f"crash by {signal.Signals(-status).name}"
        if status in (0, FAILED):
            return status == FAILED, "test fails" if status else ""
        if status in (BROKEN_OFF, BROKEN_HOOK) and self._collects_without(results):
            return True, "tests cannot be collected"
        loads = subprocess.run([sys.executable, "-c", f"import {self._changed}"], cwd=self.root, env=self.environment, capture_output=True)
        if loads.returncode:
            return True, "module cannot be imported"
        lines = _text(results / "output").strip().splitlines() or [""]
        return False, f"pytest ended with status {status}: {lines[-1]}"

    def _collects_without(self, results: Path) -> bool:
        """Whether the tests can be collected in the module as it was."""
        mutant = self._place.read_bytes()
        self._write(self._original)
        try:
            return self.pytest(["--collect-only", f"@{results / 'arguments'}"], results) == 0
        finally:
            self._write(mutant)

    def pytest(self, arguments: list[str], results: Path, *before: str, seconds: float | None = None) -> int:
        """The exit status of pytest, of which ``results`` gets the output and a line for each test.

        Raises:
            TimeoutExpired: it waits much longer than it may work.
        """
        cache = self.root / ".cache"
        shutil.rmtree(cache, ignore_errors=True)
        if self.machine_code is not None:
            shutil.copytree(self.machine_code, cache / "machine_code")
        words = [sys.executable, *(before or ()), "-m", "pytest", "-p", "covering", "-n", "0", "-q", "-p", "no:cacheprovider"]
        words += ["--basetemp", str(self.root / ".temporary"), "--hypothesis-profile=ci", *arguments]
        environment = {**self.environment, covering.OUTCOMES: str(results / "outcomes")}
        if (results / "order").exists():
            environment[covering.ORDER] = str(results / "order")
        limit = partial(resource.setrlimit, resource.RLIMIT_CPU, (int(seconds), int(seconds) + 5)) if seconds else None
        with (
            (results / "output").open("wb") as output,
            subprocess.Popen(
                words, cwd=self.root, env=environment, stdout=output, stderr=output, preexec_fn=limit, start_new_session=True
            ) as process,
        ):
            try:
                status = process.wait(max(WAITING * seconds, AT_LEAST) if seconds else None)
                # Servers of engines save their coverage when they find that nobody asks them any more.
                last = time.monotonic() + ENDING
                while not seconds and _is_alive(process.pid) and time.monotonic() < last:
                    time.sleep(0.1)
                return status
            finally:
                with contextlib.suppress(ProcessLookupError):
                    os.killpg(process.pid, signal.SIGKILL)


def in_order(seconds: Mapping[str, float]) -> list[str]:
    """Node ids, cheapest first; of those that cost about the same, the ones in a file together, as they share fixtures."""
    return sorted(seconds, key=lambda test: (round(math.log10(max(seconds[test], 0.01))), _file(test)))


def _is_alive(group: int) -> bool:
    """Whether a process group has a process left."""
    try:
        os.killpg(group, 0)
    except ProcessLookupError:
        return False
    return True


def digest(*values: Any) -> str:
    """A name of values; of a folder that is a repository, of the package and the tests in it."""
    found = hashlib.sha256()
    for value in values:
        if isinstance(value, Path):
            for path in sorted(file for room in ("harness", "tests") for file in (value / room).rglob("*") if file.suffix in _SOURCES):
                found.update(f"{path.relative_to(value)}\0".encode() + hashlib.sha256(path.read_bytes()).digest())
        else:
            found.update(f"{value}\0".encode())
    return found.hexdigest()[:24]


_SOURCES = (".py", ".xml", ".urdf", ".toml", ".txt", ".html", ".js", ".json")


def _in_package(path: Path) -> str:
    """The path of a module from its package on, whatever repository or copy of it that lies in."""
    parts = path.parts
    return "/".join(parts[len(parts) - 1 - parts[::-1].index("harness") :])


def _module(path: Path, repository: Path) -> str:
    return ".".join(path.relative_to(repository).with_suffix("").parts).removesuffix(".__init__")


def _file(test: str) -> str:
    return test.partition("::")[0]


def _text(path: Path) -> str:
    return path.read_text(encoding="utf-8", errors="replace") if path.exists() else ""
