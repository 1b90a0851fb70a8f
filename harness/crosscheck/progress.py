"""What a cross-check holds of a system and of each subject on it while their tasks are under way, and how it asks for more."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

from harness.crosscheck.judgement import Evidence
from harness.crosscheck.settings import Settings
from harness.crosscheck.tasks import Assignment
from harness.engines import Subject
from harness.equations.mechanism import Mechanism
from harness.equations.states import States
from harness.models.model_file import ModelFile
from harness.results.records import ACCELERATIONS
from harness.study import Part, Rounds
from harness.workers import Outcome, Task


@dataclass(kw_only=True)
class Pair(Evidence):
    """A subject on a system while its answers come in.

    Attributes:
        quantity: what it is asked for.
        pending: number of tasks that are still to answer for it.
        componentwise: the componentwise backward error at the worst state; None until it is asked for, NaN where it is not known.
    """

    subject: Subject
    quantity: str = ACCELERATIONS
    assignment: Assignment | None = None
    pending: int = 0
    componentwise: float | None = None

    @property
    def key(self) -> str:
        """Its name among the pairs of its system."""
        return str(self.subject) if self.quantity == ACCELERATIONS else f"{self.subject} {self.quantity}"

    def fail(self, failure: str, unsupported: bool = False, refused: bool = False) -> None:
        """The first failure is the one that is reported."""
        if not self.failure:
            self.failure, self.unsupported, self.refused = failure, unsupported, refused


Pairs = Sequence[Pair]


def answering(pairs: Iterable[Pair]) -> list[Pair]:
    """The pairs that can be asked and have not failed."""
    return [pair for pair in pairs if pair.assignment is not None and not pair.failure]


@dataclass
class System:
    """A system, or a variant of its models, while it is compared."""

    name: str
    pairs: dict[str, Pair]
    mechanism: Mechanism | None = None
    models: dict[str, ModelFile | str] = field(default_factory=dict)
    batches: Iterator[States] = field(default_factory=lambda: iter(()))
    seconds: list[float] = field(default_factory=list)
    compilation_seconds: float | None = None


class Asking(Rounds, ABC):
    """Tasks that answer for several pairs of one system, and what failed.

    Attributes:
        faults: what failed in the harness itself, each with its system.
        crashes: (system, what of it died, ran out of time or cannot be loaded): a subject, the format of a model, or None for the
            system itself.
    """

    def __init__(self, settings: Settings) -> None:
        super().__init__()
        self.settings = settings
        self.faults: list[str] = []
        self.crashes: set[tuple[str, str | None]] = set()
        self._systems: dict[str, System] = {}

    def _ask(
        self, taker: Callable[..., None], system: System, pairs: Pairs, function: Callable[..., Any], *arguments: Any, about: Any = None
    ) -> None:
        """Ask for the next round one task that answers for ``pairs``; ``taker(outcome, system, pairs, about)`` takes its outcome."""
        if pairs:
            for pair in pairs:
                pair.pending += 1
            self._next.append(Task((self._answered, system.name, taker, pairs, about), function, arguments, system.name))

    def _answered(self, outcome: Outcome, name: str, taker: Callable[..., None], pairs: Pairs, about: Any) -> Iterator[Part]:
        for pair in pairs:
            pair.pending -= 1
        taker(outcome, self._systems[name], pairs, about)
        yield from self._completed(self._systems[name])

    @abstractmethod
    def _completed(self, system: System) -> Iterator[Part]:
        """The parts that are complete once all tasks of a pair have answered."""
