"""A robot's file where a mechanism's name may stand: check, search, diagnose and show; and where somebody types it first."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import lxml.html
import numpy as np
import pytest
from support import Done, call_engines_here, expected_entry, harness, make_library

import harness as public
from harness.arrays import Array
from harness.engines.adapters.mujoco import acting as adapter
from harness.engines.request import JointForces
from harness.errors import InvalidRequest
from harness.library import Library, robots_folder
from harness.trees.robot import read_robot

BUILT_IN = Library.built_in()
HERE = Path(__file__).parent.parent
TWO_LINKS, MIMIC = HERE / "comparison" / "files" / "arm.urdf", HERE / "comparison" / "files" / "mimic.urdf"
DRIVEN = HERE / "comparison" / "files" / "driven.xml"
ARM = HERE / "trees" / "files" / "arm.urdf"
ROTOR = HERE.parent / "docs" / "examples" / "energy-of-rotors-at-unaligned-hinges.xml"
# Pinocchio's reader ignores the frame with all its contents.
FRAMED = """<mujoco>
  <worldbody>
    <body name="upper">
      <joint name="shoulder" axis="0 1 0"/><inertial pos="0 0 -0.25" mass="2" diaginertia="0.0625 0.0625 0.03125"/>
      <frame pos="0 0 -0.5">
        <body name="fore"><joint name="elbow" axis="0 1 0"/><inertial pos="0 0 -0.25" mass="1" diaginertia="0.0625 0.0625 0.03125"/></body>
      </frame>
    </body>
  </worldbody>
</mujoco>
"""
# As exporters write them: with meshes and materials, which the harness refuses of a model.
ROBOT = """<?xml version="1.0"?>
<robot name="r2">
  <material name="grey"><color rgba="0.5 0.5 0.5 1"/></material>
  <link name="base"><visual><geometry><mesh filename="package://r2/base.stl"/></geometry></visual></link>
  <link name="lower"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="waist" type="continuous"><parent link="base"/><child link="lower"/></joint>
</robot>
"""
REPLAY = re.compile(r"replay: harness (.*)$", re.MULTILINE)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for path in (TWO_LINKS, MIMIC):
        shutil.copy(path, tmp_path)
    (tmp_path / "framed.xml").write_text(FRAMED)
    return tmp_path


def rows(done: Done) -> dict[str, list[str]]:
    """The cells of a table by subject."""
    cells = [re.split(r"\s{2,}", line) for line in done.stdout.splitlines()]
    return {row[1]: row for row in cells if len(row) > 3 and "/" in row[1]}


def without_dampers(forces: JointForces, v: Array) -> Array:
    return np.zeros_like(v)


@pytest.fixture
def undamped(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pinocchio is not supplied with dampers, as if its reader took them."""
    call_engines_here(monkeypatch)
    monkeypatch.setattr(JointForces, "of_dampers", without_dampers)


def test_the_engines_that_read_a_file_are_checked_at_sampled_and_searched_states(folder: Path) -> None:
    done = harness("check", "arm.urdf", "mimic.urdf", "--aided", "--states", "12", "--json", "found.json", cwd=folder)
    assert done.returncode == 0, done.stdout + done.stderr
    found = json.loads((folder / "found.json").read_text())
    records, remarks = found["records"], found["remarks"]
    assert any(remark.startswith("pinocchio/urdf, aided: ") for remark in remarks)
    systems = ("arm.urdf", "mimic.urdf")
    assert [(one["system"], one["subject"]) for one in records] == [
        (system, subject) for system in systems for subject in ("mujoco/urdf", "pinocchio/urdf")
    ]
    assert all(one["verdict"] == "agrees" and one["backward_error"] < 64 for one in records)
    assert all(one["origins"] == {"stored": 0, "sampled": 6, "searched": 6, "simplest": 0} for one in records)
    assert "pinocchio/urdf, aided: " in done.stdout and "12" in rows(done)["pinocchio/urdf"]
    # Nothing else stands beside the files.
    assert {path.name for path in folder.iterdir()} == {"arm.urdf", "mimic.urdf", "framed.xml", "found.json"}


