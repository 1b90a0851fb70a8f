"""Documents that a process keeps are read again where a file of theirs has changed, as in a notebook beside an editor."""

from __future__ import annotations

from pathlib import Path

import pytest
from support import harness

from harness.errors import InvalidModel
from harness.explain.changes.readings import element_at
from harness.files.kept_document import kept_document
from harness.trees.robot import read_robot

FRAMED = """<mujoco>
  <worldbody>
    <body name="leg">
      <joint axis="1 0 0"/>
      <inertial pos="0 0 0.1" mass="2" diaginertia="0.1 0.1 0.1"/>
    </body>
    <frame pos="0 0 1">
      <body name="arm">
        <joint axis="0 1 0"/>
        <inertial pos="0.1 0 0" mass="1" diaginertia="0.1 0.1 0.1"/>
      </body>
    </frame>
  </worldbody>
</mujoco>
"""
PLAIN = FRAMED.replace('    <frame pos="0 0 1">\n', "").replace("    </frame>\n", "")


def tags(path: Path) -> list[object]:
    return [element.tag for element in kept_document(path).elements]


def test_a_file_is_read_once_and_again_where_it_has_changed(tmp_path: Path) -> None:
    path = tmp_path / "robot.xml"
    path.write_text(FRAMED)
    first = kept_document(path)
    assert kept_document(path) is first and "frame" in tags(path)
    path.write_text(PLAIN)
    assert "frame" not in tags(path)


def test_a_place_that_is_gone_says_that_the_file_has_changed(tmp_path: Path) -> None:
    path = tmp_path / "robot.xml"
    path.write_text(FRAMED)
    robot = read_robot(path)
    path.write_text("<mujoco/>")
    with pytest.raises(InvalidModel, match="has changed since it was read; ask about it again"):
        element_at(robot.tree.bodies[-1].place)


def test_an_included_file_that_has_changed_is_read_again(tmp_path: Path) -> None:
    (tmp_path / "robot.xml").write_text('<mujoco><include file="options.xml"/><worldbody/></mujoco>')
    for timestep in ("0.5", "0.25"):
        (tmp_path / "options.xml").write_text(f'<mujoco><option timestep="{timestep}"/></mujoco>')
        option = kept_document(tmp_path / "robot.xml").document.root.find("option")
        assert option is not None and option.get("timestep") == timestep


def test_a_layer_of_usd_that_has_changed_is_read_again(tmp_path: Path) -> None:
    (tmp_path / "robot.usda").write_text("#usda 1.0\n(\n    subLayers = [@body.usda@]\n)\n")
    for name in ("Arm", "Leg"):
        (tmp_path / "body.usda").write_text(f'#usda 1.0\ndef Xform "{name}"\n{{\n}}\n')
        assert [element.get("name") for element in kept_document(tmp_path / "robot.usda").elements] == [None, f"/{name}"]


def test_a_relative_path_is_another_file_in_another_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name, text in (("first", FRAMED), ("second", PLAIN)):
        (tmp_path / name).mkdir()
        (tmp_path / name / "robot.xml").write_text(text)
    found = []
    for name in ("first", "second"):
        monkeypatch.chdir(tmp_path / name)
        found.append("frame" in tags(Path("robot.xml")))
    assert found == [True, False]


def test_a_file_that_is_corrected_beside_a_notebook_is_judged_as_it_now_stands(tmp_path: Path) -> None:
    """Pinocchio leaves out what stands in a frame, as is said of the first file and no longer of the second."""
    path = tmp_path / "robot.xml"
    told = []
    for text in (FRAMED, PLAIN):
        path.write_text(text)
        told.append("<frame>" in harness("compare", str(path), "--states", "8").stdout)
    assert told == [True, False]
