"""The causes of records that are not as expected: the party at fault, the terms that are wrong, the change that explains it."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from harness.check.settings import Settings
from harness.check.tasks import Assignment
from harness.diagnose.held import Difference, differences, held_by
from harness.diagnose.model_side import EVALUATIONS
from harness.diagnose.pattern import infer_from_records
from harness.diagnose.subject import Scope, SubjectDiagnosis, diagnose_subject
from harness.engines import EQUATIONS, HeldModel, Subject, is_native, load_engine, subjects
from harness.equations.derivation import load_mechanism
from harness.errors import InvalidInput
from harness.library import Library
from harness.models.model_file import ModelFile, read_model
from harness.results.causes import Cause
from harness.results.records import Record
from harness.verdict import AGREEMENT, Verdict
from harness.workers import Task, Workers

# Evaluations of all diagnoses of one call together, when very much is wrong, and the least of any.
EVALUATIONS_IN_ALL, LEAST_EVALUATIONS = 30_000, 300
_WRONG = {Verdict.DISAGREES.value, Verdict.UNSTABLE.value, Verdict.ERROR.value}


def wrong_records(records: Iterable[Record]) -> list[Record]:
    """Those that have a cause: wrong, and not for a reason that is known."""
    return [record for record in records if record.verdict in _WRONG and not record.as_expected]


def find_causes(
    settings: Settings,
    records: Sequence[Record],
    workers: Workers,
    *,
    evaluations: int = EVALUATIONS,
    crashes: Collection[tuple[str, str | None]] = (),
) -> Iterator[Cause]:
    """The cause of each of ``records`` that is wrong and not as expected, as soon as it is known.

    Args:
        settings: of the cross-check. records: of all its subjects, since the party at fault follows from those that agree.
        workers: that diagnose; they end a diagnosis that hangs.
        evaluations: of changed models that a diagnosis takes at most; fewer where very much is wrong.
        crashes: (system, part that died or hung, and would again): a subject, a model's format, or None for the system itself.
    """
    inferences = infer_from_records(records, [str(subject) for subject in subjects(settings.library)])
    chosen: dict[tuple[str, str], Record] = {}
    causes: dict[tuple[str, str], list[Cause]] = {}
    for record in sorted(wrong_records(records), key=lambda record: not _is_native(settings, record)):
        inference = inferences[record.system]
        cause = Cause(system=record.system, subject=record.subject, inference=inference.sentence, first_line=inference.sentence)
        _, _, model_format = record.subject.partition("/")
        if any((record.system, what) in crashes for what in (record.subject, model_format, None)):
            yield cause
            continue
        is_of_the_model = inference.party == f"model {model_format}"
        key = record.system, model_format if is_of_the_model else record.subject
        chosen.setdefault(key, record)
        causes.setdefault(key, []).append(cause)
    share = min(evaluations, max(LEAST_EVALUATIONS, EVALUATIONS_IN_ALL // max(1, len(chosen))))
    work: list[Task] = []
    for key, record in chosen.items():
        subject = _subject(record)
        path = None if subject.format == EQUATIONS else _path(settings, record.system, subject)
        tolerance = max(AGREEMENT, record.expected_backward_error if record.expected != Verdict.AGREES else 0.0)
        worst = [] if record.worst_state is None else [record.worst_state]
        scope = Scope(settings.seed, share, tolerance, worst)
        work.append(Task(key, examine, (settings.library, record.system, subject, path, scope)))
    for outcome in workers.run(work):
        key, found = outcome.task.key, outcome.value
        suspects_textbook = inferences[chosen[key].system].party == "equations"
        for cause in causes[key]:
            if found is None:
                yield _unanswered(cause, chosen[key].subject, outcome.crash or outcome.exception)
            else:
                first_line = found.first_line(suspects_textbook)
                yield replace(cause, first_line=first_line, diagnosed=chosen[key].subject, found=found.as_json())


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
    return model, held_by(load_engine(library, subject.engine).load(model, mechanism.joints, mechanism.gravity))


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


def _is_native(settings: Settings, record: Record) -> bool:
    return is_native(settings.library, _subject(record))


def _subject(record: Record) -> Subject:
    engine, _, model_format = record.subject.partition("/")
    return Subject(engine, model_format or EQUATIONS)


def _unanswered(cause: Cause, diagnosed: str, problem: object) -> Cause:
    """Without a diagnosis; what refuses a model, the record's own message says."""
    if isinstance(problem, InvalidInput):
        return replace(cause, diagnosed=diagnosed)
    return replace(cause, first_line=f"no diagnosis: {problem}", diagnosed=diagnosed)
