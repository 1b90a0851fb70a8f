"""Why records of a cross-check are not as expected: who is at fault, the terms that are wrong, and the change that explains it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from harness.agreement_pattern import infer_from_records
from harness.derivation import load_mechanism
from harness.diagnosis import Diagnosis, diagnose
from harness.engines import Subject, linear_velocity_in_body, load_engine, subjects
from harness.library import Library
from harness.models import read_model
from harness.perturbation import diagnostic_states, watch
from harness.records import Record
from harness.reference import ReferenceKernel
from harness.run import Settings
from harness.states import sample
from harness.term_comparison import compare_terms
from harness.verdict import Verdict
from harness.workers import Task, Workers

SECONDS = 10.0
_TERM_STATES = 32
_WRONG = {Verdict.DISAGREES.value, Verdict.UNSTABLE.value, Verdict.ERROR.value}


@dataclass(frozen=True, kw_only=True)
class Cause:
    """Why one subject is wrong on one system.

    Attributes:
        system, subject: names.
        inference: what the verdicts of all subjects say together.
        terms: a sentence for each term that is wrong; () where the engine states none.
        diagnosis: the answer first, then what else is known; () where a model cannot be asked.
        found: the diagnosis as plain data; None without one.
    """

    system: str
    subject: str
    inference: str
    terms: tuple[str, ...] = ()
    diagnosis: tuple[str, ...] = ()
    found: dict[str, Any] | None = None

    @property
    def first_line(self) -> str:
        """The answer in one line."""
        return self.diagnosis[0] if self.diagnosis else self.inference

    @property
    def lines(self) -> list[str]:
        """Everything, a line each."""
        return [f"{self.system} {self.subject}", *(f"  {line}" for line in (self.inference, *self.terms, *self.diagnosis))]

    def as_json(self) -> dict[str, Any]:
        """Plain data."""
        return asdict(self)


def find_causes(
    settings: Settings, records: Sequence[Record], workers: Workers, verdicts_of: Sequence[Record] | None = None
) -> Iterator[Cause]:
    """The cause of each of ``records`` that is wrong and not as expected; a diagnosis takes ``SECONDS`` at most, on ``workers``.

    Who is at fault is told from the verdicts of all records of a system, ``verdicts_of`` or else ``records`` themselves.
    """
    every = [str(subject) for subject in subjects(settings.library)]
    inferences = infer_from_records(records if verdicts_of is None else verdicts_of, every)
    wrong = [record for record in records if record.verdict in _WRONG and not record.as_expected]
    work: list[Task] = []
    for record in wrong:
        cause = Cause(system=record.system, subject=record.subject, inference=inferences[record.system].sentence)
        engine, _, model_format = record.subject.partition("/")
        if not model_format:
            yield cause
            continue
        path = settings.stand_ins.get(model_format) or settings.library.model_path(record.system, model_format)
        subject = Subject(engine, model_format)
        work.append(Task(cause, examine, (settings.library, record.system, subject, path, settings.seed)))
    for outcome in workers.run(work):
        cause = outcome.task.key
        if outcome.value is not None:
            terms, diagnosis = outcome.value
            yield replace(cause, terms=terms, diagnosis=tuple(diagnosis.lines), found=diagnosis.as_json())
        else:
            yield replace(cause, diagnosis=(f"no diagnosis: {outcome.crash or outcome.exception}",))


def examine(
    library: Library, name: str, subject: Subject, path: Path, seed: int, note: Callable[[str], None]
) -> tuple[tuple[str, ...], Diagnosis]:
    """The wrong terms of a subject and its diagnosis, as a task for ``harness.workers``.

    What the model holds is not audited, so that a total mass or a gravity that is off is explained too.

    Raises:
        InvalidInput: the system or its model cannot be used; ValueError: the engine refuses the model.
        harness.engines.Unsupported: the engine cannot express the mechanism.
    """
    mechanism, engine = load_mechanism(library, name), load_engine(library, subject.engine)
    model = read_model(path, subject.format)
    kernel = ReferenceKernel(mechanism, linear_velocity_in_body(engine))
    states = diagnostic_states(mechanism, seed)
    watched = watch(engine, mechanism, model, states)
    diagnosis = diagnose(watched, kernel.evaluate(states), seconds=SECONDS)
    loaded = engine.load(model, mechanism.joints, mechanism.gravity)
    terms = compare_terms(mechanism, loaded, kernel, sample(mechanism, _TERM_STATES, seed), str(subject))
    return tuple(finding.sentence for finding in terms.wrong), diagnosis
