"""What several test files use beside fixtures: small libraries, workers without processes, pages taken apart."""

from __future__ import annotations

import base64
import contextlib
import functools
import gzip
import io
import json
import os
import posixpath
import re
import shutil
import signal
import subprocess
import sys
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import msgspec
import pytest
import sympy as sp
from catalogue import BUILT_IN
from click.testing import CliRunner

from harness.cli import main
from harness.crosscheck import assignment
from harness.crosscheck.run import CrossCheck
from harness.crosscheck.settings import Settings
from harness.engines import files
from harness.lagrange.equations import EquationsOfMotion
from harness.library import MODEL_SUFFIXES
from harness.programs.program import StraightLineProgram
from harness.results.records import ACCELERATIONS, Record
from harness.storage import Kept, cache_directory
from harness.study import Study, complete
from harness.workers import Outcome, SchedulerLost, Task, Workers

_ENGINE = """
import ctypes, math, os, subprocess, sys, time
import numpy as np

class Model:
    def loaded(self):
        return None

    def forward_dynamics(self, q, v, tau):
        {answer}

from harness.engines import Engine

class Engine(Engine):
    {requires}
    formats = ("mjcf",)

    def load(self, source, joints, gravity):
        return Model()

{top}
ENGINE = Engine()
"""


def is_zero(expression: sp.Expr) -> bool:
    """Whether a quotient of polynomials in sines, cosines and anything else is zero wherever it is defined.

    A sine or cosine is a sum of two exponentials, and that of a sum of angles is a product of powers: what is left is a
    polynomial in powers of the angles' exponentials, which is zero exactly where all of its coefficients are. SymPy's own
    rules, which take longer, are asked only where roots or tangents leave something.
    """
    numerator = sp.sympify(expression).together().as_numer_denom()[0]
    exponentials = {function: _by_exponentials(function) for function in numerator.atoms(sp.sin, sp.cos)}
    return bool(sp.expand(numerator.xreplace(exponentials)) == 0 or sp.simplify(expression) == 0)


def _by_exponentials(function: sp.Expr) -> sp.Expr:
    """A sine or cosine by exp(i angle) of each of the angles that it takes the sum of; they stand as symbols."""
    turn = sp.S.One
    for angle, factor in sp.expand(function.args[0]).as_coefficients_dict().items():
        turn *= sp.exp(sp.I * factor * angle) if angle.is_number else sp.Symbol(f"exp(i {angle})") ** factor
    return (turn + 1 / turn) / 2 if isinstance(function, sp.cos) else (turn - 1 / turn) / (2 * sp.I)


def energy_function(equations: EquationsOfMotion) -> sp.Expr:
    """Jacobi's energy function h = sum v dL/dv - L [J]; T + V where T is quadratic in the rates."""
    lagrangian = equations.kinetic - equations.potential
    return sum((v * lagrangian.diff(v) for v in equations.rates), sp.S.Zero) - lagrangian


def linearised(
    equations: EquationsOfMotion, equilibrium: Mapping[sp.Symbol, float] | None = None
) -> tuple[sp.Matrix, sp.Matrix, sp.Matrix]:
    """(M0, D0, K0) of M0 x'' + D0 x' + K0 x = 0 about a configuration at rest.

    ``equilibrium`` maps coordinate symbols to values; those left out are 0. D0 holds dampers and
    gyroscopic terms, K0 gravity and springs. That the configuration is one of rest is the caller's
    claim; a right-hand side that does not vanish there is not an error here.
    """
    values = dict.fromkeys((*equations.coordinates, *equations.rates), 0) | dict(equilibrium or {})
    residual = -equations.right_hand_side
    damping = residual.jacobian(list(equations.rates))
    stiffness = residual.jacobian(list(equations.coordinates))
    mass, damping, stiffness = (matrix.subs(values).applyfunc(sp.simplify) for matrix in (equations.mass_matrix, damping, stiffness))
    return mass, damping, stiffness


def program_from(data: Any) -> StraightLineProgram:
    """A program out of plain data, read as that of a mechanism in the cache is; ``msgspec.to_builtins`` writes it."""
    return msgspec.convert(data, StraightLineProgram).checked()


