"""The JSON file of a command while it runs: never far behind what is complete, at a cost that does not square."""

from __future__ import annotations

import itertools
import json
from collections.abc import Iterator
from pathlib import Path

import pytest
from support import InThisProcess
from support_results import RUN

from harness.commands.frame.bracket import Bracket
from harness.study import Inquiry, Part, Study, ask, call


class Counting(Study):
    """A study of so many parts, which fails after ``sound`` of them."""

    title = "counting"

    def __init__(self, steps: int, sound: int) -> None:
        super().__init__()
        self.steps, self.sound, self.found = steps, sound, list[dict[str, int]]()

    def inquiries(self) -> Iterator[list[Inquiry[None]]]:
        yield [self._count()]

    def _count(self) -> Inquiry[None]:
        yield from ask(call, int)
        for number in range(self.steps):
            if number == self.sound:
                raise KeyboardInterrupt
            self.found.append({"number": number})
            yield Part(str(number), None)

    def result(self) -> list[dict[str, int]]:
        return self.found


def written(path: Path, study: Counting, monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """How many parts the file held each time that it was written."""
    bracket, held = Bracket(json_path=str(path)), []
    bracket.run, bracket.pool = RUN, InThisProcess()

    def write(path: str, text: str) -> None:
        held.append(len(json.loads(text)["numbers"]))
        Path(path).write_text(text)

    monkeypatch.setattr("harness.storage.write_atomically", write)
    try:
        bracket.complete(study, lambda: {"numbers": study.found}, kept=False)
    except KeyboardInterrupt:
        assert study.sound < study.steps
    return held


def test_few_parts_are_written_each(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert written(tmp_path / "out.json", Counting(15, 15), monkeypatch) == list(range(1, 16))


def test_of_many_parts_a_twentieth_at_most_is_behind_and_as_many_times_their_text_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    held = written(tmp_path / "out.json", Counting(2000, 2000), monkeypatch)
    assert held[-1] == 2000
    assert all(after - before - 1 <= after / 20 for before, after in itertools.pairwise(held))
    assert sum(held) <= 22 * 2000


def test_an_interruption_leaves_all_that_was_complete(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    written(tmp_path / "out.json", Counting(2000, 1234), monkeypatch)
    assert len(json.loads((tmp_path / "out.json").read_text())["numbers"]) == 1234