@pytest.mark.ci
def test_an_engine_is_judged_as_its_user_calls_it_and_its_readings_are_named(folder: Path) -> None:
    """Pinocchio's ABA applies no damping: it is another arm that it moves, which nobody may be told to agree."""
    done = harness("check", "arm.urdf", "mimic.urdf", "--states", "12", "--json", "found.json", cwd=folder)
    assert done.returncode == 0 and "2 of 4" not in done.stdout, done.stdout
    records = {(one["system"], one["subject"]): one for one in json.loads((folder / "found.json").read_text())["records"]}
    assert {key: one["verdict"] for key, one in records.items()} == {
        ("arm.urdf", "mujoco/urdf"): "agrees",
        ("arm.urdf", "pinocchio/urdf"): "explained",
        ("mimic.urdf", "mujoco/urdf"): "explained",
        ("mimic.urdf", "pinocchio/urdf"): "explained",
    }
    damping, friction = records["arm.urdf", "pinocchio/urdf"]["readings"]
    assert friction["name"] == "dry friction" and friction["alone"] > 0.01 and "pin.aba applies no dry friction" in done.stdout
    assert damping["name"] == "joint damping" and damping["lines"] and damping["alone"] > 0.1
    lines = ", ".join(map(str, damping["lines"]))
    assert f" %  Pinocchio's ABA applies no joint damping (2 joints, lines {lines}): add -d v to tau\n" in done.stdout
    assert all(one["backward_error"] < 64 for one in records.values()), "what the readings leave"


