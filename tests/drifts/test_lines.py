"""Differences of two files with their lines, and the changes by which the second gets what the first says: written, they end the gap."""

from __future__ import annotations

from pathlib import Path

import pytest

from harness.comparison.robot_library import RobotLibrary
from harness.drifts.plan import DriftSettings, MovingSide
from harness.drifts.study import PreparedDrift, drift_here, prepare
from harness.engines import load_engine
from harness.engines.moving import HeldNumbers, NamedNumber
from harness.explain.changes.held import HeldFile, SizedChange, sized_change
from harness.results.cause import DriftCause

ROBOT = """<mujoco model="arm">
<compiler {compiler}/>
<default>
  <joint damping="0.2"/>
  <default class="stiff"><joint armature="0.01"/><position kp="40" dampratio="0.8"/></default>
</default>
<worldbody>
  <body name="upper">
    <body pos="0 0 -0.3">
      <joint name="elbow" axis="0 1 0" class="stiff" {elbow}/>
      <geom size="0.03" pos="0 0 -0.2" {lower}/>
      {inertial}
    </body>
    <joint name="shoulder" axis="0 1 0" class="stiff" {shoulder}/>
    <geom size="0.02" {upper}/>
  </body>
</worldbody>
<actuator><position joint="elbow" class="stiff" {servo}/></actuator>
<keyframe><key qpos="0.3 0.4" ctrl="0.5"/></keyframe>
</mujoco>
"""
PLAIN = dict.fromkeys(("compiler", "elbow", "lower", "inertial", "shoulder", "upper", "servo"), "")
INERTIAL = '<inertial pos="0 0 -0.1" mass="1" diaginertia="0.01 0.01 0.002"/>'


def prepared(folder: Path, one: dict[str, str], other: dict[str, str]) -> PreparedDrift:
    for name, words in (("a.xml", one), ("b.xml", other)):
        (folder / name).write_text(ROBOT.format(**{**PLAIN, **words}))
    return prepare(DriftSettings((MovingSide(folder / "a.xml"), MovingSide(folder / "b.xml")), 0.05), here=True)


# What both files say, the cause, the attribute that is changed with its line, and what is found there.
CASES = {
    "an attribute that both write": ({"elbow": 'damping="1"'}, {"elbow": 'damping="2"'}, DriftCause.DAMPING, ("damping", 10, "2")),
    "one that the second has of its class": ({"elbow": 'damping="1"'}, {}, DriftCause.DAMPING, ("damping", 10, "0.2")),
    "one that the first has of its class": ({}, {"elbow": 'damping="2"'}, DriftCause.DAMPING, ("damping", 10, "2")),
    "one that the second lacks": ({"shoulder": 'frictionloss="0.1"'}, {}, DriftCause.FRICTION, ("frictionloss", 14, "")),
    "one that the first lacks": ({}, {"shoulder": 'frictionloss="0.1"'}, DriftCause.FRICTION, ("frictionloss", 14, "0.1")),
    "a geom without a name": ({"upper": 'mass="2"'}, {"upper": 'mass="2" friction="0.5"'}, DriftCause.CONTACT_LAW, ("friction", 15, "0.5")),
    "one of the body's inertia": (
        {"inertial": INERTIAL},
        {"inertial": INERTIAL.replace('mass="1"', 'mass="2"')},
        DriftCause.TREE,
        ("mass", 12, "2"),
    ),
    "one of another name": ({"servo": 'kv="4"'}, {"servo": 'dampratio="2"'}, DriftCause.DERIVATIVE_GAIN, ("kv", 18, "2")),
}


@pytest.mark.parametrize("name", CASES)
def test_a_change_writes_what_the_first_file_says(tmp_path: Path, name: str) -> None:
    one, other, cause, (attribute, line, found) = CASES[name]
    made = prepared(tmp_path, one, other)
    [change] = made.changes[cause]
    assert (change.kind, change.place.attribute, change.place.line, change.place.found) == (cause, attribute, line, found)
    if name == "one of another name":
        said = '(b.xml line 18: dampratio 2; a.xml line 18: kv 4). Set kv="4" in b.xml.'
        assert drift_here(made.settings).sentence.endswith(said)
    (tmp_path / "b.xml").write_text(change.text(0.0))
    left = drift_here(made.settings)
    assert not any(left.of_positions) and not any(share.differences for share in left.shares)


def test_angles_in_other_units_are_not_copied(tmp_path: Path) -> None:
    degrees, radians = {"elbow": 'range="-60 60"'}, {"elbow": 'range="-1 1"', "compiler": 'angle="radian"'}
    made = prepared(tmp_path, degrees, radians)
    assert made.plan.causes == (DriftCause.LIMITS,) and not made.changes
    assert DriftCause.LIMITS in prepared(tmp_path, radians, {**radians, "elbow": 'range="-2 2"'}).changes


