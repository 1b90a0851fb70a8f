"""The course of a night: units side by side, what is stored with them, and which night goes on."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from support import InThisProcess
from support_results import RECORD, RUN

from harness.errors import InvalidModel, InvalidRequest
from harness.library import Library
from harness.night.answered import Answered
from harness.night.course import Course, cases_of, unfinished
from harness.night.stage import NightChoice, Stage, Steps, UnitFound
from harness.night.stages import find_stages, select_stages
from harness.night.together import Together
from harness.results.cross_check import CrossCheckResult
from harness.results.history import History
from harness.results.night import Night, NightSettings, case_of
from harness.study import Inquiry, Study, ask
from harness.workers import Outcome, Task

SETTINGS = NightSettings(stages=["toy"], states=10, seed=0, versions={"mujoco": "4.0"}, inputs={"systems/a.py": "12"})


def double(number: int, note: object) -> int:
    return 2 * number


class Doubling(Study):
    """Doubles a number as often as it says, one task after the other."""

    title, steps = "doubling", 1

    def __init__(self, number: int, times: int) -> None:
        super().__init__()
        self.value, self._times = number, times

    def inquiries(self) -> Iterator[list[Inquiry[None]]]:
        yield [self._doubled()]

    def _doubled(self) -> Inquiry[None]:
        for _ in range(self._times):
            outcome = yield from ask(double, self.value)
            self.value = outcome.value

    def result(self) -> int:
        return self.value


def toy_steps(name: str, times: Sequence[int]) -> Steps:
    value = 1
    for count in times:
        study = Doubling(value, count)
        yield study
        value = study.result()
    return UnitFound(result=CrossCheckResult(records=[replace(RECORD, system=name, states=value)]))


@pytest.mark.parametrize("most", [1, 2, 100])
def test_units_run_to_their_end_whatever_number_is_under_way(most: int) -> None:
    times = {"a": [1, 0, 2], "b": [0], "c": [], "d": [3], "e": [0, 0, 1]}
    units = {name: (lambda name=name, each=each: toy_steps(name, each)) for name, each in times.items()}
    with InThisProcess() as workers:
        parts = {part.label: part.value.result.records[0].states for part in Together(units, lambda: most, CrossCheckResult).run(workers)}
    assert parts == {name: 2 ** sum(each) for name, each in times.items()}


def test_no_more_units_are_under_way_than_are_allowed() -> None:
    begun: list[str] = []

    def steps(name: str) -> Steps:
        begun.append(name)
        return (yield from toy_steps(name, [2]))

    together = Together({name: (lambda name=name: steps(name)) for name in "abcdef"}, lambda: 2, CrossCheckResult)
    with InThisProcess() as workers:
        for done, _ in enumerate(together.run(workers), start=1):
            assert len(begun) <= done + 2
    assert begun == list("abcdef")


def test_a_unit_under_way_asks_only_for_what_was_not_answered(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two tasks beside each other, then one after the other; the night is interrupted before each of them in turn."""

    class Beside(Doubling):
        def inquiries(self) -> Iterator[list[Inquiry[None]]]:
            yield [self._doubled() for _ in range(2)]

    def steps() -> Steps:
        first = Beside(1, 2)
        yield first
        return (yield from toy_steps(str(first.value), [2, 0, 1]))

    monkeypatch.setenv("HARNESS_CACHE", str(tmp_path))
    answered, asked = Answered.of(tmp_path / "history.sqlite", "mine", "today").of_stage("toy"), 0
    other = Answered.of(tmp_path / "history.sqlite", "mine", "today").of_stage("atlas")

    class Dying(InThisProcess):
        def run(self, tasks: Iterable[Task], further: Callable[[], Iterable[Task]] = tuple) -> Iterator[Outcome]:
            nonlocal asked
            for outcome in super().run(tasks, further):
                asked += 1
                yield outcome
                raise KeyboardInterrupt

    values = []
    for _ in range(8):
        with Dying() as workers, suppress(KeyboardInterrupt):
            values += [part.value for part in Together({"a": steps}, lambda: 1, CrossCheckResult, answered).run(workers)]
    assert asked == 7
    [value] = values
    with InThisProcess() as workers:
        [unbroken] = Together({"a": steps}, lambda: 1, CrossCheckResult).run(workers)
    assert value == unbroken.value
    assert other.count() == 0 < answered.count()
    answered.forget("a")
    assert answered.count() == 0


