"""The causes of records that are not as expected: the party at fault, the terms that are wrong, the change that explains it."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from harness.crosscheck.settings import Settings
from harness.crosscheck.tasks import Assignment
from harness.diagnosis.held import Difference, differences, held_by
from harness.diagnosis.model_side import EVALUATIONS
from harness.diagnosis.pattern import infer_from_records, subject_named
from harness.diagnosis.subject import Scope, SubjectDiagnosis, diagnose_subject
from harness.engines import EQUATIONS, HeldModel, Subject, is_native, load_model, subjects
from harness.equations.derivation import load_mechanism
from harness.errors import InvalidInput
from harness.library import Library
from harness.models.model_file import ModelFile, read_model
from harness.results.cross_check import Cause
from harness.results.records import Record
from harness.study import Part, Rounds, run_study
from harness.verdict import AGREEMENT, Verdict
from harness.workers import Outcome, Task, Workers

# Evaluations of all diagnoses of one call together, when very much is wrong, and the least of any.
EVALUATIONS_IN_ALL, LEAST_EVALUATIONS = 30_000, 300
_WRONG = {Verdict.DISAGREES.value, Verdict.UNSTABLE.value, Verdict.ERROR.value}


class Diagnoses(Rounds):
    """The causes of the records that are wrong and not as expected; a ``harness.study.Study``.

    Args:
        settings: of the cross-check. records: of all its subjects, since the party at fault follows from those that agree.
        evaluations: of changed models that a diagnosis takes at most; fewer where very much is wrong.
        crashes: (system, part that died or hung, and would again): a subject, a model's format, or None for the system itself.
    """

    title = "diagnosis"

    def __init__(
        self,
        settings: Settings,
        records: Sequence[Record],
        *,
        evaluations: int = EVALUATIONS,
        crashes: Collection[tuple[str, str | None]] = (),
    ) -> None:
        super().__init__()
        self._causes: list[Cause] = []
        inferences = infer_from_records(records, [str(subject) for subject in subjects(settings.library)])
        chosen: dict[tuple[str, str], Record] = {}
        alike: dict[tuple[str, str], list[Cause]] = {}
        wrong = [(record, subject_named(record.subject)) for record in records if record.verdict in _WRONG and not record.as_expected]
        for record, subject in sorted(wrong, key=lambda pair: not is_native(settings.library, pair[1])):
            inference = inferences[record.system]
            cause = Cause(system=record.system, subject=record.subject, inference=inference.sentence, first_line=inference.sentence)
            if any((record.system, what) in crashes for what in (record.subject, subject.format, None)):
                self._causes.append(cause)
                continue
            is_of_the_model = inference.party == f"model {subject.format}"
            key = record.system, subject.format if is_of_the_model else record.subject
            chosen.setdefault(key, record)
            alike.setdefault(key, []).append(cause)
        share = min(evaluations, max(LEAST_EVALUATIONS, EVALUATIONS_IN_ALL // max(1, len(chosen))))
        for key, record in chosen.items():
            subject = subject_named(record.subject)
            path = None if subject.format == EQUATIONS else _path(settings, record.system, subject)
            tolerance = max(AGREEMENT, record.expected_backward_error if record.expected != Verdict.AGREES else 0.0)
            worst = [] if record.worst_state is None else [record.worst_state]
            suspects_textbook = inferences[record.system].party == "equations"
            arguments = (settings.library, record.system, subject, path, Scope(settings.seed, share, tolerance, worst))
            self._next.append(Task((self._diagnosed, str(subject), alike[key], suspects_textbook), examine, arguments, record.system))
        self.steps = sum(map(len, alike.values()))

    def result(self) -> list[Cause]:
        return sorted(self._causes, key=lambda cause: (cause.system, cause.subject))

    def _diagnosed(self, outcome: Outcome, diagnosed: str, alike: list[Cause], suspects_textbook: bool) -> Iterator[Part]:
        found: SubjectDiagnosis | None = outcome.value
        about: dict[str, Any] = {"diagnosed": diagnosed}
        if found is not None:
            about |= {"first_line": found.first_line(suspects_textbook), "found": found.as_json()}
        elif not isinstance(outcome.exception, InvalidInput):
            # The record's own message has the reason why a model is refused.
            about |= {"first_line": f"no diagnosis: {outcome.crash or outcome.exception}"}
        for cause in alike:
            self._causes.append(replace(cause, **about))
            yield Part(f"{cause.system} {cause.subject}", self._causes[-1])


def find_causes(settings: Settings, records: Sequence[Record], workers: Workers, **options: Any) -> list[Cause]:
    """The result of ``Diagnoses`` on workers whose context the caller has entered, by system and subject."""
    study = Diagnoses(settings, records, **options)
    for _ in run_study(study, workers):
        pass
    return study.result()


def find_differences(settings: Settings, name: str, workers: Workers) -> list[Difference]:
    """The quantities that subjects which read a model of system ``name`` do not hold alike after loading, before any dynamics."""
    reading = [subject for subject in subjects(settings.library) if subject.format != EQUATIONS]
    work = [Task(str(subject), _hold, (settings.library, name, subject, _path(settings, name, subject))) for subject in reading]
    # Load errors are already in the record.
    found = {outcome.task.key: outcome.value for outcome in workers.run(work) if outcome.value is not None}
    held = {subject: holding for subject, (_, holding) in sorted(found.items()) if holding is not None}
    return differences(name, held, {model.format: model for model, _ in found.values()})


def _hold(library: Library, name: str, subject: Subject, path: Path, note: Callable[[str], None]) -> tuple[ModelFile, HeldModel | None]:
    """The file of a subject and its engine's quantities after loading, as a task for ``harness.workers``; raises as both do."""
    model, mechanism = read_model(path, subject.format), load_mechanism(library, name)
    return model, held_by(load_model(library, subject, mechanism, model))


def examine(
    library: Library, name: str, subject: Subject, path: Path | None, scope: Scope, note: Callable[[str], None]
) -> SubjectDiagnosis:
    """``diagnose_subject`` of a system and the model at ``path``, None for equations, as a task for ``harness.workers``.

    Raises:
        InvalidInput: the system or its model cannot be used. harness.engines.Unsupported: the engine cannot express it.
    """
    model = None if path is None else read_model(path, subject.format)
    assignment = Assignment(library, subject, load_mechanism(library, name), model)
    return diagnose_subject(assignment, scope, note)


def _path(settings: Settings, name: str, subject: Subject) -> Path:
    return settings.stand_ins.get(subject.format) or settings.library.model_path(name, subject.format)
