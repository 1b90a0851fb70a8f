"""An engine's solver of constraints beside the solution that it documents: where it stops, and what its own settings make of it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np

from harness.arrays import Array, Indices
from harness.crosscheck.assignment import Assignment
from harness.engines import Engine, Model, load_engine, load_model
from harness.engines.request import StopRule
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.states import States
from harness.results.readings import share_text
from harness.trees.mechanism import RobotMechanism
from harness.truth.compare import Certified, Comparison
from harness.truth.quantities import Truth
from harness.verdict import Verdict


def judged_to_the_end(
    assignment: Assignment, certified: Certified, model: Model, states: States, comparison: Comparison
) -> tuple[Comparison, str]:
    """The judgement of answers that an engine's solver of constraints has a part in, and a sentence on where it stops.

    An answer that disagrees is explained where the solver, when it goes on until nothing changes, ends where the truth is.
    """
    wrong = np.flatnonzero(comparison.verdicts == Verdict.DISAGREES.value)
    for ended, remedy, fault in endings_of(assignment, model) if len(wrong) else ():
        left = assignment.truth.asked_and_judged(certified[wrong], states[wrong], ended)
        if left.are_all(Verdict.AGREES, Verdict.UNSTABLE, Verdict.EXPLAINED):
            verdicts = comparison.verdicts.copy()
            verdicts[wrong] = Verdict.EXPLAINED.value
            title = load_engine(assignment.library, assignment.subject.engine).title or assignment.subject.engine
            worst = f"up to {comparison.backward_error[wrong].max():.3g} data roundoffs"
            if fault:
                sentence = f"{title} ends {worst} beside the solution that it documents. {fault}: {remedy}"
            else:
                sentence = f"{title} stops its solver {worst} before the solution that it documents: {remedy}"
            return replace(comparison, verdicts=verdicts), sentence
    engine = load_engine(assignment.library, assignment.subject.engine)
    if engine.stops is None or not len(wrong):
        return comparison, ""
    return _stopped_as_documented(assignment, engine, engine.stops, model, states, comparison)


def _stopped_as_documented(
    assignment: Assignment, engine: Engine, rule: StopRule, model: Model, states: States, comparison: Comparison
) -> tuple[Comparison, str]:
    """The same where an engine documents when its solver stops, and nobody can set that: answers that leave no more are explained."""
    wrong = np.flatnonzero(comparison.verdicts == Verdict.DISAGREES.value)
    answers = assignment.truth.answers(model, states[wrong])
    shares = _shares_of(assignment.truth, states[wrong], answers, rule)
    stopped = wrong[shares <= 1.0]
    if not len(stopped):
        return comparison, ""
    verdicts = comparison.verdicts.copy()
    verdicts[stopped] = Verdict.EXPLAINED.value
    far, share = f"{comparison.backward_error[stopped].max():.3g} data roundoffs", share_text(float(shares[shares <= 1.0].max()))
    of_tolerance = f"up to {far} before the solution that it documents, by {share} of the tolerance that it documents"
    return replace(comparison, verdicts=verdicts), f"{engine.title or engine.name} stops its solver {of_tolerance}: {rule.remedy}"


def _shares_of(truth: Truth, states: States, answers: Array, rule: StopRule) -> Array:
    """(n,) as of ``share_of_rule``; infinite where the truth is of no step."""
    # Most solvers go on to the end, or can be told to.
    from harness.explain.as_read import ReadTruth
    from harness.explain.touching_truth import TouchingTruth
    from harness.truth.declared import DeclaredMechanism
    from harness.truth.quantities.accelerations import AccelerationTruth
    from harness.truth.stopping import share_of_rule

    if isinstance(truth, ReadTruth):
        return _shares_of(truth.read, truth.into(states), answers, rule)
    found = np.full(len(states), np.inf)
    parts: Iterable[tuple[Mechanism, Array | None, Indices]] = ()
    if isinstance(truth, TouchingTruth):
        parts = truth.by_structure(states)
    elif isinstance(truth, AccelerationTruth):
        parts = [(truth.mechanism, None, np.arange(len(states)))]
    for mechanism, numbers, among in parts:
        if isinstance(mechanism, DeclaredMechanism):
            found[among] = share_of_rule(mechanism, states[among], numbers, answers[among], rule)
    return found


def endings_of(assignment: Assignment, model: Model) -> Iterator[tuple[Model, str, str]]:
    """The subject's model with settings by which its solver of constraints goes to the end, what its user does for that, and ``fault``.

    That is as of ``harness.engines.request.Ending``.
    """
    mechanism, library, subject = assignment.as_read.mechanism, assignment.library, assignment.subject
    if (finish := getattr(model, "to_the_end", None)) is not None and assignment.truth.rigid is not None:
        ended, setting = finish()
        yield ended, f"set {setting}", ""
    if isinstance(mechanism, RobotMechanism) and mechanism.held is not None:
        for ending in load_engine(library, subject.engine).endings:
            held = replace(mechanism.held, solver=ending.solver)
            ended = replace(mechanism, request=replace(mechanism.request, held=held))
            yield load_model(library, subject, ended, None), ending.remedy, ending.fault


def by_defaults(truth: Truth, certified: Certified, model: Model, states: States) -> str:
    """A sentence on what a model, which the harness has told more than its user has to, answers by its engine's own settings."""
    chosen = None if (default := getattr(model, "by_default", None)) is None else default()
    if chosen is None:
        return ""
    usual, own, defaults = chosen
    few = states[: min(_BY_DEFAULTS, len(states))]
    found = truth.asked_and_judged(certified[: len(few)], few, usual).verdicts
    counts = [(f"{said} at {int((found == verdict).sum())}", (found == verdict).any()) for verdict, said in _SAID_OF_DEFAULTS.items()]
    said = ", ".join(said for said, any_of in counts if any_of)
    return f"Solved by {own}; by its defaults ({defaults}) it {said} of {len(few)} states"


# States at which a model is asked by its engine's own settings.
_BY_DEFAULTS = 64
# What an engine does by these.
_SAID_OF_DEFAULTS = {
    Verdict.AGREES.value: "agrees",
    Verdict.UNSTABLE.value: "loses digits",
    Verdict.DISAGREES.value: "disagrees",
    Verdict.ERROR.value: "answers nothing finite",
    Verdict.UNDECIDED.value: "is not judged",
}