_CHANGED = """
import os, time
import numpy as np
from harness.engines.adapters.mujoco import MujocoEngine

class Engine(MujocoEngine):
    formats = ("mjcf",)

    def load(self, source, joints, gravity):
        model = super().load(source, joints, gravity)
        exact, random, kept = model.{method}, np.random.default_rng(1), []
        def answer({arguments}):
            {body}
            return exact({arguments})
        model.{method} = answer
        return model

ENGINE = Engine()
"""


def changed_engine(body: str, method: str = "forward_dynamics", arguments: str = "q, v, tau") -> str:
    """The file of MuJoCo with a method that does ``body``, in which ``exact`` is its own; without a return it answers as that does."""
    return _CHANGED.format(body=body, method=method, arguments=arguments)


# A mass matrix that is too large by 1e-9, and right accelerations.
HEAVY_ENGINE = changed_engine("return exact(q) * (1 + 1e-9)", "mass_matrix", "q")


def records_of(document: Path, quantity: str = ACCELERATIONS) -> list[dict[str, Any]]:
    """The records of one quantity in the JSON of a cross-check or report."""
    return [record for record in json.loads(document.read_text())["records"] if record["quantity"] == quantity]


def make_library(root: Path, names: Iterable[str], engines: Mapping[str, str] | None = None) -> Path:
    """A library in ``root`` with copies of built-in mechanisms, and with engine files of the given sources; its path."""
    for folder in ("systems", *MODEL_SUFFIXES, *(["engines"] if engines else [])):
        (root / folder).mkdir(parents=True)
    for name in names:
        shutil.copy(BUILT_IN.system_path(name), root / "systems")
        for model_format in MODEL_SUFFIXES:
            shutil.copy(BUILT_IN.model_path(name, model_format), root / model_format)
    for name, source in (engines or {}).items():
        (root / "engines" / f"{name}.py").write_text(source)
    return root


def expected_entry(system: str, subject: str, verdict: str, backward_error: float) -> str:
    """An entry of a library's expected verdicts, as text."""
    about = f"subject = {json.dumps(subject)}\nverdict = {json.dumps(verdict)}\nbackward_error = {backward_error}"
    about += "\nmedian_backward_error = inf\nshare = 1.0" if verdict in ("unstable", "misreads", "disagrees") else ""
    return f'[[expected]]\nsystem = {json.dumps(system)}\n{about}\nreason = "planted"\nlink = "here"\n'


def cache_with_mechanisms(folder: Path) -> Path:
    """A new cache at ``folder``, for environments of its own, that shares with the current one what is derived of mechanisms."""
    folder.mkdir(parents=True)
    for name in ("mechanisms", "sobol"):
        shared = cache_directory() / name
        shared.mkdir(parents=True, exist_ok=True)
        (folder / name).symlink_to(shared.resolve())
    return folder


