"""Along a hard case, a wrong parameter is told from the digits that its conditioning costs."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from catalogue import BUILT_IN

from harness.explain.columns import Whitening, parameter_derivatives
from harness.explain.pattern import subject_named
from harness.hard.atlas import judged, load_hard_expectations
from harness.hard.cases import hard_cases
from harness.hard.measurement import Answered, explained, point_of, row_of
from harness.hard.truths import TruePoint, true_points
from harness.results.atlas import HardRow
from harness.truth.compare import compare
from harness.truth.quantities.accelerations import reference_kernel
from harness.verdict import AGREEMENT, Verdict

EXPECTED = load_hard_expectations(["lagrange", "mujoco/mjcf", "pinocchio/urdf"])
LOSING = sorted((case, subject) for case, subject, verdict in EXPECTED if verdict == Verdict.UNSTABLE)
# What is compiled or certified for long: arms, and chains of which every length is another system.
LONG = ("long_chain_straight", "long_chain_random", "mass_ratio_10", "vanishing_wrist")
# By day one subject of each of the others.
BY_DAY = dict(reversed([(case, subject) for case, subject in LOSING if case not in LONG]))
MARKED = [
    pytest.param(case, subject, marks=pytest.mark.costly if BY_DAY.get(case) == subject else pytest.mark.nightly)
    for case, subject in LOSING
]


@cache
def measured(case_name: str, subject: str) -> tuple[list[TruePoint], list[Answered]]:
    case, named = hard_cases()[case_name], subject_named(subject)
    truths = true_points(case_name, named, BUILT_IN)
    return truths, [point_of(case, value, truth, named, BUILT_IN) for value, truth in zip(case.values, truths, strict=True)]


def judged_row(case_name: str, subject: str, truths: list[TruePoint], answered: list[Answered]) -> HardRow:
    case = hard_cases()[case_name]
    return judged(row_of(case, subject_named(subject), explained(truths, answered, False)), EXPECTED)


@pytest.mark.ci
@pytest.mark.parametrize(("case_name", "subject"), MARKED)
def test_a_parameter_ten_times_beyond_what_its_roundoff_can_show_is_no_lost_digit(case_name: str, subject: str) -> None:
    truths, answered = measured(case_name, subject)
    assert judged_row(case_name, subject, truths, answered).problems == []
    slopes, largest = [], []
    for truth, (_, answers) in zip(truths, answered, strict=True):
        reference, states, mechanism = truth.reference, truth.states, truth.mechanism
        assert reference is not None
        if answers is None:
            continue
        kernel = reference_kernel(mechanism, False)
        values = np.array(mechanism.parameter_values)
        slopes.append(parameter_derivatives(kernel, states, reference, values.tolist()) * values[:, None, None])
        effects = [np.linalg.norm(Whitening(reference).change(slope), axis=1) for slope in slopes[-1]]
        # Where the subject's own errors are larger, nothing of this size can be seen.
        agreeing = (compare(reference, answers).verdicts == Verdict.AGREES).all()
        largest.append([float(effect.max()) if agreeing else 0.0 for effect in effects])
    names = [name for name, _, _ in truths[0].mechanism.parameters]
    shown = np.max(largest, axis=0)
    for number, name in enumerate(names):
        if shown[number] == 0:
            continue
        off = 10 * AGREEMENT / shown[number]
        changes = iter([off * slope[number] for slope in slopes])
        planted: list[Answered] = []
        for truth, (point, answers) in zip(truths, answered, strict=True):
            if answers is None or truth.reference is None:
                planted.append((point, None))
                continue
            wrong = answers + next(changes)
            comparison = compare(truth.reference, wrong, factorises=True)
            worst = max(comparison.known("backward_error").tolist(), default=None)
            verdict = str(comparison.verdicts[comparison.worst])
            planted.append((replace(point, verdict=verdict, backward_error=worst), wrong))
        assert judged_row(case_name, subject, truths, planted).problems, f"{name} off by {off:.2g} of itself"
