"""Planted faults as a study: one task per model, so that a crash costs that model alone."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from operator import attrgetter
from typing import Any

from harness.crosscheck.expected import load_expectations
from harness.diagnosis.faults.campaign import CampaignSettings, run_campaign, smallest_changes
from harness.engines import EQUATIONS, Subject, engine_files, select_subjects, subjects_beside
from harness.errors import InvalidInput, InvalidRequest
from harness.library import Library, names_in
from harness.study import Inquiry, Study, ask
from harness.verdict import Verdict


class FaultStudy(Study):
    """Rows of every model, each found by one task, ``function(library, system, format or subject, *given)``; a ``harness.study.Study``.

    Args:
        models: (system, format or subject) of each. left_out: the same of those that are expected to be unsupported, to the reason.
        order: of all rows, as names of attributes.

    Attributes:
        deaths: a sentence for each model whose process died.
    """

    title = "faults"

    def __init__(
        self,
        library: Library,
        models: Sequence[tuple[str, Any]],
        left_out: Mapping[tuple[str, str], str],
        order: Sequence[str],
        function: Callable[..., Any],
        given: Sequence[Any],
    ) -> None:
        super().__init__(list[Any]())
        self.left_out, self.deaths, self.steps = dict(left_out), list[str](), len(models)
        self._library, self._models, self._order = library, models, order
        self._function, self._given = function, given
        for file in engine_files(library).values():
            self.failure(file.outcome)

    def inquiries(self) -> Iterator[Iterable[Inquiry[None]]]:
        yield [self._ask(*model) for model in self._models]

    def result(self) -> list[Any]:
        return sorted(self.found, key=attrgetter(*self._order))

    def _ask(self, name: str, what: Any) -> Inquiry[None]:
        outcome = yield from ask(self._function, self._library, name, what, *self._given, affinity=name)
        if outcome.crash is not None:
            noted = f" at {outcome.crash.note}" if outcome.crash.note else ""
            self.deaths.append(f"{name}, {what}: {self.failure(outcome)}{noted}")
        elif outcome.exception is not None:
            of_file = isinstance(outcome.exception, InvalidInput)
            self.report(outcome.exception if of_file else InvalidRequest(f"{name}, {what}: {outcome.exception}"))  # type: ignore[arg-type]
        yield self.kept(f"{name} {what}", outcome.value or [])


def campaign(library: Library, names: Sequence[str], settings: CampaignSettings, formats: Sequence[str] = ()) -> FaultStudy:
    """Every kind of fault in the models of ``names``, or in those of ``formats``: what is caught, what is named; rows are ``Fault``."""
    models, left_out = select_models(library, names)
    chosen = [model for model in models if model[1] in formats or not formats]
    return FaultStudy(library, chosen, left_out, ("system", "format", "kind"), run_campaign, [settings])


def smallest(library: Library, names: Sequence[str], subjects: Sequence[str], states: int, seed: int) -> FaultStudy:
    """The smallest change of each number that is caught; rows are ``SmallestChange``.

    The numbers are the same for every reader: its native subject is asked.
    """
    pairs, excused = select_pairs(library, names, select_subjects(library, subjects, native_only=True))
    left_out = {(name, str(subject)): reason for (name, subject), reason in excused.items()}
    return FaultStudy(library, pairs, left_out, ("system", "subject"), smallest_changes, [states, seed])


def select_pairs(
    library: Library, names: Sequence[str], subjects: Sequence[Subject]
) -> tuple[list[tuple[str, Subject]], dict[tuple[str, Subject], str]]:
    """(system, subject) of all pairs that read a model, and the reasons of those that are expected to be unsupported, or misread.

    Without ``names``, families are represented by their smallest member, whose numbers are those of all.

    Raises:
        harness.errors.InvalidRequest: a system that does not exist.
    """
    known = load_expectations(library)
    smallest = [members[0] for path in sorted(library.systems.glob("*.py")) if (members := names_in(path))]
    systems = library.select(names) if names else smallest
    pairs = [(name, subject) for name in systems for subject in subjects if subject.format != EQUATIONS]
    expected = {pair: known.of(*pair) for pair in pairs}
    reasons = {pair: one.reason for pair, one in expected.items() if one.verdict in (Verdict.UNSUPPORTED, Verdict.MISREADS)}
    return [pair for pair in pairs if pair not in reasons], reasons


def select_models(library: Library, names: Sequence[str]) -> tuple[list[tuple[str, str]], dict[tuple[str, str], str]]:
    """(system, format) of every model that some subject reads, and the reasons of those that none does; raises as above."""
    pairs, excused = select_pairs(library, names, subjects_beside(library))
    models = sorted({(name, subject.format) for name, subject in pairs})
    reasons = {(name, subject.format): reason for (name, subject), reason in reversed(excused.items())}
    return models, {model: reasons[model] for model in sorted(reasons) if model not in models}
