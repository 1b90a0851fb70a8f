"""The causes of records that are not as expected: the party at fault, the terms that are wrong, the change that explains it.

One subject's diagnosis is of its terms, its model file, and the textbook's side. A model that the load audit refuses is diagnosed
all the same: the engine answers, and its answers show what is wrong.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from harness.certify.gaps import beside_gaps, gaps_of
from harness.certify.sampling import generic_sample
from harness.crosscheck.assignment import Assignment, acceleration_truth_of
from harness.crosscheck.held import Difference, differences, held_by
from harness.crosscheck.perturbation import diagnostic_states, watch
from harness.crosscheck.settings import Settings
from harness.diagnosis.meaning import errors_of_files
from harness.diagnosis.model_side import EVALUATIONS, diagnose
from harness.diagnosis.pattern import infer_from_records, subject_named
from harness.diagnosis.result import Conclusion, Diagnosis, digits_of
from harness.diagnosis.terms import TermComparison, TermTruth, compare_terms
from harness.diagnosis.textbook_side import diagnose_textbook, textbook_evaluations
from harness.engines import EQUATIONS, HeldModel, Subject, accelerations, engine_files, is_native, load_engine, load_model, subjects
from harness.equations.states import States
from harness.errors import InvalidInput, InvalidModel
from harness.library import MODEL_SUFFIXES, Library, member_of
from harness.models.model_file import ModelFile
from harness.results.cross_check import Cause
from harness.results.records import Record
from harness.study import Part, Rounds, Study, run_study
from harness.verdict import AGREEMENT, Verdict
from harness.workers import Outcome, Task, Workers

# Evaluations of all diagnoses of one call together, when very much is wrong, and the least of any.
EVALUATIONS_IN_ALL, LEAST_EVALUATIONS = 30_000, 300
# Positions at which terms are compared, of a mechanism of up to so many velocities; their cost grows with the cube of those.
TERM_STATES, TERM_VELOCITIES, LEAST_TERM_STATES = 64, 12, 4
# Of a parameter in a system file.
MOST_DIGITS_WRITTEN = 12
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
        self._settings, self._records, self._evaluations = settings, records, evaluations
        self._causes: list[Cause] = []
        self._meanings: dict[str, Mapping[str, float]] = {}
        wrong = [(record, subject_named(record.subject)) for record in records if record.verdict in _WRONG and not record.as_expected]
        wrong.sort(key=lambda pair: not is_native(settings.library, pair[1]))
        # What failed has nothing to be diagnosed, or would fail again.
        self._silent = [
            record
            for record, subject in wrong
            if record.failed or any((record.system, what) in crashes for what in (record.subject, subject.format, None))
        ]
        self._wrong = [record for record, _ in wrong if record not in self._silent]
        self._crashes = crashes
        self.steps = len(self._wrong)

    def rounds(self) -> Iterator[Sequence[Task]]:
        """What the files mean, where engines are wrong; then the diagnoses, which depend on it."""
        yield [task for name in dict.fromkeys(record.system for record in self._wrong) if (task := self._reading(name)) is not None]
        yield self._diagnosing()

    def _reading(self, name: str) -> Task | None:
        library, wrong = self._settings.library, [record for record in self._wrong if record.system == name]
        states = [state for record in wrong for state in _states_of(record)]
        if (name, None) in self._crashes or not any(subject_named(record.subject).format != EQUATIONS for record in wrong):
            return None
        paths = {
            form: self._settings.stand_ins.get(form, library.model_path(name, form))
            for form in MODEL_SUFFIXES
            if (form in self._settings.stand_ins or library.has_model(name, form)) and (name, form) not in self._crashes
        }
        if not paths:
            return None
        return Task((self._read, name), errors_of_files, (library, name, paths, states, self._settings.seed), name)

    def _read(self, outcome: Outcome, name: str) -> None:
        self._meanings[name] = outcome.value or {}

    def _diagnosing(self) -> list[Task]:
        settings = self._settings
        available = [str(subject) for subject in subjects(settings.library)]
        inferences = infer_from_records(self._records, available, self._meanings, settings.library.system_of)
        # The record that is diagnosed, and the causes of all that are wrong for the same reason.
        chosen: dict[tuple[str, str], tuple[Record, list[Cause]]] = {}
        for record in (*self._silent, *self._wrong):
            inference, model_format = inferences[record.system], subject_named(record.subject).format
            cause = Cause(system=record.system, subject=record.subject, inference=inference.sentence, first_line=inference.sentence)
            if record in self._silent:
                self._causes.append(cause)
                continue
            is_of_the_model = inference.party == f"model {model_format}"
            key = record.system, model_format if is_of_the_model else record.subject
            chosen.setdefault(key, (record, []))[1].append(cause)
        share = min(self._evaluations, max(LEAST_EVALUATIONS, EVALUATIONS_IN_ALL // max(1, len(chosen))))
        tasks = []
        for record, alike in chosen.values():
            subject = subject_named(record.subject)
            tolerance = max(AGREEMENT, record.expected_backward_error if record.expected != Verdict.AGREES else 0.0)
            suspects_textbook = inferences[record.system].party == "equations"
            scope = Scope(settings.seed, share, tolerance, _states_of(record))
            arguments = (settings.library, record.system, subject, settings.stand_ins.get(subject.format), scope)
            tasks.append(Task((self._diagnosed, str(subject), alike, suspects_textbook), examine, arguments, record.system))
        return tasks

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


@functools.singledispatch
def diagnoses_of(library: Library, settings: Settings, records: Sequence[Record], **options: Any) -> Study:
    """The study that finds the causes of a cross-check's records; its result is a list of ``Cause``, and ``options`` are of ``Diagnoses``.

    A kind of library whose records have other causes registers its own study.
    """
    return Diagnoses(settings, records, **options)


def _states_of(record: Record) -> list[dict[str, list[float]]]:
    """The states that are known to show a verdict."""
    shown = record.representative
    return [state for state in (record.worst_state, shown.state if shown is not None else None) if state is not None]


def find_causes(settings: Settings, records: Sequence[Record], workers: Workers, **options: Any) -> list[Cause]:
    """The result of ``diagnoses_of`` on workers whose context the caller has entered, by system and subject."""
    study = diagnoses_of(settings.library, settings, records, **options)
    for _ in run_study(study, workers):
        pass
    causes: list[Cause] = study.result()
    return causes


def find_differences(settings: Settings, name: str, workers: Workers) -> list[Difference]:
    """The quantities that subjects which read a model of system ``name`` do not hold alike after loading, before any dynamics."""
    # Load errors are already in the record.
    loads = {name for name, file in engine_files(settings.library).items() if file.outcome.value is not None}
    reading = [subject for subject in subjects(settings.library) if subject.format != EQUATIONS and subject.engine in loads]
    work = [Task(str(subject), _hold, (settings.library, name, subject, settings.stand_ins.get(subject.format))) for subject in reading]
    found = {outcome.task.key: outcome.value for outcome in workers.run(work) if outcome.value is not None}
    held = {subject: holding for subject, (_, holding) in sorted(found.items()) if holding is not None}
    return differences(name, held, {model.format: model for model, _ in found.values() if model is not None})


def _hold(
    library: Library, name: str, subject: Subject, stand_in: Path | None, note: Callable[[str], None]
) -> tuple[ModelFile | None, HeldModel | None]:
    """The file of a subject and its engine's quantities after loading, as a task for ``harness.workers``; raises as both do."""
    own = Assignment.of(library, name, subject, stand_in)
    return own.model, held_by(load_model(library, subject, own.mechanism, own.model))


