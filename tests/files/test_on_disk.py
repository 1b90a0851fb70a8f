"""An element that names what is no regular file is refused at its line before anybody opens it."""

from __future__ import annotations

import os
import socket
from collections.abc import Callable
from pathlib import Path

import pytest
from support import harness

from harness.comparison.robot_library import robot_at
from harness.errors import InvalidModel

_MJCF = """<mujoco>
  {compiler}
  <asset>
    {asset}
  </asset>
  <worldbody>
    <body name="bar">
      <joint name="pin" axis="0 1 0"/>
      <inertial pos="0 0 0.25" mass="1" diaginertia="0.1 0.1 0.1"/>
    </body>
  </worldbody>
</mujoco>
"""
_URDF = """<robot name="bar">
  <link name="world"/>
  <link name="bar">
    {shape}
    <inertial><mass value="1"/><inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial>
  </link>
  <joint name="pin" type="revolute"><parent link="world"/><child link="bar"/><limit effort="1" velocity="1"/></joint>
</robot>
"""


def _socket(path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as listening:
        listening.bind(str(path))


KINDS: dict[str, Callable[[Path], object]] = {
    "a FIFO": os.mkfifo,
    "a directory": Path.mkdir,
    "a socket": _socket,
    "a device": lambda path: path.symlink_to("/dev/zero"),
}
NAMED = {
    "mesh": ("arm.xml", _MJCF.format(compiler="", asset='<mesh name="one" file="it"/>'), "it"),
    "texture": ("arm.xml", _MJCF.format(compiler="", asset='<texture type="cube" fileup="it"/>'), "it"),
    "height field": ("arm.xml", _MJCF.format(compiler="", asset='<hfield name="one" file="it" size="1 1 1 1"/>'), "it"),
    "folder of meshes": (
        "arm.xml",
        _MJCF.format(compiler='<compiler meshdir="meshes"/>', asset='<mesh name="one" file="it"/>'),
        "meshes/it",
    ),
    "name alone": ("arm.urdf", _URDF.format(shape='<visual><geometry><mesh filename="package://r/it"/></geometry></visual>'), "it"),
}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("name", "text", "place"), NAMED.values(), ids=NAMED)
def test_what_is_no_file_is_refused_at_the_line_that_names_it(name: str, text: str, place: str, kind: str, tmp_path: Path) -> None:
    (tmp_path / place).parent.mkdir(exist_ok=True)
    (tmp_path / name).write_text(text)
    robot_at(tmp_path / name)
    KINDS[kind](tmp_path / place)
    with pytest.raises(InvalidModel, match=f"is {kind}; expected a regular file") as refused:
        robot_at(tmp_path / name)
    assert refused.value.line == 4


def test_included_files_are_looked_at_too(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "it")
    (tmp_path / "part.xml").write_text('<mujoco>\n\n<asset><mesh name="one" file="it"/></asset></mujoco>')
    (tmp_path / "arm.xml").write_text(_MJCF.format(compiler='<include file="part.xml"/>', asset=""))
    with pytest.raises(InvalidModel, match="is a FIFO") as refused:
        robot_at(tmp_path / "arm.xml")
    assert (refused.value.path.name, refused.value.line) == ("part.xml", 3)


def test_a_directory_beside_the_file_that_readers_find_is_none_of_theirs(tmp_path: Path) -> None:
    name, text, place = NAMED["folder of meshes"]
    (tmp_path / name).write_text(text)
    (tmp_path / "it").mkdir()
    (tmp_path / place).parent.mkdir()
    (tmp_path / place).write_text("solid one\nendsolid one\n")
    robot_at(tmp_path / name)


@pytest.mark.parametrize("command", ["check", "compare", "survey", "diagnose", "search"])
def test_commands_refuse_it_before_an_engine_waits(command: str, tmp_path: Path) -> None:
    name, text, place = NAMED["mesh"]
    (tmp_path / name).write_text(text)
    os.mkfifo(tmp_path / place)
    done = harness(command, name, *(["--out", "reports"] if command == "survey" else []), "--time-limit", "30", cwd=tmp_path)
    assert done.returncode == (1 if command == "survey" else 2)
    first = done.stdout.splitlines()[0] if done.stdout else done.stderr
    assert "1 robot: 1 cannot be read" in first if command == "survey" else "4: <mesh" in first.replace("line ", "")
    assert f'<mesh file="{place}">: {place} is a FIFO; expected a regular file' in done.stdout + done.stderr
    assert "time limit" not in done.stdout + done.stderr
