"""``harness compare`` and ``harness survey`` as a new user runs them."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from html import unescape
from pathlib import Path

import pytest
from support import harness

FILES = Path(__file__).parent.parent / "comparison" / "files"
ARM = FILES / "arm.urdf"


def folder_of(folder: Path, *names: str) -> Path:
    """A new folder with copies of these robots."""
    folder.mkdir()
    for name in names:
        shutil.copy(FILES / name, folder)
    return folder


def compared_at(home: Path, *arguments: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    """The command in a process whose environment is a home, which may hold Python modules, and nothing else."""
    environment = {"HOME": str(home), "PATH": "/usr/bin:/bin", "PYTHONPATH": f"{home}:{Path(__file__).parents[2]}"}
    command = [sys.executable, "-m", "harness", "compare", *arguments, "--states", "8"]
    return subprocess.run(command, cwd=cwd, env=environment, capture_output=True, text=True, timeout=300, check=False)


def test_one_file_is_told_in_sections(tmp_path: Path) -> None:
    done = harness("compare", str(ARM), "--states", "16", "--json", "found.json", "--html", "found.html", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    first, *rows = done.stdout.splitlines()
    assert re.fullmatch(
        r"arm.urdf: With the file's dry friction in 1 place and 2 joint limits on MuJoCo agrees with its documentation, \S+ % of qdd away "
        r"from the file without them\. With all of it off MuJoCo agrees with the file, and Pinocchio does not\. "
        r"pin\.aba applies no dry friction \(\S+ % of qdd\)\. Pinocchio's ABA applies no joint damping \(\d+ %\): add -d v to tau\.",
        first,
    )
    assert "Pinocchio's ABA applies no joint damping (2 joints, lines 9, 25): add -d v to tau" in rows[0]
    whole = harness("compare", str(ARM), "--states", "16", "--verbose", cwd=tmp_path).stdout.splitlines()
    titles = [line for line in whole if line[:1].isdigit()]
    assert titles == ["1. What the file is", "2. What no body can have", "3. The engines on arm.urdf", "4. The rest"]
    assert whole[0] == first and whole[1] == rows[0]
    found = json.loads((tmp_path / "found.json").read_text())
    readings = [reading for subject in found["subjects"] for reading in subject["readings"]]
    assert all(reading["alone"] > 0.01 for reading in readings) and [9, 25] in [reading["lines"] for reading in readings]
    assert found["files"][0]["degrees_of_freedom"] == 2 and found["pairs"] == [] and found["summary"] == first
    page = (tmp_path / "found.html").read_text()
    assert first in unescape(page) and "4. The rest" in page and "http-equiv" in page and "src=" not in page


@pytest.mark.ci
def test_files_of_one_robot_and_files_that_are_not(tmp_path: Path) -> None:
    same = harness("compare", str(ARM), str(FILES / "arm.xml"), "--states", "16", cwd=tmp_path)
    assert same.stdout.startswith("arm.urdf and arm.xml are the same robot (")
    other = tmp_path / "other.urdf"
    other.write_text(ARM.read_text().replace('damping="0.5"', 'damping="0.50001"'))
    done = harness("compare", str(ARM), str(other), "--states", "16", cwd=tmp_path)
    assert done.returncode == 1
    first = done.stdout.partition("\n")[0]
    said = (
        r"arm.urdf and other.urdf differ: damping of joint shoulder, 0.5 \(arm.urdf:9\) against 0.50001 \(other.urdf:9\), changes qdd by .*"
    )
    assert re.fullmatch(said, first)


@pytest.mark.ci
def test_a_joint_that_one_file_alone_moves_stands_still_while_the_rest_is_compared(tmp_path: Path) -> None:
    other = tmp_path / "other.urdf"
    other.write_text(ARM.read_text().replace('<joint name="elbow" type="revolute">', '<joint name="elbow" type="fixed">'))
    done = harness("compare", str(ARM), str(other), "--states", "8", cwd=tmp_path)
    assert done.returncode == 1 and "the same robot but for 1 joint that the files do not share" in done.stdout
    assert "elbow (arm.urdf:19) stands still in what is compared: only arm.urdf moves it" in done.stdout
    done = harness("compare", str(ARM), str(other), "--without", "elbow", "--states", "8", "--json", "found.json", cwd=tmp_path)
    assert done.returncode == 0 and "the same robot, 1 joint left out" in done.stdout
    (pair,) = json.loads((tmp_path / "found.json").read_text())["pairs"]
    assert pair["locked"][0]["name"] == "elbow" and pair["locked"][0]["second_place"] == ""


def test_a_trunk_on_the_world_is_told_with_what_makes_it_float(tmp_path: Path) -> None:
    legs = "".join(
        f"""<link name="{side}_foot"><inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>
        </inertial></link><joint name="{side}" type="revolute"><parent link="trunk"/><child link="{side}_foot"/></joint>"""
        for side in "lr"
    )
    (tmp_path / "biped.urdf").write_text(f'<robot name="r"><link name="trunk"/>{legs}</robot>')
    done = harness("compare", "biped.urdf", "--states", "4", cwd=tmp_path)
    assert "fixed base: trunk hangs on the world without a joint; --floating-base for a free one" in done.stdout


WRONG_NAMES = {
    "--map shouldr=shoulder": r"--map shouldr=shoulder: no joint 'shouldr' moves in arm.urdf; did you mean 'shoulder'\?",
    "--map shoulder=sholder": r"--map shoulder=sholder: no joint 'sholder' moves in arm.xml; did you mean 'shoulder'\?",
    "--without elow": r"--without elow: no joint 'elow' moves in arm.urdf and arm.xml; did you mean 'elbow'\?",
    "--map shoulder=elbow --map elbow=elbow": "'elbow=elbow' gives a joint a second partner",
}


@pytest.mark.parametrize("options", WRONG_NAMES)
def test_a_name_that_no_joint_has_is_bad_usage(options: str, tmp_path: Path) -> None:
    done = harness("compare", str(ARM), str(FILES / "arm.xml"), *options.split(), cwd=tmp_path)
    assert done.returncode == 2 and not done.stdout and re.search(WRONG_NAMES[options], done.stderr), done.stderr
    steps = ["--steps", "2", "--by", "mujoco/Euler", "--by", "mujoco/RK4"]
    done = harness("compare", str(ARM), str(FILES / "arm.xml"), *options.split(), *steps, cwd=tmp_path)
    assert done.returncode == 2 and re.search(WRONG_NAMES[options] if "map" in options else "--without is for files", done.stderr)
    assert harness("compare", str(ARM), *options.split(), cwd=tmp_path).returncode == 2


def test_a_file_without_meaning_is_invalid_input(tmp_path: Path) -> None:
    path = tmp_path / "bad.urdf"
    path.write_text(ARM.read_text().replace('<mass value="1"/>', '<mass value="one"/>'))
    done = harness("compare", str(path), cwd=tmp_path)
    assert done.returncode == 2 and "bad.urdf:30" in done.stderr
    assert harness("compare", "nothing.urdf", cwd=tmp_path).returncode == 2
    assert harness("compare", str(ARM), "--map", "shoulder", cwd=tmp_path).returncode == 2


@pytest.mark.ci
def test_from_an_empty_folder_with_an_empty_home(tmp_path: Path) -> None:
    home, work = folder_of(tmp_path / "home"), folder_of(tmp_path / "work", "massless_foot.urdf")
    done = compared_at(home, "massless_foot.urdf", cwd=work)
    assert done.returncode == 0, done.stderr
    assert "inertia of a link of mass 0" in done.stdout
    assert [path.name for path in work.iterdir()] == ["massless_foot.urdf"]


@pytest.mark.ci
def test_a_survey_has_a_row_for_each_robot(tmp_path: Path) -> None:
    robots = folder_of(tmp_path / "robots", "arm.urdf", "impossible.urdf", "mimic.urdf")
    (robots / "bad.urdf").write_text("<robot name='bad'><link name='a'/><link name='b'/></robot>")
    done = harness("survey", str(robots), "--states", "8", "--out", "out", "--json", "found.json", cwd=tmp_path)
    assert done.returncode == 1
    rows = {line.split()[0]: line for line in done.stdout.splitlines() if line.split()[:1] and ".urdf" in line.split()[0]}
    assert rows.keys() >= {"arm.urdf", "bad.urdf", "impossible.urdf", "mimic.urdf"}
    assert "explained" in rows["mimic.urdf"] and "refused" in rows["impossible.urdf"] and "1 link" in rows["impossible.urdf"]
    found = json.loads((tmp_path / "found.json").read_text())
    assert [bool(file["problem"]) for file in found["files"]] == [False, True, False, False]
    page = (tmp_path / "out" / "robots.html").read_text()
    # Every cell of a robot opens its comparison: two engines, plain and aided.
    cells = re.findall(r"<td[^>]*>(?:(?!</td>).)*?href=\"(robots/[^\"]+)\"", page, re.DOTALL)
    assert {target: cells.count(target) for target in set(cells)} == {
        f"robots/{name}.urdf.html": 4 for name in ("arm", "impossible", "mimic")
    }
    told = (tmp_path / "out" / "robots" / "mimic.urdf.html").read_text()
    assert "leaves a mimic joint free" in told and str(tmp_path) not in told
    # The index holds the robots in its matrix, without any cross-check.
    index = (tmp_path / "out" / "index.html").read_text()
    assert 'href="robots/mimic.urdf.html"' in index


@pytest.mark.ci
def test_a_survey_says_what_changed_since_the_last_one(tmp_path: Path) -> None:
    robots = folder_of(tmp_path / "robots", "arm.urdf", "mimic.urdf")
    survey = ("survey", str(robots), "--states", "8")
    first = harness(*survey, cwd=tmp_path)
    assert first.returncode == 0 and "Since the survey" not in first.stdout
    assert '<svg class="trend"' not in (tmp_path / "reports" / "robots.html").read_text()
    assert "nothing changed" in harness(*survey, cwd=tmp_path).stdout
    # Two robots, two engines, plain and aided.
    page = (tmp_path / "reports" / "robots.html").read_text()
    assert page.count('<svg class="trend"') == 8 and page.count("in 2 runs") == 16 and "2 with this one" in page
    (robots / "mimic.urdf").unlink()
    (robots / "arm.urdf").write_text(ARM.read_text().replace("<dynamics", "<was").replace("dynamics>", "was>"))
    told = harness(*survey, cwd=tmp_path).stdout.partition("Since the survey of")[2]
    assert "arm.urdf pinocchio/urdf, plain: agrees; it was: explained: joint damping " in told
    assert "mimic.urdf: no longer there" in told


@pytest.mark.ci
@pytest.mark.parametrize("engine", ["pinocchio", "mujoco"])
def test_an_engine_that_dies_costs_its_own_record(engine: str, tmp_path: Path) -> None:
    """The worker is killed where the engine is asked."""
    (tmp_path / "sitecustomize.py").write_text(
        "import os, sys\n"
        "class Finder:\n"
        "    def find_spec(self, name, path=None, target=None):\n"
        f"        if name == {engine!r} and 'HARNESS_WORKER' in os.environ: os.abort()\n"
        "sys.meta_path.insert(0, Finder())\n"
    )
    done = compared_at(tmp_path, str(ARM), "--json", "-", "--workers", "1", cwd=tmp_path)
    assert done.returncode == 3, done.stderr
    verdicts = {(one["engine"], one["verdict"]) for one in json.loads(done.stdout)["subjects"]}
    assert (engine, "error") in verdicts and all(verdict != "error" for name, verdict in verdicts if name != engine)
