"""Which files of a folder are robots."""

from __future__ import annotations

import errno
import json
import os
from pathlib import Path
from typing import Any

import pytest
from comparison.robots import FILES
from support import harness

from harness.comparison.collection import find_files, load_expectations
from harness.errors import InvalidInput
from harness.files.document.xml import MAXIMUM_BYTES


def test_models_are_told_by_their_root_element(tmp_path: Path) -> None:
    (tmp_path / "below").mkdir()
    wanted = [tmp_path / "below" / "arm.xml", tmp_path / "rod.urdf", tmp_path / "urdf_in.xml"]
    for path, source in zip(wanted, ("arm.xml", "impossible.urdf", "mimic.urdf"), strict=True):
        path.write_text("<!-- <world> -->\n" + (FILES / source).read_text())
    (tmp_path / "package.xml").write_text("<package><name>robots</name></package>")
    (tmp_path / "part.xml").write_text("<mujoco><asset/></mujoco>")
    (tmp_path / "broken.xml").write_text("<")
    (tmp_path / "notes.txt").write_text("<robot/>")
    assert sorted(find_files([str(tmp_path)])) == sorted(wanted)
    assert find_files([str(wanted[1]), str(tmp_path)])[0] == wanted[1]


def test_a_model_whose_world_is_in_files_that_it_includes_is_found(tmp_path: Path) -> None:
    """As a robot of which all parts are in files of their own; parts, and what includes parts alone, are none."""
    (tmp_path / "parts").mkdir()
    contents = {
        "robot.xml": "<mujoco><include file=\"parts/assets.xml\"/><include file = 'parts/body.xml'/></mujoco>",
        "deeper.xml": '<mujoco><!-- <include file="lost.xml"/> --><include file="parts/deep.xml"/></mujoco>',
        "broken.xml": '<mujoco><include file="parts/lost.xml"/></mujoco>',
        "parts/body.xml": "<mujocoinclude><worldbody/></mujocoinclude>",
        "parts/deep.xml": '<mujocoinclude><include file="parts/deep.xml"/><include file="parts/body.xml"/></mujocoinclude>',
        "parts/assets.xml": "<mujoco><asset/></mujoco>",
        "settings.xml": '<mujoco><include file="parts/assets.xml"/></mujoco>',
    }
    for name, content in contents.items():
        (tmp_path / name).write_text(content)
    assert [path.name for path in find_files([str(tmp_path)])] == ["broken.xml", "deeper.xml", "robot.xml"]


def test_what_looks_like_a_robot_is_found_whether_it_can_be_read_or_not(tmp_path: Path) -> None:
    robot = (FILES / "arm.xml").read_text()
    contents = {
        "doctype.xml": f'<!DOCTYPE mujoco [<!ENTITY world "<body/>">]>\n{robot}',
        "entity.xml": '<!DOCTYPE mujoco SYSTEM "other.dtd"><mujoco>&world;</mujoco>',
        "empty.urdf": "",
        "huge.xml": "<mujoco>" + " " * MAXIMUM_BYTES + "<worldbody/></mujoco>",
    }
    for name, content in contents.items():
        (tmp_path / name).write_text(content)
    wide = {"marked.xml": "utf-16", "little.xml": "utf-16-le", "big.xml": "utf-16-be", "wider.xml": "utf-32"}
    for name, encoding in wide.items():
        (tmp_path / name).write_bytes(robot.encode(encoding))
    (tmp_path / "lost.xml").symlink_to("nowhere")
    os.mkfifo(tmp_path / "pipe.xml")
    wanted = {*contents, *wide, "lost.xml", "pipe.xml"}
    (tmp_path / "page.xml").write_text('<!DOCTYPE html PUBLIC "mujoco"><html/>')
    (tmp_path / "unended.xml").write_text("<!--" * 100_000 + "<mujoco><worldbody/>")
    assert {path.name for path in find_files([str(tmp_path)])} == wanted
    done = harness("survey", str(tmp_path), "--out", str(tmp_path / "reports"), "--json", str(tmp_path / "found.json"))
    assert done.returncode == 1
    assert done.stdout.splitlines()[0] == f"{len(wanted)} robots: {len(wanted)} cannot be read."
    reasons = {Path(file["path"]).name: file["problem"] for file in json.loads((tmp_path / "found.json").read_text())["files"]}
    assert {name: "UTF-16" in reasons[name] for name in wide} == dict.fromkeys(wide, True)
    parts = {"doctype": "DOCTYPE", "entity": "DOCTYPE", "empty": "is empty", "huge": "is larger", "lost": "no such file", "pipe": "a FIFO"}
    for name, reason in parts.items():
        assert reason in next(problem for file, problem in reasons.items() if Path(file).stem == name)


@pytest.mark.parametrize("place", ["", "no-such-distribution"])
def test_a_place_without_robots_is_refused(place: str, tmp_path: Path) -> None:
    with pytest.raises(InvalidInput, match=r"holds no model|no distribution"):
        find_files([place or str(tmp_path)])


def test_a_folder_that_cannot_be_listed_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Who runs the tests may be allowed to list every folder."""
    closed, listed = tmp_path / "closed", os.scandir
    closed.mkdir()
    (tmp_path / "arm.urdf").write_text((FILES / "arm.urdf").read_text())

    def scandir(folder: Any) -> Any:
        if Path(folder) == closed:
            raise PermissionError(errno.EACCES, "Permission denied", str(folder))
        return listed(folder)

    monkeypatch.setattr(os, "scandir", scandir)
    done = harness("survey", str(tmp_path), "--out", str(tmp_path / "reports"))
    problem = f"{closed}: this folder cannot be listed (Permission denied); give yourself the right, or name the folders to be read"
    assert (done.returncode, done.stdout) == (2, "") and problem in " ".join(done.stderr.split())


def test_expectations_that_are_none_or_of_no_robot_are_refused(tmp_path: Path) -> None:
    entry = '[[expected]]\nfile = "arm.urdf"\nsubject = "mujoco/urdf"\noutcome = "refused"\nreason = "{}"\n'
    path = tmp_path / "expected_robots.toml"
    assert not load_expectations(tmp_path)
    for text in ("[[expected]", "[[expected]]\nfile = 3\n", "[[expected]]\nfile = 'arm.urdf'\n"):
        path.write_text(text)
        with pytest.raises(InvalidInput, match="; expected entries with file, subject, outcome and reason"):
            load_expectations(tmp_path)
    path.write_text(entry.format("first") + entry.format("second"))
    with pytest.raises(InvalidInput, match=r"names 'arm\.urdf', which is not in the folder; remove the entry, or correct the path"):
        load_expectations(tmp_path)
    (tmp_path / "arm.urdf").touch()
    ((of, found),) = load_expectations(tmp_path).items()
    assert of == ((tmp_path / "arm.urdf").resolve(), "mujoco/urdf") and found.reason == "first"
