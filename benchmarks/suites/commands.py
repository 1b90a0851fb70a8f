"""Commands as a user starts them, with all of their processes: those of docs/reference/costs.md, from a warm cache, and first checks."""

from __future__ import annotations

import importlib.util
import os
import tempfile
from collections.abc import Iterator, Sequence
from functools import partial
from importlib.metadata import distribution
from pathlib import Path

from benchmarks.benchmark import Benchmark, Measure, alone
from benchmarks.processes import cpu_seconds

ARM, ROBOTS = "harness/robots/arm.urdf", "harness/robots"
# Commands by what they stand for; {out} is a folder that goes away.
COMMANDS = {
    "list": "mechanisms and engines",
    "list cases": "other names",
    "show double_pendulum": "equations and models",
    f"compare {ARM}": "a robot with 6 degrees of freedom",
    f"compare {ARM} harness/robots/arm.xml": "two files of it",
    f"compare {ARM} --steps 100": "the gap between two motions",
    f"check {ARM}": "the same robot at searched states",
    f"survey {ROBOTS} --out {{out}}": "five robots' files",
    "check double_pendulum": "2 degrees of freedom, all quick quantities",
    "check double_pendulum --quantity accelerations": "accelerations alone",
    "check puma_560": "6 degrees of freedom",
    "check double_pendulum --quantity reactions": "what joints transmit",
    "check double_pendulum --quantity derivatives": "both kinds of derivatives",
    "diagnose double_pendulum": "a sound mechanism",
    "search double_pendulum --subject mujoco/mjcf --no-keep": "worst states of one engine",
    "bench double_pendulum": "cost against error",
    "faults double_pendulum --kind axis": "one kind of planted faults",
}
# Beside what every check imports.
BESIDE, IMPORTS = "what every check imports", "sympy, heyoka, mujoco, pinocchio, hypothesis, flint, lxml.etree"
MOST = {"list": 0.4, "check double_pendulum": 3.1}
# A mechanism with three degrees of freedom and an empty cache.
FIRST_CHECKS, MOST_OF_A_FIRST = ("arm_3r", "cart_double_pendulum", "gyroscope_gimbals"), 5.5
# Every mechanism in all quick quantities: 83 to 95 s where the imports take 0.8.
WHOLE, MOST_OF_THE_WHOLE = "check", 130.0
ROUNDS = 5
# The same with engines called by the workers themselves: one engine may then change what another is told.
CALLED_HERE = """
import sys
from functools import partialmethod

from harness.library import Library

Library.__init__ = partialmethod(Library.__init__, calls_engines_here=True)
from harness.cli import main

sys.argv[0] = "harness"
main()
"""
MOST_OF_ISOLATION = 1.05
# Robots of others with all on that is judged: 69 URDFs and 37 MJCFs, of which one is included by another. CPU seconds.
OTHERS, MOST_OF_OTHERS = ("example-robot-data", "dm_control"), 720.0
_OF_DM_CONTROL = ("suite", "locomotion/walkers/assets", "third_party")
# A survey in which a file cannot be read ends with 1.
SURVEYED = """
import sys

from harness.cli import main

sys.argv[0] = "harness"
try:
    main()
except SystemExit as ended:
    sys.exit(ended.code not in (0, 1))
"""


def benchmarks() -> Iterator[Benchmark]:
    for command in COMMANDS:
        most = MOST.get(command, float("inf"))
        yield Benchmark(name_of(command), partial(warm, command), BESIDE, most, ROUNDS)
    for name in FIRST_CHECKS:
        yield Benchmark(f"commands/first check {name}", partial(first, name), BESIDE, MOST_OF_A_FIRST, ROUNDS, warm=False)
    yield Benchmark(name_of(WHOLE), partial(warm, WHOLE), BESIDE, MOST_OF_THE_WHOLE, rounds=1)
    yield Benchmark(
        f"commands/isolation of {WHOLE}", isolated, "engines called by the workers themselves", MOST_OF_ISOLATION, ROUNDS, warm=False
    )

    if folders := others():
        yield Benchmark("commands/survey of robots of others", partial(surveyed, folders), "", MOST_OF_OTHERS, rounds=1, warm=False)


def others() -> list[Path]:
    """Folders of robots of others; none where one of their packages is not installed."""
    found = importlib.util.find_spec("dm_control")
    try:
        files = distribution(OTHERS[0]).files or []
    except ImportError:
        return []
    if found is None or not found.submodule_search_locations:
        return []
    folder = Path(found.submodule_search_locations[0])
    urdfs = [str(Path(str(file.locate())).parent) for file in files if file.suffix == ".urdf"]
    return [Path(os.path.commonpath(urdfs)), *(folder / part for part in _OF_DM_CONTROL)]


def surveyed(folders: Sequence[Path]) -> tuple[Measure, Measure]:
    def measure() -> float:
        with tempfile.TemporaryDirectory() as folder:
            words = ["survey", *map(str, folders), "--workers", "1", "--time-limit", "900", "--out", folder]
            return cpu_seconds("-c", SURVEYED, *words, cwd=Path(folder), PYTHONPATH=str(Path.cwd()))

    return measure, alone


def name_of(command: str) -> str:
    """The name of the benchmark of a command."""
    return f"commands/{command.removesuffix(' --out {out}')}"


def imports() -> float:
    """CPU seconds of what every check imports."""
    return cpu_seconds("-c", f"import {IMPORTS}", cwd=Path.cwd())


def cost(command: str, folder: str, **environment: str) -> float:
    """CPU seconds of a command, which leaves its reports in ``folder``."""
    tree = Path.cwd()
    words = [str(tree / word) if word.startswith(ROBOTS) else word for word in command.format(out=folder).split()]
    return cpu_seconds("-m", "harness", *words, cwd=Path(folder), PYTHONPATH=str(tree), **environment)


def warm(command: str) -> tuple[Measure, Measure]:
    def measure() -> float:
        with tempfile.TemporaryDirectory() as folder:
            return cost(command, folder)

    return measure, imports


def isolated() -> tuple[Measure, Measure]:
    """CPU seconds of a check of everything, with engines in processes of their own and without."""

    def measure(*python: str) -> float:
        with tempfile.TemporaryDirectory() as folder:
            return cpu_seconds(*python, WHOLE, cwd=Path(folder), PYTHONPATH=str(Path.cwd()))

    return partial(measure, "-m", "harness"), partial(measure, "-c", CALLED_HERE)


def first(name: str) -> tuple[Measure, Measure]:
    def measure() -> float:
        with tempfile.TemporaryDirectory() as folder:
            return cost(f"check {name}", folder, HARNESS_CACHE=f"{folder}/cache", HEYOKA_CACHE_DIR=f"{folder}/machine_code")

    return measure, imports
