"""The truth along a family of hard points, for one subject: states of each point, certified, and the equations they are held against.

States of mechanisms with constraints are on the manifold of the point's own parameters, unless the case moves them off it. There only a
declared truth is asked for.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import groupby

import numpy as np

from harness.crosscheck.assignment import Assignment, acceleration_truth_of
from harness.engines import EQUATIONS, Subject, load_engine
from harness.hard.cases import HardCase, hard_cases
from harness.library import Library
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.states import States
from harness.truth.manifold import closed
from harness.truth.quantities.accelerations import reference_kernel
from harness.truth.reference import Reference


@dataclass(frozen=True)
class TruePoint:
    """One point of a family.

    Attributes:
        mechanism: the equations with the parameters that they have there. reference: the accelerations; None where they are not asked for.
    """

    states: States
    mechanism: Mechanism
    reference: Reference | None = None


def true_points(case_name: str, subject: Subject, engines: Library) -> list[TruePoint]:
    """The truth of a subject at each point; ``engines`` is the library whose engines are meant.

    Raises:
        InvalidModel: the case's models cannot be held against its mechanism.
    """
    engine, case = load_engine(engines, subject.engine), hard_cases()[case_name]
    in_body, first = engine.linear_velocity_in_body, case.unchanged_at(case.values[0])
    if subject.format == EQUATIONS or first.constraints is None or not engine.has_soft_constraints:
        return truth_along(case_name, in_body)
    return _certified([_declared(case, place, subject, engines) for place in range(len(case.values))], in_body)


@functools.lru_cache(maxsize=4)
def truth_along(case_name: str, in_body: bool) -> list[TruePoint]:
    """The rigid truth at each point; a system along the knob is compiled once."""
    return _certified(list(plain_points(hard_cases()[case_name])), in_body)


def plain_points(case: HardCase) -> Iterator[TruePoint]:
    """Each point without the truth of its accelerations."""
    return (plain_point(case, place) for place in range(len(case.values)))


def plain_point(case: HardCase, place: int) -> TruePoint:
    """One point without the truth of its accelerations, its states closed at its own parameters."""
    value = case.values[place]
    at = case.mechanism_at(value)
    states = closed(at, case.states(case.unchanged_at(value), value, place))
    return TruePoint(states if case.opened is None else case.opened(states, value), at)


def _declared(case: HardCase, place: int, subject: Subject, engines: Library) -> TruePoint:
    """One point with the problem that its model file declares."""
    point, model = plain_point(case, place), case.model_at(case.values[place], subject.format)
    return replace(point, mechanism=acceleration_truth_of(Assignment(engines, subject, point.mechanism, model)).mechanism)


def _certified(points: Sequence[TruePoint], in_body: bool) -> list[TruePoint]:
    """The points with their references; those whose equations differ in parameters alone are certified at once."""
    found: list[TruePoint] = []
    for _, group in groupby(points, key=lambda point: (point.mechanism.name, point.mechanism.program.key)):
        members = list(group)
        kernel = reference_kernel(members[0].mechanism, in_body)
        parameters = np.concatenate([one.mechanism.parameters_at(one.states) for one in members])
        reference = kernel.evaluate(States.concatenate([one.states for one in members]), parameters)
        start = 0
        for one in members:
            found.append(replace(one, reference=reference[start : start + len(one.states)]))
            start += len(one.states)
    return found
