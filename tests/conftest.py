"""What several test files share: hypothesis profiles, a cache of their own, and fixtures that run a test over the systems."""

from __future__ import annotations

import gc
import math
import os
import shutil
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from catalogue import BUILT_IN, IN_CI, MODELLED, PLAIN
from hypothesis import HealthCheck, settings
from rooms import PACKAGE, REPOSITORY

from harness.programs.loops.interpreter import loop
from harness.storage import machine_code_directory

if TYPE_CHECKING:
    # Imported where they are used, because the process that gives out the tests needs none of them.
    from exact import Exact

    from harness.lagrange.system import System
    from harness.programs.mechanisms.mechanism import Mechanism

# Nothing is drawn; MuJoCo asks a Python process of its own for the window system otherwise, at each import.
os.environ.setdefault("MUJOCO_GL", "disable")
# SymPy makes and drops objects by the million; looking for cycles after each 700 of them takes a sixteenth of all processor time.
gc.set_threshold(100_000, 20, 100)
# Without bytecode, as in many containers, each process that a test starts compiles the harness anew, for a second.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

# What a draw takes is a matter of what else the machine does.
UNHURRIED = {"deadline": None, "suppress_health_check": [HealthCheck.too_slow]}
settings.register_profile("ci", derandomize=True, **UNHURRIED)
settings.register_profile("local", **UNHURRIED)
settings.load_profile("ci" if IN_CI else "local")

# One in so many cases of a test that has several, each file on other systems, and one in so many tests that have none. The desk leaves
# most of the tests marked ``costly`` and of those over the catalogue to CI, and with them costly tests without cases and all that is
# marked ``ci``. CI leaves to the night what it marks ``nightly``: ``CI=1 pytest`` and ``CI=1 pytest -m nightly`` are every case
# together.
AT_THE_DESK_ONE_IN = 24, None
IN_CI_ONE_IN = 12, 12
IN_CI_OF_THE_CATALOGUE_ONE_IN = 4, 1
# Fixtures that run a test over the catalogue.
CATALOGUE = {"built_in_name", "modelled_name", "plain_name"}
# The systems come first of all, each in one process: what is derived and compiled of them is there for every later file, and no
# two processes make it at once. Then come rooms whose files take long, most because they start processes and wait for them, and the
# files beside the rooms, so that no processor is left with one of their files in the end.
SLOW_ROOMS = (
    "workers", "commands", "crosscheck", "diagnosis", "environments", "hostile", "night", "tests", "upgrade",
    "systems", "lagrange", "motion",
)  # fmt: skip


@pytest.hookimpl(tryfirst=True)
def pytest_sessionstart(session: pytest.Session) -> None:
    """One cache for the whole run, whatever number of processes it is spread over; machine code is kept from run to run.

    A fixture would come too late for the systems' own tests, which have none.
    """
    folder = session.config._tmp_path_factory.getbasetemp()  # type: ignore[attr-defined]
    if "PYTEST_XDIST_WORKER" in os.environ:
        folder = folder.parent
    os.environ |= {"HEYOKA_CACHE_DIR": str(machine_code_directory()), "HARNESS_CACHE": str(folder / "cache")}
    # Before there are processes that would all compile them.
    loop("evaluate"), loop("follow", "closing")