@functools.cache
def environment_in(cache: Path, engine: str) -> Path:
    """A cache that then holds an environment of an engine."""
    if not any((cache / "environments").glob(f"{engine}@*/environment.json")):
        words = [sys.executable, "-m", "harness", "engines", "add", engine]
        variables = {**os.environ, "HARNESS_CACHE": str(cache)}
        done = subprocess.run(words, capture_output=True, text=True, cwd=cache, env=variables, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
    return cache


def engine_source(answer: str = "return np.zeros_like(v)", top: str = "", requires: str = 'requires = ("numpy", "numpy")') -> str:
    """An engine file that does ``top`` at import, and whose ``forward_dynamics(q, v, tau)`` has the body ``answer``."""
    return _ENGINE.format(answer=answer, top=top, requires=requires)


def given_out(tasks: Iterable[Task], further: Callable[[], Iterable[Task]]) -> Iterator[Task]:
    """The tasks one by one, and after each those that its outcome made possible."""
    waiting = deque(tasks)
    while waiting:
        yield waiting.popleft()
        waiting.extend(further())


def call_engines_here(monkeypatch: pytest.MonkeyPatch) -> None:
    """Have the harness's own engines called in this process, where a test can patch them."""
    engine_of = files._engine_of
    monkeypatch.setattr(files, "_engine_of", lambda library, name: engine_of(replace(library, calls_engines_here=True), name))
    monkeypatch.setattr(assignment, "_MODELS", Kept(64))


class InThisProcess(Workers):
    """Runs tasks here and now, for engines that do not crash."""

    def __enter__(self) -> InThisProcess:
        return self

    def __exit__(self, *exception: object) -> None:
        pass

    def __len__(self) -> int:
        return 1

    def run(self, tasks: Iterable[Task], further: Callable[[], Iterable[Task]] = tuple) -> Iterator[Outcome]:
        for task in given_out(tasks, further):
            try:
                yield Outcome(task, value=task.function(*task.arguments, lambda text: None))
            except Exception as error:
                yield Outcome(task, exception=error)


def losing_after(answers: int) -> type[Workers]:
    """Workers of this process, of which a cluster gives so many answers and is gone."""

    class Losing(InThisProcess):
        def run(self, tasks: Iterable[Task], further: Callable[[], Iterable[Task]] = tuple) -> Iterator[Outcome]:
            for number, outcome in enumerate(super().run(tasks, further)):
                if self.scheduler is not None and number == answers:
                    raise SchedulerLost(f"the scheduler at {self.scheduler.address} is gone")
                yield outcome

    return Losing


@dataclass(frozen=True)
class Done:
    """What became of a command: exit status, standard output and standard error."""

    returncode: int
    stdout: str
    stderr: str


def harness(*arguments: str, cwd: Path | None = None, isolated: bool = False) -> Done:
    """A ``harness`` command in this process, its tasks too unless ``isolated``; ``harness_in_a_process`` runs the real thing."""
    with pytest.MonkeyPatch.context() as patch:
        if not isolated:
            patch.setattr("harness.workers.Workers", InThisProcess)
        patch.setattr("sys.argv", ["harness", *arguments])
        if cwd is not None:
            patch.chdir(cwd)
        result = CliRunner().invoke(main, arguments)
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return Done(result.exit_code, result.stdout, result.stderr)


def harness_in_a_process(*arguments: str, cwd: Path | None = None, timeout: float = 600) -> subprocess.CompletedProcess[str]:
    """A ``harness`` command as users run it; one that hangs ends after ``timeout`` [s]."""
    command = [sys.executable, "-m", "harness", *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=timeout, cwd=cwd, check=False)


@contextlib.contextmanager
def heeding_interrupts() -> Iterator[None]:
    """Processes that start meanwhile heed interrupts, which what a shell without job control starts in the background ignores.

    A function that runs in the child instead would make it a copy of this process, for which memory may be lacking.
    """
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def pytest_in_this_process(*arguments: str, cwd: Path) -> Done:
    """pytest within this one, as if no other were about, with ``InThisProcess`` for its workers."""
    output, errors = io.StringIO(), io.StringIO()
    with pytest.MonkeyPatch.context() as patch, contextlib.redirect_stdout(output), contextlib.redirect_stderr(errors):
        patch.setattr("harness.workers.Workers", InThisProcess)
        patch.chdir(cwd)
        for variable in [name for name in os.environ if name.startswith("PYTEST_")]:
            patch.delenv(variable)
        # In the end it collects garbage five times, through all objects of this process too.
        plain = ["-p", "no:cacheprovider", "-p", "no:unraisableexception", "--capture=no"]
        status = pytest.main([*plain, *arguments])
    return Done(int(status), output.getvalue(), errors.getvalue())


def without_progress(errors: str) -> str:
    """Standard error without the lines that tell, on a busy machine, how far long work is."""
    return re.sub(r"^harness: [^:\n]+: \d+ of \d+ after \d+ s.*\n", "", errors, flags=re.MULTILINE)


@dataclass
class Stage:
    """Stands in for ``Workers``: remembers the rounds of tasks and with what it was made, and answers from ``answers``."""

    answers: Callable[[Task], Outcome]
    rounds: list[list[Task]] = field(default_factory=list)
    made_with: list[dict[str, Any]] = field(default_factory=list)

    def __call__(
        self, count: int | None = None, scheduler: str | None = None, time_limit: float = 0.0, memory_limit: int | None = None
    ) -> Stage:
        self.made_with.append({"count": count, "time_limit": time_limit})
        return self

    def __enter__(self) -> Stage:
        return self

    def __exit__(self, *exception: object) -> None:
        pass

    @property
    def tasks(self) -> list[Task]:
        return [task for tasks in self.rounds for task in tasks]

    def run(self, tasks: Iterable[Task], further: Callable[[], Iterable[Task]] = tuple) -> Iterator[Outcome]:
        def noted() -> list[Task]:
            if round_of_tasks := list(further()):
                self.rounds.append(round_of_tasks)
                _note_where(round_of_tasks)
            return round_of_tasks

        self.rounds.append(list(tasks))
        _note_where(self.rounds[-1])
        for task in given_out(self.rounds[-1], noted):
            yield self.answers(task)


def where(task: Task) -> tuple[Any, ...]:
    """The arguments of the inquiry that asks a task."""
    _note_where([task])
    return _WHERE[task]


# By task, as an inquiry that has ended has no arguments any more.
_WHERE: dict[Task, tuple[Any, ...]] = {}


def _note_where(tasks: Iterable[Task]) -> None:
    for task in tasks:
        inquiry = getattr(task.key[0], "inquiry", None)
        if task not in _WHERE and inquiry is not None:
            frame = inquiry.gi_frame
            _WHERE[task] = tuple(frame.f_locals[name] for name in frame.f_code.co_varnames[1 : frame.f_code.co_argcount])


def completed(study: Study, workers: Any) -> Any:
    """The result of a study after it has run to the end."""
    return complete(study, workers)


def cross_checked(settings: Settings, workers: Any = None) -> tuple[list[Record], CrossCheck]:
    """Every record of a cross-check, by default in this process, and the cross-check."""
    study = CrossCheck(settings)
    records: list[Record] = list(completed(study, workers or InThisProcess()).records)
    assert len(records) == study.steps
    return records, study


def charts_of(source: str) -> str:
    """The script that draws the charts of a page, unpacked."""
    packed = re.findall(r'class="packed">([^<]*)<', source)
    return "".join(gzip.decompress(base64.b64decode(script)).decode() for script in packed)


def pages_of(files: Mapping[str, str]) -> dict[str, str]:
    """The pages of a report by their addresses."""
    return {name: text for name, text in files.items() if name.endswith(".html")}


def site_of(files: Mapping[str, str]) -> Page:
    """Everything that all pages of a report say, as if it stood on one."""
    return Page("".join(pages_of(files).values()))


def written_site(folder: Path) -> Page:
    """The same of a report that was written into a folder."""
    return Page("".join(path.read_text() for path in sorted(folder.rglob("*.html"))))


def missing(files: Mapping[str, str]) -> list[tuple[str, str]]:
    """What a page fetches from elsewhere, or links to and is not there: (page, address)."""
    pages = {name: Page(text) for name, text in pages_of(files).items()}
    found = []
    for name, page in pages.items():
        for address in [*page.fetched, *(link for link in page.links if not link.startswith(("http:", "https:")))]:
            target, _, place = address.partition("#")
            path = posixpath.normpath(posixpath.join(posixpath.dirname(name), target)) if target else name
            if path not in files or (place and path in pages and place not in pages[path].identifiers):
                found.append((name, address))
    return found


class Page(HTMLParser):
    """What a page would fetch, its visible text as it stands and as words, its styles, its anchors, and the links to them."""

    def __init__(self, source: str) -> None:
        super().__init__()
        self.fetched: list[str] = []
        self.links: list[str] = []
        self.identifiers: list[str] = []
        self.tags: list[str] = []
        self.styles = self.text = ""
        self._inside = ""
        self.feed(source)
        self.words = " ".join(self.text.split())

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self._inside = tag
        self.tags.append(tag)
        for name, value in attrs:
            if name in {"src", "srcset", "data", "poster", "background", "action"} or (name == "href" and tag != "a"):
                self.fetched.append(value or "")
            if name == "href" and tag == "a":
                self.links.append(value or "")
            if name == "id":
                self.identifiers.append(value or "")

    def handle_endtag(self, tag: str) -> None:
        self._inside = ""

    def handle_data(self, data: str) -> None:
        if self._inside == "style":
            self.styles += data
        elif self._inside != "script":
            self.text += data
