"""The explanation of states a subject does worst at: the term of the equations that loses the digits, and a program that shows it.

For each term it is computed how far qdd moves when its entries are rounded to float64, to first order and in
the norm and units of the backward error: sum_i |t_i| |M^-1 e_i|_M for a vector t, sum_ij |M_ij qdd_j| |M^-1
e_i|_M for M. That is what an engine can lose which forms the term and rounds it once.

The term is identified by measuring the subject. Asked again at rest, with forces applied that stand for all that comes
from velocities, it has the same M, gravity and exact answer: an error that falls was the velocity terms'. With forces
added that make the answer ``LOAD`` times as large, an error of M grows as much and one of gravity or springs stays.

The program has three lines in an engine's own Python API and prints what it answers beside the certified value. It holds the model, so
that it can be pasted into the engine's issue tracker, and needs nothing but the engine. The engine's file writes it, by a method
``reproducer`` of its model; see ``Reproducible``.

A report ranks the catalogue's worst cases per subject. A case is a cross-check's record; stored states are among those that the
cross-check compared.

Source: Higham, Accuracy and Stability of Numerical Algorithms, 2nd ed., sections 7.1 and 7.2 (componentwise
perturbations), 10.1 (scaled condition number and Cholesky).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol, runtime_checkable

import numpy as np

from harness.arrays import Array
from harness.crosscheck.assignment import Assignment, contact_source, load_audited, reference_kernel_of, touches
from harness.engines import Subject, Terms, driving_of, select_subjects
from harness.files.text.scan import compact
from harness.library import Library
from harness.programs.program import OUTPUTS, right_hand_side
from harness.programs.states import States
from harness.results.hard_states import RankedCase, worst_cases
from harness.results.records import Record
from harness.results.table import counted
from harness.study import Note
from harness.truth.compare import compare, farthest_block
from harness.truth.reference import Reference, ReferenceKernel
from harness.truth.terms import certify_terms
from harness.verdict import Verdict
from harness.workers import Task, Workers

MASS_MATRIX, VELOCITY, GRAVITY_TERM, PASSIVE, NONE = "mass matrix", "velocity", "gravity", "passive", "none"
# Exact to multiply by, and large enough to distinguish a term's error from M's.
LOAD = 1024.0
# What an engine may lose beyond one rounding per entry, and still by rounding that term [times nv].
_ROUNDINGS = 16
_NAMES = {
    MASS_MATRIX: "the mass matrix and its factorisation",
    VELOCITY: "the velocity terms",
    GRAVITY_TERM: "the gravity terms",
    PASSIVE: "the spring and damper forces",
}


@dataclass(frozen=True)
class Loss:
    """The place where one answer lost its digits.

    Attributes:
        term: "mass matrix" (forming or factorising it), "velocity", "gravity" or "passive"; ``SOLVER`` where one of constraints
            stops early; of another quantity than accelerations the block that is farthest off; "none" where it is not known.
        statement: the same in a sentence.
        at_rest: backward error where forces stand for the velocity terms, in the data roundoff of the state itself; None
            where that is not known.
    """

    term: str
    statement: str
    at_rest: float | None = None


def digits_lost(backward_error: float) -> float:
    """log10 of a backward error [units of data roundoff], at least 0."""
    return math.log10(backward_error) if backward_error > 1 else 0.0


def locate(assignment: Assignment, state: States) -> Loss:
    """The loss of the subject at ``state``, which is one."""
    if not assignment.asked.is_default:
        return _farthest(assignment, state)
    if touches(assignment):
        return _at_contacts(assignment, state)
    assignment, state = assignment.as_read, assignment.into(state)
    kernel = reference_kernel_of(assignment)
    reference, comparison = kernel.evaluate(state), assignment.judge(state)
    error, verdict = float(comparison.backward_error[0]), str(comparison.verdicts[0])
    if not math.isfinite(error):
        return Loss(NONE, "the answer is not finite" if verdict == Verdict.ERROR else f"{verdict}: no backward error is known")
    terms = certify_terms(kernel, state).high
    shares = rounding_shares(reference, terms)
    at_rest, under_load = (_at_rest(assignment, kernel, state, terms, reference, load) for load in (1.0, LOAD))
    if at_rest is None or under_load is None:
        return Loss(NONE, f"{error:.3g} data roundoffs; at rest there is no finite answer")
    if at_rest < error / 2:
        term, evidence = VELOCITY, f"at rest, with forces in their place, it is {at_rest:.3g}"
    elif under_load < at_rest / 2:
        term = max((GRAVITY_TERM, PASSIVE), key=shares.__getitem__)
        evidence = f"it does not grow with the forces: {under_load:.3g} for {LOAD:g} times the answer"
    else:
        term, evidence = MASS_MATRIX, f"it grows with the forces and stays {at_rest:.3g} at rest"
    share, digits = shares[term], digits_lost(error)
    if verdict == Verdict.AGREES:
        statement = f"agrees: {error:.3g} data roundoffs, most of it by {_NAMES[term]}, whose rounding alone is worth {share:.3g}"
    elif error > _ROUNDINGS * assignment.mechanism.nv * max(1.0, share):
        statement = (
            f"{_NAMES[term]} wrong: the error is {error:.3g} data roundoffs, rounding is worth {share:.3g}; {evidence}; "
            "the model or an algorithm is wrong"
        )
    elif term == MASS_MATRIX:
        statement = (
            f"M is ill-conditioned (kappa_s = {reference.condition[0]:.2g}): forming and factorising it loses {digits:.1f} digits, "
            f"{error:.3g} data roundoffs; rounding its entries alone is worth {share:.3g}; {evidence}"
        )
    else:
        statement = (
            f"{_NAMES[term]} cancel and lose {digits:.1f} digits, {error:.3g} data roundoffs; rounding them alone is worth "
            f"{share:.3g}; {evidence}"
        )
    return Loss(term, statement, at_rest)


def _at_contacts(assignment: Assignment, state: States) -> Loss:
    """Loss with contacts on: terms of M say nothing of what a solver of constraints leaves."""
    error = float(assignment.judge(state).backward_error[0])
    pushing = [one for one in contact_source(assignment).contacts(state)[0] if one.pushes]
    if not math.isfinite(error):
        return Loss(NONE, "the answer is not finite, or the truth is not certified")
    verb = "pushes" if len(pushing) == 1 else "push"
    return Loss(NONE, f"{error:.3g} data roundoffs where {counted(len(pushing), 'contact')} {verb}")


def _farthest(assignment: Assignment, state: States) -> Loss:
    """Loss in another quantity: the block that is farthest off."""
    truth = assignment.truth
    certified, answers = truth.evaluate(state), assignment.answers(state)
    error = float(compare(certified, answers).backward_error[0])
    if not math.isfinite(error):
        return Loss(NONE, "the answer is not finite" if certified.certified.all() else "the truth is not certified")
    block = truth.blocks[farthest_block(certified, answers)]
    return Loss(block, f"{error:.3g} data roundoffs in the {block}")


def rounding_shares(reference: Reference, terms: Terms) -> dict[str, float]:
    """Term to how far qdd moves when each of its entries is rounded [units of data roundoff], of the one state of ``reference``.

    ``terms`` are those of the same state.
    """
    factor = reference.norm_factor[0]
    # |M^-1 e_i|_M is the length of column i of R^-T.
    reach = np.linalg.norm(np.linalg.inv(factor.T), axis=0)
    moved = {MASS_MATRIX: float((np.abs(terms.mass[0]) @ np.abs(reference.high[0])) @ reach)}
    moved |= {name: float(np.abs(getattr(terms, name)[0]) @ reach) for name in (VELOCITY, GRAVITY_TERM, PASSIVE)}
    return {name: move / float(reference.sensitivity[0]) for name, move in moved.items()}


def _at_rest(assignment: Assignment, kernel: ReferenceKernel, state: States, terms: Terms, moving: Reference, load: float) -> float | None:
    """The subject's error at rest under forces that make the answer ``load`` times as large, over ``load``.

    In data roundoffs of the moving state; None where there is no finite answer.
    """
    still = replace(state, v=np.zeros_like(state.v))
    held = certify_terms(kernel, still).high
    stand_in = state.tau - terms.velocity + held.velocity + terms.passive - held.passive
    total = np.array(right_hand_side({name: getattr(held, name)[0] for name in OUTPUTS}, stand_in[0]))[None]
    still = replace(still, tau=stand_in + (load - 1) * total)
    reference = kernel.evaluate(still)
    error = assignment.judge(still).backward_error[0] * reference.sensitivity[0] / moving.sensitivity[0] / load
    return float(error) if math.isfinite(error) else None


@runtime_checkable
class Reproducible(Protocol):
    """The method of an engine's model where its answers can be reproduced without the harness."""

    def reproducer(self, source: str, q: Array, v: Array, tau: Array, certified: Array, *driving: Array) -> str:
        """Python text that prints two lines: the engine's accelerations, then ``certified``, as lists in the engine's order.

        ``source`` is a Python expression for the text of the model. q of shape (nq,), v, tau and certified (nv,) [SI] are in the
        order of the joints given to ``load``. ``driving`` are controls and activations, for a model that takes some.
        """