def test_an_answer_that_was_being_written_is_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A kill before the file has its name: a night that goes on tells how many answers it has, and asks for that one again."""
    monkeypatch.setenv("HARNESS_CACHE", str(tmp_path))
    answered, outcome = Answered.of(tmp_path / "history.sqlite", "mine", "today"), Outcome(Task(None, double, (1,)), value=2)
    answered.keep("a", 0, 0, outcome)
    with monkeypatch.context() as killed:
        killed.setattr(Path, "replace", lambda *_: None)
        killed.setattr(Path, "unlink", lambda *_, **__: None)
        answered.keep("a", 1, 1, outcome)
    assert len([path for path in tmp_path.rglob("*") if path.is_file()]) == 2
    assert answered.count() == 1 == len(list(answered.read("a")))


@pytest.mark.parametrize("damage", ["cut", "gone", "other question"])
def test_answers_that_cannot_be_used_are_asked_again(damage: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HARNESS_CACHE", str(tmp_path))
    answered = Answered.of(tmp_path / "history.sqlite", "mine", "today")

    def found() -> list[int]:
        with InThisProcess() as workers:
            parts = Together({"a": lambda: toy_steps("a", [3])}, lambda: 1, CrossCheckResult, answered).run(workers)
            return [part.value.result.records[0].states for part in parts]

    assert found() == [8]
    files = sorted(path for path in tmp_path.rglob("*") if path.is_file())
    assert [file.name for file in files] == ["0", "1", "2"]
    if damage == "cut":
        files[1].write_bytes(files[1].read_bytes()[:-3])
    elif damage == "gone":
        files[0].unlink()
    else:
        answered.keep("a", 1, 7, Outcome(Task(None, double, (1,)), value=5))
    assert found() == [8]


class Broken(Doubling):
    """Raises when its first task has come back, while others are out."""

    def __init__(self, error: Exception) -> None:
        super().__init__(1, 1)
        self._error = error

    def inquiries(self) -> Iterator[list[Inquiry[None]]]:
        yield [self._doubled() for _ in range(3)]

    def _doubled(self) -> Inquiry[None]:
        yield from ask(double, 1)
        raise self._error


@pytest.mark.parametrize("most", [1, 3])
def test_a_unit_that_fails_costs_itself(most: int) -> None:
    def breaking(error: Exception) -> Steps:
        yield Broken(error)
        raise AssertionError("nothing follows")

    def raising() -> Steps:
        yield Doubling(1, 1)
        raise ZeroDivisionError("nothing by nothing")

    units = {
        "fault": lambda: breaking(KeyError("gone")),
        "file": lambda: breaking(InvalidModel("a.xml", 3, "is no model")),
        "late": raising,
        "good": lambda: toy_steps("good", [2]),
    }
    with InThisProcess() as workers:
        parts = {part.label: part.value for part in Together(units, lambda: most, CrossCheckResult).run(workers)}
    [fault] = parts["fault"].faults
    assert re.fullmatch(r"fault: KeyError: 'gone' \(test_course\.py:\d+\)", fault)
    assert [str(problem) for problem in parts["file"].problems] == ["a.xml:3: is no model"]
    assert parts["late"].faults[0].startswith("late: ZeroDivisionError: nothing by nothing")
    assert parts["good"].result.records[0].states == 4
    assert not any(parts["fault"].result.stored_parts())


@pytest.mark.parametrize(
    "error", [InvalidRequest("the cluster is gone"), OSError(28, "no space left"), MemoryError()], ids=lambda one: type(one).__name__
)
def test_what_the_surroundings_refuse_ends_the_night(error: Exception) -> None:
    def steps() -> Steps:
        yield Broken(error)
        return UnitFound(result=CrossCheckResult())

    with InThisProcess() as workers, pytest.raises(type(error)):
        list(Together({"a": steps}, lambda: 1, CrossCheckResult).run(workers))


def toy(names: Sequence[str] = ("a", "b", "c"), fail_at: str = "") -> Stage:
    def steps(choice: NightChoice, name: str) -> Steps:
        if name == fail_at:
            raise KeyboardInterrupt
        return (yield from toy_steps(name, [1]))

    def closing(choice: NightChoice, found: CrossCheckResult, workers: object) -> CrossCheckResult:
        return CrossCheckResult(records=[replace(RECORD, system="all", states=len(found.records))])

    return Stage(
        name="toy", kind=CrossCheckResult, time_limit=10.0, units=lambda choice: names, steps=steps,
        cases=lambda found: [case_of(record, "toy") for record in found.records], closing=closing, is_timed=True,
    )  # fmt: skip


def choice_of(settings: NightSettings = SETTINGS) -> NightChoice:
    return NightChoice(Library.built_in(), settings)


def run_to_the_end(course: Course, stage: Stage) -> None:
    with InThisProcess() as workers:
        for _ in course.complete(stage, workers):
            pass


def records_of(history: History, night: int) -> list[tuple[str, int]]:
    course = history.read(night, Night)
    study = course.study_of("toy")
    assert study is not None
    return sorted((one.system, one.states) for one in history.read(study, CrossCheckResult).records)


def test_a_night_that_goes_on_asks_for_what_is_left(tmp_path: Path) -> None:
    with History(tmp_path / "history.sqlite") as history:
        course = Course.begin(history, RUN, choice_of())
        with pytest.raises(KeyboardInterrupt):
            run_to_the_end(course, toy(fail_at="c"))
        assert unfinished(history, RUN.library) == course.number
        assert records_of(history, course.number) == [("a", 2), ("b", 2)]
        again = Course.resume(history, replace(RUN, started="2026-02-01T02:00:00+00:00"), choice_of())
        assert (again.number, again.resumed, again.run) == (course.number, 2, RUN)
        assert again.left(toy()) == ["c"]
        assert again.steps(toy()) == 2
        run_to_the_end(again, toy())
        assert records_of(history, course.number) == [("a", 2), ("all", 3), ("b", 2), ("c", 2)]
        assert again.steps(toy()) == 0
        run_to_the_end(again, toy())
        assert len(records_of(history, course.number)) == 4
        again.end("All is well.")
        assert unfinished(history, RUN.library) is None
        assert Course.resume(history, RUN, choice_of()).number != course.number


def test_a_unit_and_its_mark_are_stored_together_or_not_at_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with History(tmp_path / "history.sqlite") as history:
        course = Course.begin(history, RUN, choice_of())
        run_to_the_end(course, toy(["a"]))
        monkeypatch.setattr("harness.results.night.Night.stored_parts", lambda self: iter([("done", object())]))
        with pytest.raises(TypeError):
            run_to_the_end(course, toy(["a", "b"]))
        monkeypatch.undo()
        assert records_of(history, course.number) == [("a", 2), ("all", 1)]
        assert history.read(course.number, Night).units_of("toy") == {"a", "(closing)"}


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"states": 20}, "states was 10 and is 20"),
        ({"survey": ["robots"]}, "survey was none and is robots"),
        ({"versions": {"mujoco": "4.1"}}, "mujoco was 4.0 and is 4.1"),
        ({"inputs": {"systems/a.py": "13"}}, "the content of systems/a.py has changed"),
        ({"seed": 1, "motion": True}, "seed was 0 and is 1; motion was False and is True"),
    ],
)
def test_a_night_does_not_go_on_as_another(tmp_path: Path, changed: dict[str, Any], said: str) -> None:
    with History(tmp_path / "history.sqlite") as history:
        Course.begin(history, RUN, choice_of())
        with pytest.raises(InvalidRequest, match=said):
            Course.resume(history, RUN, choice_of(replace(SETTINGS, **changed)))


def test_a_night_of_another_library_does_not_go_on(tmp_path: Path) -> None:
    with History(tmp_path / "history.sqlite") as history:
        first = Course.begin(history, RUN, choice_of())
        assert Course.resume(history, replace(RUN, library="mine"), choice_of()).number != first.number
        assert Course.resume(history, RUN, choice_of()).number == first.number


def test_the_night_before_is_the_last_that_ended(tmp_path: Path) -> None:
    with History(tmp_path / "history.sqlite") as history:
        first = Course.begin(history, RUN, choice_of())
        run_to_the_end(first, toy(["a"]))
        assert first.night_before([toy()]) is None
        first.end("done")
        Course.begin(history, RUN, choice_of())
        third = Course.begin(history, RUN, choice_of())
        before = third.night_before([toy()])
        assert before is not None
        assert [case.group for case in before] == ["a", "all"]
        assert cases_of(history, first.night, toy()) == before


def test_stages_are_found_by_name_in_their_order() -> None:
    assert list(find_stages()) == ["cross-check", "atlas", "survey", "bench", "faults"]
    assert [stage.name for stage in select_stages(["bench", "atlas"])] == ["atlas", "bench"]
    with pytest.raises(InvalidRequest, match=r"'benhc'.*bench"):
        select_stages(["benhc"])
