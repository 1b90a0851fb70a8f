"""Who was not asked, and who did not answer, has not agreed: no command ends with exit status 0 there."""

from __future__ import annotations

import shutil
from importlib.metadata import version
from pathlib import Path

import pytest
from support import harness

from harness import commands
from harness.commands.new import write_example
from harness.registry import module_names

FILES = Path(__file__).parents[1] / "comparison" / "files"
HINGE = '<joint name="hinge" type="hinge" axis="0 1 0"/>'
INERTIAL = '<inertial pos="0 0 -.5" mass="1" diaginertia="1 1 1"/>'
WORLD = '<mujoco model="robot"><worldbody>{}</worldbody></mujoco>'
# A table that stands before the arm, and all that Pinocchio reads.
TABLE = WORLD.format(f'<body name="table">{INERTIAL}</body><body name="arm">{HINGE}{INERTIAL}</body>')
# M is singular in every state.
MASSLESS = WORLD.format(f'<body name="arm">{HINGE}<inertial pos="0 0 0" mass="0" diaginertia="0 0 0"/></body>')
VERSION = version("mujoco")
# Of these an engine is asked, and gives no answer that can be judged.
UNANSWERED = {
    "refused": ((FILES / "impossible.urdf").read_text(), ["--subject", "mujoco/urdf"], "refuses the file"),
    "undecided": (MASSLESS, ["--subject", "pinocchio/mjcf"], "cannot be judged"),
    "another robot": (TABLE, ["--subject", "pinocchio/mjcf"], "reads another robot"),
}
# Of these no engine is asked.
UNASKED = {
    "no engine for the format": ((FILES / "arm.urdf").read_text(), ["--subject", "mujoco/mjcf"], "no engine was asked"),
    "a part that others include": ("<mujoco><asset/></mujoco>", [], "holds no body, as a part that other files include"),
    "nothing that moves": ('<robot name="r"><link name="a"/></robot>', [], "no joint moves"),
    "not installed": ((FILES / "arm.urdf").read_text(), ["--subject", "drake@0.1/urdf"], "harness engines add drake==0.1"),
}


def written(folder: Path, text: str) -> str:
    """Name of a new robot of this text."""
    path = folder / f"robot.{'urdf' if '<robot' in text else 'xml'}"
    path.write_text(text)
    return path.name


@pytest.mark.parametrize("outcome", UNANSWERED)
def test_an_engine_without_an_answer_has_not_agreed_unless_that_is_expected(outcome: str, tmp_path: Path) -> None:
    text, options, said = UNANSWERED[outcome]
    name = written(tmp_path, text)
    for command, words in {("compare", name): said, ("survey", "."): "1 robot: 1 is not answered by every engine"}.items():
        done = harness(*command, *options, "--states", "8", cwd=tmp_path)
        assert done.returncode == 1 and words in done.stdout.partition("\n")[0], done.stdout + done.stderr
    entry = f'[[expected]]\nfile = "{name}"\nsubject = "{options[1]}"\noutcome = "{outcome}"\nreason = "a test"\n'
    (tmp_path / "expected_robots.toml").write_text(entry)
    done = harness("compare", name, *options, "--states", "8", cwd=tmp_path)
    assert done.returncode == 0 and f"{outcome} (as expected: a test)" in done.stdout, done.stdout + done.stderr
    (tmp_path / "expected_robots.toml").write_text(entry.replace(f'outcome = "{outcome}"', 'outcome = "agrees"'))
    done = harness("compare", name, *options, "--states", "8", cwd=tmp_path)
    assert done.returncode == 1 and f"{outcome}, expected agrees because a test" in done.stdout


@pytest.mark.parametrize("case", UNASKED)
def test_where_no_engine_is_asked_nothing_agrees(case: str, tmp_path: Path) -> None:
    text, options, said = UNASKED[case]
    done = harness("compare", written(tmp_path, text), *options, "--states", "8", cwd=tmp_path)
    assert done.returncode == (2 if case == "not installed" else 1) and said in done.stdout + done.stderr, done.stdout + done.stderr
    assert "agree" not in done.stdout.partition("\n")[0]


@pytest.mark.ci
def test_a_survey_counts_the_files_that_it_could_not_read(tmp_path: Path) -> None:
    shutil.copy(FILES / "arm.urdf", tmp_path)
    written(tmp_path, '<robot name="r"><link name="a"/></robot>')
    (tmp_path / "bad.urdf").write_text("<robot><a")
    done = harness("survey", ".", "--states", "8", cwd=tmp_path)
    assert done.returncode == 1
    said = "3 robots: 1 cannot be read; on 1 an engine differs from the file for a known reason; 1 holds nothing that moves."
    assert done.stdout.startswith(
        f"{said} With dry friction and joint limits on, 1 of 1 answers agree with the documentation of the engine"
    )