def test_masses_that_follow_from_geoms_are_set_by_no_attribute(tmp_path: Path) -> None:
    made = prepared(tmp_path, {}, {"lower": 'mass="3"'})
    # The damping ratio stands for another derivative gain then.
    assert made.plan.causes == (DriftCause.TREE, DriftCause.DERIVATIVE_GAIN) and not made.changes
    record = drift_here(made.settings)
    assert any(one.what == "mass" and one.second_place == "line 9" for one in record.ranked[0].differences), record.ranked[0].differences


def test_what_the_first_file_does_not_say_is_taken_out(tmp_path: Path) -> None:
    prepared(tmp_path, {}, {"shoulder": 'frictionloss="0.4"'})
    sides = MovingSide(tmp_path / "a.xml"), MovingSide(tmp_path / "b.xml")
    record = drift_here(DriftSettings(sides, 0.2))
    assert record.sentence.endswith('Remove frictionloss="0.4" from b.xml.')


def test_a_switch_of_one_file_alone_is_told_by_what_it_switches(tmp_path: Path) -> None:
    prepared(tmp_path, {}, {})
    text = (tmp_path / "b.xml").read_text()
    (tmp_path / "b.xml").write_text(text.replace("<worldbody>", '<option><flag actuation="disable"/></option>\n<worldbody>', 1))
    sides = MovingSide(tmp_path / "a.xml"), MovingSide(tmp_path / "b.xml")
    record = drift_here(DriftSettings(sides, 0.1))
    assert record.sentence.startswith("b.xml has no actuators: 100 % of the gap")
    assert record.sentence.endswith('Remove actuation="disable" from b.xml.')


@pytest.mark.parametrize("setting", ['<option timestep="0.004"/>', '<option><flag gravity="disable"/></option>'])
def test_a_setting_of_a_file_without_options_is_written(tmp_path: Path, setting: str) -> None:
    prepared(tmp_path, {}, {})
    text = (tmp_path / "a.xml").read_text()
    (tmp_path / "a.xml").write_text(text.replace("<worldbody>", f"{setting}\n<worldbody>", 1))
    made = prepare(DriftSettings((MovingSide(tmp_path / "a.xml"), MovingSide(tmp_path / "b.xml")), 0.1), here=True)
    [[change]] = made.changes.values()
    (tmp_path / "b.xml").write_text(change.text(0.0))
    assert not any(drift_here(made.settings).of_positions)


def test_a_number_of_an_included_file_is_told_and_written_there(tmp_path: Path) -> None:
    joint = '<mujocoinclude><joint name="hinge" axis="0 1 0" damping="{damping}"/></mujocoinclude>'
    body = '<mujoco><worldbody><body><include file="{file}"/><geom size="0.1" pos="0.2 0 0"/></body></worldbody></mujoco>'
    for name, damping in (("a", 1), ("b", 3)):
        (tmp_path / f"{name}_joint.xml").write_text(f"\n{joint.format(damping=damping)}")
        (tmp_path / f"{name}.xml").write_text(body.format(file=f"{name}_joint.xml"))
    made = prepare(DriftSettings((MovingSide(tmp_path / "a.xml"), MovingSide(tmp_path / "b.xml")), 0.1), here=True)
    [change] = made.changes[DriftCause.DAMPING]
    assert change.path == tmp_path / "b_joint.xml"
    record = drift_here(made.settings)
    assert record.sentence.endswith('(b.xml b_joint.xml:2: damping 3; a.xml a_joint.xml:2: damping 1). Set damping="1" in b.xml.')
    change.path.write_text(change.text(0.0))
    assert not any(drift_here(made.settings).of_positions)


URDF = """<robot name="arm">
<link name="base"/>
<link name="rod">
  <inertial><origin xyz="0 0 -0.2"/><mass value="{mass}"/><inertia ixx="0.01" iyy="0.01" izz="{izz}" ixy="0" ixz="0" iyz="0"/></inertial>
</link>
<joint name="pin" type="revolute">
  <parent link="base"/><child link="rod"/><axis xyz="0 1 0"/>
  <limit lower="{lower}" upper="1.5" effort="5" velocity="9"/>{dynamics}
</joint>
</robot>
"""


