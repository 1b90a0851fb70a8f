"""The numbers of a user's file by which an engine's answers on it are explained: they are the parameters of its truth.

The truth is certified anew at each value. No change is taken for linear, where a number is named.
"""

from __future__ import annotations

import numpy as np

from harness.arrays import Array
from harness.engines.request import EngineAnswers
from harness.explain.as_read import Folded, fold, readings_that_do_not_hold
from harness.explain.fit import best_change
from harness.explain.meant import Meant, reference_of
from harness.explain.search import Tried
from harness.explain.suspects import Suspect, SuspectSearch, masses_of
from harness.explain.textbook_side import TextbookSide, search_parameters
from harness.files.given import Given, every_number_in, with_numbers
from harness.results.table import error_text
from harness.trees.bodies.inertias import impossible_inertias
from harness.trees.bodies.spatial import parameter_name
from harness.trees.mechanism import mechanism_of
from harness.trees.robot import Robot
from harness.truth.compare import Comparison, compare
from harness.truth.reference import ReferenceKernel
from harness.verdict import AGREEMENT, Verdict

# Numbers that are named, and the share of the error that a small change or a fitted value of one may leave to be of interest.
MOST_NAMED, OF_INTEREST = 3, 0.1
# Attributes of what is never negative.
_NEVER_NEGATIVE = ("armature", "damping", "density", "mass", "size", "stiffness")
# Share of its largest entry by which M varies where it is the same but for rounding.
SAME_MATRIX = 1e-12


def numbers_that_explain(side: TextbookSide, robot: Robot) -> list[str]:
    """A sentence on each number of a file that makes answers agree, and that a body can have."""
    sentences = []
    search, enough = search_parameters(side), max(AGREEMENT, _rounding_of_answers(side))
    for one in search.found():
        number, value = one.change.place.attribute, _agreeing_value(side, one, enough)
        if value is not None and _is_possible(robot, number, value):
            behaves, left = f"{number} = {one.change.start:g}: the engine behaves as with {value:.10g}", side.left_at(one.change, value)
            sentences.append(f"{behaves}, which leaves {error_text(left)} data roundoffs")
    return sentences[:MOST_NAMED]


def _rounding_of_answers(side: TextbookSide) -> float:
    """The most that an answer is off by for being float64 [data roundoffs]."""
    half = np.spacing(np.abs(side.answers)) / 2
    parts = (side.whitening.change(half * unit) for unit in np.eye(half.shape[1]))
    return float(sum(np.linalg.norm(part, axis=1) for part in parts).max())


def _agreeing_value(side: TextbookSide, tried: Tried, enough: float) -> float | None:
    """The value of a number that leaves ``enough`` or less; None where neither that which was fitted does nor one of fewer digits."""
    if tried.value is None or tried.left > OF_INTEREST * side.before:
        return None
    values = (tried.value, *(float(f"{tried.value:.{digits}g}") for digits in range(1, 17)))
    return next((value for value in values if side.left_at(tried.change, value) <= enough), None)


def _is_possible(robot: Robot, name: str, value: float) -> bool:
    """True where the number of the file that is a parameter of this name can have a value.

    It gives no body an inertia that no body can have, no force or size another sign, gravity no other direction, and no unit quaternion
    a component beyond 1: numbers beyond these imitate what is wrong elsewhere.
    """
    found: list[Given] = []

    def changed(number: Given) -> Given:
        if parameter_name(number) != name:
            return number
        found.append(number)
        return Given(value, number.place, number.attribute, number.index)

    tree = with_numbers(robot.tree, changed)
    if any(_is_out_of_bounds(number, value) for number in found):
        return False
    return len(impossible_inertias(tree)) <= len(robot.impossible)


def _is_out_of_bounds(number: Given, value: float) -> bool:
    attribute, own = number.attribute.partition(" ")[0], float(number)
    if attribute == "quat":
        return abs(value) > max(1.0, abs(own))
    return value < 0 if attribute in _NEVER_NEGATIVE else attribute == "gravity" and own * value < 0


