"""What readings leave of an answer: which single number of the file, were it another, would explain it.

The numbers of a file are the parameters of its truth. One whose best value leaves the least of the error is named with that value, at
which the truth is certified anew: no change is taken for linear.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

import numpy as np

from harness.arrays import Array
from harness.certify.compare import compare
from harness.certify.reference import Reference
from harness.comparison.truth import Meant, reference_of
from harness.engines.request import EngineAnswers
from harness.explain.fit import left_by
from harness.explain.textbook_side import TextbookSide, search_parameters
from harness.results.table import error_text
from harness.robots.robot import Robot
from harness.verdict import AGREEMENT

# Numbers that are named, and the share of the error that the best may leave to be worth naming.
MOST_NAMED, WORTH_NAMING = 3, 0.1
# Share of its largest entry by which M varies where it is the same but for rounding.
SAME_MATRIX = 1e-12


def unexplained(meant: Meant, answers: EngineAnswers) -> list[str]:
    """Sentences on an answer that differs from what the tree means."""
    accelerations = answers.of(meant.robot.joints)
    side = _side(meant, accelerations)
    size = float(np.linalg.norm(side.here))
    found = []
    for one in search_parameters(side).found() if 0 < size < np.inf else ():
        residual = None if one.value is None else side.residual_at(one.change, one.value)
        left = np.inf if residual is None else float(np.linalg.norm(residual)) / size
        found.append((not one.explains, left, one))
    sentences = []
    for _, left, one in sorted(found, key=lambda of: of[:2])[:MOST_NAMED]:
        if left < WORTH_NAMING:
            named = f"{one.change.place.attribute} = {one.change.start:g}"
            sentences.append(f"{named}: the engine behaves as with {one.value:.10g}, which leaves {left:.1e} of the difference")
    return sentences or [f"no single number of the file explains it; it differs in {_where(meant, accelerations)}"]


def is_explained_by_number(meant: Meant, accelerations: Array) -> bool:
    """True where a small change of one number of the file leaves little of the errors of accelerations (n, nv).

    Where M is the same at all states it must leave as little of what a change of M leaves, as its rounding there is.
    """
    side = _side(meant, accelerations)
    if not 0 < float(np.linalg.norm(side.here)) < np.inf:
        return False
    least = min((left_by(column.values[side.seen], side.here) for column in side.columns()), default=1.0)
    return least < WORTH_NAMING * _left_by_rounding(side)


def _side(meant: Meant, accelerations: Array) -> TextbookSide:
    """The answers beside the truth of the file, at the states that have both."""
    kept = np.flatnonzero(meant.truth.certified & np.isfinite(accelerations).all(axis=1))
    return TextbookSide(reference_of(meant.robot), meant.states[kept], accelerations[kept])


def _left_by_rounding(side: TextbookSide) -> float:
    """Share of the residual that the best change of a constant M leaves, d(qdd) = -M^-1 dM qdd; 1 where M varies."""
    truth = side.truth[side.seen]
    matrices = truth.norm_factor.transpose(0, 2, 1) @ truth.norm_factor
    if np.ptp(matrices, axis=0).max(initial=0.0) > SAME_MATRIX * np.abs(matrices).max(initial=0.0):
        return 1.0
    moved = side.whitening.change(side.truth.high)[side.seen]
    change = np.linalg.lstsq(moved, side.here)[0]
    return float(np.linalg.norm(side.here - moved @ change) / np.linalg.norm(side.here))


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
