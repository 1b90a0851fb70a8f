"""The truth along a family of hard points, for one subject: states of each point, certified, and the equations they are held against.

States of mechanisms with constraints are on the manifold of the point's own parameters, unless the case moves them off it. There only a
declared truth is asked for: the impedance of each constraint is then that of its distance at each state.
"""

from __future__ import annotations

import functools
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import groupby

import numpy as np

from harness.arrays import Array
from harness.crosscheck.assignment import Assignment, acceleration_truth_of
from harness.engines import EQUATIONS, Subject, load_engine
from harness.files.model_file import ModelFile, read_model
from harness.hard.cases import HardCase, hard_cases, library_of
from harness.lagrange.derivation import load_mechanism
from harness.library import MODEL_SUFFIXES, Library
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.states import States
from harness.truth.constraints.manifold import closed, distances
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


_IMPEDANCE = re.compile(r"(?P<constraint>.*)\[\d+\] impedance")


def true_points(case_name: str, subject: Subject, engines: Library) -> list[TruePoint]:
    """The truth of a subject at each point; ``engines`` is the library whose engines are meant.

    Raises:
        InvalidModel: the case's models cannot be held against its mechanism.
    """
    engine = load_engine(engines, subject.engine)
    in_body = engine.linear_velocity_in_body
    case = hard_cases()[case_name]
    first = load_mechanism(library_of(case), case.system_at(case.values[0]))
    if subject.format == EQUATIONS or first.constraints is None or not engine.has_soft_constraints:
        return truth_along(case_name, in_body)
    return _declared(case, subject, engines, in_body)


@functools.lru_cache(maxsize=4)
def truth_along(case_name: str, in_body: bool) -> list[TruePoint]:
    """The rigid truth at each point; a system along the knob is compiled once."""
    case = hard_cases()[case_name]
    points = []
    for place, value in enumerate(case.values):
        mechanism = load_mechanism(library_of(case), case.system_at(value))
        points.append((states_at(case, mechanism, value, place), case.mechanism_at(mechanism, value), None))
    return _certified(points, in_body)


def plain_points(case_name: str) -> Iterator[TruePoint]:
    """Each point without the truth of its accelerations."""
    case = hard_cases()[case_name]
    for place, value in enumerate(case.values):
        mechanism = load_mechanism(library_of(case), case.system_at(value))
        yield TruePoint(states_at(case, mechanism, value, place), case.mechanism_at(mechanism, value))


def states_at(case: HardCase, mechanism: Mechanism, value: float, place: int) -> States:
    """The states of one point, closed at its parameters; ``mechanism`` has its own."""
    states = closed(case.mechanism_at(mechanism, value), case.states(mechanism, value, place))
    return states if case.opened is None else case.opened(states, value)


@functools.lru_cache(maxsize=64)
def model_file(case_name: str, system: str, model_format: str) -> ModelFile | None:
    """The model of a system along a case, as it is written; None for equations."""
    if model_format == EQUATIONS:
        return None
    return read_model(library_of(hard_cases()[case_name]).model_path(system, model_format), model_format)


def file_at(case: HardCase, mechanism: Mechanism, value: float, model_format: str | None) -> ModelFile | None:
    """The model at one point in a format, by default in the first one that the system has; None for equations."""
    if model_format is None:
        model_format = next((one for one in MODEL_SUFFIXES if library_of(case).has_model(mechanism.name, one)), EQUATIONS)
    model = model_file(case.name, mechanism.name, model_format)
    return None if model is None else case.model_at(model, mechanism, value)


def _declared(case: HardCase, subject: Subject, engines: Library, in_body: bool) -> list[TruePoint]:
    points: list[tuple[States, Mechanism, Array | None]] = []
    for place, value in enumerate(case.values):
        mechanism = load_mechanism(library_of(case), case.system_at(value))
        at, states = case.mechanism_at(mechanism, value), states_at(case, mechanism, value, place)
        model = file_at(case, mechanism, value, subject.format)
        assert model is not None
        truth = acceleration_truth_of(Assignment(engines, subject, at, model)).mechanism
        if case.opened is None:
            points.append((states, truth, None))
            continue
        laws = load_engine(engines, subject.engine).constraint_laws(model)
        away = distances(at, states)
        own = np.tile(truth.parameter_values, (len(states), 1))
        for column, (name, _, _) in enumerate(truth.parameters):
            if found := _IMPEDANCE.fullmatch(name):
                law = laws[found["constraint"]].impedance
                own[:, column] = [law.at(distance) for distance in away[found["constraint"]]]
        # Off the manifold the problem is still one, and has no constraints to be closed.
        points.append((states, replace(truth, constraints=None), own))
    return _certified(points, in_body)


def _certified(points: Sequence[tuple[States, Mechanism, Array | None]], in_body: bool) -> list[TruePoint]:
    """The points with their references; those whose equations differ in parameters alone are certified at once.

    A point without parameters for each state has those of its mechanism.
    """
    found: list[TruePoint] = []
    for _, group in groupby(points, key=lambda point: (point[1].name, point[1].program.key)):
        members = list(group)
        rows = [own if own is not None else np.tile(one.parameter_values, (len(batch), 1)) for batch, one, own in members]
        kernel = reference_kernel(members[0][1], in_body)
        reference = kernel.evaluate(States.concatenate([batch for batch, _, _ in members]), np.concatenate(rows))
        start = 0
        for batch, one, _ in members:
            found.append(TruePoint(batch, one, reference[start : start + len(batch)]))
            start += len(batch)
    return found
