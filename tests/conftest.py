"""What several test files share: hypothesis profiles, a cache of their own, and fixtures that run a test over the systems."""

from __future__ import annotations

import contextlib
import gc
import os
import shutil
from collections.abc import Callable, Iterator
from functools import partial
from importlib.util import spec_from_file_location
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

import costs
import pytest
from browser import CHROMIUM, Browser
from catalogue import BUILT_IN, MODELLED, PLAIN, REPRESENTATIVE, REPRESENTATIVE_ROBOTS, ROBOTS, VARIANTS
from hypothesis import HealthCheck, settings
from rooms import PACKAGE, REPOSITORY

from harness.programs.loops.interpreter import loop
from harness.storage import machine_code_directory
from harness.workers.program import VARIABLES

if TYPE_CHECKING:
    # Imported where they are used, because the process that gives out the tests needs none of them.
    from exact import Exact

    from harness.lagrange.system import System
    from harness.programs.mechanisms.mechanism import Mechanism

# The processes among which the tests are divided take it from this one, before they import what it is for.
os.environ |= VARIABLES | os.environ
# SymPy makes and drops objects by the million; looking for cycles after each 700 of them takes a sixteenth of all processor time.
gc.set_threshold(100_000, 20, 100)
# Without bytecode, as in many containers, each process that a test starts compiles the harness anew, for a second.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

# What a draw takes is a matter of what else the machine does.
UNHURRIED = {"deadline": None, "suppress_health_check": [HealthCheck.too_slow]}
settings.register_profile("ci", derandomize=True, **UNHURRIED)
settings.register_profile("local", **UNHURRIED)
settings.load_profile("local")

# What ``pytest`` runs by itself, and what it runs of the tests that ``-k`` picks; a test that the command line names is run always.
AT_THE_DESK = "not ci and not nightly"
IN_CI = "not nightly"
# The systems and robots for which others stand at the desk.
REPRESENTED = {
    *(name for name in [*BUILT_IN.system_names(), *VARIANTS] if BUILT_IN.system_of(name) not in REPRESENTATIVE),
    *(path for path in ROBOTS if path not in REPRESENTATIVE_ROBOTS),
}
# The systems come first of all, each in one process: what is derived and compiled of them is there for every later file, and no
# two processes make it at once. Then come rooms whose files take long, most because they start processes and wait for them, and the
# files beside the rooms, so that no processor is left with one of their files in the end.
SLOW_ROOMS = (
    "workers", "commands", "crosscheck", "diagnosis", "environments", "hostile", "night", "tests", "upgrade",
    "systems", "lagrange", "motion",
)  # fmt: skip


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--costs", choices=("file", "test"), help="print the processor seconds of each file of tests, or of each test")
    parser.addoption("--night", type=int, default=0, metavar="N", help="number of the night; long campaigns take cases in turn")


def pytest_xdist_auto_num_workers() -> int:
    """Three pytest processes keep two processors busy: some tests wait for processes and for time limits."""
    return (3 * (os.cpu_count() or 1) + 1) // 2


def pytest_configure(config: pytest.Config) -> None:
    if config.option.costs:
        config.pluginmanager.register(costs)
    if not config.option.markexpr and not any("::" in argument for argument in config.args):
        config.option.markexpr = IN_CI if config.option.keyword else AT_THE_DESK


def pytest_report_header(config: pytest.Config) -> str:
    return f"set: -m {config.option.markexpr!r}, night {config.option.night} (again with --night {config.option.night})"


@pytest.hookimpl(tryfirst=True)
def pytest_sessionstart(session: pytest.Session) -> None:
    """One cache for the whole run, whatever number of processes it is spread over; machine code is kept from run to run.

    A fixture would come too late for the systems' own tests, which have none.
    """
    folder = session.config._tmp_path_factory.getbasetemp()  # type: ignore[attr-defined]
    if "PYTEST_XDIST_WORKER" in os.environ:
        folder = folder.parent
        if Path(__file__).parent in (Path(one).absolute() for one in session.config.args):
            _rewrite_a_share(session.config)
    os.environ |= {"HEYOKA_CACHE_DIR": str(machine_code_directory()), "HARNESS_CACHE": str(folder / "cache")}
    # Before there are processes that would all compile them.
    loop("evaluate"), loop("follow", "closing")


