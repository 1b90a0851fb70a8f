"""Each misreading of Pinocchio's MJCF reader is what the installed reader does: it alone explains the answers on a file that has it."""

from __future__ import annotations

from pathlib import Path

import pinocchio
import pytest
from comparison.robots import record_of

from harness.explain.changes.readings import find_readings
from harness.trees.robot import read_robot
from harness.verdict import AGREEMENT

INERTIA = '<inertial pos="0.1 0.2 0.3" mass="2" diaginertia="0.3 0.4 0.5"/>'
COMPILER = '<compiler angle="radian"/>'


def body(name: str, joint: str, inside: str = "", about: str = "") -> str:
    """A body with an inertia; ``joint`` are the attributes of its joint, "" for none."""
    return f'<body name="{name}" {about}>{joint and f"<joint {joint}/>"}{INERTIA}{inside}</body>'


def unnamed(position: str, joint: str, inside: str = "") -> str:
    """The same without a name."""
    return f'<body pos="{position}">{joint and f"<joint {joint}/>"}{INERTIA}{inside}</body>'


FIRST, SECOND = 'name="j1" axis="0 1 0"', body("b", 'name="j2" axis="1 0 0"', about='pos="0 0 1"')
ARM = body("a", FIRST, SECOND)
TURNED = body("a", FIRST, body("b", 'name="j2" axis="1 0 0"', about='euler="0.3 0.5 0.7"'))
ROTORS = "rotor inertias of sections that are not read"
COMPOSITE = f'{FIRST} ref="0.5"/><joint name="j3" type="slide" axis="1 0 0" ref="0.3"/><joint name="j4" axis="1 0 0" ref="0.4"'
SLIDE = body("b", 'name="j2" type="slide" axis="0 1 0" class="c"', body("c", 'name="j3" axis="1 0 0"'))
FILES = {
    "second compiler": ("sections that are read once", f'{COMPILER}<compiler angle="degree"/>', TURNED, ""),
    "late compiler": ("sections that are read once", "", TURNED, COMPILER),
    "second default": (ROTORS, f'{COMPILER}<default><joint damping="0"/></default><default><joint armature="2"/></default>', ARM, ""),
    "late default": (ROTORS, COMPILER, ARM, '<default><joint armature="2"/></default>'),
    "bare root": ("bodies without attributes", COMPILER, f'<body><joint name="j1" axis="0 1 0"/>{INERTIA}{SECOND}</body>', ""),
    "bare body": ("bodies without attributes", COMPILER, body("a", FIRST, f"<body>{SECOND}</body>"), ""),
    "pose of a root": ("pose of a body fixed to the world", COMPILER, body("w", "", ARM, 'pos="1 2 3" euler="0.3 0.4 0.5"'), ""),
    "fixed siblings": (
        "bodies without names", COMPILER,
        body("a", FIRST, unnamed("0 0.3 1", "") + unnamed("0.2 0 0", "", unnamed("0 0 1", 'name="j2" axis="1 0 0"'))), "",
    ),
    "composite": ("reference of the first of several joints", COMPILER, body("a", COMPOSITE, SECOND), ""),
    "slide": (
        "reference of a slide from a default class", '<default><default class="c"><joint ref="20"/></default></default>',
        body("a", 'name="j1" axis="1 0 0"', SLIDE), "",
    ),
    **{
        f"pose of a class{beside}": (
            "pose of a default class",
            '<default><default class="c"><geom type="box" size="0.1 0.2 0.3" pos="0.1 0.2 0.3" quat="3 1 0 2"/></default></default>',
            f'<body name="a"><joint name="j1" axis="0 1 0"/><geom class="c"{beside}/></body>', "",
        )
        for beside in ("", ' pos="0 0 1"', ' quat="1 0 1 0"')
    },
    "rotors of a free joint": ("rotors of free joints", COMPILER, body("a", 'name="j1" type="free" armature="0.3"', SECOND), ""),
    "type of a childclass": (
        "class beside a childclass",
        '<default><default class="c"><joint damping="0"/></default><default class="k"><joint type="slide"/></default></default>',
        body("a", 'name="j1" class="c" axis="1 0 0"', about='childclass="k"'), "",
    ),
}  # fmt: skip


