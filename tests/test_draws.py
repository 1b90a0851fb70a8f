"""What the desk leaves to CI: cases of costly tests, and most costly tests without cases; never the whole of several cases."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest


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
def left_out(request: pytest.FixtureRequest) -> Callable[[Iterable[Item]], set[Item]]:
    conftest: Any = request.config.pluginmanager.get_plugin(str(Path(__file__).parent / "conftest.py"))
    found: Callable[[Iterable[Item]], set[Item]] = conftest._left_out
    return found


def cases(test: str, count: int, **rest: Any) -> list[Item]:
    return [Item(f"tests/test_it.py::{test}[system{number}]", **rest) for number in range(count)]


@pytest.mark.parametrize("count", [2, 3, 5, 36])
def test_of_several_cases_the_desk_runs_one_in_four_and_at_least_one(left_out: Callable[[Iterable[Item]], set[Item]], count: int) -> None:
    several = cases("test_costly", count)
    assert len(set(several) - left_out(several)) == -(-count // 4)


def test_tests_of_a_file_are_drawn_on_the_same_systems(left_out: Callable[[Iterable[Item]], set[Item]]) -> None:
    left = left_out([*cases("test_one", 36), *cases("test_other", 36)])
    one, other = ({item.name.partition("[")[2] for item in left if item.name.startswith(name)} for name in ("test_one", "test_other"))
    assert one == other and len(one) == 27


def test_a_test_over_the_catalogue_needs_no_mark(left_out: Callable[[Iterable[Item]], set[Item]]) -> None:
    over = cases("test_over", 8, marks=frozenset(), fixturenames=("case", "built_in_name"))
    assert len(left_out(over)) == 6
    assert left_out(cases("test_cheap", 8, marks=frozenset(), fixturenames=("tmp_path",))) == set()


def test_one_in_four_tests_without_cases_is_drawn_whatever_its_file(left_out: Callable[[Iterable[Item]], set[Item]]) -> None:
    alone = [Item(f"tests/test_it.py::test_number_{number}") for number in range(400)]
    assert 250 < len(left_out(alone)) < 350


def test_the_night_is_left_alone(left_out: Callable[[Iterable[Item]], set[Item]]) -> None:
    assert left_out(cases("test_long", 8, marks=frozenset({"costly", "nightly"}))) == set()
