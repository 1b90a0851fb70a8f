"""The diagnosis of one subject that does not agree: its terms, its model file, and the textbook's side.

A model that the load audit refuses is diagnosed all the same: the engine answers, and its answers show what is wrong.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from harness.certify.sampling import sample
from harness.crosscheck.tasks import Assignment, reference_kernel
from harness.diagnosis.model_side import EVALUATIONS, diagnose
from harness.diagnosis.perturbation import diagnostic_states, watch
from harness.diagnosis.result import Conclusion, Diagnosis
from harness.diagnosis.terms import TermComparison, compare_terms
from harness.diagnosis.textbook_side import diagnose_textbook, textbook_evaluations
from harness.engines import linear_velocity_in_body, load_engine
from harness.equations.states import States
from harness.errors import InvalidModel
from harness.library import member_of
from harness.verdict import AGREEMENT

# Positions at which terms are compared, of a mechanism of up to so many velocities; their cost grows with the cube of those.
TERM_STATES, TERM_VELOCITIES, LEAST_TERM_STATES = 64, 12, 4


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

        ``suspects_textbook``: the textbook's parameter goes first where one explains.
        """
        explained = self.model is not None and self.model.conclusion == Conclusion.EXPLAINED
        textbook_explains = self.textbook.conclusion == Conclusion.EXPLAINED
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
    kernel = reference_kernel(mechanism, linear_velocity_in_body(engine))
    worst = [States.at(state["q"], state["v"], state["tau"]) for state in scope.worst_states]
    states = States.concatenate([diagnostic_states(mechanism, scope.seed), *worst])
    try:
        loaded = engine.load(mechanism if model is None else model, mechanism.joints, mechanism.gravity)
        watched = None if model is None else watch(engine, mechanism, model, states)
    except (ValueError, KeyError) as error:
        if model is None:
            raise
        raise InvalidModel(model.path, None, f"{assignment.subject.engine} refuses it: {error}") from error
    accelerations = loaded.forward_dynamics(states.q, states.v, states.tau) if watched is None else watched.healthy
    note("comparing terms")
    count = TERM_STATES * min(1.0, (TERM_VELOCITIES / len(mechanism.joints)) ** 3)
    positions = sample(mechanism, max(LEAST_TERM_STATES, int(count)), scope.seed)
    terms = compare_terms(mechanism, loaded, kernel, positions, str(assignment.subject))
    note("diagnosing the model")
    of_model = None
    if watched is not None:
        of_model = diagnose(watched, kernel.evaluate(states), evaluations=scope.evaluations, tolerance=scope.tolerance)
    note("diagnosing the textbook's side")
    path = library.system_path(mechanism.name)
    member = member_of(path)
    of_textbook = diagnose_textbook(
        kernel,
        states,
        accelerations,
        path if member is None else member[0],
        tolerance=scope.tolerance,
        evaluations=int(textbook_evaluations(mechanism) * scope.evaluations / EVALUATIONS),
    )
    return SubjectDiagnosis(str(assignment.subject), terms, of_model, of_textbook)