def written(folder: Path, head: str, inside: str, tail: str) -> Path:
    path = folder / "robot.xml"
    path.write_text(f'<mujoco model="robot">{head}<worldbody>\n{inside}\n</worldbody>{tail}</mujoco>')
    return path


@pytest.mark.parametrize("name", FILES)
def test_a_misreading_is_what_the_reader_does(name: str, tmp_path: Path) -> None:
    reading, *parts = FILES[name]
    path = written(tmp_path, *parts)
    plain = record_of(path, "pinocchio")
    assert plain.explained and [one.name for one in plain.readings] == [reading] and plain.left is not None and plain.left <= AGREEMENT
    assert plain.readings[0].alone is None or plain.readings[0].alone > 1e-3
    assert record_of(path, "mujoco").verdict == "agrees"
    # A file that data do not feel is misread all the same; what is supplied is not.
    assert (plain.outcome, plain.tone) == ("misreads", "misreads expected")
    aided = record_of(path, "pinocchio", aided=True)
    assert aided.explained and [one.name for one in aided.readings] == ([] if reading == ROTORS else [reading])


def test_what_is_included_is_passed_over(tmp_path: Path) -> None:
    (tmp_path / "inner.xml").write_text(f"<mujocoinclude>{SECOND}</mujocoinclude>")
    path = written(tmp_path, COMPILER, body("a", FIRST, '<include file="inner.xml"/>'), "")
    record = record_of(path, "pinocchio")
    assert record.explained and [one.name for one in record.readings] == ["sections that are read once"]


HINGE, SLIDE_Y = 'axis="0 1 0"', 'type="slide" axis="0 1 0"'
SECOND_HINGE = f'{HINGE}/><joint axis="1 0 0"'
WITHOUT_NAMES = {
    "free": unnamed("0 0 1", 'type="free"'),
    "freejoint": f'<body pos="0 0 1"><freejoint/>{INERTIA}</body>',
    "named joint": unnamed("0 0 1", 'name="root" type="free"', unnamed("0 0.3 1", HINGE)),
    "chain": unnamed("0 0 1", 'type="free"', unnamed("0 0.3 1", HINGE, unnamed("0.1 0 0", 'type="ball"'))),
    "two joints": unnamed("0 0 1", 'type="free"', unnamed("0 0.3 1", SECOND_HINGE, unnamed("0.1 0 0", SLIDE_Y))),
    "siblings of named bodies": body("a", HINGE, body("b", HINGE, unnamed("0 0 1", SLIDE_Y)) + body("c", HINGE, unnamed("0 1 0", HINGE))),
}


@pytest.mark.parametrize("name", WITHOUT_NAMES)
def test_joints_and_bodies_without_names_are_found_by_their_places(name: str, tmp_path: Path) -> None:
    path = written(tmp_path, COMPILER, WITHOUT_NAMES[name], "")
    for aided in (False, True):
        record = record_of(path, "pinocchio", aided)
        assert (record.verdict, record.readings, record.rest) == ("agrees", [], [])


@pytest.mark.parametrize("second", [HINGE, "", SLIDE_Y, SECOND_HINGE])
def test_the_second_of_two_bodies_without_names_moves_nothing(second: str, tmp_path: Path) -> None:
    """Pinocchio's own answer there is no number."""
    inside = body("a", HINGE, unnamed("0 0.3 1", HINGE) + unnamed("0.2 0 0", second, body("c", HINGE)))
    record = record_of(written(tmp_path, COMPILER, inside, ""), "pinocchio")
    assert record.explained and [one.name for one in record.readings] == ["bodies without names"]
    assert record.left is None and "as it reads the file" in record.another_robot