def reproduce(assignment: Assignment, state: States) -> str:
    """The program for one state; "" where the subject's engine offers none, and for what are no accelerations.

    Raises:
        InvalidModel: as ``harness.crosscheck.assignment.load_audited``.
    """
    if not assignment.asked.is_default:
        return ""
    model = load_audited(assignment)
    if not isinstance(model, Reproducible) or assignment.model is None:
        return ""
    certified = reference_kernel_of(assignment).evaluate(state).high[0]
    driving = [part[0] for part in driving_of(model, state)]
    return model.reproducer(repr(compact(assignment.model.text)), state.q[0], state.v[0], state.tau[0], certified, *driving)


def ranked(library: Library, records: Sequence[Record], workers: Workers, most: int = 10) -> list[RankedCase]:
    """The worst cases of each subject, worst first, at most ``most`` each, on workers whose context the caller has entered.

    To what a record says is added which term loses the digits at the state shown; a case that cannot be explained, as
    where the engine crashes, keeps its own words.
    """
    cases = worst_cases(records, most)
    subjects = {str(subject): subject for subject in select_subjects(library, sorted({case.subject for case in cases}))}
    work = []
    for index, case in enumerate(cases):
        # An engine that gave no number, or no answer at all, would do so again.
        functions = [_reproducer_there] if case.verdict == Verdict.ERROR else [_reproducer_there, _loss_there]
        given = library, case.system, subjects[case.subject], case.state
        work += [Task((index, function), function, given) for function in functions]
    for outcome in workers.run(work):
        index, function = outcome.task.key
        case, text = cases[index], outcome.value or ""
        if function is _reproducer_there:
            cases[index] = replace(case, reproducer=text)
        else:
            cases[index] = replace(case, statement=" ".join(filter(None, [case.statement, text])))
    return cases


def _loss_there(library: Library, system: str, subject: Subject, state: dict[str, list[float]], note: Note) -> str:
    """In a sentence, which term of the equations loses the digits there."""
    return locate(Assignment.of(library, system, subject), States.at(**state)).statement


def _reproducer_there(library: Library, system: str, subject: Subject, state: dict[str, list[float]], note: Note) -> str:
    """The program in the engine's own Python API; the engine is not asked at the state."""
    return reproduce(Assignment.of(library, system, subject), States.at(**state))
