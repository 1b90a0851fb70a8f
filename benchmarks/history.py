"""Runs of benchmarks as they are stored: one line of JSON each, appended to a text file."""

from __future__ import annotations

import datetime
import importlib.metadata
import os
import platform
import subprocess
from collections.abc import Iterable
from pathlib import Path

import msgspec

REPOSITORY = Path(__file__).resolve().parents[1]
HISTORY = REPOSITORY / "reports" / "benchmarks.jsonl"
DISTRIBUTIONS = ("numpy", "sympy", "mujoco", "pin", "python-flint", "llvmlite", "heyoka")


class Measured(msgspec.Struct, omit_defaults=True):
    """Rounds of one benchmark.

    Attributes:
        values: of each round, in ``unit``. besides: of what was measured in turns with it.
        most: bar on the ratio. failure: why nothing was measured.
    """

    name: str
    values: list[float] = []
    besides: list[float] = []
    unit: str = "s"
    beside: str = ""
    most: float | None = None
    failure: str = ""

    @property
    def ratio(self) -> float:
        """Least value over the least beside it: a neighbour on the machine makes single rounds longer, and none shorter."""
        return min(self.values) / min(self.besides)

    @property
    def ratios(self) -> list[float]:
        """The ratio of each round."""
        return [value / beside for value, beside in zip(self.values, self.besides, strict=True)]


class Run(msgspec.Struct):
    """One run: which state of the code, on what machine, when, and what was measured.

    Attributes:
        commit: of the code, with "+" where files differ from it. started: UTC, ISO 8601. machine: kind of system and processor, without a
            name. versions: of Python and of the distributions that cost depends on.
    """

    commit: str
    started: str
    machine: str
    versions: dict[str, str]
    measured: list[Measured]


def machine() -> str:
    """Kind of machine, as "Linux x86_64, 2 cores, AMD EPYC"."""
    model = platform.processor()
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        model = next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), model)
    except OSError:
        pass
    parts = [f"{platform.system()} {platform.machine()}", f"{os.cpu_count()} cores", model]
    return ", ".join(part for part in parts if part)


def versions() -> dict[str, str]:
    """Versions of Python and of what is installed of ``DISTRIBUTIONS``."""
    found = {"python": platform.python_version()}
    for name in DISTRIBUTIONS:
        try:
            found[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            continue
    return found


def commit_of(folder: Path = REPOSITORY) -> str:
    """Short name of the commit in ``folder``, with "+" where tracked files differ; "unknown" without git."""
    try:
        name = subprocess.check_output(["git", "rev-parse", "--short=10", "HEAD"], cwd=folder, text=True, stderr=subprocess.DEVNULL)
        changed = subprocess.check_output(["git", "status", "--porcelain", "--untracked-files=no"], cwd=folder, text=True)
    except (OSError, subprocess.CalledProcessError):
        return "unknown"
    return name.strip() + ("+" if changed.strip() else "")


def run_of(measured: Iterable[Measured], commit: str) -> Run:
    """A run that ends now on this machine."""
    now = datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")
    return Run(commit, now, machine(), versions(), list(measured))


def append(run: Run, path: Path = HISTORY) -> None:
    """Add a run as the last line of the file, which is made where there is none."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("ab") as file:
        file.write(msgspec.json.encode(run) + b"\n")


def read(path: Path = HISTORY) -> list[Run]:
    """All runs of the file, the oldest first; none where there is no file.

    Raises:
        ValueError: a line is no run, with the number of the line.
    """
    runs = []
    lines = path.read_bytes().splitlines() if path.is_file() else []
    for number, line in enumerate(lines, 1):
        try:
            runs.append(msgspec.json.decode(line, type=Run))
        except msgspec.DecodeError as error:
            raise ValueError(
                f"{path}:{number}: {error}; expected one run a line, as python -m benchmarks writes it: delete the line"
            ) from None
    return runs