XACRO = '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">\n  <link name="base"/>\n  {}\n</robot>\n'
CALL = XACRO.format('<xacro:arm prefix="left"/>')
UNREADABLE = {
    "robot.urdf.xacro": (CALL, "robot.urdf.xacro:3: is a xacro template: run `xacro robot.urdf.xacro > robot.urdf`"),
    "arm.xacro": (CALL, "run `xacro arm.xacro > arm.urdf`"),
    "robot.urdf": (XACRO.format('<link name="${prefix}_arm"/>'), "robot.urdf:3: is a xacro template: run `xacro robot.urdf >"),
    "robot.xml": (CALL.replace("robot", "mujoco"), "robot.xml:3: is a xacro template"),
    "bad.urdf": ("<robot><a", "is not well-formed XML"),
    "missing.urdf": (None, "there is no such file"),
    "folder": (None, "name one in it; harness survey takes all robots of a folder"),
}


@pytest.mark.parametrize("command", ["compare", "check", "bench", "search", "show", "diagnose"])
@pytest.mark.parametrize("name", UNREADABLE)
def test_a_file_that_cannot_be_read_is_2_with_what_to_do(command: str, name: str, tmp_path: Path) -> None:
    text, said = UNREADABLE[name]
    (tmp_path / "folder").mkdir()
    if text is not None:
        (tmp_path / name).write_text(text)
    done = harness(command, name, cwd=tmp_path)
    assert done.returncode == 2 and said in done.stderr, done.stdout + done.stderr


def test_a_folder_of_templates_is_told_that_xacro_writes_the_files(tmp_path: Path) -> None:
    (tmp_path / "arm.xacro").write_text(CALL)
    done = harness("survey", ".", cwd=tmp_path)
    assert done.returncode == 2 and "arm.xacro is a xacro template" in done.stderr


def test_a_property_that_xacro_left_is_no_template(tmp_path: Path) -> None:
    text = (FILES / "arm.urdf").read_text().replace("<link", '<xacro:property name="m" value="1"/><link', 1)
    assert harness("compare", written(tmp_path, text), "--states", "8", cwd=tmp_path).returncode == 0


# Of each command that asks engines a way of asking nobody; "own" is a library whose engine offers accelerations alone.
NOBODY = {
    "atlas": (["far_base", "--subject", "pinocchio/urdf", "--quantity", "steps"], "Nothing was measured"),
    "bench": (["rod", "--library", "own", "--quantity", "mass_matrix", "--methods", "mine/urdf"], "Nothing was measured"),
    "check": (
        ["rod", "--library", "own", "--quantity", "mass_matrix", "--quantity", "energy", "--subject", "mine/urdf"],
        "nothing was compared",
    ),
    "compare": (["still.urdf"], "no engine was asked"),
    "compare-runs": ([], "holds no history"),
    "diagnose": (["rod", "--library", "own", "--quantity", "mass_matrix", "--subject", "mine/urdf"], "no subject was judged"),
    "drift": (["still.urdf"], "has no joint that moves"),
    "faults": (["spring_damper", "--kind", "products", "--states", "16"], "no faults were planted"),
    "nightly": (["--stage", "survey"], "no stage has anything to do"),
    "report": (["--library", "empty"], "holds no system file"),
    "search": (["rod", "--library", "own", "--quantity", "mass_matrix", "--subject", "mine/urdf"], "offers no mass matrix"),
    "survey": (["empty"], "holds no model of a robot"),
    "upgrade": (["mujoco", VERSION, VERSION], "is one version"),
}
# They ask no engine for an answer.
ASK_NOBODY = {"engines", "list", "new", "show"}


def test_each_command_that_asks_engines_has_a_way_of_asking_nobody() -> None:
    assert NOBODY.keys() | ASK_NOBODY == {name.replace("_", "-") for name in module_names(commands.__name__)}


@pytest.mark.ci
@pytest.mark.parametrize("command", NOBODY)
def test_no_command_ends_well_where_nobody_was_asked(command: str, tmp_path: Path) -> None:
    (tmp_path / "empty" / "systems").mkdir(parents=True)
    (tmp_path / "still.urdf").write_text('<robot name="r"><link name="a"/></robot>')
    write_example(tmp_path / "own", "rod", engine="mine")
    arguments, said = NOBODY[command]
    done = harness(command, *arguments, cwd=tmp_path)
    assert done.returncode in (1, 2) and said in done.stdout + done.stderr, done.stdout + done.stderr


@pytest.mark.parametrize("options", [["--subject", "pinocchio/urdf"], ["--subject", "pinocchio/urdf", "--quantity", "energy"]])
def test_a_mechanism_that_an_engine_cannot_express_is_not_as_expected_by_itself(options: list[str], tmp_path: Path) -> None:
    done = harness("check", "rolling_disc", *options, "--states", "20", cwd=tmp_path)
    assert done.returncode == 1 and done.stdout.startswith("nothing was compared: rolling_disc pinocchio/urdf"), done.stdout