def _rewrite_a_share(config: pytest.Config) -> None:
    """Rewrite the assertions of each n-th file, of n processes that would all rewrite every file of a new clone when they collect it."""
    number, count = (int(os.environ[name].removeprefix("gw")) for name in ("PYTEST_XDIST_WORKER", "PYTEST_XDIST_WORKER_COUNT"))
    for path in sorted(Path(__file__).parent.rglob("test_*.py"))[number::count]:
        module = ModuleType(path.stem)
        module.__spec__ = spec_from_file_location(path.stem, path)
        # It cannot even import: what is kept is the rewritten code. What is wrong with a file, its collection says.
        module.__dict__["__builtins__"] = {}
        with contextlib.suppress(Exception):
            config.pluginmanager.rewrite_hook.exec_module(module)  # type: ignore[attr-defined]


@pytest.fixture
def copied(tmp_path: Path) -> Path:
    """A folder with a copy of the package and its settings."""
    shutil.copytree(PACKAGE, tmp_path / "harness", ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(REPOSITORY / "pyproject.toml", tmp_path)
    for folder in ("mjcf", "urdf"):
        (tmp_path / folder).symlink_to(REPOSITORY / folder)
    return tmp_path


@pytest.fixture(scope="session")
def environments(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A cache with environments of engines, which all tests share and add to: that of ``HARNESS_TEST_CACHE``, or one of this run."""
    from support import cache_with_mechanisms

    kept = os.environ.get("HARNESS_TEST_CACHE")
    cache = Path(kept) if kept else cache_with_mechanisms(tmp_path_factory.mktemp("environments") / "cache")
    cache.mkdir(parents=True, exist_ok=True)
    return cache


@pytest.fixture(scope="session")
def environment(environments: Path) -> Callable[[str], Path]:
    """The cache that holds the environment of an engine, which is made at its first use in a run."""
    from support import environment_in

    return partial(environment_in, environments)


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


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    if CHROMIUM is None:
        pytest.skip("needs Chromium, which is no Python package")
    with Browser() as found:
        yield found


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
    for item in items:
        if not REPRESENTED.isdisjoint(_subjects(item)):
            item.add_marker("ci")
    waiting = _waiting(items, config.option.night)
    if waiting and not any("::" in argument for argument in config.args):
        config.hook.pytest_deselected(items=list(waiting))
        items[:] = [item for item in items if item not in waiting]


def _turn(item: pytest.Item) -> int:
    if item.path.parent == BUILT_IN.systems:
        return 0
    return 1 if item.path.parent.name in SLOW_ROOMS else 2


def _subjects(item: pytest.Item) -> Iterator[object]:
    """The names of systems and variants and the files of robots that a test is about.

    One of the room ``systems`` is about those that it names itself: what a textbook says of one system is published for that alone.
    """
    parameters = item.callspec.params.values() if hasattr(item, "callspec") else ()
    named = item.function.__code__.co_consts if isinstance(item, pytest.Function) and item.path.parent.name == "systems" else ()
    return (value for value in (getattr(item, "system", None), *parameters, *named) if isinstance(value, str | Path))


def _waiting(items: list[pytest.Item], night: int) -> set[pytest.Item]:
    """Cases of tests marked ``nightly(nights=N)``, which run them all in N nights, that have their turn in another night."""
    cases: dict[str, list[pytest.Item]] = {}
    for item in items:
        mark = item.get_closest_marker("nightly")
        if mark and "nights" in mark.kwargs:
            cases.setdefault(item.nodeid.partition("[")[0], []).append(item)
    waiting: set[pytest.Item] = set()
    for several in cases.values():
        nights = several[0].get_closest_marker("nightly").kwargs["nights"]
        waiting.update(item for number, item in enumerate(several) if (number - night) % nights)
    return waiting


def pytest_collection_finish() -> None:
    """What was imported for the tests is there to stay, and need not be looked through at each collection of garbage."""
    gc.collect()
    gc.freeze()