@pytest.mark.ci
def test_a_plain_engine_that_its_readings_do_not_explain_is_red(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # A process keeps what it has read of a file of this name.
    (folder / "arm.urdf").rename(folder / "unexplained.urdf")
    monkeypatch.setattr("harness.explain.as_read.find_readings", lambda *_: [])
    done = harness("check", "unexplained.urdf", "--states", "12", cwd=folder)
    assert done.returncode == 1 and rows(done)["pinocchio/urdf"][3].startswith("disagrees")
    assert "harness diagnose unexplained.urdf --states 12" in done.stdout
    assert "the file is the truth, and pinocchio/urdf differs from it" in done.stdout


def test_a_quantity_of_a_file_that_no_reading_explains_is_red(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """No diagnosis is offered, for there is none of a file's quantities."""
    for name in ("known.xml", "unknown.xml"):
        shutil.copy(ROTOR, folder / name)
    words = ("--states", "8", "--quantity", "energy")
    done = harness("check", "known.xml", *words, cwd=folder)
    assert done.returncode == 0 and "energy of rotors at unaligned hinges" in rows(done)["pinocchio/mjcf"][4], done.stdout
    monkeypatch.setattr("harness.explain.as_read.find_readings", lambda *_: [])
    done = harness("check", "unknown.xml", *words, cwd=folder)
    assert done.returncode == 1 and rows(done)["pinocchio/mjcf"][4].startswith("disagrees") and "harness diagnose" not in done.stdout


@pytest.mark.ci
def test_an_engine_that_is_wrong_is_red_with_the_number_it_is_wrong_by(folder: Path, undamped: None) -> None:
    done = harness("check", "arm.urdf", "--aided", "--states", "12", cwd=folder)
    assert done.returncode == 1
    assert rows(done)["mujoco/urdf"][3] == "agrees" and rows(done)["pinocchio/urdf"][3].startswith("disagrees")
    assert "the file is the truth, and pinocchio/urdf differs from it" in done.stdout
    assert "harness diagnose arm.urdf --aided --states 12" in done.stdout
    words = REPLAY.search(done.stdout)
    assert words is not None
    command, _, state = words[1].partition(" --state ")
    again = harness(*command.split(), "--state", state.strip("'"), cwd=folder)
    assert again.returncode == 1 and rows(again).keys() == {"pinocchio/urdf"}


@pytest.mark.ci
def test_what_a_folder_expects_of_a_robot_holds(folder: Path, undamped: None) -> None:
    expected = folder / "expected_verdicts.toml"
    expected.write_text(expected_entry("arm.urdf", "pinocchio/urdf", "disagrees", 1e30))
    assert harness("check", "arm.urdf", "--aided", "--states", "4", cwd=folder).returncode == 0
    # Of another robot of the folder it says nothing here; of none it is refused.
    assert harness("check", "mimic.urdf", "--states", "4", "--subject", "mujoco/urdf", cwd=folder).returncode == 0
    expected.write_text(expected_entry("gone.urdf", "pinocchio/urdf", "disagrees", 1e30))
    assert "gone.urdf" in harness("check", "arm.urdf", cwd=folder).stderr


def test_what_a_reader_leaves_out_is_said_of_an_engine_that_has_too_few_joints(folder: Path) -> None:
    done = harness("diagnose", "framed.xml", "--states", "4", "--all", cwd=folder)
    assert done.returncode == 0 and done.stdout.startswith("framed.xml: nothing is wrong with mujoco/mjcf")
    assert rows(done)["mujoco/mjcf"][3] == "agrees" and rows(done)["pinocchio/mjcf"][3] == "misreads (as expected): frames joints lost"
    assert (
        "joints lost  Pinocchio's MJCF reader ignores <frame> and <replicate> with all their contents (1 element, line 6): write"
        in done.stdout
    )


def test_an_engine_that_refuses_the_file_costs_its_own_record(folder: Path) -> None:
    """MuJoCo takes no height field without rows, which bears on no acceleration."""
    text = FRAMED.replace("<mujoco>", '<mujoco><asset><hfield name="h" nrow="0" ncol="0" size="1 1 1 1"/></asset>')
    (folder / "framed.xml").write_text(text)
    done = harness("check", "framed.xml", "--states", "4", cwd=folder)
    assert done.returncode == 1 and done.stderr == ""
    assert rows(done)["mujoco/mjcf"][3].startswith("unsupported") and "mujoco refuses the file" in done.stdout
    assert "the file is the truth, and mujoco/mjcf refuses it" in done.stdout


def test_a_suspected_file_has_its_line_named(folder: Path) -> None:
    (folder / "other.urdf").write_text((folder / "arm.urdf").read_text().replace('<mass value="1"/>', '<mass value="1.01"/>'))
    done = harness("diagnose", "arm.urdf", "--urdf", "other.urdf", "--states", "8", cwd=folder)
    assert done.returncode == 1 and done.stdout.startswith("arm.urdf and other.urdf differ: mass of link fore, 1 (arm.urdf:30)")
    assert "mass of link fore" in done.stdout and "other.urdf:30" in done.stdout
    same = harness("diagnose", "arm.urdf", "--urdf", "arm.urdf", "--states", "8", cwd=folder)
    assert same.returncode == 0 and "the same robot" in same.stdout
    for option, value in (("--subject", "mujoco/urdf"), ("--evaluations", "9")):
        chosen = harness("diagnose", "arm.urdf", "--urdf", "other.urdf", option, value, cwd=folder)
        assert chosen.returncode == 2 and option in chosen.stderr


@pytest.mark.ci
def test_a_search_stores_hard_states_beside_the_file_and_a_check_takes_them(folder: Path, undamped: None) -> None:
    done = harness("search", "arm.urdf", "--aided", "--subject", "pinocchio/urdf", "--budget", "40", cwd=folder)
    assert done.returncode == 1 and "stored in hard_states/arm.urdf.json" in done.stdout
    checked = harness("check", "arm.urdf", "--aided", "--states", "4", "--subject", "pinocchio/urdf", "--json", "found.json", cwd=folder)
    assert checked.returncode == 1
    (record,) = json.loads((folder / "found.json").read_text())["records"]
    assert record["origins"]["stored"] == 1


@pytest.mark.ci
def test_a_search_asks_every_engine_that_reads_the_file(folder: Path) -> None:
    done = harness("search", "mimic.urdf", "--budget", "16", "--no-keep", cwd=folder)
    assert done.returncode == 0, done.stderr
    assert all(f"{subject}: 1" in done.stdout for subject in ("mujoco/urdf", "pinocchio/urdf"))
    # Both leave the joint free that mimics another: the first line says so, and the rest what to do.
    first, *rest = done.stdout.splitlines()
    assert all(f"{subject} answers for the file as it reads it: mimic joints" in first for subject in ("mujoco/urdf", "pinocchio/urdf"))
    assert "pinocchio/urdf: explained" in rest and any("leaves a mimic joint free" in line for line in rest)
    assert not (folder / "hard_states").exists()


def test_a_file_is_shown(folder: Path) -> None:
    done = harness("show", "framed.xml", "--html", "page.html", cwd=folder)
    assert done.returncode == 0 and "2 bodies, 2 joints, 2 degrees of freedom" in done.stdout
    assert "What the file is" in (folder / "page.html").read_text() and "engine" not in done.stdout.partition("2. ")[2]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("check", "nowhere.urdf"), "nowhere.urdf: there is no such file"),
        (("check", "nothing"), "(there is no file of this name either)"),
        (("check", "text.urdf"), "text.urdf:1: is not well-formed XML"),
        (("check", "page.xml"), "page.xml:1: the root element is <html>; expected a robot"),
        (("check", "fixed.urdf"), "fixed.urdf: no joint moves"),
        (("check", "idle.urdf"), "idle.urdf:1: no acceleration is determined, for nothing with mass or inertia moves with pin"),
        (("check", "arm.urdf", "double_pendulum"), "arm.urdf is a file and double_pendulum is not"),
        (("check", "arm.urdf", "sub/arm.urdf"), "name those of one folder"),
        (("check", "arm.urdf", "--urdf", "mimic.urdf"), "harness diagnose arm.urdf --urdf mimic.urdf"),
        (("check", "arm.urdf", "--subject", "mujoco/mjcf"), "arm.urdf has a model in urdf alone"),
        (("search", "arm.urdf", "--subject", "mujoco/mjcf"), "mujoco/mjcf cannot be searched on arm.urdf"),
        (("check", "double_pendulum", "--floating-base"), "a floating base is put under the root of a robot's file"),
        (("check", "double_pendulum", "--aided"), "by name engines get all that a model says"),
        (("check", "arm.urdf", "--library", "library"), "no library has to do with"),
        (("check", "arm.urdf", "--state", '{"q": [0], "v": [0], "tau": [0]}'), "--state has 1 numbers for q"),
        (("diagnose", "arm.urdf", "--urdf", "nowhere.urdf"), "nowhere.urdf: there is no such file"),
    ],
)
def test_what_cannot_be_used_is_named_with_what_to_do(folder: Path, arguments: tuple[str, ...], words: str) -> None:
    (folder / "text.urdf").write_text("no XML")
    (folder / "page.xml").write_text("<html/>")
    (folder / "fixed.urdf").write_text('<robot name="fixed"><link name="base"/></robot>')
    joint = '<joint name="pin" type="continuous"><parent link="base"/><child link="rod"/></joint>'
    (folder / "idle.urdf").write_text(f'<robot name="idle"><link name="base"/><link name="rod"/>{joint}</robot>')
    for name in ("sub", "library/systems"):
        (folder / name).mkdir(parents=True)
    shutil.copy(TWO_LINKS, folder / "sub")
    done = harness(*arguments, cwd=folder)
    assert done.returncode == 2 and words in done.stderr, done.stderr


