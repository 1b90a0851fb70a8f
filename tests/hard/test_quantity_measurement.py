"""Quantities other than accelerations along hard cases: at the same points, with entries of their own."""

from __future__ import annotations

from pathlib import Path

import pytest
from studies import silent
from support import HEAVY_ENGINE, InThisProcess, completed, make_library
from support_results import RUN

from harness.engines import NotOffered, select_subjects
from harness.hard.atlas import AtlasStudy, judged, load_hard_expectations
from harness.hard.cases import hard_cases
from harness.hard.measurement import measure
from harness.library import Library
from harness.report.hard_cases import HardSummary
from harness.results.atlas import Atlas, HardRow
from harness.results.records import ACCELERATIONS

SUBJECTS = ["lagrange", "mujoco/mjcf", "pinocchio/urdf"]
BUILT_IN = Library.built_in()


def row_of(case: str, subject: str, quantity: str, library: Library = BUILT_IN) -> HardRow:
    (chosen,) = select_subjects(library, [subject])
    return measure(case, chosen, quantity, library, silent)


@pytest.mark.costly
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
    row = row_of(case, subject, quantity)
    assert row.verdict == verdict and len(row.points) == len(hard_cases()[case].values)
    assert judged(row, load_hard_expectations(SUBJECTS, quantity)).problems == []
    if verdict == "disagrees":
        assert any(point.reason.startswith("farthest off is the") for point in row.points)
        # The entries of another quantity say nothing of this one.
        others = load_hard_expectations(SUBJECTS, "jacobian")
        assert any("which no entry expects" in problem for problem in judged(row, others).problems)


@pytest.mark.costly
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
        row_of("grashof_limit", "mujoco/mjcf", "inverse_dynamics")
    study = AtlasStudy(BUILT_IN, ["stiff_damper"], ["lagrange"], quantities=["energy"])
    assert completed(study, InThisProcess()).rows == [] and not study.problems
