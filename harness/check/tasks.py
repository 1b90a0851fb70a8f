"""What worker processes do: derive, certify, ask an engine, and search for the state it does worst at.

Each function takes ``note`` last, a channel whose text survives a crash; what was loaded or compiled
stays in the process for the next task.
"""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Hashable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from harness.arrays import Array
from harness.certify.compare import Comparison, compare
from harness.certify.reference import Reference, ReferenceKernel
from harness.certify.sampling import sample, strategy
from harness.check.superfluous import SEED, STATES, superfluous
from harness.engines import EQUATIONS, Model, Subject, linear_velocity_in_body, load_engine
from harness.engines._audit import audit
from harness.equations.derivation import load_mechanism
from harness.equations.mechanism import Mechanism
from harness.equations.states import States
from harness.errors import InvalidModel
from harness.library import Library
from harness.models.model_file import ModelFile, read_model
from harness.results.superfluous import SuperfluousPart
from harness.storage import Kept
from harness.verdict import Verdict

Note = Callable[[str], None]
T = TypeVar("T")

# A timing shorter than this is repeated, so that the set-up for the size of a batch is not charged to the engine.
REPEATED_BELOW_SECONDS = 0.25


@dataclass(frozen=True)
class Assignment:
    """One subject on one mechanism; ``model`` is None for an engine that takes equations."""

    library: Library
    subject: Subject
    mechanism: Mechanism
    model: ModelFile | None


@dataclass(frozen=True)
class Found:
    """What a hypothesis search saw.

    Attributes:
        states: every state it tried, in order.
        comparison: the judgement of each.
        simplest_failure: index of the shrunk state that does not agree, None where all agree.
    """

    states: States
    comparison: Comparison
    simplest_failure: int | None


def derive(library: Library, name: str, note: Note) -> Mechanism:
    """The mechanism of system ``name``."""
    return load_mechanism(library, name)


def read(path: Path, model_format: str, note: Note) -> ModelFile:
    """The validated model file at ``path``."""
    return read_model(path, model_format)


def certify(mechanism: Mechanism, linear_velocity_in_body: bool, states: States, note: Note) -> tuple[Reference, float, float]:
    """References of ``states``, seconds per state, and the seconds compilation took: 0 where this process had compiled already."""
    import flint  # noqa: F401  (so that loading the libraries is not charged to compilation)
    import heyoka  # noqa: F401

    known = _kernel_key(mechanism, linear_velocity_in_body) in _KERNELS
    started = time.perf_counter()
    kernel = reference_kernel(mechanism, linear_velocity_in_body)
    kernel.evaluate(states[:1])
    compiled = time.perf_counter()
    reference = kernel.evaluate(states)
    return reference, (time.perf_counter() - compiled) / len(states), 0.0 if known else compiled - started


def accelerate(assignment: Assignment, states: States, note: Note) -> tuple[Array, float]:
    """The subject's accelerations at ``states``, (n, nv), and seconds per state."""
    model = load_audited(assignment)
    # What is compiled or allocated on first use is not charged to the engine.
    model.forward_dynamics(states.q[:1], states.v[:1], states.tau[:1])
    elapsed = math.inf
    for _ in range(2):
        started = time.perf_counter()
        accelerations = model.forward_dynamics(states.q, states.v, states.tau)
        elapsed = min(elapsed, time.perf_counter() - started)
        if elapsed > REPEATED_BELOW_SECONDS:
            break
    return accelerations, elapsed / len(states)


def accelerate_one_by_one(assignment: Assignment, states: States, note: Note) -> None:
    """Ask for one state after the other, noting each, so that a crash names its state."""
    model = load_audited(assignment)
    for index in range(len(states)):
        note(json.dumps(states.as_json(index)))
        one = states[index : index + 1]
        model.forward_dynamics(one.q, one.v, one.tau)


def search(assignment: Assignment, examples: int, seed: int, database: Path | None, note: Note) -> Found:
    """Let hypothesis look for the worst state, and shrink the first one that does not agree.

    Guided by ``target()`` on log10 of the backward error; examples that failed once are kept in
    ``database`` and tried first the next time.
    """
    kept = database if database is not None and database.is_dir() and any(database.iterdir()) else None
    found = _search(assignment, examples, seed, kept, note, stops_at_failure=True)
    if found.simplest_failure is not None and kept is None and database is not None:
        # With a database hypothesis keeps a front of the best of all examples, which doubles its time: it gets one once there is a failure.
        _search(assignment, examples, seed, database, note, stops_at_failure=True)
    return found


def explore(assignment: Assignment, examples: int, seed: int, note: Note) -> Found:
    """``search`` to the end of its examples, whatever the verdicts; nothing is shrunk."""
    return _search(assignment, examples, seed, None, note, stops_at_failure=False)