def is_explained_by_number(side: TextbookSide) -> bool:
    """True where a small change of one number of a file leaves little of the errors of answers.

    Where M is the same at all states it must leave as little of what a change of M leaves, as its rounding there is.
    """
    if not 0 < float(np.linalg.norm(side.here)) < np.inf:
        return False
    least = min((best_change(column.values[side.seen], side.here)[1] for column in side.columns()), default=1.0)
    return least < OF_INTEREST * _left_by_rounding(side)


def side_of(meant: Meant, accelerations: Array, kernel: ReferenceKernel | None = None) -> TextbookSide:
    """Accelerations (n, nv) beside the truth of a file, at the states that have both; ``kernel`` as of ``unexplained``."""
    kept = np.flatnonzero(meant.truth.certified & np.isfinite(accelerations).all(axis=1))
    return TextbookSide(
        kernel or reference_of(meant.robot, meant.unit_roundoff),
        meant.states[kept],
        accelerations[kept],
        meant.robot.path,
        certified=meant.truth[kept],
    )


def _left_by_rounding(side: TextbookSide) -> float:
    """Share of the residual that the best change of a constant M leaves, d(qdd) = -M^-1 dM qdd; 1 where M varies."""
    truth = side.truth[side.seen]
    matrices = truth.norm_factor.transpose(0, 2, 1) @ truth.norm_factor
    if np.ptp(matrices, axis=0).max(initial=0.0) > SAME_MATRIX * np.abs(matrices).max(initial=0.0):
        return 1.0
    moved = side.whitening.change(side.truth.high)[side.seen]
    change = np.linalg.lstsq(moved, side.here)[0]
    return float(np.linalg.norm(side.here - moved @ change) / np.linalg.norm(side.here))


def left_beside_readings(found: Meant, folded: Folded, read: Meant, answers: EngineAnswers, judged: Comparison) -> list[str]:
    """Sentences on what the readings of a file, ``found``, leave of an engine's errors; none where digits are lost and no more.

    ``read`` is what they make of it, and ``judged`` the judgement of the answers by that.
    """
    accelerations = answers.of(read.robot.joints)
    if judged.are_all(Verdict.AGREES, Verdict.UNSTABLE) and not is_explained_by_number(side_of(read, accelerations)):
        return []
    return readings_that_do_not_hold(found, folded, answers) or unexplained(read, accelerations, before=(found.robot, folded))


def unexplained(
    meant: Meant, accelerations: Array, kernel: ReferenceKernel | None = None, before: tuple[Robot, Folded] | None = None
) -> list[str]:
    """Sentences on accelerations (n, nv) that differ from what a tree means: numbers that explain them, or where they differ.

    ``kernel`` gives the truth of ``meant``, by default that of its tree alone; ``before`` is the robot of the file, where readings have
    made the tree of it.
    """
    numbers = numbers_that_explain(side_of(meant, accelerations, kernel), meant.robot)
    if not numbers and before is not None:
        numbers = _masses_read_otherwise(*before, meant, accelerations)
    return numbers or [f"no single number of the file explains it; it differs in {_where(meant, accelerations)}"]


def _masses_read_otherwise(robot: Robot, folded: Folded, read: Meant, accelerations: Array) -> list[str]:
    """A sentence on each mass that makes answers agree, where readings have computed more of it, as moments of inertia."""
    own = {number.key for number in every_number_in(robot.tree)}
    if own.issuperset(number.key for number in every_number_in(read.robot.tree)):
        return []

    def truth_with(suspect: Suspect, value: float) -> tuple[Array, Array]:
        other = fold(suspect.robot(value), [reading for reading, _ in folded.applied]).robot
        return ReferenceKernel(mechanism_of(other)).accelerations(read.states)

    found = SuspectSearch(masses_of(robot), truth_with, read.truth).explaining(accelerations)
    return [one.sentence for one in found][:MOST_NAMED]


def _where(meant: Meant, accelerations: Array) -> str:
    """The joints whose accelerations differ, the worst first."""
    truth = meant.truth
    error = np.abs(accelerations - truth.high).max(axis=0)
    joints = reference_of(meant.robot).mechanism.joints
    worst = dict.fromkeys(joints[column] for column in np.argsort(-error)[:4])
    bad = compare(truth, accelerations).known("backward_error") > AGREEMENT
    return f"{int(bad.sum())} of {len(truth)} states, most in {', '.join(worst)} (up to {error_text(float(error.max()))} rad/s^2 or m/s^2)"
