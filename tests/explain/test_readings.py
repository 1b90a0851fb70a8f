"""A plain engine's answer is explained by its readings, with the lines they concern; without them it is not."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from comparison.robots import FILES, edited, line_of, meant_by, record_of
from support import BUILT_IN

from harness.comparison.judgement import ILL_CONDITIONED
from harness.comparison.robot_library import engines_of_files
from harness.explain.changes.readings import find_readings
from harness.programs.states import States
from harness.trees.mechanism import accelerations_of
from harness.trees.recursion import recursion_program
from harness.truth.far_links import FarLinks
from harness.verdict import AGREEMENT, Verdict

EXPLAINED = [
    ("arm.urdf", "pinocchio", "joint damping", ('damping="0.5"', 'damping="0.25"')),
    ("mimic.urdf", "pinocchio", "mimic joints", ('<mimic joint="left"',)),
    ("mimic.urdf", "mujoco", "mimic joints", ('<mimic joint="left"',)),
    ("massless_foot.urdf", "mujoco", "inertia without mass", ('<mass value="0"/>',)),
]


@pytest.mark.parametrize(("name", "engine", "reading", "texts"), EXPLAINED)
def test_a_reading_explains_a_plain_answer(name: str, engine: str, reading: str, texts: tuple[str, ...]) -> None:
    record = record_of(FILES / name, engine)
    assert (record.verdict, record.explained, record.outcome) == (Verdict.DISAGREES, True, "explained")
    (found,) = record.readings
    assert (found.name, found.lines) == (reading, tuple(line_of(FILES / name, text) for text in texts))
    # It is the only one, so that alone it is the whole difference.
    assert found.alone == pytest.approx(record.relative_error, rel=0.5) and record.left is not None and record.left <= AGREEMENT


@pytest.mark.parametrize(("name", "engine", "reading", "texts"), EXPLAINED)
def test_without_its_reading_the_answer_is_not_explained(
    name: str, engine: str, reading: str, texts: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("harness.explain.as_read.find_readings", lambda *_: [])
    record = record_of(FILES / name, engine)
    assert not record.explained and record.rest


def test_one_number_that_explains_the_rest_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """ABA takes the one damper of this arm for none."""
    monkeypatch.setattr("harness.explain.as_read.find_readings", lambda *_: [])
    path = edited(FILES / "arm.urdf", tmp_path, ('<dynamics damping="0.25" friction="0.125"/>', ""))
    record = record_of(path, "pinocchio")
    assert record.rest[0].startswith(f"arm.urdf:{line_of(path, 'damping=')}: dynamics damping = 0.5: the engine behaves as with ")


@pytest.mark.parametrize("engine", ["pinocchio", "mujoco"])
@pytest.mark.parametrize("name", ["arm.urdf", "mimic.urdf", "massless_foot.urdf", "impossible.urdf", "planar.urdf"])
def test_an_aided_engine_agrees_with_the_file(name: str, engine: str) -> None:
    record = record_of(FILES / name, engine, aided=True)
    assert (record.verdict, record.readings) == (Verdict.AGREES, [])


def test_a_plane_that_a_reader_passes_over_is_a_reading(tmp_path: Path) -> None:
    path = edited(FILES / "planar.urdf", tmp_path, ('<axis xyz="0 0 1"/>', '<axis xyz="0.6 0 0.8"/>'))
    record = record_of(path, "pinocchio", aided=True)
    assert record.explained and record.verdict == Verdict.DISAGREES
    assert [reading.name for reading in record.readings] == ["axis of planar joints"]
    assert record_of(path, "mujoco", aided=True).verdict == Verdict.AGREES


@pytest.mark.parametrize("engine", ["pinocchio", "mujoco"])
@pytest.mark.parametrize("aided", [False, True])
def test_a_floating_base_is_put_under_the_root(engine: str, aided: bool, tmp_path: Path) -> None:
    base = '<link name="ground"><inertial><mass value="4"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>'
    path = edited(FILES / "arm.urdf", tmp_path, ('<link name="ground"/>', base))
    record = record_of(path, engine, aided, floating_base=True)
    assert record.explained and record.verdict == (Verdict.DISAGREES if engine == "pinocchio" and not aided else Verdict.AGREES)


def test_what_an_engine_refuses_is_named(tmp_path: Path) -> None:
    record = record_of(FILES / "impossible.urdf", "mujoco")
    assert (record.outcome, record.explained) == ("refused", True)
    assert "A + B >= C" in record.message
    assert any("rod" in sentence and f"line {line_of(FILES / 'impossible.urdf', '<inertia ')}" in sentence for sentence in record.rest)


def test_a_refusal_is_told_without_the_place_in_the_sources_of_the_engine(tmp_path: Path) -> None:
    path = tmp_path / "field.xml"
    body = '<body name="one"><joint name="pin" axis="0 1 0"/><inertial pos="0.1 0 0" mass="1" diaginertia="1 1 1"/></body>'
    path.write_text(f'<mujoco><asset><hfield name="h" nrow="2" ncol="2" size="1 1 1 1"/></asset><worldbody>{body}</worldbody></mujoco>')
    assert record_of(path, "pinocchio").message == "hfields are not supported yet"


def test_a_joint_that_carries_nothing_has_no_acceleration(tmp_path: Path) -> None:
    inertial = FILES.joinpath("impossible.urdf").read_text().partition("<inertial>")[2].partition("</inertial>")[0]
    path = edited(FILES / "impossible.urdf", tmp_path, (f"<inertial>{inertial}</inertial>", ""))
    found = meant_by(path)
    assert "pin" in found.undetermined
    record = record_of(path, "pinocchio")
    assert (record.verdict, "0 of" in record.message) == (Verdict.UNDECIDED, True)


@pytest.mark.parametrize("engine", sorted(engines_of_files()))
def test_every_reading_says_where_it_is_known_from(engine: str) -> None:
    for model_format in engines_of_files()[engine].formats:
        for reading in find_readings(engine, model_format):
            assert reading.engine == engine and len(reading.source) > 20 and reading.sentence[0].isupper()


def test_joints_that_inherit_one_damping_are_counted_each(tmp_path: Path) -> None:
    body = '<body name="{0}"><joint name="{0}" axis="0 1 0"/><inertial pos="0.1 0 0" mass="1" diaginertia="1 1 1"/>{1}</body>'
    bodies = body.format("one", body.format("two", body.format("three", "")))
    path = tmp_path / "r.xml"
    path.write_text(f'<mujoco>\n<default>\n<joint damping="0.5"/>\n</default>\n<worldbody>\n{bodies}</worldbody></mujoco>')
    (found,) = record_of(path, "pinocchio").readings
    assert (found.count, found.lines) == (3, (3,))
    assert found.concerned() == "3 joints, line 3"


# What a user is told to do begins with one of these.
IMPERATIVES = {"add", "build", "call", "give", "keep", "leave", "load", "pass", "put", "reduce", "set", "turn", "write"}


@pytest.mark.parametrize("engine", sorted(engines_of_files()))
def test_every_reading_says_what_its_user_can_do(engine: str) -> None:
    found = engines_of_files()[engine]
    readings = [reading for model_format in found.formats for reading in find_readings(engine, model_format, found.reader)]
    assert readings
    for reading in readings:
        assert reading.remedy.split()[0] in IMPERATIVES and len(reading.remedy) <= 90 and reading.remedy[-1] not in ".;", reading


def test_a_reading_that_does_not_apply_leaves_the_very_robot() -> None:
    robot = meant_by(FILES / "impossible.urdf").robot
    found = [(reading, reading.read(robot)) for engine in engines_of_files() for reading in find_readings(engine, "urdf")]
    assert all((read is robot) == (read.tree == robot.tree) for _, read in found)
    assert not {reading.engine for reading, read in found if read is not robot} & {"mujoco", "pinocchio", "idyntree", "dartpy"}
    assert np.isfinite(meant_by(FILES / "impossible.urdf").truth.high).all()


def test_digits_lost_far_from_the_tree_are_told_from_a_wrong_number(tmp_path: Path) -> None:
    """A wheel of 1e-6 kg m^2 a hundred metres from the base."""
    text = (FILES / "arm.urdf").read_text()
    text = text.replace('<origin xyz="0 0.0625 -0.5"/>', '<origin xyz="0 100 -0.5"/>').replace('xyz="0 0 -0.1875"', 'xyz="0 0 0"')
    text = text.replace('ixx="0.015625" ixy="0" ixz="0" iyy="0.015625"', 'ixx="0.000001" ixy="0" ixz="0" iyy="0.0078125"')
    path = tmp_path / "far.urdf"
    start, end = text.index('  <joint name="flange"'), text.index("</robot>")
    path.write_text(text[:start] + text[end:])
    record = record_of(path, "mujoco", aided=True)
    assert record.explained and record.outcome == "lost digits" and "roundings of m r^2" in record.lost_digits
    found = meant_by(path)
    links = FarLinks(found.robot)
    assert links.explain(found.truth, found.states, found.truth.high).all()
    assert not links.explain(found.truth, found.states, found.truth.high * (1 + 1e-3)).any()


@pytest.mark.parametrize("shape", ['<box size="0.25 0.5 0.125"/>', '<cylinder radius="0.125" length="0.5"/>', '<sphere radius="0.125"/>'])
def test_mass_of_collision_geometry_is_a_reading_of_mujoco(shape: str, tmp_path: Path) -> None:
    collision = f'<collision><origin xyz="0 0.25 0" rpy="0.5 0.25 1"/><geometry>{shape}</geometry></collision>'
    text = (FILES / "arm.urdf").read_text()
    start, end = text.index("<inertial>", text.index('<link name="tool">')), text.rindex("</inertial>") + len("</inertial>")
    path = tmp_path / "arm.urdf"
    path.write_text(text[:start] + collision + text[end:])
    record = record_of(path, "mujoco")
    assert record.explained and [reading.name for reading in record.readings] == ["mass of collision geometry"]
    assert record.readings[0].lines == (line_of(path, '<link name="tool">'),)
    assert record_of(path, "mujoco", aided=True).verdict == Verdict.AGREES


def test_a_position_of_a_default_class_is_a_reading_of_pinocchio(tmp_path: Path) -> None:
    path = tmp_path / "class.xml"
    path.write_text("""<mujoco>
    <default><default class="off"><joint pos="0.25 0 0.125"/></default></default>
    <worldbody><body name="one"><joint name="near" axis="0 1 0"/><geom size="0.125" pos="0.5 0 0"/>
      <body name="two" pos="0 0 1"><joint name="far" class="off" axis="1 1 0"/><geom size="0.125" pos="0 0.25 0"/></body>
    </body></worldbody></mujoco>""")
    record = record_of(path, "pinocchio")
    assert record.explained and record.verdict == Verdict.DISAGREES
    assert [(reading.name, reading.lines) for reading in record.readings] == [("position of a default class", (2,))]


@pytest.mark.parametrize("sequence", ["XYZ", "xYz", "zYX"])
def test_euler_angles_about_fixed_axes_are_a_reading_of_pinocchio(sequence: str, tmp_path: Path) -> None:
    path = tmp_path / "euler.xml"
    path.write_text(f"""<mujoco><compiler angle="degree" eulerseq="{sequence}"/><worldbody>
    <body name="one" euler="30 40 50"><joint name="near" axis="0 1 0"/>
      <inertial pos="0.5 0 0.25" euler="20 10 70" mass="1" diaginertia="0.5 0.75 1"/>
      <body name="two" pos="0 0 1"><joint name="far" axis="1 1 0"/><geom size="0.125" pos="0 0.25 0"/></body>
    </body></worldbody></mujoco>""")
    record = record_of(path, "pinocchio")
    assert record.outcome == "misreads" and [reading.name for reading in record.readings] == ["Euler angles about fixed axes"]
    assert record.readings[0].lines == (2, 3)


def test_a_class_beside_a_childclass_is_a_reading_of_pinocchio(tmp_path: Path) -> None:
    path = tmp_path / "class.xml"
    path.write_text("""<mujoco><compiler angle="radian"/>
    <default><default class="own"><joint damping="0.5"/></default>
    <default class="around"><joint axis="1 0 1" ref="0.25" armature="0.125"/></default></default>
    <worldbody><body name="one" childclass="around"><joint name="near" class="own"/><geom size="0.125" pos="0.5 0.25 0"/>
      <body name="two" pos="0 0 1"><joint name="far"/><geom size="0.125" pos="0 0.25 0"/></body>
    </body></worldbody></mujoco>""")
    own = ["class beside a childclass", "joint damping", "rotor inertia beside a childclass"]
    for aided, names in ((False, own), (True, own[:1])):
        record = record_of(path, "pinocchio", aided)
        assert record.outcome == "misreads" and sorted(reading.name for reading in record.readings) == names
        assert record.readings[0].lines == (4,)


def test_digits_lost_where_m_is_constant_are_told_from_a_wrong_number() -> None:
    """As Pinocchio reads this file both axes are parallel, and the first link alone has 1e-15 kg m^2 about its own."""
    path = BUILT_IN.model_path("furuta_pendulum.class_in_childclass", "mjcf")
    record = record_of(path, "pinocchio")
    assert record.explained and ILL_CONDITIONED in record.lost_digits


def test_the_gravity_that_pinocchio_takes_is_rounded_like_that_of_a_file(tmp_path: Path) -> None:
    """In free fall from rest nothing else says how far an acceleration may be off."""
    path = tmp_path / "falls.xml"
    path.write_text("""<mujoco><option gravity="0 0 0"/><worldbody><body name="one"><freejoint name="free"/>
    <geom size="0.125" pos="0.3 0.1 0"/>
    <body name="two" pos="0 0.2 1"><joint name="pin" axis="1 2 3"/><geom size="0.1" pos="0.1 0.3 0"/></body></body></worldbody></mujoco>""")
    record = record_of(path, "pinocchio")
    assert record.outcome == "explained" and record.left is not None and record.left <= AGREEMENT


def test_joints_without_names_are_found_in_pinocchio(tmp_path: Path) -> None:
    """It calls them after their body and number."""
    path = tmp_path / "unnamed.xml"
    path.write_text("""<mujoco><worldbody><body name="one"><freejoint/><geom size="0.125" pos="0.3 0.1 0"/>
    <body name="two" pos="0 0.2 1"><joint axis="1 2 3"/><joint axis="0 1 0"/><geom size="0.1" pos="0.1 0.3 0"/>
    <body name="three"><joint/><geom size="0.1" pos="0.5 0 0"/></body></body></body></worldbody></mujoco>""")
    assert record_of(path, "pinocchio").verdict == Verdict.AGREES


def test_a_robot_that_a_reading_leaves_without_mass_is_explained(tmp_path: Path) -> None:
    path = tmp_path / "pictures.xml"
    path.write_text("""<mujoco><worldbody><body name="one"><joint name="pin" axis="0 1 0"/>
    <geom size="0.125" pos="0.3 0.1 0" contype="0" conaffinity="0"/></body></worldbody></mujoco>""")
    record = record_of(path, "pinocchio")
    assert record.outcome == "another robot" and [reading.name for reading in record.readings] == ["geoms that cannot collide"]
    assert "nothing with mass or inertia moves with pin (line 1)" in record.another_robot


def test_a_robot_without_a_certain_acceleration_is_undecided(tmp_path: Path) -> None:
    """A ball joint in the centre of a free body that weighs nothing else."""
    path = tmp_path / "ball.urdf"
    text = (FILES / "impossible.urdf").read_text()
    moments = text[text.index("<inertia ") : text.index("/>", text.index("<inertia "))]
    path.write_text(text.replace(moments, '<inertia ixx="-1" ixy="0" ixz="0" iyy="-9" iyz="0" izz="-1"'))
    record = record_of(path, "pinocchio")
    assert (record.verdict, record.explained, "at no state" in record.message) == (Verdict.UNDECIDED, True, True)


# What MuJoCo 3.13.0 compiles of these: body_inertia turned by body_iquat.
FULL_INERTIAS = {
    "0.1 0.2 0.25 0.01 0.02 -0.03": (
        0.09999999944611705, 0.20000001263844416, 0.24999998791544303, 0.009999999975022482, 0.019999996489070217, -0.03000001149626236,
    ),
    "0.001 0.002 0.0025 0.0001 0.0002 -0.0003": (
        0.0009999999944611715, 0.002000000126384442, 0.002499999879154432, 9.999999975022505e-05, 0.0001999999648907024,
        -0.00030000011496262365,
    ),
}  # fmt: skip


@pytest.mark.parametrize("moments", FULL_INERTIAS)
def test_what_a_compiler_of_old_makes_of_a_full_inertia(moments: str, tmp_path: Path) -> None:
    path = tmp_path / "full.xml"
    joint = '<joint name="pin" axis="0 1 0"/>'
    path.write_text(f'<mujoco><worldbody><body>{joint}<inertial pos="0 0 1" mass="2" fullinertia="{moments}"/></body></worldbody></mujoco>')
    [reading] = [one for one in find_readings("mujoco@3.13.0", "mjcf") if one.name == "digits of a full inertia"]
    [body] = reading.read(meant_by(path).robot).tree.bodies
    assert body.inertia is not None
    assert [float(one) for one in body.inertia.moments] == pytest.approx(FULL_INERTIAS[moments], rel=1e-13)


def test_a_reading_is_that_of_versions() -> None:
    named = {version: {one.name for one in find_readings(version, "urdf")} for version in ("mujoco@3.13.0", "mujoco@3.14.0", "mujoco")}
    assert named["mujoco@3.13.0"] - named["mujoco"] == {"rotation of an inertial origin", "digits of a full inertia"}
    assert named["mujoco@3.14.0"] == named["mujoco"]
    robot = meant_by(FILES / "arm.urdf").robot
    [reading] = [one for one in find_readings("mujoco@3.13.0", "urdf") if one.name == "rotation of an inertial origin"]
    assert [place.line for place in reading.places(robot)[1]] == [line_of(FILES / "arm.urdf", 'rpy="0 0.5 0"')]


def test_what_pinocchio_passed_over_before_4_is_of_its_readings_then(tmp_path: Path) -> None:
    path = tmp_path / "ref.xml"
    joints = '<joint name="pin" axis="0 1 0"/>\n<joint name="turn" axis="1 0 0" ref="20"/>'
    inertial = '<inertial pos="0 0 1" mass="2" diaginertia="1 1 1"/>'
    path.write_text(f"<mujoco><worldbody><body>{joints}{inertial}</body></worldbody></mujoco>")
    robot = meant_by(path).robot
    old, new = ({one.name for one in find_readings(engine, "mjcf")} for engine in ("pinocchio@3.9.0", "pinocchio@4.0.0"))
    assert old - new == {"references of joints", "pose of a body that floats"} and not new - old
    [reading] = [one for one in find_readings("pinocchio@3.9.0", "mjcf") if one.name == "references of joints"]
    assert (reading.places(robot)[0], [place.line for place in reading.places(robot)[1]]) == (1, [2])
    assert [float(joint.reference) for joint in reading.read(robot).tree.joints] == [0.0, 0.0]


def test_pinocchio_before_4_measured_a_free_joint_from_the_pose_of_its_body() -> None:
    """What its tree accelerates by gravity is turned by that pose; the same file without the pose is read as it stands."""
    robot, plain = (meant_by(BUILT_IN.model_path(name, "mjcf")) for name in ("free_body.turned", "free_body"))
    [reading] = [one for one in find_readings("pinocchio@3.9.0", "mjcf") if one.name == "pose of a body that floats"]
    assert reading.places(plain.robot) == (0, [])
    read = reading.read(robot.robot)
    assert [place.line for place in reading.places(robot.robot)[1]] == [14]
    states = States(np.array([[0.0, 0, 0, 1, 0, 0, 0]]), np.zeros((1, 6)), np.zeros((1, 6)), np.zeros(1))
    fall = [accelerations_of(recursion_program(of.tree, of.joints), states)[0, :3] for of in (robot.robot, read)]
    assert np.allclose(fall[0], [0, 0, -9.81]) and np.allclose(fall[1], [9.81 * 0.96, 0, -9.81 * 0.28])


EULER: dict[str, list[int]] = {"acrobot.euler": [15, 18], "acrobot.euler_sequence": [], "acrobot.euler_fixed_axes": []}


def test_pinocchio_before_3_4_took_euler_without_a_sequence_for_no_rotation() -> None:
    named = [{one.name for one in find_readings(f"pinocchio@{version}", "mjcf")} for version in ("3.3.1", "3.4.0")]
    assert named[0] - named[1] == {"Euler angles without a sequence"} and not named[1] - named[0]
    [reading] = [one for one in find_readings("pinocchio@3.3.1", "mjcf") if one.name == "Euler angles without a sequence"]
    lines = {name: [place.line for place in reading.places(meant_by(BUILT_IN.model_path(name, "mjcf")).robot)[1]] for name in EULER}
    assert lines == EULER


FUSED = """<robot name="fused">
  <link name="base"/>
  <link name="arm"><inertial><origin xyz="0.1 0.2 0.05"/><mass value="2"/>
    <inertia ixx="0.1" iyy="0.2" izz="0.25" ixy="0.01" ixz="0.02" iyz="-0.03"/></inertial></link>
  <link name="hand"><inertial><origin xyz="0 0.02 0.05"/><mass value="0.2"/>
    <inertia ixx="0.001" iyy="0.002" izz="0.0025" ixy="0.0001" ixz="0.0002" iyz="-0.0003"/></inertial></link>
  <link name="finger"><inertial><origin xyz="0.01 0 0"/><mass value="0.1"/>
    <inertia ixx="0.001" iyy="0.001" izz="0.001" ixy="0.0002" ixz="0.0001" iyz="0.0003"/></inertial></link>
  <joint name="pin" type="continuous"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/></joint>
  <joint name="wrist" type="fixed"><parent link="arm"/><child link="hand"/><origin xyz="0 0.3 0.1" rpy="0.3 0.2 -0.5"/></joint>
  <joint name="knuckle" type="fixed"><parent link="hand"/><child link="finger"/><origin xyz="0.05 0 0.1" rpy="0 0.7 0"/></joint>
