"""JSON of what grows: at each moment the text that all of it gives at once, and each element made text once."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from harness.results.plain_json import GrowingJson, dumps


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
DOCUMENTS = st.dictionaries(st.sampled_from(["records", "causes", "run", 'a "name"\n']), PLAIN | st.lists(PLAIN, max_size=5), max_size=4)


@given(st.lists(DOCUMENTS, max_size=4))
def test_every_state_is_the_text_of_the_whole(states: list[dict[str, Any]]) -> None:
    growing = GrowingJson()
    for document in states:
        assert growing.dumps(document) == dumps(document, indent=2)


def test_what_stays_is_made_text_once() -> None:
    made: list[Pair] = []

    def plain(item: Pair) -> Pair:
        made.append(item)
        return item

    growing, pairs = GrowingJson(plain), [Pair(str(number), number) for number in range(50)]
    for count in range(len(pairs) + 1):
        text = growing.dumps({"head": 1, "pairs": pairs[:count], "tail": []})
    assert text == dumps({"head": 1, "pairs": pairs, "tail": []}, indent=2)
    assert made == pairs
    # What left is forgotten, so that what is made anew each time fills no memory.
    growing.dumps({"pairs": []})
    growing.dumps({"pairs": pairs[:1]})
    assert made == [*pairs, pairs[0]]