@pytest.fixture
def copied(tmp_path: Path) -> Path:
    """A folder with a copy of the package and its settings."""
    shutil.copytree(PACKAGE, tmp_path / "harness", ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(REPOSITORY / "pyproject.toml", tmp_path)
    for folder in ("mjcf", "urdf"):
        (tmp_path / folder).symlink_to(REPOSITORY / folder)
    return tmp_path


@pytest.fixture
def in_this_process(monkeypatch: pytest.MonkeyPatch) -> None:
    """Tasks run here: for commands whose processes are not what is tested."""
    from support import InThisProcess

    monkeypatch.setattr("harness.workers.Workers", InThisProcess)


@pytest.fixture
def without_charts(monkeypatch: pytest.MonkeyPatch) -> None:
    """Reports whose pages have no charts, which take nearly all of the time: for what else is in them."""
    drawing = ("plots", "trend_plots", "plots_of", "hard_plots")
    for place in (*(f"charts.{name}" for name in drawing), "benchmark_charts.plots", "benchmark_charts.plots_of"):
        monkeypatch.setattr(f"harness.report.{place}", lambda summary, system="": {})


@pytest.fixture(scope="session")
def mechanism_of() -> Callable[[System], Mechanism]:
    """The mechanism of a system that has no file."""
    import exact

    return exact.mechanism_of


@pytest.fixture(scope="session")
def exact_of() -> Callable[[System], Exact]:
    """The exact evaluation of a system that has no file."""
    from exact import Exact

    from harness.lagrange.equations import derive

    return lambda system: Exact(system, derive(system))


@pytest.fixture(scope="session", params=BUILT_IN.system_names())
def built_in_name(request: pytest.FixtureRequest) -> str:
    """Runs a test once for every system of the library."""
    return str(request.param)


@pytest.fixture(scope="session", params=MODELLED)
def modelled_name(request: pytest.FixtureRequest) -> str:
    """Runs a test once for every system that engines can express; whether others may lack a model, the cross-check tells."""
    return str(request.param)


@pytest.fixture(scope="session", params=PLAIN)
def plain_name(request: pytest.FixtureRequest) -> str:
    """Runs a test once for every system whose joints carry its coordinates themselves."""
    return str(request.param)


def _system(name: str) -> System:
    from exact import system_of

    return system_of(name)


def _exact(name: str) -> Exact:
    from exact import exact_of

    return exact_of(name)


def _mechanism(name: str) -> Mechanism:
    from harness.lagrange.derivation import load_mechanism

    return load_mechanism(BUILT_IN, name)


@pytest.fixture(scope="session")
def built_in_system(built_in_name: str) -> System:
    return _system(built_in_name)


@pytest.fixture(scope="session")
def built_in_exact(built_in_name: str) -> Exact:
    return _exact(built_in_name)


@pytest.fixture(scope="session")
def built_in_mechanism(built_in_name: str) -> Mechanism:
    return _mechanism(built_in_name)


@pytest.fixture(scope="session")
def modelled_system(modelled_name: str) -> System:
    return _system(modelled_name)


@pytest.fixture(scope="session")
def modelled_mechanism(modelled_name: str) -> Mechanism:
    return _mechanism(modelled_name)


@pytest.fixture(scope="session")
def plain_exact(plain_name: str) -> Exact:
    return _exact(plain_name)


@pytest.fixture(scope="session")
def plain_mechanism(plain_name: str) -> Mechanism:
    return _mechanism(plain_name)


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Before pytest looks at the marks, of which this gives some."""
    items.sort(key=_turn)
    if _asked_for_by_name(config):
        return
    marked = [item for item in items if _is_marked(item)]
    over_the_catalogue = [item for item in items if _is_over_the_catalogue(item) and not _is_marked(item)]
    at_the_desk = _left_out([*marked, *over_the_catalogue], *AT_THE_DESK_ONE_IN)
    at_night = _left_out(marked, *IN_CI_ONE_IN) | _left_out(over_the_catalogue, *IN_CI_OF_THE_CATALOGUE_ONE_IN)
    for item in at_night:
        item.add_marker("nightly")
    to_ci = {item for item in items if item.get_closest_marker("ci") and not item.get_closest_marker("nightly")}
    left_out = set() if IN_CI else (at_the_desk | to_ci) - at_night
    if left_out:
        config.hook.pytest_deselected(items=list(left_out))
        items[:] = [item for item in items if item not in left_out]


def _asked_for_by_name(config: pytest.Config) -> bool:
    """Whether the command line names tests or cases, as one does for a mechanism that is new or a test that has failed."""
    return bool(config.option.keyword) or any("::" in argument for argument in config.args)


def _turn(item: pytest.Item) -> int:
    if item.path.parent == BUILT_IN.systems:
        return 0
    return 1 if item.path.parent.name in SLOW_ROOMS else 2


def _left_out(items: list[pytest.Item], one_case_in: int, one_test_in: int | None) -> set[pytest.Item]:
    """Of each test all but one case in so many, and of tests without cases all but one in so many, or all; long ones are left alone."""
    cases: dict[str, list[pytest.Item]] = {}
    for item in items:
        if not item.get_closest_marker("nightly"):
            cases.setdefault(item.nodeid.partition("[")[0], []).append(item)
    left_out: set[pytest.Item] = set()
    for name, several in cases.items():
        if len(several) > 1:
            left_out.update(sorted(several, key=_lot)[math.ceil(len(several) / one_case_in) :])
        elif one_test_in is None or zlib.crc32(name.encode()) % one_test_in:
            left_out.update(several)
    return left_out


def _is_marked(item: pytest.Item) -> bool:
    return item.get_closest_marker("costly") is not None


def _is_over_the_catalogue(item: pytest.Item) -> bool:
    return not CATALOGUE.isdisjoint(getattr(item, "fixturenames", ()))


def _lot(item: pytest.Item) -> int:
    """A number by chance, the same for a system in all tests of a file, which share what is made of it."""
    return zlib.crc32(f"{item.path.name}[{item.name.partition('[')[2]}".encode())


def pytest_collection_finish() -> None:
    """What was imported for the tests is there to stay, and need not be looked through at each collection of garbage."""
    gc.collect()
    gc.freeze()
