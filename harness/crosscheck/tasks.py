"""The tasks of worker processes: derive, read, load, certify, and judge a subject's answers.

Each function takes ``note`` last, a channel whose text survives a crash; what was loaded or compiled
stays in the process for the next task.
"""

from __future__ import annotations

import contextlib
import functools
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from harness.certify.compare import Comparison
from harness.certify.componentwise import componentwise_error
from harness.certify.reference import Reference, ReferenceKernel
from harness.certify.sampling import keep_points, random_sample
from harness.crosscheck.gaps import compare_with_gaps, gaps_of
from harness.crosscheck.superfluous import SEED, STATES, superfluous
from harness.crosscheck.truth import Truth, softened, softness_of
from harness.engines import (
    EQUATIONS,
    Model,
    Subject,
    Unsupported,
    accelerations,
    constraint_laws,
    factorises_mass_matrix,
    linear_velocity_in_body,
    load_engine,
    load_model,
    runs_elsewhere,
    unit_roundoff,
)
from harness.engines.audit import audit, require_constraints
from harness.equations.derivation import load_mechanism
from harness.equations.mechanism import Mechanism
from harness.equations.states import States
from harness.errors import InvalidModel
from harness.library import Library
from harness.models.model_file import ModelFile, read_model
from harness.results.cross_check import SuperfluousPart
from harness.storage import Kept
from harness.verdict import Verdict

Note = Callable[[str], None]


@dataclass(frozen=True)
class Assignment:
    """One subject on one mechanism; ``model`` is None for an engine that is handed the mechanism itself."""

    library: Library
    subject: Subject
    mechanism: Mechanism
    model: ModelFile | None

    @classmethod
    def of(cls, library: Library, name: str, subject: Subject, path: Path | None = None) -> Assignment:
        """The subject on system ``name`` with the model at ``path``, by default the library's own.

        Raises:
            InvalidInput: the system or its model cannot be used.
        """
        file = path or library.validated_models(name).get(subject.format)
        model = None if subject.format == EQUATIONS or file is None else read_model(file, subject.format)
        return cls(library, subject, load_mechanism(library, name), model)


def derive(library: Library, name: str, note: Note) -> Mechanism:
    """The mechanism of system ``name``."""
    return load_mechanism(library, name)


def derive_and_sample(library: Library, name: str, states: int, seed: int, note: Note) -> Mechanism:
    """The mechanism of system ``name``; the points of its sample are in the cache afterwards."""
    mechanism = derive(library, name, note)
    keep_points(mechanism, states, seed)
    return mechanism


def read(path: Path, model_format: str, note: Note) -> ModelFile:
    """The validated model file at ``path``."""
    return read_model(path, model_format)


def accept(assignments: Sequence[Assignment], note: Note) -> None:
    """Let every subject's engine read its model.

    Raises:
        InvalidModel: one refuses it. What the model is held against comes later.
    """
    for assignment in assignments:
        with contextlib.suppress(Unsupported):
            load_model(assignment.library, assignment.subject, assignment.mechanism, assignment.model)


def measure_componentwise(assignment: Assignment, state: States, beyond: float, note: Note) -> float:
    """The componentwise backward error of the subject's answer at one state, as ``componentwise_error`` gives it."""
    kernel = reference_kernel_of(assignment)
    answer = accelerations(load_audited(assignment), state)
    return componentwise_error(kernel, state, kernel.evaluate(state), answer[0], beyond)


@dataclass(frozen=True)
class Judge:
    """What asks a subject at n states at once and judges its answers by certified truth.

    Attributes:
        key: equal for judges by one truth. certify: that truth at states.
        compare: the judgement of the subject's answers by the truth at the same states; raises as ``load_audited``.
    """

    key: Hashable
    certify: Callable[[States], Any]
    compare: Callable[[Any, States], Comparison]

    def __call__(self, states: States) -> Comparison:
        return self.compare(self.certify(states), states)


def judge_of(assignment: Assignment) -> Judge:
    """The judge of a subject, whose model is loaded; raises as ``load_audited``."""
    load_audited(assignment)
    return unloaded_judge_of(assignment)


