"""Bodies whose inertia is that of a mesh: as MuJoCo compiles it, wherever the geom stands, and judged in all else."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from comparison.robots import record_of

from harness.comparison import robot_library
from harness.comparison.robot_library import compiled_meshes
from harness.files.mjcf.inertias import CompiledMesh, Number
from harness.report.comparison import sections
from harness.results.comparison import FileRecord, FilesComparison
from harness.trees.robot import read_robot
from harness.verdict import Verdict

# A wedge, as solid and as shell, in frames and replicas, as a size for a box, in a body that is fused, and one of a given mass.
TEXT = """<mujoco>
<compiler fusestatic="true" boundmass="0.5" settotalmass="30" inertiagrouprange="0 3"/>
<asset>
  <mesh name="wedge" vertex="0 0 0 0.3 0 0 0 0.5 0 0.1 0 0.4 0.2 0.3 0.1"/>
  <mesh name="bowl" inertia="shell" vertex="0 0 0 0.3 0 0 0 0.2 0 0 0 0.4"/>
</asset>
<worldbody>
  <geom type="mesh" mesh="wedge"/>
  <body name="one"><joint name="first" axis="0 1 0"/>
    <geom size="0.1"/>
    <frame pos="0.1 0 0" euler="10 0 30"><geom name="wedge" type="mesh" mesh="wedge" pos="0 0.1 0" euler="20 0 0"/></frame>
    <geom type="mesh" mesh="bowl" mass="0.25"/>
    <body pos="0 0 0.5"><geom name="fused" type="box" mesh="wedge" density="500"/></body>
    <replicate count="2" offset="0 0.5 0"><body pos="0 0 1"><joint name="next" axis="1 0 0"/>
      <geom type="mesh" mesh="wedge" group="5"/><geom type="mesh" mesh="bowl" contype="0" conaffinity="0"/>
    </body></replicate>
  </body>
</worldbody>
</mujoco>
"""


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "meshes.xml"
    path.write_text(TEXT)
    return path


@pytest.mark.filterwarnings("ignore:compiler attribute 'settotalmass'")
def test_a_robot_of_meshes_is_that_of_mujoco(path: Path) -> None:
    record = record_of(path, "mujoco")
    assert (record.verdict, record.readings) == (Verdict.AGREES, [])


@pytest.mark.filterwarnings("ignore:compiler attribute 'settotalmass'")
def test_other_numbers_of_a_mesh_are_felt(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def heavier(file: Path) -> dict[Number, CompiledMesh]:
        return {number: replace(mesh, mass=mesh.mass * (1 + 1e-9)) for number, mesh in compiled_meshes(file).items()}

    monkeypatch.setattr(robot_library, "compiled_meshes", heavier)
    assert record_of(path, "mujoco").verdict == Verdict.DISAGREES


def test_the_report_says_that_meshes_are_not_judged() -> None:
    file = FileRecord(path="robot.xml", format="mjcf", meshes=(3, 5))
    lines = next(iter(sections(FilesComparison(files=[file])))).parts
    assert "  inertia of 2 meshes as MuJoCo compiled it (lines 3, 5): not judged" in lines


def test_a_mesh_of_one_kilogram_is_a_reading_of_pinocchio(tmp_path: Path) -> None:
    """Whatever its size and density; one that cannot collide has no mass there."""
    path = tmp_path / "mesh.xml"
    path.write_text("""<mujoco><asset><mesh name="wedge" vertex="0 0 0 0.3 0 0 0 0.5 0 0.1 0 0.4"/></asset><worldbody>
    <body name="one"><joint name="first" axis="0 1 0"/><geom name="felt" type="mesh" mesh="wedge" pos="0.1 0.2 0.3" euler="0 20 0"/>
    <geom name="ball" size="0.1" pos="0.2 0 0"/>
    <body name="two" pos="0 0 1"><joint name="second" axis="1 0 0"/><geom name="tip" size="0.1" pos="0 0.5 0"/>
    <geom name="picture" type="mesh" mesh="wedge" contype="0" conaffinity="0"/></body></body></worldbody></mujoco>""")
    assert record_of(path, "mujoco").verdict == Verdict.AGREES
    record = record_of(path, "pinocchio", aided=True)
    assert record.outcome == "misreads"
    assert [(reading.name, reading.lines) for reading in record.readings] == [
        ("geoms that cannot collide", (5,)),
        ("inertia of meshes", (2,)),
    ]


@pytest.mark.parametrize("massless", ['mass="0"', 'density="0"', 'class="bare"'])
def test_so_is_a_mesh_that_weighs_nothing(massless: str, tmp_path: Path) -> None:
    """It adds nothing to its body, and nobody compiles it; no inertia of a mesh is then unjudged."""
    path = tmp_path / "mesh.xml"
    path.write_text(f"""<mujoco><default><default class="bare"><geom mass="0"/></default></default>
    <asset><mesh name="wedge" vertex="0 0 0 0.3 0 0 0 0.5 0 0.1 0 0.4"/></asset><worldbody>
    <body name="one"><joint name="first" axis="0 1 0"/><geom name="felt" type="mesh" mesh="wedge" pos="0.1 0.2 0.3" {massless}/>
    <geom name="ball" size="0.1" pos="0.2 0 0"/></body></worldbody></mujoco>""")
    assert read_robot(path).meshes == ()
    assert record_of(path, "mujoco").verdict == Verdict.AGREES
    record = record_of(path, "pinocchio", aided=True)
    assert record.outcome == "misreads"
    assert [(reading.name, reading.lines) for reading in record.readings] == [("inertia of meshes", (3,))]


def test_what_a_missing_mesh_stands_among_keeps_what_it_names(tmp_path: Path) -> None:
    """Materials, textures that are drawn, and contacts that name the geoms; MuJoCo refused a copy of the file without these."""
    path = tmp_path / "absent.xml"
    link = '<inertial pos="0 0 0.1" mass="1" diaginertia="0.1 0.2 0.2"/>'
    path.write_text(f"""<mujoco><asset><texture name="drawn" type="2d" builtin="checker" width="8" height="8"/>
    <texture name="picture" type="2d" file="absent.png"/><material name="ground" texture="drawn"/><material name="skin" texture="picture"/>
    <mesh name="shell" file="absent.stl"/><hfield name="hills" file="absent.png" size="1 1 1 1"/></asset><worldbody>
    <geom name="floor" type="plane" size="1 1 1" material="ground"/><geom name="hill" type="hfield" hfield="hills"/>
    <body name="one">{link}<joint name="first" axis="0 1 0"/><geom name="outside" type="mesh" mesh="shell" material="skin"/>
    <body name="two" pos="0 0 1">{link}<joint name="second" axis="1 0 0"/><geom name="tip" type="mesh" mesh="shell"/></body></body>
    </worldbody><contact><pair geom1="floor" geom2="tip"/></contact></mujoco>""")
    for aided in (False, True):
        record = record_of(path, "mujoco", aided)
        assert record.verdict == Verdict.AGREES and "absent.stl" in record.notes[0], record.message