FLOATING = """<robot name="cart">
  <link name="world"/>
  <link name="frame"/>
  <link name="trunk"><inertial><mass value="2"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="mount" type="fixed"><parent link="world"/><child link="frame"/></joint>
  <joint name="base" type="floating"><parent link="frame"/><child link="trunk"/></joint>
</robot>
"""


@pytest.mark.parametrize("command", ["check", "compare"])
def test_a_robot_that_floats_already_gets_no_second_floating_base(command: str, tmp_path: Path) -> None:
    (tmp_path / "cart.urdf").write_text(FLOATING)
    done = harness(command, "cart.urdf", "--floating-base", "--states", "8", cwd=tmp_path)
    assert done.returncode == 2
    assert 'cart.urdf:6: <joint name="base"> lets the robot float already; leave the floating base out' in done.stderr


@pytest.mark.ci
def test_a_floating_base_has_six_more_degrees_of_freedom(folder: Path) -> None:
    # A base without mass could turn about the first joint at no cost.
    inertial = '<inertial><mass value="2"/><inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial>'
    text = (folder / "arm.urdf").read_text()
    (folder / "arm.urdf").write_text(text.replace('<link name="ground"/>', f'<link name="ground">{inertial}</link>'))
    done = harness("check", "arm.urdf", "--floating-base", "--states", "4", "--json", "found.json", cwd=folder)
    assert done.returncode == 0, done.stdout
    records = json.loads((folder / "found.json").read_text())["records"]
    assert {len(one["worst_state"]["v"]) for one in records} == {8} and all("--floating-base" in one["replay"] for one in records)


