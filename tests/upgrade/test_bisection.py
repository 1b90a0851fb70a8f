"""A bisection finds where the answer changes first, and asks no version twice."""

from __future__ import annotations

import math

from hypothesis import given
from hypothesis import strategies as st

from harness.upgrade.study import first_changed


@given(st.integers(2, 60), st.data())
def test_the_first_change_is_found_in_few_questions(count: int, data: st.DataObject) -> None:
    versions = [f"1.{number}" for number in range(count)]
    first_bad = data.draw(st.integers(1, count))
    asked = []

    def ask(version: str) -> bool:
        asked.append(version)
        return versions.index(version) >= first_bad

    found = first_changed(versions, ask, lambda one, other: one != other)
    assert found == (None if first_bad == count else (versions[first_bad - 1], versions[first_bad]))
    assert len(asked) == len(set(asked)) <= 2 + math.ceil(math.log2(count))