def _search(assignment: Assignment, examples: int, seed: int, database: Path | None, note: Note, stops_at_failure: bool) -> Found:
    import hypothesis
    from hypothesis.database import DirectoryBasedExampleDatabase
    from hypothesis.internal.conjecture import providers

    compare_at = judge_of(assignment)
    tried: list[tuple[States, Comparison]] = []

    def judge(state: States) -> None:
        note(json.dumps(state.as_json(0)))
        comparison = compare_at(state)
        tried.append((state, comparison))
        error = float(comparison.backward_error[0])
        if 0 < error < math.inf:
            hypothesis.target(math.log10(error))
        if stops_at_failure and comparison.verdicts[0] != Verdict.AGREES.value:
            raise _DoesNotAgree

    settings = hypothesis.settings(
        max_examples=examples,
        database=None if database is None else DirectoryBasedExampleDatabase(database),
        deadline=None,
        derandomize=False,
        suppress_health_check=list(hypothesis.HealthCheck),
        phases=[phase for phase in hypothesis.Phase if phase is not hypothesis.Phase.explain],
        report_multiple_bugs=False,
        print_blob=False,
        verbosity=hypothesis.Verbosity.quiet,
    )
    # Hypothesis would also draw constants from the sources of whatever happens to be imported.
    providers.is_local_module_file = lambda path: False  # type: ignore[assignment, attr-defined]
    failure: int | None = None
    try:
        # In the other order, the seed would switch the database off.
        settings(hypothesis.seed(seed)(hypothesis.given(strategy(assignment.mechanism))(judge)))()
    except _DoesNotAgree:
        # Hypothesis runs the smallest failing example last, to show it.
        failure = len(tried) - 1
    return Found(
        States.concatenate([state for state, _ in tried]), Comparison.concatenate([comparison for _, comparison in tried]), failure
    )


def judge_of(assignment: Assignment) -> Callable[[States], Comparison]:
    """A function that asks the subject at n states at once and judges its answers by certified truth; raises as ``load_audited``."""
    model, kernel = load_audited(assignment), reference_kernel_of(assignment)
    return lambda states: compare(kernel.evaluate(states), model.forward_dynamics(states.q, states.v, states.tau))


def reference_kernel_of(assignment: Assignment) -> ReferenceKernel:
    """The certified kernel that a subject is judged by, compiled once per process."""
    in_body = linear_velocity_in_body(load_engine(assignment.library, assignment.subject.engine))
    return reference_kernel(assignment.mechanism, in_body)


def find_superfluous(assignment: Assignment, note: Note) -> list[SuperfluousPart]:
    """Parts of the subject's model that its scene does not need; none where its answers are wrong as it is."""
    mechanism, model = assignment.mechanism, assignment.model

    def is_sound() -> bool:
        states = sample(mechanism, STATES, SEED)
        in_body = linear_velocity_in_body(load_engine(assignment.library, assignment.subject.engine))
        answers = load_audited(assignment).forward_dynamics(states.q, states.v, states.tau)
        comparison = compare(reference_kernel(mechanism, in_body).evaluate(states), answers)
        return not {Verdict.DISAGREES.value, Verdict.ERROR.value} & set(comparison.verdicts)

    return superfluous(assignment.library, mechanism.name, assignment.subject, model, mechanism, is_sound)


class _DoesNotAgree(Exception):
    """Tells hypothesis that a state fails."""


def load_audited(assignment: Assignment) -> Model:
    """The subject's model, loaded once per process and audited.

    Raises:
        InvalidModel: the engine refuses the model, or holds another mechanism than the system's.
        harness.engines.Unsupported: the engine cannot express it.
    """
    key = assignment.library, assignment.subject, assignment.mechanism.key, assignment.model and assignment.model.text
    return _MODELS.get(key, lambda: _load_and_audit(assignment))


def _load_and_audit(assignment: Assignment) -> Model:
    mechanism, model = assignment.mechanism, assignment.model
    engine = load_engine(assignment.library, assignment.subject.engine)
    source = mechanism if assignment.subject.format == EQUATIONS else model
    assert source is not None
    try:
        loaded = engine.load(source, mechanism.joints, mechanism.gravity)
    except ValueError as error:
        if model is None:
            raise
        raise InvalidModel(model.path, None, f"{assignment.subject.engine} refuses it: {error}") from error
    held = loaded.loaded()
    if held is not None and model is not None:
        audit(held, model, mechanism)
    return loaded


def reference_kernel(mechanism: Mechanism, linear_velocity_in_body: bool) -> ReferenceKernel:
    key = _kernel_key(mechanism, linear_velocity_in_body)
    return _KERNELS.get(key, lambda: ReferenceKernel(mechanism, key[1]))


def _kernel_key(mechanism: Mechanism, linear_velocity_in_body: bool) -> tuple[Hashable, bool]:
    return mechanism.key, linear_velocity_in_body and bool(mechanism.charts_in_body)


_MODELS: Kept[Model] = Kept(64)
_KERNELS: Kept[ReferenceKernel] = Kept(64)