def test_a_robot_in_a_namespace_is_checked_and_is_like_no_mechanism(folder: Path) -> None:
    """Models of mechanisms have none. Whoever checks a file by itself asks for no mechanism whose joints have such names."""
    text = BUILT_IN.model_path("simple_pendulum", "urdf").read_text()
    (folder / "own.urdf").write_text(re.sub(r"<robot ", '<robot xmlns="http://www.ros.org/urdf" ', text, count=1))
    done = harness("check", "own.urdf", "--subject", "pinocchio/urdf", "--states", "4", cwd=folder)
    assert done.returncode == 0 and done.stderr == "" and "named like" not in done.stdout


def test_a_script_evaluates_a_robot() -> None:
    robot = public.load(ARM)
    truth = robot.accelerations(q=[0.1] * 8, v=[0.2] * 8)
    assert truth.certified.all() and read_robot(ARM).degrees_of_freedom == truth.value.shape[1] == 8
    assert robot.compare([0.1] * 8, [0.2] * 8, truth.value).verdicts.tolist() == ["agrees"]
    assert not hasattr(robot, "_repr_latex_")
    with pytest.raises(InvalidRequest, match="by recursion over its bodies"):
        robot.equations  # noqa: B018


@pytest.fixture
def exported(tmp_path: Path) -> Path:
    (tmp_path / "robot.urdf").write_text(ROBOT)
    shutil.copy(BUILT_IN.model_path("double_pendulum", "urdf"), tmp_path / "own.urdf")
    shutil.copy(BUILT_IN.model_path("cart_pendulum", "mjcf"), tmp_path / "own.xml")
    return tmp_path


def test_a_robot_is_checked_by_itself(exported: Path) -> None:
    done = harness("check", "robot.urdf", "--states", "8", cwd=exported)
    assert done.returncode == 0, done.stderr
    for subject in ("mujoco/urdf", "pinocchio/urdf"):
        assert re.search(rf"^robot.urdf +{subject} +8 +agrees", done.stdout, re.MULTILINE)
    assert "aided" not in done.stdout


def test_a_file_that_stands_in_for_nothing_is_answered_with_what_to_do(exported: Path) -> None:
    done = harness("check", "--urdf", "robot.urdf", cwd=exported)
    assert done.returncode == 2 and done.stdout == ""
    ways = ("harness check NAME --urdf robot.urdf", "harness check robot.urdf", "harness list", "harness new NAME")
    for words in ("robot.urdf is a model file", *ways):
        assert words in done.stderr
    # Not with the whole catalogue.
    assert sum(name in done.stderr for name in BUILT_IN.system_names()) == 0
    assert max(map(len, done.stderr.splitlines())) < 120


