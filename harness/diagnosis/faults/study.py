"""Planted faults as a study: one task per model, so that a crash costs that model alone."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

from harness.crosscheck.expected import load_expectations
from harness.diagnosis.faults.campaign import CampaignSettings, run_campaign, smallest_changes
from harness.diagnosis.faults.summary import Fault, SmallestChange, broken_bars
from harness.engines import EQUATIONS, Subject, engine_files, select_subjects, subjects_beside
from harness.errors import InvalidInput, InvalidRequest
from harness.library import Library
from harness.study import Part, Rounds
from harness.verdict import Verdict
from harness.workers import Outcome, Task


class FaultStudy(Rounds):
    """Rows of every model, each found by one task; a ``harness.study.Study``.

    Attributes:
        left_out: (system, subject or format) that is expected to be unsupported, to the reason.
        deaths: a sentence for each model whose process died.
    """

    title = "faults"
    # The order of rows, as names of attributes.
    order: tuple[str, ...]

    def __init__(
        self, models: Sequence[tuple[str, Any]], left_out: Mapping[tuple[str, str], str], function: Callable[..., Any], *given: Any
    ) -> None:
        super().__init__()
        self.left_out, self.deaths = dict(left_out), list[str]()
        self._rows: list[Any] = []
        self.steps = len(models)
        library, *rest = given
        for file in engine_files(library).values():
            self.failure(file.outcome)
        self._next = [Task((self._taken, *model), function, (library, *model, *rest), model[0]) for model in models]

    def result(self) -> list[Any]:
        return sorted(self._rows, key=lambda row: [getattr(row, name) for name in self.order])

    def _taken(self, outcome: Outcome, name: str, what: Any) -> Iterator[Part]:
        rows = outcome.value or []
        if outcome.crash is not None:
            noted = f" at {outcome.crash.note}" if outcome.crash.note else ""
            self.deaths.append(f"{name}, {what}: {self.failure(outcome)}{noted}")
        elif outcome.exception is not None:
            of_file = isinstance(outcome.exception, InvalidInput)
            self.report(outcome.exception if of_file else InvalidRequest(f"{name}, {what}: {outcome.exception}"))  # type: ignore[arg-type]
        self._rows += rows
        yield Part(f"{name} {what}", rows)


class CampaignStudy(FaultStudy):
    """Every kind of fault in the models of ``names``, or in those of ``formats``: what is caught, what is named."""

    order = ("system", "format", "kind")

    def __init__(self, library: Library, names: Sequence[str], settings: CampaignSettings, formats: Sequence[str] = ()) -> None:
        models, left_out = select_models(library, names)
        chosen = [model for model in models if model[1] in formats or not formats]
        super().__init__(chosen, left_out, run_campaign, library, settings)

    def broken(self) -> list[str]:
        """A sentence for each bar that does not hold."""
        rows: list[Fault] = self.result()
        return broken_bars(rows)


class SmallestStudy(FaultStudy):
    """The smallest change of each number that is caught. The numbers are the same for every reader: its native subject is asked."""

    order = ("system", "subject")

    def __init__(self, library: Library, names: Sequence[str], subjects: Sequence[str], states: int, seed: int) -> None:
        pairs, excused = select_pairs(library, names, select_subjects(library, subjects, native_only=True))
        left_out = {(name, str(subject)): reason for (name, subject), reason in excused.items()}
        super().__init__(pairs, left_out, smallest_changes, library, states, seed)

    def broken(self) -> list[SmallestChange]:
        """The numbers whose smallest change is not as theory has it."""
        return [number for number in self.result() if not number.as_in_theory]


def select_pairs(
    library: Library, names: Sequence[str], subjects: Sequence[Subject]
) -> tuple[list[tuple[str, Subject]], dict[tuple[str, Subject], str]]:
    """(system, subject) of all pairs that read a model, and the reasons of those that are expected to be unsupported.

    Without ``names``, families are represented by their smallest member, whose numbers are those of all.

    Raises:
        harness.errors.InvalidRequest: a system that does not exist.
    """
    known = load_expectations(library)
    smallest = [members[0] for path in sorted(library.systems.glob("*.py")) if (members := library.names_in(path))]
    systems = library.select(names) if names else smallest
    pairs = [(name, subject) for name in systems for subject in subjects if subject.format != EQUATIONS]
    expected = {pair: known.of(*pair) for pair in pairs}
    reasons = {pair: one.reason for pair, one in expected.items() if one.verdict == Verdict.UNSUPPORTED}
    return [pair for pair in pairs if pair not in reasons], reasons


def select_models(library: Library, names: Sequence[str]) -> tuple[list[tuple[str, str]], dict[tuple[str, str], str]]:
    """(system, format) of every model that some subject reads, and the reasons of those that none does; raises as above."""
    pairs, excused = select_pairs(library, names, subjects_beside(library))
    models = sorted({(name, subject.format) for name, subject in pairs})
    reasons = {(name, subject.format): reason for (name, subject), reason in reversed(excused.items())}
    return models, {model: reasons[model] for model in sorted(reasons) if model not in models}
