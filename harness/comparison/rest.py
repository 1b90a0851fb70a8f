"""What readings leave of an answer: which single number of the file, were it another, would explain it.

The change of an acceleration by a number is linear for small changes: M d(qdd) = d(force - M qdd), with the derivatives that data
roundoff is made of. A number whose best change leaves the least of the error is named with the value that the engine behaves as with.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from harness.arrays import Array
from harness.certify.compare import compare
from harness.certify.reference import Reference
from harness.comparison.questions import Answers
from harness.comparison.truth import Meant, reference_of
from harness.results.table import error_text
from harness.robots.robot import Robot
from harness.verdict import AGREEMENT

# Numbers that are named, and the share of the error that the best may leave to be worth naming.
MOST_NAMED, WORTH_NAMING = 3, 0.1
# Share of its largest entry by which M varies where it is the same but for rounding.
SAME_MATRIX = 1e-12


@dataclass(frozen=True)
class Candidate:
    """A number of the file whose change explains an error.

    Attributes:
        number: its place in the parameters of the robot's mechanism. by: the change. left: share of the error that it leaves.
    """

    number: int
    by: float
    left: float


def unexplained(meant: Meant, answers: Answers) -> list[str]:
    """Sentences on an answer that differs from what the tree means."""
    accelerations = answers.of(meant.robot.joints)
    found = list(single_numbers(meant, accelerations))
    mechanism = reference_of(meant.robot).mechanism
    sentences = []
    for one in found[:MOST_NAMED]:
        name, value, _ = mechanism.parameters[one.number]
        sentences.append(
            f"{name} = {value:g}: the engine behaves as with {value + one.by:.10g}, which leaves {one.left:.1e} of the difference"
        )
    return sentences or [f"no single number of the file explains it; it differs in {_where(meant, accelerations)}"]


def single_numbers(meant: Meant, accelerations: Array) -> Iterator[Candidate]:
    """The numbers whose change explains most of the error of accelerations (n, nv), the best first."""
    columns, error = _whitened(meant, accelerations)
    size = float(np.linalg.norm(error))
    if not 0 < size < np.inf:
        return
    candidates = []
    for number, column in enumerate(columns):
        length = float(np.linalg.norm(column))
        if 0 < length < np.inf:
            by = float((column / length * error).sum()) / length
            left = float(np.linalg.norm(error - by * column)) / size
            candidates.append(Candidate(number, by, left))
    yield from (one for one in sorted(candidates, key=lambda one: one.left) if one.left < WORTH_NAMING)


def are_of_several_mass_matrices(meant: Meant) -> bool:
    """False where M is the same at all states, whose rounding then moves every answer as a wrong number of the file would."""
    factors = meant.truth.norm_factor[meant.truth.certified]
    matrices = factors.transpose(0, 2, 1) @ factors
    return bool(np.ptp(matrices, axis=0).max(initial=0.0) > SAME_MATRIX * np.abs(matrices).max(initial=0.0))


def _whitened(meant: Meant, accelerations: Array) -> tuple[list[Array], Array]:
    """For each number of the file the change of qdd by it, and the error, both in units of data roundoff, (n, nv)."""
    reference = reference_of(meant.robot)
    mechanism = reference.mechanism
    truth, kept = meant.truth, np.flatnonzero(meant.truth.certified & np.isfinite(accelerations).all(axis=1))
    slopes = reference.derivatives(meant.states[kept], truth.high[kept])
    inputs = mechanism.nq + 2 * mechanism.nv + 1
    scale = truth.data_roundoff[kept, None]
    error = np.einsum("nij,nj->ni", truth.norm_factor[kept], (accelerations - truth.high - truth.low)[kept]) / scale
    columns = []
    for number in range(len(mechanism.parameters)):
        # |M^-1 f|_M = |R^-T f| with M = R' R.
        columns.append(np.linalg.solve(truth.norm_factor[kept].transpose(0, 2, 1), slopes[:, :, inputs + number, None])[:, :, 0] / scale)
    return columns, error


def _where(meant: Meant, accelerations: Array) -> str:
    """The joints whose accelerations differ, the worst first."""
    truth: Reference = meant.truth
    error = np.abs(accelerations - truth.high).max(axis=0)
    joints = reference_of(meant.robot).mechanism.joints
    worst = dict.fromkeys(joints[column] for column in np.argsort(-error)[:4])
    bad = compare(truth, accelerations).known("backward_error") > AGREEMENT
    return f"{int(bad.sum())} of {len(truth)} states, most in {', '.join(worst)} (up to {error_text(float(error.max()))} rad/s^2 or m/s^2)"


def why_refused(robot: Robot, element: str) -> list[str]:
    """What the file says of the body that an engine's refusal names, and what is impossible in it, a sentence each."""
    sentences = []
    for body in robot.tree.bodies:
        if body.name == element and body.place is not None:
            line = body.place.line if body.inertia is None else body.inertia.places["moments"].line
            numbers = (
                "no inertia" if body.inertia is None else f"{_numbers((body.inertia.mass,))} kg, {_numbers(body.inertia.moments)} kg m^2"
            )
            sentences.append(f"line {line}: {element}: {numbers}")
    return sentences + [f"line {one.line}: {one.body}: {one.what}" for one in robot.impossible]


def _numbers(values: Sequence[Fraction]) -> str:
    return " ".join(f"{float(value):g}" for value in values)
