"""The causes of records that are not as expected: the party at fault, what of the answers is wrong, the change that explains it."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from harness.crosscheck.assignment import Assignment
from harness.crosscheck.held import Difference, differences, held_by
from harness.crosscheck.settings import Settings
from harness.diagnosis.subject import Scope, SubjectDiagnosis, examine
from harness.engines import EQUATIONS, HeldModel, Subject, engine_files, is_native, load_model, subjects
from harness.engines.interface import require_bounds
from harness.errors import InvalidInput
from harness.explain.pattern import Inference, infer_from_records, subject_named
from harness.explain.search import EVALUATIONS
from harness.files.model_file import ModelFile, read_model
from harness.lagrange.derivation import load_mechanism
from harness.library import MODEL_SUFFIXES, Library
from harness.programs.states import States
from harness.results.cross_check import Cause
from harness.results.records import Record
from harness.study import Inquiry, Part, Study, ask
from harness.trees.mechanism import accelerations
from harness.truth.compare import compare
from harness.truth.quantities import find_quantities
from harness.truth.quantities.accelerations import reference_kernel
from harness.truth.sampling import sample
from harness.verdict import AGREEMENT, Verdict
from harness.workers import Task, Workers

# Evaluations of all diagnoses of one call together, when very much is wrong, and the least of any.
EVALUATIONS_IN_ALL, LEAST_EVALUATIONS = 30_000, 300
_WRONG = {Verdict.MISREADS.value, Verdict.DISAGREES.value, Verdict.UNSTABLE.value, Verdict.ERROR.value}


@dataclass
class _Alike:
    """The record that is diagnosed, and the causes of all that are wrong for the same reason."""

    record: Record
    inference: Inference
    causes: list[Cause] = field(default_factory=list)


class Diagnoses(Study):
    """The causes of the records of one quantity that are wrong and not as expected; a ``harness.study.Study``.

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
        self._settings, self._records, self._evaluations, self._crashes = settings, records, evaluations, crashes
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
        self.steps = len(self._wrong)

    def inquiries(self) -> Iterator[Iterable[Inquiry[None]]]:
        """Meanings of the files, where engines are wrong; then the diagnoses, which depend on them."""
        yield [self._read(name) for name in dict.fromkeys(record.system for record in self._wrong if _is_default(record))]
        chosen = self._chosen()
        share = min(self._evaluations, max(LEAST_EVALUATIONS, EVALUATIONS_IN_ALL // max(1, len(chosen))))
        yield [self._diagnose(alike, share) for alike in chosen]

    def result(self) -> list[Cause]:
        return sorted(self._causes, key=lambda cause: (cause.system, cause.subject))

    def _read(self, name: str) -> Inquiry[None]:
        library, wrong = self._settings.library, [record for record in self._wrong if record.system == name]
        states = [state for record in wrong for state in _states_of(record)]
        own = {form: library.model_path(name, form) for form in MODEL_SUFFIXES if library.has_model(name, form)}
        paths = {form: path for form, path in {**own, **self._settings.stand_ins}.items() if (name, form) not in self._crashes}
        if paths and any(subject_named(record.subject).format != EQUATIONS for record in wrong):
            outcome = yield from ask(errors_of_files, library, name, paths, states, self._settings.seed, affinity=name)
            self._meanings[name] = outcome.value or {}

    def _chosen(self) -> list[_Alike]:
        """One record of each cause; readers of one file at fault share theirs, where accelerations are wrong."""
        settings = self._settings
        available = [str(subject) for subject in subjects(settings.library)]
        inferences = infer_from_records(self._records, available, self._meanings, settings.library.system_of)
        chosen: dict[tuple[str, str], _Alike] = {}
        for record in (*self._silent, *self._wrong):
            inference, model_format = inferences[record.system], subject_named(record.subject).format
            cause = Cause(system=record.system, subject=record.subject, inference=inference.sentence, first_line=inference.sentence)
            if record in self._silent:
                self._causes.append(cause)
                continue
            is_of_the_model = inference.party == f"model {model_format}" and _is_default(record)
            key = record.system, model_format if is_of_the_model else record.subject
            chosen.setdefault(key, _Alike(record, inference)).causes.append(cause)
        return list(chosen.values())

    def _diagnose(self, alike: _Alike, evaluations: int) -> Inquiry[None]:
        settings, record, subject = self._settings, alike.record, subject_named(alike.record.subject)
        tolerance = max(AGREEMENT, record.expected_backward_error if record.expected != Verdict.AGREES else 0.0)
        scope = Scope(settings.seed, record.quantity, evaluations, tolerance, _states_of(record))
        stand_in = settings.stand_ins.get(subject.format)
        outcome = yield from ask(examine, settings.library, record.system, subject, stand_in, scope, affinity=record.system)
        # Of another quantity a cause tells what was diagnosed where there is a diagnosis.
        about: dict[str, Any] = {"diagnosed": str(subject)} if outcome.value is not None or _is_default(record) else {}
        if outcome.value is not None:
            found: SubjectDiagnosis = outcome.value
            first = found.first_line(suspects_textbook=alike.inference.party == "equations")
            about |= {"first_line": first or alike.inference.sentence, "found": found.as_json()}
        elif not isinstance(outcome.exception, InvalidInput):
            # The record's own message has the reason why a model is refused.
            about |= {"first_line": f"no diagnosis: {outcome.crash or outcome.exception}"}
        for cause in alike.causes:
            self._causes.append(replace(cause, **about))
            yield Part(f"{cause.system} {cause.subject}", self._causes[-1])


def _is_default(record: Record) -> bool:
    return find_quantities()[record.quantity].is_default


def _states_of(record: Record) -> list[dict[str, list[float]]]:
    """The states that are known to show a verdict."""
    shown = record.representative
    return [state for state in (record.worst_state, shown.state if shown is not None else None) if state is not None]


def find_differences(settings: Settings, name: str, workers: Workers) -> list[Difference]:
    """The quantities that subjects which read a model of system ``name`` do not hold alike after loading, before any dynamics."""
    # Load errors are already in the record.
    loads = {name for name, file in engine_files(settings.library).items() if file.outcome.value is not None}
    reading = [subject for subject in subjects(settings.library) if subject.format != EQUATIONS and subject.engine in loads]
    work = [Task(str(subject), _hold, (settings.library, name, subject, settings.stand_ins.get(subject.format))) for subject in reading]
    found = {outcome.task.key: outcome.value for outcome in workers.run(work) if outcome.value is not None}
    held = {subject: holding for subject, (_, holding) in sorted(found.items()) if holding is not None}
    return differences(held, {model.format: model for model, _ in found.values() if model is not None})


def _hold(
    library: Library, name: str, subject: Subject, stand_in: Path | None, note: Callable[[str], None]
) -> tuple[ModelFile | None, HeldModel | None]:
    """The file of a subject and its engine's quantities after loading, as a task for ``harness.workers``; raises as both do."""
    own = Assignment.of(library, name, subject, stand_in)
    return own.model, held_by(load_model(library, subject, own.mechanism, own.model))


# Sampled states beside those at which a subject is known to be wrong.
SAMPLED = 8


def errors_of_files(
    library: Library,
    name: str,
    paths: Mapping[str, Path],
    states: Sequence[Mapping[str, Sequence[float]]],
    seed: int,
    note: Callable[[str], None],
) -> dict[str, float]:
    """The largest backward error of each file's meaning [data roundoffs], by format; a file that has none that is known is left out.

    A file means accelerations by recursion over it, and by no engine: engines that agree may share a misreading. MuJoCo leaves out a
    rotation of an inertia below about 2e-6 rad: a file with one of 5e-10 passes there, and fails with an engine that reads it as it is.

    ``paths`` are the files by format, ``states`` {"q", "v", "tau"} each, of the free joints' velocities in the parent's frame.
    """
    mechanism = load_mechanism(library, name)
    everywhere = States.concatenate([sample(mechanism, SAMPLED, seed), *(States.at(**state) for state in states)])
    reference = reference_kernel(mechanism, False).evaluate(everywhere)
    found = {}
    for model_format, path in paths.items():
        note(model_format)
        try:
            # Its equations of motion may be right where dry friction, limits or actuators are those of another mechanism.
            require_bounds(read := read_model(path, model_format), mechanism)
            meant = accelerations(read, mechanism.joints, mechanism.gravity, everywhere)
        except (InvalidInput, ValueError):
            # The record's own message has the reason.
            continue
        known = compare(reference, meant).known("backward_error")
        if len(known):
            found[model_format] = float(np.max(known))
    return found