@pytest.mark.parametrize(
    ("file", "command"),
    [
        ("own.urdf", "harness check double_pendulum --urdf own.urdf"),
        ("own.xml", "harness check cart_pendulum --mjcf own.xml"),
    ],
)
def test_a_mechanism_whose_joints_have_the_names_of_the_file_is_named(exported: Path, file: str, command: str) -> None:
    done = harness("check", "--mjcf" if file.endswith("xml") else "--urdf", file, cwd=exported)
    assert done.returncode == 2 and command in done.stderr


@pytest.mark.parametrize(
    ("options", "command"),
    [
        (["--mjcf", "own.xml"], "(cart|double)_pendulum --mjcf own.xml --urdf own.urdf"),
        (["--library", "mine"], "double_pendulum --library mine --urdf own.urdf"),
    ],
)
def test_both_files_of_a_mechanism_and_the_library_of_the_user_are_kept(exported: Path, options: list[str], command: str) -> None:
    make_library(exported / "mine", ["double_pendulum"])
    done = harness("check", "--urdf", "own.urdf", *options, cwd=exported)
    assert done.returncode == 2 and re.search(f"harness check {command}$", done.stderr, re.MULTILINE), done.stderr


@pytest.mark.parametrize("file", ["nowhere.urdf", "torn.urdf", "own.xml"])
def test_a_file_that_cannot_be_read_is_named_with_its_fault_and_what_to_do(exported: Path, file: str) -> None:
    (exported / "torn.urdf").write_text(ROBOT[:200])
    done = harness("check", "--urdf", file, cwd=exported)
    assert done.returncode == 2
    assert done.stderr.startswith(f"harness: {file}:") and f"harness check NAME --urdf {file}" in done.stderr