WORLD = '<worldbody><light pos="1 0 3"/></worldbody>'


@pytest.mark.parametrize("further", [1, 2])
def test_further_worlds_are_the_first_one_again(further: int, tmp_path: Path) -> None:
    """Joints stand there as often as there are worlds, and all masses in the first of them; Pinocchio's own answer is no number."""
    inside = body("a", FIRST, body("b", 'name="j2" axis="1 0 0" armature="0.5"', body("c", "", about='pos="1 0 0"')))
    path = written(tmp_path, COMPILER, inside, WORLD * further)
    found = record_of(path, "pinocchio")
    assert found.explained and [one.name for one in found.readings] == ["further worlds"]
    assert "it has joints that the file does not have: j1 (world 2), j2 (world 2)" in found.another_robot
    assert record_of(path, "mujoco").verdict == "agrees"
    (reading,) = [one for one in find_readings("pinocchio", "mjcf") if one.name == "further worlds"]
    tree, model = reading.read(read_robot(path)).tree, pinocchio.buildModelFromMJCF(path)
    assert sorted(joint.name.split()[0] for joint in tree.joints) == sorted([*model.names][1:])
    assert sorted(float(joint.armature) for joint in tree.joints) == sorted(model.armature.tolist())
    masses = {one.name: float(one.inertia.mass) if one.inertia else 0.0 for one in tree.bodies}
    assert sum(masses.values()) == sum(one.mass for one in model.inertias)
    assert masses["a"] == model.inertias[1].mass and masses["b"] + masses["c"] == model.inertias[2].mass


def test_a_world_that_is_included_is_no_further_one(tmp_path: Path) -> None:
    (tmp_path / "scene.xml").write_text(f"<mujoco>{WORLD}</mujoco>")
    record = record_of(written(tmp_path, COMPILER, ARM, '<include file="scene.xml"/>'), "pinocchio")
    assert record.verdict == "agrees" and "further worlds" not in [one.name for one in record.readings]


GEOM = '<geom size="0.1" pos="0.2 0 0"/>'
PASSED_OVER = {
    # The first of the replicas stands where the element does.
    "replicas": (f'<body name="a"><joint {HINGE}/>{GEOM}<replicate count="2" offset="0 0 0.3">{GEOM}</replicate></body>', "frames"),
    "free body in a frame": (body("a", HINGE) + f'<frame pos="0 0 1"><body name="b"><freejoint/>{INERTIA}</body></frame>', "frames"),
    "joint in replicas": (body("a", HINGE, f'<replicate count="1" offset="0 1 0"><joint name="b" {SLIDE_Y}/></replicate>'), "frames"),
    "trees without names": (unnamed("0 0 1", 'type="free"') + unnamed("0 1 1", 'type="free"'), "further trees"),
}


@pytest.mark.parametrize("name", PASSED_OVER)
def test_what_is_passed_over_explains_the_answer(name: str, tmp_path: Path) -> None:
    inside, reading = PASSED_OVER[name]
    record = record_of(written(tmp_path, COMPILER, inside, ""), "pinocchio")
    assert record.explained and reading in [one.name for one in record.readings] and record.rest == []


def test_lines_of_included_files_carry_their_name(tmp_path: Path) -> None:
    inside = body("b", 'name="j2" axis="1 0 0" damping="2"', about='pos="0 0 1"')
    (tmp_path / "inner.xml").write_text(f"<mujocoinclude>\n{inside}</mujocoinclude>")
    path = written(tmp_path, COMPILER, body("a", f'{FIRST} damping="1"', '<include file="inner.xml"/>'), "")
    record = record_of(path, "pinocchio")
    (dampers,) = [one for one in record.readings if one.name == "joint damping"]
    assert dampers.lines == (2,)
    (sections,) = [one for one in record.readings if one.name == "sections that are read once"]
    assert "inner.xml:2" in sections.included and "inner.xml:2" in sections.concerned()
