"""What the desk leaves to CI, and CI to the night: cases of costly tests, never all of several; at the desk costly tests without
cases, and those marked ``ci``."""

from __future__ import annotations

import os
import subprocess
import sys
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from catalogue import BUILT_IN


@dataclass(frozen=True)
class Item:
    """As much of a test as the draw looks at."""

    nodeid: str
    marks: frozenset[str] = frozenset({"costly"})
    fixturenames: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        return self.nodeid.partition("::")[2]

    @property
    def path(self) -> Path:
        return Path(self.nodeid.partition("::")[0])

    def get_closest_marker(self, name: str) -> str | None:
        return name if name in self.marks else None


@pytest.fixture
def conftest(request: pytest.FixtureRequest) -> Any:
    return request.config.pluginmanager.get_plugin(str(Path(__file__).parent / "conftest.py"))


@pytest.fixture
def left_out(conftest: Any) -> Callable[[Iterable[Item]], set[Item]]:
    def at_the_desk(items: Iterable[Item]) -> set[Item]:
        found: set[Item] = conftest._left_out(items, *conftest.AT_THE_DESK_ONE_IN)
        return found

    return at_the_desk


def cases(test: str, count: int, **rest: Any) -> list[Item]:
    return [Item(f"tests/test_it.py::{test}[system{number}]", **rest) for number in range(count)]


@pytest.mark.parametrize("count", [2, 3, 5, 36])
def test_of_several_cases_the_desk_runs_one_in_24_and_at_least_one(left_out: Callable[[Iterable[Item]], set[Item]], count: int) -> None:
    several = cases("test_costly", count)
    assert len(set(several) - left_out(several)) == -(-count // 24)


@pytest.mark.parametrize("count", [2, 3, 5, 36])
def test_ci_runs_a_twelfth_of_several_cases_with_all_that_the_desk_runs(conftest: Any, count: int) -> None:
    several = cases("test_costly", count)
    desk, ci = (set(several) - conftest._left_out(several, *one_in) for one_in in ((24, 1), conftest.IN_CI_ONE_IN))
    assert desk <= ci and len(ci) == -(-count // 12)


def test_tests_of_a_file_are_drawn_on_the_same_systems(left_out: Callable[[Iterable[Item]], set[Item]]) -> None:
    left = left_out([*cases("test_one", 36), *cases("test_other", 36)])
    one, other = ({item.name.partition("[")[2] for item in left if item.name.startswith(name)} for name in ("test_one", "test_other"))
    assert one == other and len(one) == 34


def test_a_twelfth_of_the_tests_without_cases_is_left_to_ci_and_none_to_the_desk(
    conftest: Any, left_out: Callable[[Iterable[Item]], set[Item]]
) -> None:
    alone = [Item(f"tests/test_it.py::test_number_{number}") for number in range(400)]
    assert left_out(alone) == set(alone)
    assert 15 < len(set(alone) - conftest._left_out(alone, *conftest.IN_CI_ONE_IN)) < 55


def test_the_night_is_left_alone(left_out: Callable[[Iterable[Item]], set[Item]]) -> None:
    assert left_out(cases("test_long", 8, marks=frozenset({"costly", "nightly"}))) == set()


TESTS = """
import pytest

@pytest.mark.costly
def test_costly(built_in_name):
    pass

def test_over(built_in_name):
    pass

@pytest.mark.costly
@pytest.mark.parametrize("number", range(12))
def test_several(number):
    pass

@pytest.mark.costly
def test_by_itself():
    pass

def test_cheap():
    pass

@pytest.mark.ci
def test_whole_command():
    pass
"""


@pytest.fixture
def collected(tmp_path: Path) -> Callable[..., set[str]]:
    """The tests that pytest would run of a file of costly ones beside this suite's ``conftest.py``."""
    tests = Path(__file__).parent
    (tmp_path / "conftest.py").write_text((tests / "conftest.py").read_text())
    (tmp_path / "test_it.py").write_text(TESTS)
    settings = [
        "-c",
        str(tests.parent / "pyproject.toml"),
        "--rootdir",
        str(tmp_path),
        "-o",
        f"pythonpath={tests}",
        "-p",
        "no:cacheprovider",
    ]

    def collect(*arguments: str, ci: bool) -> set[str]:
        command = [
            sys.executable,
            "-m",
            "pytest",
            *settings,
            "--collect-only",
            "-q",
            "-n",
            "0",
            *arguments,
            *([] if "::" in str(arguments) else ["."]),
        ]
        environment = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST_") and name != "CI"}
        done = subprocess.run(
            command, cwd=tmp_path, env=environment | ({"CI": "1"} if ci else {}), capture_output=True, text=True, timeout=120
        )
        assert done.returncode == 0, done.stdout + done.stderr
        return {line.rpartition("::")[2] for line in done.stdout.splitlines() if "::" in line}

    return collect


@pytest.mark.ci
def test_ci_and_the_night_are_every_case_together(collected: Callable[..., set[str]]) -> None:
    names = BUILT_IN.system_names()
    every = {"test_cheap", "test_whole_command", "test_by_itself", *(f"test_several[{number}]" for number in range(12))}
    every |= {f"{test}[{name}]" for name in names for test in ("test_costly", "test_over")}
    by_day, at_night, desk = collected(ci=True), collected("-m", "nightly", ci=True), collected(ci=False)
    assert by_day | at_night == every and by_day & at_night == set()
    left = Counter(name.partition("[")[0] for name in at_night)
    assert left == {
        "test_costly": len(names) - -(-len(names) // 12),
        "test_over": len(names) - -(-len(names) // 4),
        "test_several": 11,
        "test_by_itself": 1,
    }
    count = {
        test: len([name for name in desk if name.startswith(test)]) for test in ("test_costly", "test_over", "test_several", "test_cheap")
    }
    assert desk <= by_day and count == {
        "test_costly": -(-len(names) // 24),
        "test_over": -(-len(names) // 24),
        "test_several": 1,
        "test_cheap": 1,
    }
    assert "test_whole_command" in by_day - desk


@pytest.mark.parametrize(("keyword", "argument", "named"), [("system7", "tests", True), ("", "tests", False), ("", "a.py::test_it", True)])
def test_what_is_named_is_run(conftest: Any, keyword: str, argument: str, named: bool) -> None:
    config = SimpleNamespace(option=SimpleNamespace(keyword=keyword), args=[argument])
    assert conftest._asked_for_by_name(config) == named
