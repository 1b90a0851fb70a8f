"""The two stages of a cross-check, as a worker process runs them: ``prepare`` certifies states, ``ask`` evaluates one subject there.

``compare_all`` is the way of every state from the sample to its verdicts: the truth is certified once, and every subject's
answers are held against it. What was loaded or compiled stays in the process for the next task.
"""

from __future__ import annotations

import contextlib
import functools
import json
import math
import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from harness.arrays import Array
from harness.certify.compare import Comparison, compare
from harness.certify.machine_code import loop
from harness.certify.numbers import UNIT_ROUNDOFF
from harness.certify.reference import Reference
from harness.crosscheck.gaps import compare_with_gaps, gaps_of, remark_on
from harness.crosscheck.repeatability import precision_of, require_repeatable
from harness.crosscheck.tasks import Assignment, Note, load_audited, may_lose_digits, rigid_truth_of, truth_of
from harness.crosscheck.truth import Truth
from harness.engines import Model, Unsupported, accelerations, load_engine, unit_roundoff
from harness.equations.states import States
from harness.errors import InvalidInput
from harness.study import sentence
from harness.verdict import Verdict

# Timings of a batch: that many at least, and more until they take that long, up to the most.
LEAST_TIMINGS, ENOUGH_SECONDS, MOST_TIMINGS = 3, 0.02, 5
# A longer call is timed once; one that is shorter is set up for the size of its batch by a call before.
REPEATED_BELOW_SECONDS = 0.25


@dataclass(frozen=True)
class Answers:
    """The answers of one subject at a batch of states.

    Attributes:
        comparison: the judgement of each answer; None where there is none.
        seconds: cost per state of each timing [s]; none where there is no answer.
        failure: why there are no answers, "" where there are. problem: the same where a file is invalid.
        remark: what the answers have in common, as a sentence; "" for nothing.
        unsupported: whether the failure is that the engine cannot express the mechanism.
        from_rigid: how far answers that are held against a declared truth are from the rigid one, relative; none for the others.
    """

    comparison: Comparison | None = None
    seconds: Sequence[float] = ()
    failure: str = ""
    problem: InvalidInput | None = None
    unsupported: bool = False
    remark: str = ""
    from_rigid: Array = field(default_factory=lambda: np.empty(0))

    @classmethod
    def missing(cls, error: Exception) -> Answers:
        """No answers because of ``error``; only what can be mended in a file keeps its type."""
        if isinstance(error, InvalidInput):
            return cls(failure=str(error), problem=error)
        return cls(failure=str(error), unsupported=True) if isinstance(error, Unsupported) else cls(failure=sentence(error))


def compare_all(assignments: Sequence[Assignment], states: States, note: Note) -> tuple[float, float, dict[str, Answers]]:
    """Seconds per certified state, seconds of compilation, and by subject what it answered at ``states``.

    All assignments are of one mechanism. The note names the subject that is being asked.
    """
    truths = set()
    for assignment in assignments:
        # Who has none is told when asked.
        with contextlib.suppress(Exception):
            truths |= {truth_of(assignment), rigid_truth_of(assignment)}
    references, seconds, compilation_seconds = prepare(truths, states)
    answers = {}
    for assignment in assignments:
        note(json.dumps({"subject": str(assignment.subject)}))
        answers[str(assignment.subject)] = ask(assignment, states, references)
    return seconds, compilation_seconds, answers


def prepare(truths: Iterable[Truth], states: States) -> tuple[dict[Truth, Reference], float, float]:
    """Every truth at ``states``, seconds per certified state, and seconds of compilation, of the one that takes longest.

    Seconds of compilation are 0 where this process had compiled already.
    """
    # So that making or loading the loops, which all systems share, is not charged to this one.
    loop("evaluate")
    references, seconds, compilation_seconds = {}, 0.0, 0.0
    for truth in truths:
        known = truth.is_known
        started = time.perf_counter()
        truth.kernel.evaluate(states[:1])
        compiled = time.perf_counter()
        references[truth] = truth.kernel.evaluate(states)
        seconds = max(seconds, (time.perf_counter() - compiled) / len(states))
        compilation_seconds = max(compilation_seconds, 0.0 if known else compiled - started)
    return references, seconds, compilation_seconds


def ask(assignment: Assignment, states: States, references: Mapping[Truth, Reference]) -> Answers:
    """The subject's accelerations at ``states``, timed, held against each other and compared with its truth there."""
    try:
        truth = truth_of(assignment)
        reference, model = references[truth], load_audited(assignment)
        factorises = may_lose_digits(assignment, model)
        answers, seconds = timed_accelerations(model, states)
        require_repeatable(model, states, answers, reference, factorises)
        gaps, mechanism = gaps_of(model, states), assignment.mechanism
        comparison = compare_with_gaps(reference, mechanism, states, answers[0], gaps, factorises)
        disagrees = (comparison.verdicts == Verdict.DISAGREES.value).any()
        declared = declared_precision(assignment)
        remark = declared or ((remark_on(mechanism, states, gaps) or precision_of(model, states, answers[0])) if disagrees else "")
        if not truth.is_declared:
            return Answers(comparison, seconds, remark=remark)
        rigid = compare(references[rigid_truth_of(assignment)], answers[0])
        return Answers(comparison, seconds, remark=remark, from_rigid=rigid.known("relative_error"))
    except Exception as error:
        return Answers.missing(error)


def declared_precision(assignment: Assignment) -> str:
    """A sentence where the subject's engine declares that it computes in another precision than float64, "" where it does not."""
    roundoff = unit_roundoff(load_engine(assignment.library, assignment.subject.engine))
    if roundoff == UNIT_ROUNDOFF:
        return ""
    bits = round(-math.log2(roundoff))
    name = "float32" if bits == 24 else f"numbers of {bits} bits"
    return f"computes in {name}: judged in data roundoffs of 2^-{bits}, at states rounded to {name}"


def timed_accelerations(model: Model, states: States) -> tuple[list[Array], list[float]]:
    """The accelerations at ``states``, (n, nv), of each call, and seconds per state of each timing."""
    # What is compiled or allocated on first use is not charged to the engine.
    accelerations(model, states[:1])
    clock = getattr(model, "clock", time.perf_counter)
    answers: list[Array] = []
    seconds: list[float] = []
    while len(seconds) <= MOST_TIMINGS:
        started = clock()
        answer = accelerations(model, states)
        seconds.append(clock() - started)
        # An engine may return one array each time.
        answers.append(answer.copy())
        if seconds[-1] > REPEATED_BELOW_SECONDS or (len(seconds) > LEAST_TIMINGS and sum(seconds) > ENOUGH_SECONDS):
            break
    return answers, [one / len(states) for one in seconds[1:] or seconds]


@functools.singledispatch
def ask_one_by_one(assignment: Assignment, states: States, note: Note) -> None:
    """Ask for one state after the other, noting each, so that a crash names its state."""
    model = load_audited(assignment)
    for index in range(len(states)):
        note(json.dumps(states.as_json(index)))
        one = states[index : index + 1]
        accelerations(model, one)