@pytest.mark.parametrize(
    ("words", "cause", "line"),
    [
        ({"mass": "2"}, DriftCause.TREE, 4),
        ({"izz": "0.009"}, DriftCause.TREE, 4),
        ({"lower": "-0.1"}, DriftCause.LIMITS, 8),
        ({"dynamics": ""}, DriftCause.DAMPING, 6),
    ],
)
def test_a_urdf_is_told_and_written_by_its_own_attributes(tmp_path: Path, words: dict[str, str], cause: DriftCause, line: int) -> None:
    plain = {"mass": "1", "izz": "0.002", "lower": "-1.5", "dynamics": '<dynamics damping="0.3"/>'}
    (tmp_path / "a.urdf").write_text(URDF.format(**plain))
    (tmp_path / "b.urdf").write_text(URDF.format(**{**plain, **words}))
    sides = MovingSide(tmp_path / "a.urdf"), MovingSide(tmp_path / "b.urdf")
    made = prepare(DriftSettings(sides, 0.3, start={"pin": ([0.4], [0.0])}), here=True)
    [change] = made.changes[cause]
    assert change.place.line == line
    (tmp_path / "b.urdf").write_text(change.text(0.0))
    assert not any(drift_here(made.settings).of_positions)


def test_elements_without_names_are_counted_body_by_body(tmp_path: Path) -> None:
    """The geom of a body comes before those of its children, wherever it stands; the world is body 0."""
    prepared(tmp_path, {}, {})
    file = HeldFile(tmp_path / "a.xml")
    assert [file.says("geom_size", f"geom {number} of anything")[0].told(file.path) for number in range(2)] == ["line 15", "line 11"]
    assert [file.says("body_pos", name)[0].told(file.path) for name in ("upper", "body 2", "body 3")] == ["line 8", "line 9", ""]


def test_files_of_two_formats_are_set_by_their_own_words(tmp_path: Path) -> None:
    """A coefficient has another name in each; moments and ranges are written otherwise."""
    words = {"mass": "1", "izz": "0.002", "lower": "-1.5", "dynamics": '<dynamics damping="0.3" friction="0.2"/>'}
    (tmp_path / "b.urdf").write_text(URDF.format(**words))
    (tmp_path / "a.xml").write_text(
        """<mujoco><worldbody><body name="rod"><joint name="pin" axis="0 1 0" range="-60 60" damping="0.3" frictionloss="0.5"/>
        <inertial pos="0 0 -0.2" mass="1" diaginertia="0.01 0.01 0.003"/></body></worldbody></mujoco>"""
    )
    made = prepare(DriftSettings((MovingSide(tmp_path / "a.xml"), MovingSide(tmp_path / "b.urdf")), 0.1), here=True)
    assert {DriftCause.TREE, DriftCause.FRICTION, DriftCause.LIMITS} <= set(made.plan.causes)
    [[change]] = made.changes.values()
    assert (change.kind, change.place.attribute) == (DriftCause.FRICTION, "friction")
    assert 'friction="0.5"' in change.text(0.0)


def test_a_link_that_is_fixed_to_another_is_told_by_its_own_line(tmp_path: Path) -> None:
    """Of both MuJoCo makes one body, whose numbers no element has."""
    tool = """<link name="tool">
  <inertial><mass value="{mass}"/><inertia ixx="0.001" iyy="0.001" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="flange" type="fixed"><parent link="rod"/><child link="tool"/><origin xyz="0.1 0 -0.3"/></joint>
</robot>"""
    words = {"mass": "1", "izz": "0.002", "lower": "-1.5", "dynamics": ""}
    for name, mass in (("a.urdf", "0.2"), ("b.urdf", "0.6")):
        (tmp_path / name).write_text(URDF.format(**words).replace("</robot>", tool.format(mass=mass)))
    sides = MovingSide(tmp_path / "a.urdf"), MovingSide(tmp_path / "b.urdf")
    made = prepare(DriftSettings(sides, 0.1), here=True)
    [change] = made.changes[DriftCause.TREE]
    assert (change.place.attribute, change.place.found) == ("value", "0.6")
    record = drift_here(made.settings)
    assert (
        "(b.urdf line 11: inertial mass value 0.6; a.urdf line 11: inertial mass value 0.2" in record.sentence
        and "body tool" in " ".join(record.lines)
    )
    (tmp_path / "b.urdf").write_text(change.text(0.0))
    assert not any(drift_here(made.settings).of_positions)


TOOL = """<link name="mount"/><link name="tool"><inertial><mass value="0.2"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>
</inertial></link>
<joint name="flange" type="fixed"><parent link="rod"/><child link="mount"/><origin xyz="0.1 0 {height}"/></joint>
<joint name="wrist" type="continuous"><parent link="mount"/><child link="tool"/>{origin}<axis xyz="1 0 0"/></joint>
</robot>"""


