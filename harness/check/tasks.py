"""What worker processes do: derive, certify, ask an engine, and search for the state it does worst at.

Each function takes ``note`` last, a channel whose text survives a crash; what was loaded or compiled
stays in the process for the next task.
"""

from __future__ import annotations

import json
import math
from collections import OrderedDict
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from harness.certify.compare import Comparison, compare
from harness.certify.reference import ReferenceKernel
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
from harness.verdict import Verdict

Note = Callable[[str], None]
T = TypeVar("T")


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


def search_all(assignments: Sequence[Assignment], examples: int, seed: int, folder: Path | None, note: Note) -> dict[str, Found]:
    """``search`` for each subject."""
    return {
        str(one.subject): search(one, examples, seed, folder and folder / str(one.subject).replace("/", "-"), note) for one in assignments
    }


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
    return _kept(_MODELS, key, lambda: _load_and_audit(assignment))


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


def is_reference_known(mechanism: Mechanism, linear_velocity_in_body: bool) -> bool:
    """Whether this process has compiled the kernel."""
    return _kernel_key(mechanism, linear_velocity_in_body) in _KERNELS


def reference_kernel(mechanism: Mechanism, linear_velocity_in_body: bool) -> ReferenceKernel:
    key = _kernel_key(mechanism, linear_velocity_in_body)
    return _kept(_KERNELS, key, lambda: ReferenceKernel(mechanism, key[1]))


def _kernel_key(mechanism: Mechanism, linear_velocity_in_body: bool) -> tuple[Hashable, bool]:
    return mechanism.key, linear_velocity_in_body and bool(mechanism.charts_in_body)


_MODELS: OrderedDict[Hashable, Model] = OrderedDict()
_KERNELS: OrderedDict[Hashable, ReferenceKernel] = OrderedDict()
_MOST_KEPT = 64


def _kept(store: OrderedDict[Hashable, T], key: Hashable, make: Callable[[], T]) -> T:
    """What ``make`` gave for ``key`` last time; the oldest entry goes when there are too many."""
    if key not in store:
        store[key] = make()
        if len(store) > _MOST_KEPT:
            store.popitem(last=False)
    return store[key]
