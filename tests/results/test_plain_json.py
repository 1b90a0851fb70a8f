"""JSON of what grows: at each moment the text that all of it gives at once, and each element made text once."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support_results import RUN

from harness.results.plain_json import JsonDocument, dumps


@dataclass(frozen=True)
class Pair:
    name: str
    value: Any


PLAIN = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: (
        st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3), inner, max_size=3) | st.builds(Pair, st.text(max_size=3), inner)
    ),
    max_leaves=6,
)
DOCUMENTS = st.dictionaries(st.sampled_from(["causes", "atlas", 'a "name"\n']), PLAIN | st.lists(PLAIN, max_size=5), max_size=4)


@pytest.mark.ci
@given(st.lists(DOCUMENTS, max_size=4))
def test_every_state_is_the_text_of_the_whole(states: list[dict[str, Any]]) -> None:
    growing, about = JsonDocument(RUN), asdict(RUN)
    head = {"harness": about.pop("versions"), "run": about, "records": [], "systems": []}
    for document in states:
        assert growing.text(**document) == dumps(head | document, indent=2) + "\n"


def test_what_stays_is_made_text_once(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[Pair] = []

    def noted(item: Pair) -> Pair:
        made.append(item)
        return item

    monkeypatch.setattr("harness.results.plain_json._with_outcome", noted)
    growing, pairs = JsonDocument(RUN), [Pair(str(number), number) for number in range(50)]
    for count in range(len(pairs) + 1):
        growing.text(pairs=pairs[:count], tail=[])
    assert made == pairs
    # What left is forgotten, so that what is made anew each time fills no memory.
    growing.text(pairs=[])
    growing.text(pairs=pairs[:1])
    assert made == [*pairs, pairs[0]]
