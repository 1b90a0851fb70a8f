"""Along a hard case a wrong parameter is told from the digits that its conditioning costs; other quantities have entries of their own."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from catalogue import BUILT_IN
from studies import silent
from support import HEAVY_ENGINE, InThisProcess, completed, make_library
from support_results import RUN

from harness.engines import NotOffered
from harness.explain.columns import Whitening, parameter_derivatives
from harness.explain.pattern import subject_named
from harness.hard.atlas import AtlasStudy, judged, load_hard_expectations
from harness.hard.cases import hard_cases
from harness.hard.measurement import Answered, explained, measure, point_of, row_of
from harness.hard.truths import TruePoint, true_points
from harness.library import Library
from harness.report.hard_cases import HardSummary
from harness.results.atlas import Atlas, HardRow
from harness.results.records import ACCELERATIONS
from harness.truth.compare import compare
from harness.truth.quantities.accelerations import reference_kernel
from harness.verdict import AGREEMENT, Verdict

SUBJECTS = ["lagrange", "mujoco/mjcf", "pinocchio/urdf"]
EXPECTED = load_hard_expectations(SUBJECTS)
LOSING = sorted((case, subject) for case, subject, verdict in EXPECTED if verdict == Verdict.UNSTABLE)
# What is compiled or certified for long: arms, and chains of which every length is another system.
LONG = ("long_chain_straight", "long_chain_random", "mass_ratio_10", "vanishing_wrist")
# By day one subject of each of the others.
BY_DAY = dict(reversed([(case, subject) for case, subject in LOSING if case not in LONG]))
MARKED = [pytest.param(case, subject, marks=() if BY_DAY.get(case) == subject else pytest.mark.nightly) for case, subject in LOSING]


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


@pytest.mark.ci
@pytest.mark.parametrize(
    ("case", "subject", "quantity", "verdict"),
    [
        ("unnormalised_quaternion", "pinocchio/urdf", "energy", "disagrees"),
        ("unnormalised_quaternion", "mujoco/mjcf", "energy", "agrees"),
        ("zero_length_link", "mujoco/mjcf", "mass_matrix", "disagrees"),
        ("stiff_damper", "pinocchio/urdf", "inverse_dynamics", "agrees"),
    ],
)
def test_verdicts_are_as_the_entries_of_the_quantity_say(case: str, subject: str, quantity: str, verdict: str) -> None:
    row = measure(case, subject_named(subject), quantity, BUILT_IN, silent)
    assert row.verdict == verdict and len(row.points) == len(hard_cases()[case].values)
    assert judged(row, load_hard_expectations(SUBJECTS, quantity)).problems == []
    if verdict == "disagrees":
        assert any(point.reason.startswith("farthest off is the") for point in row.points)
        # The entries of another quantity say nothing of this one.
        others = load_hard_expectations(SUBJECTS, "jacobian")
        assert any("which no entry expects" in problem for problem in judged(row, others).problems)


@pytest.mark.ci
def test_a_fault_is_seen_in_its_quantity_alone_and_has_a_family_of_its_own(tmp_path: Path) -> None:
    library = Library.at(make_library(tmp_path / "library", ["bar_pendulum"], {"heavy": HEAVY_ENGINE}))
    study = AtlasStudy(library, ["stiff_damper"], ["heavy/mjcf"], quantities=["mass_matrix", "gravity", ACCELERATIONS])
    found: Atlas = completed(study, InThisProcess())
    assert {row.family: row.verdict for row in found.rows} == {
        "stiff_damper": "agrees",
        "stiff_damper, mass_matrix": "disagrees",
        "stiff_damper, gravity": "agrees",
    }
    assert [sentence.partition(":")[0] for sentence in found.unexpected] == ["stiff_damper, mass_matrix, heavy/mjcf"]
    families = [family.name for family in HardSummary(RUN, found).families]
    assert families == ["stiff_damper", "stiff_damper, gravity", "stiff_damper, mass_matrix"]


def test_what_nobody_offers_has_no_row() -> None:
    with pytest.raises(NotOffered, match="not determined"):
        measure("grashof_limit", subject_named("mujoco/mjcf"), "inverse_dynamics", BUILT_IN, silent)
    study = AtlasStudy(BUILT_IN, ["stiff_damper"], ["lagrange"], quantities=["energy"])
    assert completed(study, InThisProcess()).rows == [] and not study.problems
