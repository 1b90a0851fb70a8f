"""The tasks of worker processes: derive, read, load, certify, and judge a subject's answers.

Each function takes ``note`` last, a channel whose text survives a crash; what was loaded or compiled
stays in the process for the next task.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from pathlib import Path

from harness.crosscheck.assignment import Assignment, judge_of, load_audited, reference_kernel_of
from harness.crosscheck.superfluous import SEED, STATES, superfluous
from harness.engines import (
    Unsupported,
    accelerations,
    load_model,
)
from harness.files.model_file import ModelFile, read_model
from harness.lagrange.derivation import load_mechanism
from harness.library import Library
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.states import States
from harness.results.cross_check import SuperfluousPart
from harness.truth.componentwise import componentwise_error
from harness.truth.sampling import keep_points, random_sample
from harness.verdict import Verdict

Note = Callable[[str], None]


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


def find_superfluous(assignment: Assignment, note: Note) -> list[SuperfluousPart]:
    """Parts of the subject's model that its scene does not need; none where its answers are wrong as it is."""

    def is_sound() -> bool:
        verdicts = judge_of(assignment)(random_sample(assignment.mechanism, STATES, SEED)).verdicts
        return not {Verdict.DISAGREES.value, Verdict.ERROR.value} & set(verdicts)

    return superfluous(assignment, is_sound)
