"""What engines hold unlike is told by every check, be it felt by the motion or not."""

from __future__ import annotations

import json
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest
from support import call_engines_here, cross_checked, harness, make_library, pytest_in_this_process

from harness.crosscheck.settings import Settings
from harness.errors import InvalidInput
from harness.library import Library
from harness.results.cross_check import HeldDifference

ENTRY = """[[differs]]
system = "arm_2r"
quantity = "inertia"
joint = "{joint}"
ulps = {ulps}
reason = "a bar has no inertia about itself"
link = "https://example.org"
"""
THICK = ("1e-15 0.07 0.07", "0.001 0.07 0.07")


def inertial(centre: str, mass: str, moment: str) -> str:
    return f'<inertial pos="{centre} 0 0" mass="{mass}" diaginertia="1e-15 {moment} {moment}"/>'


def about_centre(mass: Fraction, first: Fraction, second: Fraction) -> str:
    """An ``<inertial>`` from mass, first and second moment about the joint."""
    return inertial(str(float(first / mass)), str(float(mass)), repr(float(second - first**2 / mass)))


# A quarter of a kilogram goes from the forearm to the end of the upper arm, where the elbow is.
MOVED = [
    (inertial("0.22", "3", "0.07"), about_centre(Fraction("3.25"), Fraction("0.785"), Fraction("0.2777"))),
    (inertial("0.18", "2", "0.04"), about_centre(Fraction("1.75"), Fraction("0.36"), Fraction("0.1048"))),
]


@pytest.fixture
def library(tmp_path: Path) -> Path:
    return make_library(tmp_path / "library", ["arm_2r"])


def change(library: Path, *changes: tuple[str, str]) -> None:
    path = library / "mjcf" / "arm_2r.xml"
    for old, new in changes:
        assert old in path.read_text()
        path.write_text(path.read_text().replace(old, new))


def differs(library: Path, **options: Any) -> list[HeldDifference]:
    records, study = cross_checked(Settings(library=Library.at(library), states=10, examples=None, **options))
    assert {record.verdict for record in records} == {"agrees"}
    assert study.result().as_expected == (not any(finding.fails for finding in study.result().differs))
    return study.result().differs


def test_mass_that_moves_between_links_is_found_though_no_acceleration_feels_it(library: Path) -> None:
    change(library, *MOVED)
    done = harness(
        "check", "arm_2r", "--quantity", "accelerations", "--library", str(library), "--states", "10", "--json", "out.json", cwd=library
    )
    assert done.returncode == 1
    [mass] = [line for line in done.stdout.splitlines() if "mass of elbow" in line]
    assert "is 1.75 (mujoco/mjcf, pinocchio/mjcf), but 2 (mujoco/urdf, pinocchio/urdf)" in mass
    assert "arm_2r.xml:23" in mass and "arm_2r.urdf:23" in mass
    assert done.stdout.startswith("arm_2r: all 5 subjects agree; not as expected: 6 differences after loading.\n")
    found = json.loads((library / "out.json").read_text())
    assert {record["verdict"] for record in found["records"]} == {"agrees"}
    assert {(finding["quantity"], finding["joint"]) for finding in found["differs"]} == {
        (quantity, joint) for quantity in ("mass", "centre", "inertia") for joint in ("shoulder", "elbow")
    }


def test_models_that_are_alike_hold_alike(library: Path) -> None:
    assert differs(library) == []


def test_a_gravity_that_tilts_out_of_the_plane_is_named(library: Path) -> None:
    change(library, ('gravity="0 0 -9.81"', 'gravity="0 1e-9 -9.81"'))
    [finding] = differs(library)
    assert "gravity is 0 1e-09 -9.81 (mujoco/mjcf, pinocchio/mjcf), but 0 0 -9.81 (mujoco/urdf, pinocchio/urdf)" in str(finding)


@pytest.mark.ci
def test_a_hinge_whose_coordinate_passes_for_a_length_is_named(tmp_path: Path) -> None:
    library = make_library(tmp_path / "library", ["atwood"])
    path = library / "systems" / "atwood.py"
    assert cross_checked(Settings(library=Library.at(library), states=10, examples=None))[1].result().differs == []
    path.write_text(path.read_text().replace("    angles=(turn,),\n", ""))
    [finding] = cross_checked(Settings(library=Library.at(library), states=10, examples=None))[1].result().differs
    assert finding.fails and finding.joint == "pulley"
    assert str(finding) == "atwood: joint pulley is a hinge, and the system's file has turn for a length: name it in angles=(turn,)"


@pytest.mark.ci
def test_a_difference_is_excused_up_to_its_size_and_no_longer_than_it_is_there(library: Path) -> None:
    expected, entry = library / "expected_verdicts.toml", ENTRY.format(joint="shoulder", ulps=1e15)
    change(library, THICK)
    expected.write_text(entry)
    [finding] = differs(library)
    assert not finding.fails and "expected because a bar has no inertia about itself" in str(finding)
    expected.write_text(ENTRY.format(joint="shoulder", ulps=1e9))
    assert [finding.fails for finding in differs(library)] == [True]
    change(library, THICK[::-1])
    [stale] = differs(library)
    assert stale.fails and "inertia of shoulder is expected to differ, and is held alike; remove its [[differs]]" in str(stale)
    assert differs(library, subjects=["mujoco/mjcf", "mujoco/urdf"]) == []


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (ENTRY.format(joint="", ulps=0), "number 1: .*expected the texts system, quantity, joint, reason, link, and ulps"),
        (ENTRY.format(joint="", ulps=1).replace("inertia", "weight"), "number 1 names quantity 'weight', which does not exist"),
        (ENTRY.format(joint="", ulps=1).replace("arm_2r", "arm_2l"), "number 1 names system 'arm_2l', which does not exist"),
        (ENTRY.format(joint="", ulps=1) * 2, "number 2 repeats arm_2r, inertia of ''"),
        ("[differs]", r"holds something other than \[\[expected\]\] and \[\[differs\]\] tables"),
    ],
)
def test_an_entry_that_cannot_be_used_is_refused(library: Path, text: str, message: str) -> None:
    (library / "expected_verdicts.toml").write_text(text)
    with pytest.raises(InvalidInput, match=message):
        differs(library)


def test_an_engine_that_cannot_say_what_it_holds_keeps_its_verdict(library: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def held(*arguments: object) -> None:
        raise KeyError("no such body")

    call_engines_here(monkeypatch)
    monkeypatch.setattr("harness.engines.adapters.mujoco.quantities.held", held)
    [one, other] = differs(library)
    assert "mujoco/mjcf does not say what it holds after loading: KeyError: 'no such body'" in str(one)
    assert one.fails and other.fails


def test_pytest_fails_those_that_hold_otherwise_than_most(library: Path, tmp_path: Path) -> None:
    change(library, THICK)
    done = pytest_in_this_process("--harness-library", str(library), "--harness-states", "10", cwd=tmp_path)
    assert done.returncode == 1
    assert "2 failed, 3 passed" in done.stdout
    assert "not held alike after loading:" in done.stdout