</robot>
"""
# What MuJoCo 3.13.0 and 3.14.0 compile of it.
BEFORE = 0.10781193694148311, 0.2074941700157205, 0.2565192355169573, 0.012237091620363448, 0.02240610414095826, -0.03274916832012245
AFTER = 0.10781193998809252, 0.2074941092457723, 0.2565192932402938, 0.012237090650457548, 0.022406122672046207, -0.0327491163162622


def test_what_a_compiler_of_old_makes_of_links_that_it_fuses(tmp_path: Path) -> None:
    path = tmp_path / "fused.urdf"
    path.write_text(FUSED)
    robot = meant_by(path).robot
    [reading] = [one for one in find_readings("mujoco@3.13.0", "urdf") if one.name == "digits of a full inertia"]
    arms = [next(body.inertia for body in one.tree.bodies if body.name == "arm") for one in (robot, reading.read(robot))]
    given, read = (np.array([float(one) for one in arm.moments]) for arm in arms if arm is not None)
    assert read - given == pytest.approx(np.array(BEFORE) - np.array(AFTER), abs=1e-14)


@pytest.mark.parametrize("parent", ["base", "world"])
def test_a_link_of_the_name_of_the_world_is_the_world(parent: str, tmp_path: Path) -> None:
    path = tmp_path / "fused.urdf"
    path.write_text(FUSED.replace('"base"', f'"{parent}"'))
    robot = meant_by(path).robot
    [reading] = [one for one in find_readings("mujoco@3.13.0", "urdf") if one.name == "digits of a full inertia"]
    assert reading.places(robot)[0] == 1