@pytest.mark.parametrize(
    ("words", "line", "attribute"),
    [
        ({"origin": '<origin xyz="0 0.2 0"/>'}, 13, "xyz"),
        ({"height": "-0.5"}, 12, "xyz"),
        ({"origin": '<origin rpy="0 0 0.3"/>'}, 13, "rpy"),
    ],
)
def test_where_a_link_is_placed_is_told_by_its_joint(tmp_path: Path, words: dict[str, str], line: int, attribute: str) -> None:
    """A joint places its child, and so do the fixed ones by which its parent stands on another link; no joint above those does."""
    plain = URDF.format(mass="1", izz="0.002", lower="-1.5", dynamics="")
    tool = {"height": "-0.3", "origin": '<origin xyz="0 0 0" rpy="0 0 0"/>'}
    (tmp_path / "a.urdf").write_text(plain.replace("</robot>", TOOL.format(**tool)))
    (tmp_path / "b.urdf").write_text(plain.replace("</robot>", TOOL.format(**{**tool, **words})))
    made = prepare(DriftSettings((MovingSide(tmp_path / "a.urdf"), MovingSide(tmp_path / "b.urdf")), 0.1), here=True)
    [change] = made.changes[DriftCause.TREE]
    assert (change.place.line, change.place.attribute) == (line, attribute)
    joint = "wrist" if line == 13 else "flange"
    assert f"origin {attribute} of joint {joint}: " in drift_here(made.settings).lines[0]
    (tmp_path / "b.urdf").write_text(change.text(0.0))
    assert not any(drift_here(made.settings).of_positions)


# The number of a compiled file, the words by which it is found there, its attribute with its line, and its text with another value.
NUMBERS = {
    "one that is written": ("damping of joint elbow", {"elbow": 'damping="1"'}, 3.0, ("damping", 10), "3"),
    "one of a class": ("armature of joint elbow", {}, 0.02, ("armature", 10), "0.02"),
    "one that nothing says": ("frictionloss of joint shoulder", {}, 0.5, ("frictionloss", 14), "0.5"),
    "one of three": ("centre of mass z of body 2", {"inertial": INERTIAL}, -0.2, ("pos", 12), "0 0 -0.2"),
    "a moment of three": ("moment of inertia y of body 2", {"inertial": INERTIAL}, 0.009, ("diaginertia", 12), "0.01 0.009 0.002"),
    "a range of both signs": ("forcerange of actuator 0", {"servo": 'forcerange="-3.5 3.5"'}, 2.0, ("forcerange", 18), "-2 2"),
    "a gain of two numbers": ("kp of actuator 0", {"servo": 'kp="30" kv="1"'}, 50.0, ("kp", 18), "50"),
    "a gain that is negative in the engine": ("kv of actuator 0", {"servo": 'kv="1"'}, 2.5, ("kv", 18), "2.5"),
}


@pytest.mark.parametrize("case", NUMBERS)
def test_a_number_of_an_engine_is_a_change_of_its_attribute(tmp_path: Path, case: str) -> None:
    name, words, value, where, text = NUMBERS[case]
    file = tmp_path / "a.xml"
    # A damping ratio would follow the inertia.
    file.write_text(ROBOT.format(**{**PLAIN, "servo": 'kv="1"', **words}))
    sized = sized_of(file, name)
    assert sized is not None
    change = sized.change
    assert ((change.place.attribute, change.place.line), sized.words(value)) == (where, text)
    assert change.start is not None
    before = held(file)
    for written in (change.start, value):
        file.write_text(change.text(written))
        [number] = [one for one in held(file).named if name_of(one) == name]
        assert number.value == pytest.approx(written, rel=1e-12)
        after = {key: row for own in held(file).by_cause.values() for key, row in own.items()}
        differing = {key for own in before.by_cause.values() for key in own if (own[key] != after[key]).any()}
        assert differing == (set() if written == change.start else set(number.directions))


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("kv of actuator 0", {}),
        ("mass of body 2", {}),
        (
            "moment of inertia x of body 2",
            {"inertial": INERTIAL.replace('diaginertia="0.01 0.01 0.002', 'fullinertia="0.01 0.01 0.002 0 0 0')},
        ),
    ],
    ids=["a damping ratio", "a mass that follows from geoms", "moments in another order"],
)
def test_a_number_that_no_attribute_says_is_no_change(tmp_path: Path, name: str, words: dict[str, str]) -> None:
    (tmp_path / "a.xml").write_text(ROBOT.format(**{**PLAIN, **words}))
    assert sized_of(tmp_path / "a.xml", name) is None


def held(file: Path) -> HeldNumbers:
    return load_engine(RobotLibrary.without_files(), "mujoco").held_numbers(MovingSide(file).file)


def name_of(number: NamedNumber) -> str:
    return f"{number.what} of {number.owner}"


def sized_of(file: Path, name: str) -> SizedChange | None:
    numbers = held(file)
    rows = {key: row for own in numbers.by_cause.values() for key, row in own.items()}
    [number] = [one for one in numbers.named if name_of(one) == name]
    return sized_change(HeldFile(file), number, rows.__getitem__)
