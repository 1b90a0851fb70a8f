"""What meshes weigh stands in no file: whoever reads the file says it, and the robot says of which geoms."""

from __future__ import annotations

from pathlib import Path

import pytest

from harness.errors import InvalidModel
from harness.files.mjcf.inertias import CompiledMesh, Number
from harness.trees.robot import read_robot

TEXT = """<mujoco>
<asset><mesh name="m" vertex="0 0 0 1 0 0 0 1 0 0 0 1"/></asset>
<worldbody>
<geom name="floor" type="plane" size="1 1 1"/>
<body><joint name="first"/><geom size="0.1"/>
<frame pos="1 0 0"><geom name="shell" type="mesh" mesh="m"/></frame>
<body><joint name="second"/><geom name="tip" size="0.1"/></body>
</body>
</worldbody>
</mujoco>
"""
SHELL = CompiledMesh("shell", 2.0, (0.25, 0.5, 0.5), (1.0, 0.5, 0.0), (0.0, 1.0, 0.0, 0.0))


def test_a_mesh_weighs_what_its_reader_says(tmp_path: Path) -> None:
    path = tmp_path / "robot.xml"
    path.write_text(TEXT)
    asked: list[Path] = []

    def compiled(file: Path) -> dict[Number, CompiledMesh]:
        asked.append(file)
        return {(0, 1): SHELL}

    robot = read_robot(path, compile_meshes=compiled)
    sphere, mesh = robot.tree.bodies[0].solids
    assert (sphere.kind, mesh.kind, mesh.mass) == ("sphere", "mesh", 2)
    assert [float(moment) for moment in mesh.moments] == [0.25, 0.5, 0.5]
    assert [float(component) for component in mesh.pose[-1].position] == [1, 0.5, 0]
    assert (robot.meshes, asked) == ((6,), [path])


@pytest.mark.parametrize("found", [{}, {(0, 0): SHELL}, {(0, 1): CompiledMesh("tip", 1.0, (1, 1, 1), (0, 0, 0), (1, 0, 0, 0))}])
def test_a_mesh_that_its_reader_has_elsewhere_is_refused(found: dict[Number, CompiledMesh], tmp_path: Path) -> None:
    path = tmp_path / "robot.xml"
    path.write_text(TEXT)
    with pytest.raises(InvalidModel, match="is not where the engine has one") as caught:
        read_robot(path, compile_meshes=lambda _: found)
    assert caught.value.line == 6


def test_a_file_that_does_not_compile_is_refused_in_the_words_of_its_reader(tmp_path: Path) -> None:
    path = tmp_path / "robot.xml"
    path.write_text(TEXT)

    def refused(_: Path) -> dict[Number, CompiledMesh]:
        raise ValueError("at least 4 vertices")

    with pytest.raises(InvalidModel, match="does not compile: at least 4 vertices"):
        read_robot(path, compile_meshes=refused)


def test_no_file_without_such_a_mesh_is_compiled(tmp_path: Path) -> None:
    path = tmp_path / "robot.xml"
    path.write_text(TEXT.replace('type="mesh" mesh="m"', 'mass="0" type="mesh" mesh="m"'))
    assert read_robot(path, compile_meshes=lambda _: pytest.fail("asked for nothing")).meshes == ()