def examine(
    library: Library, name: str, subject: Subject, stand_in: Path | None, scope: Scope, note: Callable[[str], None]
) -> SubjectDiagnosis:
    """``diagnose_subject`` of a system and the model that stands in for its own, if any, as a task for ``harness.workers``.

    Raises:
        InvalidInput: the system or its model cannot be used. harness.engines.Unsupported: the engine cannot express it.
    """
    return diagnose_subject(Assignment.of(library, name, subject, stand_in), scope, note)


@dataclass(frozen=True)
class SubjectDiagnosis:
    """The terms of one subject, and both sides of its diagnosis.

    Attributes:
        subject: as "mujoco/mjcf". terms: its terms against the certified ones.
        model: the diagnosis of its file; None for one that reads none. textbook: that of the system's parameters.
    """

    subject: str
    terms: TermComparison
    model: Diagnosis | None
    textbook: Diagnosis

    def first_line(self, suspects_textbook: bool = False) -> str:
        """The model's place where one explains, else the textbook's parameter, else what the model's side came to.

        ``suspects_textbook``: the textbook's parameter goes first where one explains, but for a value that nobody would have written
        where the model has an explanation without any.
        """
        explained = self.model is not None and self.model.conclusion == Conclusion.EXPLAINED
        textbook_explains = self.textbook.conclusion == Conclusion.EXPLAINED
        of_model, of_textbook = (side.first if side is not None else None for side in (self.model, self.textbook))
        if of_model is not None and of_model.value is None and of_textbook is not None:
            suspects_textbook = suspects_textbook and digits_of(of_textbook.value) <= MOST_DIGITS_WRITTEN
        if self.model is None or (textbook_explains and (suspects_textbook or not explained)):
            return self.textbook.first_line
        return self.model.first_line

    def as_json(self) -> dict[str, Any]:
        """Plain data."""
        return {
            "subject": self.subject,
            "terms": self.terms.as_json(),
            "model": None if self.model is None else self.model.as_json(),
            "textbook": self.textbook.as_json(),
        }