@pytest.mark.ci
def test_robots_of_a_library_stand_in_its_report(tmp_path: Path) -> None:
    """With a row and a page each, in the JSON, and in the exit status: a robot that an engine cannot answer on is not as expected."""
    root = make_library(tmp_path / "mine", ["bar_pendulum"])
    (root / "robots").mkdir()
    shutil.copy(robots_folder(BUILT_IN) / "gripper.urdf", root / "robots")
    done = harness("report", "--library", "mine", "--out", "out", "--json", "out.json", cwd=tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    index = lxml.html.parse(tmp_path / "out" / "index.html")
    [row] = index.xpath("//tr[th/@data-kind='robot']")
    cells = [(cell.get("class"), cell.text_content()) for cell in row if cell.get("data-column") == "pinocchio/urdf"]
    assert row[0].text_content() == "gripper.urdf" and cells == [("explained", "explained mimic joints 282 %")]
    assert "1 explained (mimic joints)" in index.xpath("string(//header//table)")
    page = (tmp_path / "out" / "robots" / "gripper.urdf.html").read_text()
    assert "leaves a mimic joint free" in page and "Robots of the mine library" in (tmp_path / "out" / "robots.html").read_text()
    told = json.loads((tmp_path / "out.json").read_text())["robots"]
    assert {one["engine"] for one in told["subjects"]} == {"mujoco", "pinocchio"}
    counted = "1 robot: on 1 an engine differs from the file for a known reason."
    with_all_on = (
        "With equalities and joint limits on, 1 of 1 answers agree with the documentation of the engine; they move qdd by more than 1 %"
    )
    first = f"bar_pendulum: all 5 subjects agree; 51 answers for further quantities as expected. {counted} {with_all_on} on 1 robot."
    assert done.stdout.splitlines()[0] == first
    assert json.loads((tmp_path / "out.json").read_text())["summary"] == done.stdout.splitlines()[0]

    (root / "robots" / "broken.urdf").write_text("<robot name='r'><link name='a'/><link name='a'/></robot>")
    done = harness("report", "--library", "mine", "--out", "out", cwd=tmp_path)
    assert done.returncode == 1 and "1 cannot be read" in done.stdout


@pytest.mark.ci
def test_a_trunk_that_hangs_on_the_world_is_told_by_a_check_too(folder: Path) -> None:
    ends = [(x, y) for x in ("left", "right") for y in ("front", "hind")]
    inertial = '<inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>'
    links = "".join(
        f'<link name="{x}_{y}_foot">{inertial}</link><joint name="{x}_{y}" type="revolute"><parent link="trunk"/>'
        f'<child link="{x}_{y}_foot"/><axis xyz="0 1 0"/><limit effort="0" velocity="0"/></joint>'
        for x, y in ends
    )
    (folder / "dog.urdf").write_text(f'<robot name="dog"><link name="trunk">{inertial}</link>{links}</robot>')
    told = "dog.urdf: fixed base: trunk hangs on the world without a joint; --floating-base for a free one"
    assert told in harness("check", "dog.urdf", "--states", "4", cwd=folder).stdout
    assert "fixed base" not in harness("check", "dog.urdf", "--floating-base", "--states", "4", cwd=folder).stdout
    assert "fixed base" not in harness("check", "arm.urdf", "--states", "4", cwd=folder).stdout


# Actuators


@pytest.mark.ci
def test_the_actuators_of_a_file_act_and_a_replay_gives_their_controls(folder: Path) -> None:
    shutil.copy(DRIVEN, folder)
    done = harness("check", "driven.xml", "--subject", "mujoco/mjcf", "--states", "16", "--json", "found.json", cwd=folder)
    assert done.returncode == 0, done.stdout + done.stderr
    first, (record,) = done.stdout.splitlines()[0], json.loads((folder / "found.json").read_text())["records"]
    assert "agrees. 1 equality and 3 actuators on; off: 1 actuator (line 26: it is of the kind <muscle>, which is not read)." in first
    state = record["worst_state"]
    assert len(state["control"]) == len(state["activation"]) == 3 and state["activation"][:2] == [0.0, 0.0]
    done = harness("check", "driven.xml", "--subject", "mujoco/mjcf", "--states", "4", "--quantity", "energy", cwd=folder)
    assert done.stdout.splitlines()[0].endswith("energy agrees. Off: equalities and actuators."), done.stdout
    words = ("check", "driven.xml", "--subject", "mujoco/mjcf", "--json", "again.json", "--state")
    assert harness(*words, json.dumps(state), cwd=folder).returncode == 0
    (again,) = json.loads((folder / "again.json").read_text())["records"]
    assert again["backward_error"] == record["backward_error"] and again["worst_state"] == state
    # Without controls it is another question.
    assert harness(*words, json.dumps({name: state[name] for name in ("q", "v", "tau")}), cwd=folder).returncode == 0
    (still,) = json.loads((folder / "again.json").read_text())["records"]
    assert "control" not in still["worst_state"] and still["backward_error"] != record["backward_error"]
    refused = harness(*words, json.dumps({**state, "control": [1.0]}), cwd=folder)
    assert refused.returncode == 2 and "--state has 1 numbers for control" in refused.stderr


@pytest.mark.ci
def test_a_gain_that_an_engine_holds_otherwise_is_red_and_named(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    drive = adapter.drive

    def doubled(model: Any, acting: Sequence[int]) -> None:
        drive(model, acting)
        model.actuator_gear[0, 0] *= 2

    shutil.copy(DRIVEN, folder)
    call_engines_here(monkeypatch)
    monkeypatch.setattr(adapter, "drive", doubled)
    done = harness("diagnose", "driven.xml", "--subject", "mujoco/mjcf", "--states", "16", cwd=folder)
    assert done.returncode == 1 and "gear = 3" in done.stdout and "6" in done.stdout, done.stdout


@pytest.mark.ci
def test_other_quantities_of_a_driven_file_are_those_without_its_actuators(folder: Path) -> None:
    shutil.copy(DRIVEN, folder)
    words = ("--quantity", "inverse_dynamics", "--quantity", "mass_matrix", "--quantity", "accelerations")
    done = harness("check", "driven.xml", "--subject", "mujoco/mjcf", "--states", "8", *words, "--json", "found.json", cwd=folder)
    assert done.returncode == 0, done.stdout + done.stderr
    assert {one["verdict"] for one in json.loads((folder / "found.json").read_text())["records"]} == {"agrees"}
