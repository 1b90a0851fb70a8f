"""A subject that is asked for another quantity than accelerations, as every study asks and judges it that takes an ``Assignment``."""

from __future__ import annotations

import json
from dataclasses import dataclass

from harness.arrays import Array
from harness.certify.compare import compare
from harness.certify.quantities import Truth, find_quantities
from harness.crosscheck.quantity_truth import truth_of
from harness.crosscheck.stages import ask_one_by_one
from harness.crosscheck.tasks import Assignment, Judge, Note, load_audited, unloaded_judge_of
from harness.equations.states import States
from harness.errors import InvalidRequest
from harness.library import Library
from harness.results.records import ACCELERATIONS


@dataclass(frozen=True)
class QuantityAssignment(Assignment):
    """A subject and what it is asked for.

    Attributes:
        system: the system or variant whose own file is the truth. quantity: the name of what is asked for.
    """

    system: str
    quantity: str

    @property
    def truth(self) -> Truth:
        """What the subject is held against; raises as ``harness.crosscheck.quantity_truth.truth_of``."""
        return truth_of(find_quantities()[self.quantity], self.system, self)

    def answers(self, states: States) -> Array:
        """Those of the subject; raises as ``load_audited`` and ``Truth.answers``."""
        return self.truth.answers(load_audited(self), states)


def asked_for(quantity: str, system: str, assignment: Assignment) -> Assignment:
    """The assignment of the same subject for a quantity, which may be accelerations."""
    if quantity == ACCELERATIONS:
        return assignment
    return QuantityAssignment(**vars(assignment), system=system, quantity=quantity)


def quantity_of(assignment: Assignment) -> str:
    """What the subject is asked for."""
    return assignment.quantity if isinstance(assignment, QuantityAssignment) else ACCELERATIONS


def refuse_robots(library: Library, quantities: str) -> None:
    """Raises InvalidRequest where the library is of robots, whose files have no second truth."""
    if library.is_of_robots:
        raise InvalidRequest(f"{quantities}: of mechanisms here; harness check takes quantities of a robot's file")


@unloaded_judge_of.register
def _judge(assignment: QuantityAssignment) -> Judge:
    truth = assignment.truth
    return Judge(truth.key, truth.evaluate, lambda certified, states: compare(certified, assignment.answers(states)))


@ask_one_by_one.register
def _ask_one_by_one(assignment: QuantityAssignment, states: States, note: Note) -> None:
    load_audited(assignment)
    for index in range(len(states)):
        note(json.dumps(states.as_json(index)))
        assignment.answers(states[index : index + 1])
