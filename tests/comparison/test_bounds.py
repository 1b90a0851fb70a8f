"""Least masses and inertias: what a file of MJCF means, and what an engine makes of them that has other rules, or of another format."""

from __future__ import annotations

from pathlib import Path

import pytest
from comparison.robots import FILES, edited, line_of, record_of

from harness.verdict import AGREEMENT, Verdict

# A box that is too light, a rod whose principal moments are not those of its axes, a sensor's frame, and a stick that no body can be.
BODIES = {
    "box": '<body name="box"><joint name="tip" axis="0 1 0"/><geom type="box" size="0.02 0.03 0.04" pos="-0.1 0.2 0"/>{}</body>',
    "rod": '<body name="rod" pos="0 0 0.5"><joint name="swing" axis="1 0 0"/>'
    '<inertial pos="0.1 0.2 0.3" mass="2" fullinertia="0.08 0.1 0.11 0.01 0.005 0.02"/>{}</body>',
    "frame": '<body name="frame" pos="0.25 0 0.5"/>',
}
BOX, ROD, FRAME = BODIES.values()
STICK = '<inertial pos="0.1 0.2 0.3" mass="2" diaginertia="0.5 0.01 0.02"/>'


def mjcf(folder: Path, options: str, bodies: str) -> Path:
    path = folder / "bounded.xml"
    path.write_text(f"<mujoco>\n<compiler {options}/>\n<worldbody>\n{bodies}\n</worldbody>\n</mujoco>\n")
    return path


@pytest.mark.parametrize(
    "options", ['boundmass="0.6" boundinertia="0.09"', 'boundmass="0.6" boundinertia="0.003"', 'balanceinertia="true"']
)
def test_pinocchio_bounds_the_numbers_of_an_inertial_alone(options: str, tmp_path: Path) -> None:
    """Of all others it takes what stands there: no geom is bounded, nor a principal moment, nor is a mean taken."""
    rod = ROD.replace('<inertial pos="0.1 0.2 0.3" mass="2" fullinertia="0.08 0.1 0.11 0.01 0.005 0.02"/>', STICK)
    path = mjcf(tmp_path, options, BOX.format((rod if "balance" in options else ROD).format("")))
    assert record_of(path, "mujoco").verdict == Verdict.AGREES
    record = record_of(path, "pinocchio")
    assert record.explained and record.verdict == Verdict.DISAGREES
    assert [reading.name for reading in record.readings] == ["least masses and inertias"]
    assert record.left is not None and record.left <= AGREEMENT


def test_a_bound_that_changes_nothing_is_no_reading(tmp_path: Path) -> None:
    path = mjcf(tmp_path, 'boundmass="0.01" boundinertia="1e-6"', BOX.format(ROD.format("")))
    record = record_of(path, "pinocchio")
    assert (record.verdict, record.readings) == (Verdict.AGREES, [])


def test_mujoco_moves_the_mass_of_a_massless_body(tmp_path: Path) -> None:
    """The documentation gives it a mass; it stands a pose away from where the body is."""
    path = mjcf(tmp_path, 'boundmass="0.1" boundinertia="0.001"', ROD.format(FRAME))
    record = record_of(path, "mujoco")
    assert record.explained and record.verdict == Verdict.DISAGREES
    assert [(reading.name, reading.lines) for reading in record.readings] == [("centre of a massless body", (4,))]


@pytest.mark.filterwarnings("ignore:compiler attribute 'settotalmass'")
@pytest.mark.parametrize(
    ("name", "settings", "reading"),
    [
        ("arm.urdf", '<compiler boundmass="2.5" boundinertia="0.03"/>', "least masses and inertias"),
        ("impossible.urdf", '<compiler balanceinertia="true"/>', "least masses and inertias"),
        ("arm.urdf", '<compiler settotalmass="3"/>', "settotalmass"),
        ("arm.urdf", '<option gravity="0 0.5 -3"/>', "gravity"),
    ],
)
def test_what_a_urdf_says_to_mujoco_is_a_reading_of_mujoco(name: str, settings: str, reading: str, tmp_path: Path) -> None:
    start = "<robot name=" + FILES.joinpath(name).read_text().partition("<robot name=")[2].partition(">")[0] + ">"
    path = edited(FILES / name, tmp_path, (start, f"{start}<mujoco>{settings}</mujoco>"))
    record = record_of(path, "mujoco")
    assert record.explained and record.verdict == Verdict.DISAGREES and record.left is not None and record.left <= AGREEMENT
    assert [one.name for one in record.readings] == [reading] and record.readings[0].lines
    assert record_of(path, "mujoco", aided=True).verdict == Verdict.AGREES


def test_a_massless_link_is_bounded_before_it_is_fused(tmp_path: Path) -> None:
    settings = '<mujoco><compiler boundmass="0.5" boundinertia="0.001"/></mujoco>'
    text = FILES.joinpath("massless_foot.urdf").read_text()
    start = text[text.index("<robot") : text.index(">", text.index("<robot")) + 1]
    path = edited(FILES / "massless_foot.urdf", tmp_path, (start, start + settings))
    record = record_of(path, "mujoco")
    assert record.explained and [one.name for one in record.readings] == ["least masses and inertias"]
    assert line_of(path, '<mass value="0"/>') in record.readings[0].lines
