"""Everything a diagnosis says of one subject that does not agree: its terms, its model file, and the textbook's side.

What the load audit refuses is diagnosed all the same: the engine answers, and its answers say what is wrong.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from harness.arrays import Array
from harness.certify.reference import ReferenceKernel
from harness.certify.sampling import sample
from harness.check.tasks import Assignment, reference_kernel
from harness.diagnose.model_side import diagnose
from harness.diagnose.perturbation import diagnostic_states, watch
from harness.diagnose.result import Diagnosis, Finding
from harness.diagnose.terms import TermComparison, compare_terms
from harness.diagnose.textbook_side import diagnose_textbook
from harness.engines import linear_velocity_in_body, load_engine
from harness.equations.states import States
from harness.errors import InvalidModel
from harness.library import member_of
from harness.models.text import Watch
from harness.verdict import AGREEMENT

# Positions at which terms are compared, of a mechanism of up to so many velocities; their cost grows with the cube of those.
TERM_STATES, TERM_VELOCITIES, LEAST_TERM_STATES = 64, 12, 4
# Of the time, what the model side may take, and the textbook's side; the rest is for the terms.
SHARE_OF_MODEL, SHARE_OF_TEXTBOOK = 0.65, 0.25


@dataclass(frozen=True)
class SubjectDiagnosis:
    """What is known of one subject.

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

        ``suspects_textbook``: the textbook's parameter goes first where one explains.
        """
        explained = self.model is not None and self.model.finding == Finding.EXPLAINED
        textbook_explains = self.textbook.finding == Finding.EXPLAINED
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
class _Answered:
    """A subject's accelerations at the states of a diagnosis, and what answers changed texts where it reads a file."""

    kernel: ReferenceKernel
    states: States
    accelerations: Array
    watch: Watch | None


@dataclass(frozen=True)
class Scope:
    """What a diagnosis asks for.

    Attributes:
        seed: of the sampled states. seconds: that it may take beside loading and compiling.
        tolerance: the largest backward error that explains [data roundoffs].
        worst_states: {"q", "v", "tau"} of states at which the subject is known to be wrong, to be among those of the diagnosis.
    """

    seed: int
    seconds: float
    tolerance: float = AGREEMENT
    worst_states: Sequence[Mapping[str, Sequence[float]]] = ()


def diagnose_subject(assignment: Assignment, scope: Scope, note: Callable[[str], None]) -> SubjectDiagnosis:
    """Diagnose a subject; ``note`` is told what comes next.

    Raises:
        InvalidModel: the engine refuses the model.
        harness.engines.Unsupported: the engine cannot express the mechanism.
    """
    mechanism = assignment.mechanism
    note("loading")
    asked = _answered(assignment, scope)
    engine = load_engine(assignment.library, assignment.subject.engine)
    source = assignment.model if assignment.model is not None else mechanism
    note("comparing terms")
    loaded = engine.load(source, mechanism.joints, mechanism.gravity)
    count = TERM_STATES * min(1.0, (TERM_VELOCITIES / len(mechanism.joints)) ** 3)
    positions = sample(mechanism, max(LEAST_TERM_STATES, int(count)), scope.seed)
    terms = compare_terms(mechanism, loaded, asked.kernel, positions, str(assignment.subject))
    note("diagnosing the model")
    of_model = _of_model(asked, SHARE_OF_MODEL * scope.seconds, scope.tolerance)
    note("diagnosing the textbook's side")
    of_textbook = _of_textbook(assignment, asked, SHARE_OF_TEXTBOOK * scope.seconds, scope.tolerance)
    return SubjectDiagnosis(str(assignment.subject), terms, of_model, of_textbook)


def _answered(assignment: Assignment, scope: Scope) -> _Answered:
    mechanism, model = assignment.mechanism, assignment.model
    states = States.concatenate(
        [diagnostic_states(mechanism, scope.seed), *(States.at(state["q"], state["v"], state["tau"]) for state in scope.worst_states)]
    )
    engine = load_engine(assignment.library, assignment.subject.engine)
    kernel = reference_kernel(mechanism, linear_velocity_in_body(engine))
    if model is None:
        answers = engine.load(mechanism, mechanism.joints, mechanism.gravity).forward_dynamics(states.q, states.v, states.tau)
        return _Answered(kernel, states, answers, None)
    try:
        watched = watch(engine, mechanism, model, states)
    except (ValueError, KeyError) as error:
        raise InvalidModel(model.path, None, f"{assignment.subject.engine} refuses it: {error}") from error
    return _Answered(kernel, states, watched.healthy, watched)


def _of_model(asked: _Answered, seconds: float, tolerance: float) -> Diagnosis | None:
    if asked.watch is None:
        return None
    return diagnose(asked.watch, asked.kernel.evaluate(asked.states), seconds=seconds, tolerance=tolerance)


def _of_textbook(assignment: Assignment, asked: _Answered, seconds: float, tolerance: float) -> Diagnosis:
    path = assignment.library.system_path(assignment.mechanism.name)
    member = member_of(path)
    file = path if member is None else member[0]
    return diagnose_textbook(asked.kernel, asked.states, asked.accelerations, file, seconds=seconds, tolerance=tolerance)
