"""Why records of a cross-check are not as expected: who is at fault, the terms that are wrong, and the change that explains it."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from harness.check.settings import Settings
from harness.check.tasks import Assignment
from harness.diagnose.held import Difference, differences, held_by
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

SECONDS = 10.0
# What all diagnoses of one call may take together on each worker, when very much is wrong, and the least that any may.
SECONDS_IN_ALL, LEAST_SECONDS = 120.0, 2.0
# Of the time limit of a task; the rest is for loading and compiling.
SHARE_OF_TIME_LIMIT = 0.5
_WRONG = {Verdict.DISAGREES.value, Verdict.UNSTABLE.value, Verdict.ERROR.value}


def wrong_records(records: Iterable[Record]) -> list[Record]:
    """Those that have a cause: wrong, and not for a reason that is known."""
    return [record for record in records if record.verdict in _WRONG and not record.as_expected]


def find_causes(
    settings: Settings,
    records: Sequence[Record],
    workers: Workers,
    *,
    seconds: float = SECONDS,
    crashes: Collection[tuple[str, str | None]] = (),
) -> Iterator[Cause]:
    """The cause of each of ``records`` that is wrong and not as expected, as soon as it is known.

    Args:
        settings: of the cross-check. records: of all its subjects, for who is wrong is told by who is right.
        workers: on which a diagnosis takes ``seconds`` at most beside loading, less where very much is wrong.
        crashes: (system, what died or hung, and would again): a subject, a model's format, or None for the system itself.
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
    share = min(seconds, max(LEAST_SECONDS, SECONDS_IN_ALL * len(workers) / max(1, len(chosen))), SHARE_OF_TIME_LIMIT * workers.time_limit)
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
    """What the subjects that read a model of system ``name`` do not hold alike after loading, before any dynamics."""
    reading = [subject for subject in subjects(settings.library) if subject.format != EQUATIONS]
    work = [Task(str(subject), _hold, (settings.library, name, subject, _path(settings, name, subject))) for subject in reading]
    # Who cannot load its model is told by its record.
    found = {outcome.task.key: outcome.value for outcome in workers.run(work) if outcome.value is not None}
    held = {subject: holding for subject, (_, holding) in sorted(found.items()) if holding is not None}
    return differences(name, held, {model.format: model for model, _ in found.values()})


def _hold(library: Library, name: str, subject: Subject, path: Path, note: Callable[[str], None]) -> tuple[ModelFile, HeldModel | None]:
    """The file of a subject and what its engine holds of it, as a task for ``harness.workers``; raises what reading and loading raise."""
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
