"""The runner of studies that are written as generators."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import pytest
from support import InThisProcess

from harness.study import Inquiry, Part, Study, ask, run_study
from harness.workers import Task


def twice(number: int, note: object) -> int:
    if number < 0:
        raise ArithmeticError("below zero")
    return 2 * number


class Doubling(Study):
    """Two rounds of inquiries beside empty ones: the first grows while it runs, the second is about what the first found."""

    title, steps = "doubling", 4

    def __init__(self, *numbers: int) -> None:
        super().__init__()
        self.numbers, self.found = numbers, dict[int, int]()

    def inquiries(self) -> Iterator[Iterable[Inquiry[None]]]:
        yield []
        yield [self.doubled(number) for number in self.numbers]
        # What joined this round while it ran has ended too.
        assert 2 not in self.numbers or 10 in self.found
        yield []
        yield [self.added()]

    def doubled(self, number: int) -> Inquiry[None]:
        outcome = yield from ask(twice, number)
        if failure := self.failure(outcome):
            yield Part(failure, None)
            return
        again = yield [Task(None, twice, (outcome.value + one,)) for one in range(3)]
        assert not (yield [])
        assert [one.value for one in again] == [2 * (2 * number + one) for one in range(3)], "outcomes come in the order of the tasks"
        self.found[number] = outcome.value
        if number == 2:
            self._begin(self.doubled(10))
        yield Part(str(number), outcome.value)
        yield Part(f"{number} again", outcome.value)

    def added(self) -> Inquiry[None]:
        outcome = yield from ask(twice, sum(self.found.values()))
        yield Part("all", outcome.value)

    def result(self) -> dict[int, int]:
        return self.found


def test_inquiries_are_under_way_together_and_rounds_one_after_the_other() -> None:
    study = Doubling(1, 2)
    parts = [(part.label, part.value) for part in run_study(study, InThisProcess())]
    assert sorted(parts[:6]) == [("1", 2), ("1 again", 2), ("10", 20), ("10 again", 20), ("2", 4), ("2 again", 4)]
    assert parts[6:] == [("all", 52)] and study.result() == {1: 2, 2: 4, 10: 20}


def test_what_fails_costs_its_own_inquiry_alone() -> None:
    study = Doubling(1, -1)
    labels = {part.label for part in run_study(study, InThisProcess())}
    assert labels == {"1", "1 again", "ArithmeticError: below zero", "all"} and not study.crashed


def test_a_part_before_the_first_question_is_refused() -> None:
    class Hasty(Doubling):
        def doubled(self, number: int) -> Inquiry[None]:
            yield Part("nothing asked", None)
            yield from ask(twice, number)

    with pytest.raises(AssertionError, match="nothing asked"):
        list(run_study(Hasty(1), InThisProcess()))