@functools.singledispatch
def unloaded_judge_of(assignment: Assignment) -> Judge:
    """The judge of a subject, whose model is loaded when it is asked first; of accelerations, but where an assignment is of others."""
    truth = truth_of(assignment)
    return Judge(truth, lambda states: truth.kernel.evaluate(states), lambda found, states: judge_by(found, assignment, states))


def judge_by(reference: Reference, assignment: Assignment, states: States) -> Comparison:
    """The judgement of the subject's answers at ``states`` by the reference there; raises as ``load_audited``."""
    model = load_audited(assignment)
    answers, gaps = accelerations(model, states), gaps_of(model, states)
    return compare_with_gaps(reference, assignment.mechanism, states, answers, gaps, may_lose_digits(assignment, model))


def factorises(assignment: Assignment) -> bool:
    """True if the subject's engine declares that it factorises M."""
    return factorises_mass_matrix(load_engine(assignment.library, assignment.subject.engine))


def may_lose_digits(assignment: Assignment, model: Model) -> bool:
    """True if the subject's engine factorises M, or declares it of the model that it has loaded."""
    return factorises(assignment) or factorises_mass_matrix(model)


def reference_kernel_of(assignment: Assignment) -> ReferenceKernel:
    """The certified kernel that a subject is judged by, compiled once per process."""
    return truth_of(assignment).kernel


def truth_of(assignment: Assignment) -> Truth:
    """What a subject's answers are held against.

    Raises:
        InvalidModel: the file's softness of constraints cannot be held against the mechanism's rows.
    """
    rigid, mechanism, model = rigid_truth_of(assignment), assignment.mechanism, assignment.model
    if mechanism.constraints is None or model is None:
        return rigid

    def find() -> Truth:
        assert mechanism.constraints is not None and model is not None
        require_constraints(model, mechanism)
        laws = constraint_laws(load_engine(assignment.library, assignment.subject.engine), model)
        if not laws:
            return rigid
        rows = softness_of(mechanism.constraints, laws, model)
        return replace(rigid, mechanism=softened(mechanism, rows), is_declared=True)

    # The weights of rows are evaluated in balls, and every batch of states asks for them.
    return _TRUTHS.get((assignment.library, assignment.subject, mechanism.key, model.text), find)


def rigid_truth_of(assignment: Assignment) -> Truth:
    """The mechanism's own equations, in the frame and for the precision of the subject's engine."""
    engine = load_engine(assignment.library, assignment.subject.engine)
    return Truth(assignment.mechanism, frame_of(assignment), unit_roundoff=unit_roundoff(engine))


def frame_of(assignment: Assignment) -> bool:
    """True if the subject's answers need the reference with linear velocities in the body's frame."""
    in_body = linear_velocity_in_body(load_engine(assignment.library, assignment.subject.engine))
    return in_body and bool(assignment.mechanism.charts_in_body)


def find_superfluous(assignment: Assignment, note: Note) -> list[SuperfluousPart]:
    """Parts of the subject's model that its scene does not need; none where its answers are wrong as it is."""

    def is_sound() -> bool:
        verdicts = judge_of(assignment)(random_sample(assignment.mechanism, STATES, SEED)).verdicts
        return not {Verdict.DISAGREES.value, Verdict.ERROR.value} & set(verdicts)

    return superfluous(assignment, is_sound)


def load_audited(assignment: Assignment) -> Model:
    """The subject's model, loaded once per process and audited.

    Raises:
        InvalidModel: the engine refuses the model, or holds another mechanism than the system's.
        ValueError: so does an engine of an environment.
        harness.engines.Unsupported: the engine cannot express it.
    """
    library, subject, mechanism, model = assignment.library, assignment.subject, assignment.mechanism, assignment.model

    def load() -> Model:
        try:
            loaded = load_model(library, subject, mechanism, model)
            audit(loaded.loaded(), model, mechanism)
        except InvalidModel as error:
            if not runs_elsewhere(load_engine(library, subject.engine)):
                raise
            # What an engine of an environment makes of a file is no fault of the file, which those beside the harness read.
            raise ValueError(str(error)) from error
        return loaded

    return _MODELS.get((library, subject, mechanism.key, model and model.text), load)


_MODELS: Kept[Model] = Kept(64)
_TRUTHS: Kept[Truth] = Kept(64)