@dataclass(frozen=True)
class Scope:
    """The states of a diagnosis and its limits.

    Attributes:
        seed: of the sampled states. evaluations: of changed models that it may take; of the textbook in proportion.
        tolerance: the largest backward error that explains [data roundoffs].
        worst_states: {"q", "v", "tau"} of states at which the subject is known to be wrong, to be among those of the diagnosis.
    """

    seed: int
    evaluations: int = EVALUATIONS
    tolerance: float = AGREEMENT
    worst_states: Sequence[Mapping[str, Sequence[float]]] = ()


def diagnose_subject(assignment: Assignment, scope: Scope, note: Callable[[str], None]) -> SubjectDiagnosis:
    """Diagnose a subject; each stage is announced by ``note``.

    Raises:
        InvalidModel: the engine refuses the model.
        harness.engines.Unsupported: the engine cannot express the mechanism.
    """
    mechanism, model, library = assignment.mechanism, assignment.model, assignment.library
    note("loading")
    engine = load_engine(library, assignment.subject.engine)
    of_answers = acceleration_truth_of(assignment)
    kernel = of_answers.kernel
    worst = [States.at(**state) for state in scope.worst_states]
    states = States.concatenate([diagnostic_states(mechanism, scope.seed), *worst])
    try:
        loaded = engine.load(mechanism if model is None else model, mechanism.joints, mechanism.gravity)
        watched = None if model is None else watch(engine, mechanism, model, states)
    except (ValueError, KeyError) as error:
        if model is None:
            raise
        raise InvalidModel(model.path, None, f"{assignment.subject.engine} refuses it: {error}") from error
    answer = accelerations(loaded, states)
    note("comparing terms")
    count = TERM_STATES * min(1.0, (TERM_VELOCITIES / len(mechanism.joints)) ** 3)
    positions = generic_sample(mechanism, max(LEAST_TERM_STATES, int(count)), scope.seed)
    terms = compare_terms(TermTruth(kernel, positions), loaded, str(assignment.subject), of_answers.factorises)
    note("diagnosing the model")
    of_model = None
    if watched is not None:
        truth = beside_gaps(kernel.evaluate(states), mechanism, states, gaps_of(loaded, states))
        of_model = diagnose(watched, truth, evaluations=scope.evaluations, tolerance=scope.tolerance, factorises=of_answers.factorises)
    note("diagnosing the textbook's side")
    path = library.system_path(mechanism.name)
    member = member_of(path)
    of_textbook = diagnose_textbook(
        kernel,
        states,
        answer,
        path if member is None else member[0],
        tolerance=scope.tolerance,
        factorises=of_answers.factorises,
        evaluations=int(textbook_evaluations(mechanism) * scope.evaluations / EVALUATIONS),
        parameters=len(mechanism.parameters),
    )
    return SubjectDiagnosis(str(assignment.subject), terms, of_model, of_textbook)
