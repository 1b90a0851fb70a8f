"""What an engine's departures from the law that it documents of constraints do to the accelerations of a mechanism, each alone."""

from __future__ import annotations

from dataclasses import replace

from harness.crosscheck.assignment import Assignment, acceleration_truth_of, departures_of, truth_of
from harness.crosscheck.constraint_laws import DepartedTruth, effect_of
from harness.explain.meant import STATES
from harness.results.readings import Effect
from harness.results.records import ACCELERATIONS
from harness.truth.quantities.accelerations import AccelerationTruth
from harness.truth.sampling import sample


def departures_and_refusal(assignment: Assignment, seed: int) -> tuple[list[Effect], list[str]]:
    """Each departure from the documented law of the model's constraints, with what it does; the model is refused by none."""
    about = replace(assignment, quantity=ACCELERATIONS)
    documented = truth_of(about)
    assert isinstance(documented, DepartedTruth) and isinstance(documented.of_file, AccelerationTruth)
    states = documented.asked_at(sample(assignment.mechanism, STATES, seed))
    reference = documented.of_file.evaluate(states)
    found = []
    for one, concerned in departures_of(about).items():
        departed = acceleration_truth_of(replace(about, departures=(one.name,)))
        found.append(effect_of(one, concerned, reference, departed.evaluate(states)))
    return found, []
