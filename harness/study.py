"""Studies: everything the harness computes on worker processes, and the one loop that runs them.

A cross-check, an atlas, a benchmark, a search, a diagnosis and a fault campaign are each a ``Study``. What is asked next
depends on what was answered: ``tasks`` gives what can run by now, ``take`` the parts that an outcome completes, ``result`` all
of them.

A study is written as a generator for each mechanism, file or case, in which a question and what is made of its answer stand in one
place. Several generators are under way at once; where a process dies, the task that it ran has an outcome that says so, and all
others go on::

    def inquiry(self, name: str) -> Inquiry[None]:
        outcome = yield from ask(call, load_mechanism, self.library, name, affinity=name)
        mechanism = outcome.value
        ...
        yield Part(name, record)
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Hashable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

from harness.errors import InvalidEngine, InvalidInput, InvalidRequest, is_out_of_memory, message_of
from harness.workers import Outcome, Task, Workers
from harness.workers.tasks import MORE_MEMORY


@dataclass(frozen=True)
class Part:
    """A completed part of a study: ``label`` for a progress bar, ``value`` for the history and the JSON file."""

    label: str
    value: Any


_Found = TypeVar("_Found")
# A generator that yields tasks, to be sent their outcomes in the same order, and parts as they are complete; it asks before its first
# part.
Inquiry = Generator[Sequence[Task] | Part, Sequence[Outcome], _Found]


def ask(function: Callable[..., Any], *arguments: Any, affinity: Hashable | None = None) -> Inquiry[Outcome]:
    """The outcome of one task, ``function(*arguments, note)``; of an ``affinity`` as of ``Task``."""
    (outcome,) = yield [Task(None, function, arguments, affinity)]
    return outcome


# A channel whose text survives a crash, which a task takes last.
Note = Callable[[str], None]


def call(function: Callable[..., Any], *arguments: Any) -> Any:
    """Result of a function that takes no note; a task is ``ask(call, function, ...)``."""
    return function(*arguments[:-1])


@dataclass(eq=False)
class _UnderWay:
    """An inquiry with the outcomes that it waits for."""

    inquiry: Inquiry[None]
    outcomes: dict[int, Outcome] = field(default_factory=dict)
    awaited: int = 0


class Study:
    """Work for worker processes that is made of generators, as many under way as workers have time for.

    ``inquiries`` gives rounds of generators. Those of a round begin together, once all of the round before have ended.

    Attributes:
        title: of the progress bar. steps: how many parts there will be, as far as it is known.
        found: what is complete so far. problems: what its user has to mend. crashed: whether a process died or ran out of time.
        refused: whether an engine file gives no engine.
    """

    title: str
    steps: int

    def __init__(self, found: Any = None) -> None:
        self.found = found
        self.problems: list[Exception] = []
        self.crashed = self.refused = False
        self._next: list[Task] = []
        self._open = 0
        self._rounds = self.inquiries()

    def inquiries(self) -> Iterator[Iterable[Inquiry[None]]]:
        """The rounds in order, each made when the one before is complete."""
        yield from ()

    def result(self) -> Any:
        """Everything that is complete so far; nothing of a study without rounds, which takes failures alone."""
        return self.found

    def kept(self, label: str, found: Any) -> Part:
        """A completed part, which is added to what was found before."""
        self.found.extend(found)
        return Part(label, found)

    def tasks(self) -> Sequence[Task]:
        """The tasks that can run by now and were not given out before."""
        while not self._next and not self._open and (coming := next(self._rounds, None)) is not None:
            for inquiry in coming:
                self._begin(inquiry)
        work, self._next = self._next, []
        return work

    def take(self, outcome: Outcome) -> Iterable[Part]:
        """The parts that the outcome of one of ``tasks`` completes."""
        under_way, place = outcome.task.key
        under_way.outcomes[place] = outcome
        if len(under_way.outcomes) == under_way.awaited:
            yield from self._go_on(under_way)

    def _begin(self, inquiry: Inquiry[None]) -> None:
        """Let a generator go on beside the others of its round."""
        self._open += 1
        for part in self._go_on(_UnderWay(inquiry)):
            raise AssertionError(f"{part.label} is complete before anything was asked")

    def _go_on(self, under_way: _UnderWay) -> Iterator[Part]:
        """Send what has come, and give out what is asked next; no task at all is answered at once."""
        outcomes = [under_way.outcomes[place] for place in sorted(under_way.outcomes)]
        under_way.outcomes, under_way.awaited = {}, 0
        try:
            coming = under_way.inquiry.send(outcomes) if outcomes else next(under_way.inquiry)
            while isinstance(coming, Part) or not coming:
                if isinstance(coming, Part):
                    yield coming
                    coming = next(under_way.inquiry)
                else:
                    coming = under_way.inquiry.send(())
        except StopIteration:
            self._open -= 1
            return
        under_way.awaited = len(coming)
        self._next += [replace(task, key=(under_way, place)) for place, task in enumerate(coming)]

    def failure(self, outcome: Outcome) -> str:
        """Why a task gave no value, "" where it did; invalid input is added to ``problems``, a death or a refusal is remembered."""
        if outcome.crash is not None:
            self.crashed = True
            return str(outcome.crash)
        if isinstance(outcome.exception, InvalidEngine):
            self.refused = True
            return str(outcome.exception)
        if isinstance(outcome.exception, InvalidInput):
            self.report(outcome.exception)
            return str(outcome.exception)
        return "" if outcome.exception is None else sentence(outcome.exception)

    def fails(self, outcome: Outcome) -> bool:
        """True for a task that gave no value; why is a problem then, whatever it was, for nothing else is left to do."""
        failure, exception = self.failure(outcome), outcome.exception
        if failure and not isinstance(exception, InvalidInput):
            self.report(exception if isinstance(exception, InvalidRequest) else InvalidRequest(failure))
        return bool(failure)

    def report(self, problem: Exception) -> None:
        """Add a problem that is not known yet."""
        if str(problem) not in map(str, self.problems):
            self.problems.append(problem)


def run_study(study: Study, workers: Workers) -> Iterator[Part]:
    """Run to the end on workers whose context the caller has entered; each part as soon as it is complete."""
    for outcome in workers.run(study.tasks(), study.tasks):
        yield from study.take(outcome)


def complete(study: Study, workers: Workers) -> Any:
    """The result of a study that is run to the end as by ``run_study``."""
    for _ in run_study(study, workers):
        pass
    return study.result()


def sentence(exception: BaseException) -> str:
    """An exception as a sentence: kind and message, and what leaves more memory where that ran out."""
    remedy = MORE_MEMORY if is_out_of_memory(exception) else ""
    return f"{type(exception).__name__}: {'; '.join(filter(None, [message_of(exception), remedy]))}"
