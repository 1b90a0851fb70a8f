"""Model files: what is read from a valid one, and that every malformed one is refused at its line."""

from __future__ import annotations

import itertools
import os
import pickle
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from harness.engines import load_engine
from harness.errors import InvalidModel
from harness.files.document.xml import MAXIMUM_BYTES, MAXIMUM_DEPTH, MAXIMUM_ELEMENTS
from harness.files.given import every_number_in
from harness.files.model_file import JointDamper, JointSpring, ModelFile, PointSpring, meaning_of, parse_model, read_model
from harness.files.text.scan import find_elements, find_numbers, with_values
from harness.library import Library

SUFFIXES = {"mjcf": ".xml", "urdf": ".urdf"}

MJCF = """\
<?xml version="1.0"?>
<mujoco>
  <compiler angle="radian"/>
  <option gravity="0 0 -9.81"/>
  <worldbody>
    <body name="cart">
      <joint name="slide" type="slide" axis="1 0 0" stiffness="270" springref="0"/>
      <inertial pos="0 0 0" mass="10" diaginertia="1 1 1"/>
      <frame pos="0 0 0.1">
        <body name="bar" quat="1 0 0 0">
          <joint
              name="pin" axis="0 -1 0" damping="0.2"/>
          <inertial pos="0 0 -0.3" mass="1" fullinertia="0.03 0.03 0.001 0 0 0"/>
        </body>
      </frame>
    </body>
  </worldbody>
  <tendon>
    <spatial stiffness="120" springlength="2.5"/>
  </tendon>
</mujoco>
"""

URDF = """\
<robot name="template" xmlns:drake="http://drake.mit.edu">
  <link name="world"/>
  <link name="cart">
    <inertial>
      <origin xyz="0 0 0"/>
      <mass value="10"/>
      <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>
    </inertial>
  </link>
  <link name="bar">
    <inertial>
      <mass value="1"/>
      <inertia ixx="0.03" ixy="0" ixz="0" iyy="0.03" iyz="0" izz="0"/>
    </inertial>
  </link>
  <joint name="slide" type="prismatic">
    <parent link="world"/>
    <child link="cart"/>
    <axis xyz="1 0 0"/>
    <limit lower="-1e9" upper="1e9" effort="1e9" velocity="1e9"/>
  </joint>
  <joint name="pin" type="revolute">
    <parent link="cart"/>
    <child link="bar"/>
    <axis xyz="0 -1 0"/>
    <limit lower="-1e9" upper="1e9" effort="1e9" velocity="1e9"/>
    <dynamics damping="0.2" friction="0"/>
  </joint>
  <gazebo reference="slide">
    <springStiffness>270</springStiffness>
    <springReference>0</springReference>
  </gazebo>
  <drake:linear_spring_damper>
    <drake:linear_spring_damper_body_A name="world"/>
    <drake:linear_spring_damper_p_AP value="-2.5 0 0"/>
    <drake:linear_spring_damper_body_B name="bar"/>
    <drake:linear_spring_damper_p_BQ value="0 0 -0.6"/>
    <drake:linear_spring_damper_free_length value="2.5"/>
    <drake:linear_spring_damper_stiffness value="120"/>
    <drake:linear_spring_damper_damping value="0"/>
  </drake:linear_spring_damper>
</robot>
"""
LIMIT, DAMPER = '<limit lower="-1e9" upper="1e9" effort="1e9" velocity="1e9"/>', '<dynamics damping="0.2" friction="0"/>'
TEMPLATES = {"mjcf": MJCF, "urdf": URDF}

Reader = Callable[[str | bytes, str], ModelFile]


@pytest.fixture
def read(tmp_path: Path) -> Reader:
    def write_and_read(content: str | bytes, model_format: str) -> ModelFile:
        path = tmp_path / f"model{SUFFIXES[model_format]}"
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return read_model(path, model_format)

    return write_and_read


def refusal(read: Reader, content: str | bytes, model_format: str) -> InvalidModel:
    with pytest.raises(InvalidModel) as caught:
        read(content, model_format)
    assert "\n" not in str(caught.value)
    return caught.value


def test_what_is_read_from_mjcf(read: Reader) -> None:
    model = read(MJCF, "mjcf")
    assert (model.text, model.format, model.gravity) == (MJCF, "mjcf", (0.0, 0.0, -9.81))
    assert model.force_elements == (JointSpring("slide", 270.0, 0.0, 7), JointDamper("pin", 0.2, 11))
    # The tendon runs through no site.
    assert [missing.line for missing in model.unexpressed] == [19]
    assert list(model.joint_lines.items()) == [("slide", 7), ("pin", 11)]  # where the tag starts, not where it ends
    assert (model.root_line, model.gravity_line) == (2, 4)


def test_what_is_read_from_urdf(read: Reader) -> None:
    model = read(URDF, "urdf")
    assert (model.text, model.format) == (URDF, "urdf")
    assert list(model.joint_lines.items()) == [("slide", 16), ("pin", 22)]
    assert (model.root_line, model.gravity_line) == (1, None)
    assert model.force_elements == (
        JointDamper("pin", 0.2, 27),
        JointSpring("slide", 270.0, 0.0, 30),
        PointSpring("world", (-2.5, 0.0, 0.0), "bar", (0.0, 0.0, -0.6), 2.5, 120.0, 0.0, 33),
    )


def test_reflected_inertia_is_read(read: Reader) -> None:
    def with_rotor(parts: str) -> str:
        return URDF.replace("</robot>", TRANSMISSION + parts + "</actuator></transmission></robot>")

    geared = read(with_rotor(ROTOR + '<drake:gear_ratio value="62"/>'), "urdf")
    assert [(one.name, float(one.armature), one.places["armature"].line) for one in geared.armatures] == [("pin", 62**2 * 2e-4, 42)]
    assert [float(one.armature) for one in read(with_rotor(ROTOR), "urdf").armatures] == [2e-4]
    assert read(URDF, "urdf").armatures == ()
    unlimited = with_rotor(ROTOR).replace('effort="1e9"', 'effort="0"')
    error = refusal(read, unlimited, "urdf")
    assert error.line == 26 and "with which Drake leaves out its transmission" in error.problem


def test_reflected_inertia_is_what_mujoco_calls_armature() -> None:
    library = Library.built_in()
    edits = {
        ("mujoco", "mjcf"): ('name="pin"', 'name="pin" armature="2.25"'),
        ("pinocchio", "urdf"): (
            "</robot>",
            TRANSMISSION + '<drake:rotor_inertia value="0.25"/><drake:gear_ratio value="3"/></actuator></transmission></robot>',
        ),
    }
    answers = []
    for (engine, model_format), (old, new) in edits.items():
        path = library.model_path("bar_pendulum", model_format)
        text = path.read_text().replace(old, new, 1).replace('effort="0"', 'effort="1"')
        text = text.replace("<robot ", '<robot xmlns:drake="http://drake.mit.edu" ')
        loaded = load_engine(library, engine).load(parse_model(path, text, model_format), ["pin"], 9.81)
        answers.append(loaded.forward_dynamics(np.array([[1.0]]), np.array([[2.0]]), np.array([[3.0]])))
    assert answers[0] == pytest.approx(answers[1], rel=1e-14)


def test_at_least_sixty_malformed_inputs_of_each_format() -> None:
    assert min(len(MALFORMED_MJCF), len(MALFORMED_URDF)) >= 60


@pytest.mark.parametrize(
    ("options", "line"),
    [
        ('<option><flag contact="disable"/></option>\n<option gravity="0 0 0"/>', 3),
        ('<option gravity="0 0 0"/>\n<option><flag contact="disable"/></option>', 2),
        ('\n<option><flag contact="disable"/></option>', 3),
        ("", 1),
    ],
)
def test_line_of_gravity(read: Reader, options: str, line: int) -> None:
    body = '<body><joint name="pin"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body>'
    assert read(f"<mujoco>\n{options}<worldbody>{body}</worldbody></mujoco>", "mjcf").gravity_line == line


SHIPPED = [
    (path, model_format)
    for model_format, suffix in SUFFIXES.items()
    for path in sorted((Library.built_in().models / model_format).glob(f"*{suffix}"))
]


@pytest.mark.parametrize(("path", "model_format"), SHIPPED, ids=lambda value: getattr(value, "name", value))
def test_shipped_models_read_and_pickle(path: Path, model_format: str) -> None:
    model = read_model(path, model_format)
    assert pickle.loads(pickle.dumps(model)) == model
    assert model.text == path.read_text()
    for name, line in model.joint_lines.items():
        assert f'name="{name}"' in model.text.splitlines()[line - 1]


# One change each to a valid template: what is replaced everywhere, by what, the line to blame, what the message must say.
MALFORMED_MJCF = {
    "root": ("mujoco>", "robot>", 2, "root element is <robot>; expected <mujoco>"),
    "namespaced root": ("<mujoco>", '<mujoco xmlns="urn:x">', 2, "without a default namespace"),
    "doctype": ("<mujoco>", "<!DOCTYPE mujoco>\n<mujoco>", 2, "DOCTYPE"),
    "entity bomb": ("<mujoco>", '<!DOCTYPE m [<!ENTITY a "x"><!ENTITY b "&a;&a;">]>\n<mujoco>', 2, "DOCTYPE"),
    "undefined entity": ('name="cart"', 'name="&cart;"', 6, "not well-formed"),
    "unclosed": ("</frame>", "", 16, "mismatch"),
    "attribute twice": ('mass="10"', 'mass="10" mass="10"', 8, "not well-formed"),
    "null byte": ("cart", "ca\0rt", 6, "not well-formed"),
    "include": ("<tendon>", '<include file="/etc/passwd"/>\n<tendon>', 18, "<include> reads another file"),
    "replicate": ("frame", "replicate", 9, "makes bodies and joints that this file does not spell out"),
    "no worldbody": ("worldbody", "world", 5, "<world> in <mujoco> is unknown; did you mean 'worldbody'?"),
    "joint twice": ('name="pin"', 'name="slide"', 11, "repeats the name of line 7"),
    "body called world": ('<body name="bar"', '<body name="world"', 10, "has the name of the world itself"),
    "joint without name": ('name="slide" ', "", 7, "has no name"),
    "joint universe": ('name="slide"', 'name="universe"', 7, "joint 'universe', as Pinocchio calls the world"),
    "joint with empty name": ('name="slide" ', 'name="" ', 7, "has no name"),
    "joint in the world": (
        "<worldbody>",
        '<worldbody>\n<joint name="floor"/>',
        6,
        "<joint> in <worldbody> does not belong there; expected in <body> or",
    ),
    "joint type": ('type="slide"', 'type="slider"', 7, "did you mean 'slide'?"),
    "axis zero": ('axis="1 0 0"', 'axis="0 0 0"', 7, "is zero; expected a unit vector"),
    "axis not unit": ('axis="0 -1 0"', 'axis="0 -1 1"', 11, "has length 1.41421"),
    "axis short": ('axis="1 0 0"', 'axis="1 0"', 7, "holds 2 numbers; expected 3"),
    "axis empty": ('axis="1 0 0"', 'axis=""', 7, "holds 0 numbers"),
    "stiffness long": ('stiffness="270"', 'stiffness="1 2 3 4"', 7, "expected 1 to 3"),
    "armature negative": ('springref="0"', 'armature="-1"', 7, "is negative"),
    "dry friction": ('springref="0"', 'frictionloss="-1"', 7, "is negative"),
    "gravity scalar": ("0 0 -9.81", "-9.81", 4, "holds 1 numbers; expected 3"),
    "quat zero": ('quat="1 0 0 0"', 'quat="0 0 0 0"', 10, "is zero"),
    "quat short": ('quat="1 0 0 0"', 'quat="1 0 0"', 10, "expected 4"),
    "no inertial": ('<inertial pos="0 0 0" mass="10" diaginertia="1 1 1"/>', "", 6, "moves but has no <inertial>"),
    "inertial twice": ("<frame", '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>\n<frame', 9, "second <inertial>"),
    "no mass": ('mass="1" ', "", 13, "has no attribute 'mass'"),
    "mass negative": ('mass="10"', 'mass="-10"', 8, "is negative"),
    "leaf without mass": ('mass="1"', 'mass="0"', 13, "not positive"),
    "mass that underflows": ('mass="1"', 'mass="1e-400"', 13, "not positive"),
    "both inertias": ('diaginertia="1 1 1"', 'diaginertia="1 1 1" fullinertia="1 1 1 0 0 0"', 8, "both diaginertia and fullinertia"),
    "no inertia": ('diaginertia="1 1 1"', "", 8, "neither diaginertia nor fullinertia"),
    "inertia negative": ('diaginertia="1 1 1"', 'diaginertia="1 1 -1"', 8, "expected none below zero"),
    "inertia triangle": ('diaginertia="1 1 1"', 'diaginertia="1 1 2.001"', 8, "1, 1, 2.001; expected the two smaller"),
    "inertia indefinite": ("0.03 0.03 0.001 0 0 0", "0.03 0.03 0.001 0 0 0.02", 13, "expected none below zero"),
    "inertia full triangle": ("0.03 0.03 0.001 0 0 0", "0.03 0.03 0.001 0.01 0 0", 13, "expected the two smaller"),
    "fullinertia short": ("0.03 0.03 0.001 0 0 0", "0.03 0.03 0.001", 13, "expected 6"),
    "attribute misspelt": ('damping="0.2"', 'dampng="0.2"', 11, "dampng=\"0.2\" is unknown; did you mean 'damping'?"),
    "attribute in capitals": ('mass="10"', 'mass="10" Mass="10"', 8, "did you mean 'mass'?"),
    "attribute of another reader": ('name="cart"', 'name="cart" colour="red"', 6, 'colour="red" is not understood; expected one of'),
    "attribute with a prefix": ('name="cart"', 'name="cart" xmlns:a="urn:a" a:b="1"', 6, "is not understood"),
    "element misspelt": (
        '<inertial pos="0 0 -0.3"',
        '<innertial pos="0 0 -0.3"',
        13,
        '<innertial> in <body name="bar"> is unknown; did you mean',
    ),
    "element in its own namespace": ('<joint name="slide"', '<joint xmlns="urn:x" name="slide"', 7, "in a default namespace"),
    "element of another reader": ("<tendon>", "<springs/><tendon>", 18, "<springs> in <mujoco> is not understood"),
    "text": ('<body name="bar" quat="1 0 0 0">', '<body name="bar">damping 0.2', 10, "holds the text 'damping 0.2', which no reader reads"),
    "actuator": ("<tendon>", '<actuator><motor joint="pin"/></actuator><tendon>', 18, "has no attribute 'name'"),
    "sensor": ("<tendon>", '<sensor><jointpos joint="pin"/></sensor><tendon>', 18, "<sensor> is not felt"),
    "equality": ("<tendon>", '<equality><joint joint1="pin"/></equality><tendon>', 18, "<joint> has no name; add one"),
    "contact": ("<tendon>", '<contact><exclude body1="cart" body2="bar"/></contact><tendon>', 18, "<contact> is a constraint"),
    "keyframe": ("<tendon>", '<keyframe><key qpos="0 0"/></keyframe><tendon>', 18, "<keyframe> holds states"),
    "plugin": ("<tendon>", '<extension><plugin plugin="p"/></extension><tendon>', 18, "runs code"),
    "deformable": ("<tendon>", "<deformable/><tendon>", 18, "is deformable"),
    "size": ("<tendon>", '<size njmax="1"/><tendon>', 18, "is not felt"),
    "joint of the world": (
        "<worldbody>",
        '<worldbody><frame><joint name="x" axis="1 0 0"/></frame>',
        5,
        '<joint name="x"> stands in <worldbody>; a joint belongs in the <body> that it moves',
    ),
    "actuator of nothing": ("</mujoco>", '<actuator><motor name="m"/></actuator></mujoco>', 21, "drives by nothing that is known"),
    "mocap": ('name="cart"', 'name="cart" mocap="true"', 6, "moved from outside"),
    "gravity taken away": ('name="cart"', 'name="cart" gravcomp="1"', 6, "takes gravity away from one body"),
    "joint range": ('springref="0"', 'range="-1"', 7, "holds 1 numbers; expected 2"),
    "joint limited": ('springref="0"', 'limited="yes"', 7, "is unknown"),
    "joint spring and damper at once": ('springref="0"', 'springdamper="1 1"', 7, "does not spell out"),
    "joint yield": ('springref="0"', 'springyield="1"', 7, "lets a spring yield"),
    "joint force range": ('springref="0"', 'actuatorfrcrange="-1 1"', 7, "belongs to actuators"),
    "tendon range": ('springlength="2.5"', 'range="0 1"', 19, "is a limit"),
    "tendon around a geom": ('springlength="2.5"/>', '><geom geom="g"/></spatial>', 19, "wraps the tendon"),
    "tendon through nothing": ('springlength="2.5"/>', "><site/></spatial>", 19, "no attribute 'site'"),
    "fluid density": ('<option gravity="0 0 -9.81"/>', '<option density="1.2"/>', 4, 'density="1.2" is a fluid'),
    "fluid viscosity": ('<option gravity="0 0 -9.81"/>', '<option viscosity="1"/>', 4, "is a fluid"),
    "wind": ('<option gravity="0 0 -9.81"/>', '<option wind="1 0 0"/>', 4, "is a fluid"),
    "timestep": (
        '<option gravity="0 0 -9.81"/>',
        '<option timestep="0.001"/>',
        4,
        'timestep="0.001"> is for constraints',
    ),
    "integrator": ('<option gravity="0 0 -9.81"/>', '<option integrator="RK4"/>', 4, "is not felt"),
    "gravity misspelt": ('gravity="', 'gravty="', 4, "did you mean 'gravity'?"),
    "stage misspelt": ("<tendon>", '<option><flag contacts="disable"/></option><tendon>', 18, "did you mean 'contact'?"),
    "stage neither on nor off": ("<tendon>", '<option><flag contact="off"/></option><tendon>', 18, "expected one of 'enable', 'disable'"),
    "stage that stops bodies": ("<tendon>", '<option><flag sleep="enable"/></option><tendon>', 18, "computes what no acceleration needs"),
    "masses from geoms": ('angle="radian"', 'inertiafromgeom="true"', 3, "changes masses or inertias behind"),
    "total mass": ('angle="radian"', 'settotalmass="1"', 3, "changes masses or inertias behind"),
    "fused bodies": ('angle="radian"', 'fusestatic="yes"', 3, "is unknown; expected one of 'true', 'false'"),
    "angle unit": ('angle="radian"', 'angle="degrees"', 3, "did you mean 'degree'?"),
    "geom": (
        "<frame",
        '<geom size="1"/><frame',
        9,
        "<geom> is decoration; remove it, or declare it by the comment <!-- decoration: geom -->",
    ),
    "geom that touches": ("<frame", '<!-- decoration: geom --><geom size="1"/><frame', 9, "can touch, which is no decoration"),
    "material": ("<tendon>", "<asset/><tendon>", 18, "<asset> is decoration"),
    "visual": ("<tendon>", "<visual/><tendon>", 18, "<visual> is decoration"),
    "statistic": ("<tendon>", '<statistic extent="1"/><tendon>', 18, "<statistic> is decoration"),
    "colour of a site": (
        "<frame",
        '<site rgba="1 0 0 1"/><frame',
        9,
        "is decoration; remove it, or declare it by the comment <!-- decoration: rgba -->",
    ),
    "decoration that is none": ("<worldbody>", "<!--\ndecoration: geom joint -->\n<worldbody>", 5, "declares 'joint' as decoration"),
    "decoration misspelt": ("<worldbody>", "<!-- decoration: goem -->\n<worldbody>", 5, "did you mean 'geom'?"),
    "bad number in defaults": ("<worldbody>", '<default><joint damping="?"/></default><worldbody>', 5, "'?'"),
}

INERTIAL = """
    <inertial>
      <origin xyz="0 0 0"/>
      <mass value="10"/>
      <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>
    </inertial>"""
SECOND_SPRING = """
  <gazebo reference="slide"><springStiffness>1</springStiffness><springReference>0</springReference></gazebo>"""
TYPE = "<type>transmission_interface/SimpleTransmission</type>"
TRANSMISSION = f'<transmission name="t">{TYPE}<joint name="pin"/><actuator name="a">'
ROTOR = '<drake:rotor_inertia value="2e-4"/>'


def transmission(problem: str, parts: str = ROTOR, old: str = "", new: str = "") -> tuple[str, str, int, str]:
    """A change of the template: a transmission with parts in its actuator, one text of which is another."""
    whole = f"{TRANSMISSION}{parts}</actuator></transmission></robot>"
    return "</robot>", whole.replace(old, new) if old else whole, 42, problem


MALFORMED_URDF = {
    "root": ("robot", "model", 1, "root element is <model>; expected <robot>"),
    "drake undeclared": (' xmlns:drake="http://drake.mit.edu"', "", 33, "not well-formed"),
    "robot without name": (' name="template"', "", 1, "<robot> has no name"),
    "link twice": ('<link name="bar"', '<link name="cart"', 10, "repeats the name of line 3"),
    "link without name": ('<link name="world"/>', "<link/>", 2, "<link> has no name"),
    "joint twice": ('<joint name="pin"', '<joint name="slide"', 22, "repeats the name of line 16"),
    "joint without name": ('<joint name="pin"', "<joint", 22, "<joint> has no name"),
    "joint universe": ('<joint name="pin"', '<joint name="universe"', 22, "joint 'universe', as Pinocchio calls the world"),
    "joint without type": (' type="revolute"', "", 22, "no attribute 'type'"),
    "joint type": ("revolute", "revolut", 22, "did you mean 'revolute'?"),
    "no parent": ('<parent link="cart"/>', "", 22, "has no <parent>"),
    "no child": ('<child link="bar"/>', "", 22, "has no <child>"),
    "parent twice": ('<parent link="cart"/>', '<parent link="cart"/><parent link="world"/>', 23, "second <parent>"),
    "parent names no link": ('<parent link="cart"/>', "<parent/>", 23, "has no attribute 'link'"),
    "unknown link": ('<child link="bar"/>', '<child link="baar"/>', 24, "names nothing in this file; did you mean 'bar'?"),
    "two roots": ('<link name="world"/>', '<link name="world"/><link name="stray"/>', 2, "'stray' hangs on no joint, nor does 'world'"),
    "two parents": ('<child link="bar"/>', '<child link="cart"/>', 22, "carries link 'cart', and so does"),
    "cycle": ('<parent link="world"/>', '<parent link="bar"/>', 16, "a cycle that link 'world' does not reach"),
    "axis zero": ('xyz="1 0 0"', 'xyz="0 0 0"', 19, "is zero"),
    "axis not unit": ('xyz="0 -1 0"', 'xyz="0 -2 0"', 25, "has length 2"),
    "axis long": ('xyz="1 0 0"', 'xyz="1 0 0 0"', 19, "holds 4 numbers; expected 3"),
    "no limit": (
        '<axis xyz="1 0 0"/>\n    <limit',
        '<axis xyz="1 0 0"/>\n    <bound',
        20,
        '<bound> in <joint name="slide"> is not understood',
    ),
    "no limit at all": ('<limit lower="-1e9" upper="1e9" effort="1e9" velocity="1e9"/>', "", 22, "has no <limit>"),
    "limit without effort": (' effort="1e9"', "", 20, "no attribute 'effort'"),
    "no inertial": (INERTIAL, "", 3, "moves but has no <inertial>"),
    "inertial misspelt": ("inertial>", "innertial>", 4, "<innertial> in <link name=\"cart\"> is unknown; did you mean 'inertial'?"),
    "no mass": ('<mass value="10"/>', "", 4, "has no <mass>"),
    "no inertia": ('<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>', "", 4, "has no <inertia>"),
    "mass without value": ('<mass value="10"/>', "<mass/>", 6, "no attribute 'value'"),
    "mass negative": ('value="10"', 'value="-10"', 6, "is negative"),
    "leaf without mass": ('<mass value="1"/>', '<mass value="0"/>', 12, "not positive"),
    "origin malformed": ('xyz="0 0 0"', 'xyz="0 0"', 5, "holds 2 numbers; expected 3"),
    "inertia incomplete": (' ixy="0"', "", 7, "no attribute 'ixy'"),
    "inertia negative": ('izz="1"', 'izz="-1"', 7, "expected none below zero"),
    "inertia triangle": ('izz="0"', 'izz="0.07"', 13, "expected the two smaller to sum to the largest"),
    "inertia indefinite": ('ixy="0"', 'ixy="2"', 7, "expected none below zero"),
    "damping malformed": ('damping="0.2"', 'damping="0.2 0"', 27, "holds 2 numbers; expected 1"),
    "dynamics of nothing": (' damping="0.2" friction="0"', "", 27, "has no damping"),
    "damping negative": ('damping="0.2"', 'damping="-0.2"', 27, "is negative"),
    "dry friction": ('friction="0"', 'friction="-0.1"', 27, "is negative"),
    "damping of a fixed joint": (
        "</robot>",
        '<link name="eye"/><joint name="w" type="fixed"><dynamics damping="1"/><parent link="world"/><child link="eye"/></joint></robot>',
        42,
        '<joint name="w"> is fixed; a damper needs a joint that is revolute or continuous or prismatic',
    ),
    "damping of a floating joint": ("revolute", "floating", 27, "is floating; a damper needs a joint"),
    "spring on an unknown joint": ('reference="slide"', 'reference="slyde"', 29, "did you mean 'slide'?"),
    "spring on a link": ('reference="slide"', 'reference="bar"', 29, "names nothing in this file"),
    "spring on nothing": (' reference="slide"', "", 29, "has no attribute 'reference'"),
    "spring on a floating joint": ("prismatic", "floating", 29, "is floating; a spring needs a joint"),
    "spring without stiffness": ("<springStiffness>270</springStiffness>", "", 29, "has no <springStiffness>"),
    "spring without reference": ("<springReference>0</springReference>", "", 29, "has no <springReference>"),
    "spring reference empty": (">0<", "><", 31, "holds 0 numbers"),
    "spring twice": ("</gazebo>", "</gazebo>" + SECOND_SPRING, 33, "second spring"),
    "point spring on an unknown link": ('_B name="bar"', '_B name="bra"', 36, "did you mean 'bar'?"),
    "point spring without a body": ("damper_body_A", "damper_body_C", 34, "did you mean 'drake:linear_spring_damper_body_B'?"),
    "point spring without body A": (
        '<drake:linear_spring_damper_body_A name="world"/>',
        "",
        33,
        "has no <drake:linear_spring_damper_body_A>",
    ),
    "point spring without stiffness": ("damper_stiffness", "damper_stifness", 39, "did you mean 'drake:linear_spring_damper_stiffness'?"),
    "point spring part twice": ("damper_p_BQ", "damper_p_AP", 37, "second <drake:linear_spring_damper_p_AP>"),
    "point short": ('value="0 0 -0.6"', 'value="0 -0.6"', 37, "holds 2 numbers; expected 3"),
    "free length zero": ('length value="2.5"', 'length value="0"', 38, "not positive"),
    "point spring negative": ('stiffness value="120"', 'stiffness value="-120"', 39, "is negative"),
    "point damping without value": ('damping value="0"', 'damping valu="0"', 40, "did you mean 'value'?"),
    "point damping empty": ('damping value="0"', "damping", 40, "has no attribute 'value'"),
    "dynamics misspelt": ("<dynamics", "<dynamic", 27, "<dynamic> in <joint name=\"pin\"> is unknown; did you mean 'dynamics'?"),
    "damping misspelt": ('damping="0.2"', 'dampng="0.2"', 27, "did you mean 'damping'?"),
    "limit misspelt": ("upper=", "uper=", 20, "did you mean 'upper'?"),
    "link with a type": ('<link name="bar"', '<link name="bar" type="x"', 10, "is not understood; expected one of 'name'"),
    "element of another reader": ("</robot>", "<xacro/></robot>", 42, '<xacro> in <robot name="template"> is not understood'),
    "text in a mass": ('<mass value="10"/>', "<mass>10</mass>", 6, "has no attribute 'value'"),
    "text in a link": ('<link name="world"/>', '<link name="world">fixed</link>', 2, "holds the text 'fixed'"),
    "mimic of nothing": (DAMPER, '<mimic joint="slyde"/>', 27, "did you mean 'slide'?"),
    "mimic of itself": (DAMPER, '<mimic joint="pin"/>', 27, "mimics 'pin', which mimics it"),
    "mimic twice": (DAMPER, '<mimic joint="slide"/><mimic joint="slide"/>', 27, "second <mimic>"),
    "mimic with a word": (DAMPER, '<mimic joint="slide" multiplier="minus"/>', 27, "'minus'"),
    "mimic by a floating joint": (
        f'type="revolute">\n    <parent link="cart"/>\n    <child link="bar"/>\n    <axis xyz="0 -1 0"/>\n    {LIMIT}\n    {DAMPER}',
        'type="floating">\n    <parent link="cart"/>\n    <child link="bar"/>\n    <mimic joint="slide"/>',
        25,
        "is floating; both joints of a mimic must be",
    ),
    "spring in a mimic": (
        f'{DAMPER}\n  </joint>\n  <gazebo reference="slide">',
        '<mimic joint="slide"/></joint><gazebo reference="pin">',
        27,
        "has a spring in a joint that mimics",
    ),
    "damper in a mimic": ('<axis xyz="0 -1 0"/>', '<axis xyz="0 -1 0"/><mimic joint="slide"/>', 22, "has a damper in a joint that mimics"),
    "safety controller": ('<axis xyz="0 -1 0"/>', '<safety_controller k_velocity="1"/>', 25, "<safety_controller> is not felt"),
    "calibration": ('<axis xyz="0 -1 0"/>', '<calibration rising="0"/>', 25, "<calibration> is not felt"),
    "visual": ('<link name="world"/>', '<link name="world"><visual/></link>', 2, "declare it by the comment <!-- decoration: visual -->"),
    "collision": ('<link name="world"/>', '<link name="world"><collision/></link>', 2, "<collision> is decoration"),
    "material": ("</robot>", '<material name="m"/></robot>', 42, "<material> is decoration"),
    "decoration that is none": ("</robot>", "<!-- decoration: gazebo --></robot>", 42, "declares 'gazebo' as decoration"),
    "other Gazebo extension": ("</gazebo>", "<plugin/></gazebo>", 32, "<plugin> in <gazebo> is a Gazebo extension that is not read"),
    "other Drake extension": ("</robot>", "<drake:collision_filter_group/></robot>", 42, "is a Drake extension that is not read"),
    "Drake acceleration limit": ('effort="1e9"', 'effort="1e9" drake:acceleration="1"', 20, "is not understood"),
    "transmission of nothing": transmission("has no <drake:rotor_inertia>", ""),
    "transmission without type": transmission(
        "has no <type>; expected <type>transmission_interface/SimpleTransmission</type>", old=TYPE, new=""
    ),
    "transmission without joint": transmission("has no <joint>; add it", old='<joint name="pin"/>', new=""),
    "other transmission": transmission("is of type 'transmission_interface/DifferentialTransmission'", old="Simple", new="Differential"),
    "transmission of no joint": transmission("did you mean 'pin'?", "", "pin", "pim"),
    "two transmissions": ("</robot>", 2 * (TRANSMISSION + ROTOR + "</actuator></transmission>") + "</robot>", 42, "second transmission"),
    "transmission twice geared": transmission("second <drake:gear_ratio>", ROTOR + 2 * '<drake:gear_ratio value="62"/>'),
    "rotor inertia negative": transmission("is negative", old="2e-4", new="-2e-4"),
    "rotor inertia misspelt": transmission("did you mean 'drake:rotor_inertia'?", old="inertia", new="inertias"),
    "mechanical reduction": transmission("write the ratio as <drake:gear_ratio>", f"{ROTOR}<mechanicalReduction>62</mechanicalReduction>"),
    "hardware interface": transmission("<hardwareInterface> is decoration", f"{ROTOR}<hardwareInterface>x</hardwareInterface>"),
    "bushing": ("</robot>", "<drake:linear_bushing_rpy/></robot>", 42, "is a force element that is not read"),
}

MALFORMED = [
    pytest.param(model_format, *mutation, id=f"{model_format}-{name}")
    for model_format, mutations in (("mjcf", MALFORMED_MJCF), ("urdf", MALFORMED_URDF))
    for name, mutation in mutations.items()
]


@pytest.mark.parametrize(("model_format", "old", "new", "line", "fragment"), MALFORMED)
def test_malformed_models_are_refused_at_their_line(read: Reader, model_format: str, old: str, new: str, line: int, fragment: str) -> None:
    assert old in TEMPLATES[model_format]
    error = refusal(read, TEMPLATES[model_format].replace(old, new), model_format)
    assert fragment in error.problem
    assert error.line == line


NO_NUMBERS = ["nan", "inf", "1e400", "0x1", "1_0", "1O", "270N/m", "2,5", "?"]


@pytest.mark.ci
@pytest.mark.parametrize("model_format", TEMPLATES)
def test_each_number_must_be_a_finite_decimal(read: Reader, model_format: str) -> None:
    """Whatever it is of, be it in an attribute or between two tags."""
    template = TEMPLATES[model_format]
    for element in find_elements(template, model_format):
        for number, word in itertools.product((number for one in element.attributes for number in one.numbers), NO_NUMBERS):
            error = refusal(read, template[: number.start] + word + template[number.end :], model_format)
            assert (error.line, "expected a finite decimal number" in error.problem, word in error.problem) == (element.line, True, True)


def chain(links: int) -> str:
    """A URDF of ``links`` point masses, one joint below the other."""
    mass = '<inertial><mass value="1"/><inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/></inertial>'
    limit = '<limit effort="1" velocity="1"/>'
    parts = [
        f'<link name="l{i}">{mass}</link>\n'
        f'<joint name="j{i}" type="revolute"><parent link="l{i - 1}"/><child link="l{i}"/><axis xyz="0 1 0"/>{limit}</joint>\n'
        for i in range(1, links + 1)
    ]
    return f'<robot name="chain">\n<link name="l0"/>\n{"".join(parts)}</robot>'


RIGID = '<joint name="weld" type="fixed"><parent link="a"/><child link="b"/></joint>'
LOOP = '<joint name="j" type="continuous"><parent link="a"/><child link="b"/></joint>\n<joint name="k" type="continuous">'
WHOLE_FILES = {
    "empty": ("mjcf", b"", None, "is empty; expected a <mujoco> model"),
    "blank": ("urdf", b" \n\t", None, "is empty; expected a <robot> model"),
    "byte order mark only": ("urdf", "\ufeff".encode(), None, "is empty"),
    "truncated": ("urdf", URDF[: URDF.index("<axis")].encode(), 19, "not well-formed"),
    "truncated in a tag": ("mjcf", MJCF[: MJCF.index("axis")].encode(), 7, "not well-formed"),
    "not XML": ("mjcf", b"joint: pin\n", 1, "not well-formed"),
    "not UTF-8": ("mjcf", MJCF.replace("cart", "caf\u00e9").encode("latin-1"), 6, "byte 0xe9 is not UTF-8"),
    "UTF-16": ("urdf", URDF.encode("utf-16"), None, "is in UTF-16"),
    "too large": ("mjcf", b" " * (MAXIMUM_BYTES + 1), None, f"larger than {MAXIMUM_BYTES} bytes"),
    "not UTF-8 after an empty line": ("mjcf", b"\n\n<mujoco>\xe9", 3, "byte 0xe9 is not UTF-8"),
    "too deep after many that are closed": (
        "mjcf",
        b"<mujoco>\n" + b"<body></body>\n" * 5 + b"<body>" * MAXIMUM_DEPTH,
        7,
        f"nested more than {MAXIMUM_DEPTH} deep",
    ),
    "too many": (
        "mjcf",
        b"<mujoco>\n" + b"<body/>\n" * MAXIMUM_ELEMENTS,
        MAXIMUM_ELEMENTS + 1,
        f"is element {MAXIMUM_ELEMENTS + 1} of the file",
    ),
    "too deep": ("mjcf", b"<mujoco>\n" + b"<body>" * (MAXIMUM_DEPTH - 1) + b"\n<body>", 3, f"nested more than {MAXIMUM_DEPTH} deep"),
    "chain too deep": ("urdf", chain(MAXIMUM_DEPTH).encode(), 2 * MAXIMUM_DEPTH + 1, f"more than {MAXIMUM_DEPTH} joints from the root"),
    "MJCF without joints": ("mjcf", b"<mujoco><worldbody><body/></worldbody></mujoco>", 1, "no joint in any body"),
    "URDF without links": ("urdf", b'<robot name="r"/>', 1, "has no link"),
    "URDF without joints": ("urdf", b'<robot name="r">\n<link name="a"/></robot>', 1, "no moving joint"),
    "URDF with fixed joints only": (
        "urdf",
        f'<robot name="r"><link name="a"/><link name="b"/>{RIGID}</robot>'.encode(),
        1,
        "no moving joint",
    ),
    "URDF without a root": (
        "urdf",
        f'<robot name="r"><link name="a"/><link name="b"/>\n{LOOP}<parent link="b"/><child link="a"/></joint></robot>'.encode(),
        2,
        "form a cycle",
    ),
}


@pytest.mark.parametrize(("model_format", "content", "line", "fragment"), WHOLE_FILES.values(), ids=WHOLE_FILES)
def test_unusable_files_are_refused(read: Reader, model_format: str, content: bytes, line: int | None, fragment: str) -> None:
    error = refusal(read, content, model_format)
    assert fragment in error.problem
    assert error.line == line


def test_unreadable_paths_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    loop, pipe, locked = tmp_path / "loop.xml", tmp_path / "pipe.xml", tmp_path / "locked.xml"
    loop.symlink_to(loop)
    os.mkfifo(pipe)
    locked.write_text(MJCF)
    cases = {
        tmp_path / "none.xml": "no such file",
        tmp_path: "is a directory",
        pipe: "is a FIFO; expected a model file",
        loop: "cannot be read: Too many levels of symbolic links",
        tmp_path / "null\0.xml": "cannot be read: embedded null byte",
        locked: "cannot be read: Permission denied",
    }

    def refuse_locked(path: Path, *arguments: object) -> object:
        raise PermissionError(13, "Permission denied", path)

    monkeypatch.setattr(Path, "open", refuse_locked)  # the superuser may read a file that nobody may
    for path, fragment in cases.items():
        with pytest.raises(InvalidModel) as caught:
            read_model(path, "mjcf")
        assert fragment in caught.value.problem
        assert caught.value.line is None


def test_unknown_format_is_a_programming_error(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="expected one of"):
        read_model(tmp_path, "sdf")


VALID_VARIANTS = {
    "byte order mark": ("mjcf", "<?xml", "\ufeff<?xml"),
    "declared encoding that is not used": ("mjcf", '<?xml version="1.0"?>', '<?xml version="1.0" encoding="latin-1"?><!-- \u00e9 -->'),
    "unit axis rounded to eight digits": ("mjcf", '1 0 0" stiffness', '0.70710678 0 0.70710678" stiffness'),
    "principal moments that sum up to rounding": ("mjcf", "0.03 0.03 0.001", "0.3 0.1 0.2"),
    "thin plate": ("urdf", 'iyy="0.03" iyz="0" izz="0"', 'iyy="0.03" iyz="0" izz="0.06"'),
    "zero axis in a fixed joint": (
        "urdf",
        "</robot>",
        '<link name="eye"/><joint name="weld" type="fixed"><axis xyz="0 0 0"/><parent link="world"/><child link="eye"/></joint></robot>',
    ),
    "massless link between two joints": ("urdf", '<mass value="10"/>', '<mass value="0"/>'),
    "declared decoration in MJCF": (
        "mjcf",
        "<worldbody>",
        '<!-- decoration: geom asset rgba, visual --><option><flag contact="disable"/></option><visual><map znear="1"/></visual>'
        '<asset><material name="steel"/></asset><worldbody><geom size="1"/><site name="s" rgba="1 0 0 1"/>',
    ),
    "declared decoration in URDF": (
        "urdf",
        '<link name="world"/>',
        '<!-- decoration: visual\nmaterial --><material name="red"/><link name="world"><visual><geometry><box size="1 1 1"/></geometry>'
        "</visual></link>",
    ),
    "stages switched off": ("mjcf", "<worldbody>", '<option><flag limit="disable" island="enable"/></option><worldbody>'),
    "classes": ("mjcf", "<worldbody>", '<default><default class="c"><joint damping="1"/></default></default><worldbody>'),
}


@pytest.mark.parametrize(("model_format", "old", "new"), VALID_VARIANTS.values(), ids=VALID_VARIANTS)
def test_unusual_but_valid_models_are_read(read: Reader, model_format: str, old: str, new: str) -> None:
    assert old in TEMPLATES[model_format]
    changed = TEMPLATES[model_format].replace(old, new)
    model = read(changed, model_format)
    assert model.text == changed
    assert list(model.joint_lines) == ["slide", "pin"]


edits = st.lists(
    st.tuples(
        st.floats(0, 1),
        st.integers(0, 12),
        st.sampled_from(["", "", "-", "0", "9", "e", " ", '"', "<", ">", "/", "&", "n", "\0", "\u00e9"]),
    ),
    min_size=1,
    max_size=4,
)


@pytest.mark.ci
@pytest.mark.parametrize("model_format", SUFFIXES)
@settings(max_examples=100, deadline=None)
@given(data=st.data(), changes=edits, keep=st.one_of(st.just(1.0), st.floats(0, 1)))
def test_a_damaged_model_is_read_or_refused(
    tmp_path_factory: pytest.TempPathFactory, model_format: str, data: st.DataObject, changes: list[tuple[float, int, str]], keep: float
) -> None:
    text = data.draw(st.sampled_from([path for path, format in SHIPPED if format == model_format])).read_text()
    text = text[: round(keep * len(text))]
    for where, removed, inserted in changes:
        start = round(where * len(text))
        text = text[:start] + inserted + text[start + removed :]
    path = tmp_path_factory.getbasetemp() / f"damaged{SUFFIXES[model_format]}"
    path.write_text(text)
    try:
        assert read_model(path, model_format).joint_lines
    except InvalidModel as error:
        assert error.problem and "\n" not in str(error)


BALL = """<robot name="top" xmlns:drake="http://drake.mit.edu">
  <link name="top"><inertial><mass value="2"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
  <drake:joint name="pivot" type="ball"><parent link="world"/><child link="top"/></drake:joint>
</robot>
"""


def test_a_ball_joint_hangs_the_root_link_on_the_world(tmp_path: Path) -> None:
    path = tmp_path / "top.urdf"
    path.write_text(BALL)
    model = read_model(path, "urdf")
    assert model.ball_joint == "pivot"
    assert model.joint_lines == {"pivot": 3}


@pytest.mark.parametrize(
    ("old", "new", "fragment"),
    [
        ('type="ball"', 'type="universal"', "universal"),
        ('parent link="world"', 'parent link="top"', "expected 'world'"),
        ('child link="top"', 'child link="tip"', "names nothing in this file; did you mean 'top'"),
        ("<parent", "<parnt", "parnt"),
        ('<mass value="2"/>', '<mass value="0"/>', "mass"),
        ("</robot>", '<drake:joint name="b" type="ball"><parent link="world"/><child link="top"/></drake:joint></robot>', "second"),
        ("</robot>", '<link name="world"/></robot>', "<drake:joint> knows by itself; remove the link"),
        (' name="pivot"', "", "name"),
    ],
)
def test_a_wrong_ball_joint_is_refused(tmp_path: Path, old: str, new: str, fragment: str) -> None:
    path = tmp_path / "top.urdf"
    assert old in BALL
    path.write_text(BALL.replace(old, new))
    with pytest.raises(InvalidModel, match=fragment):
        read_model(path, "urdf")


@pytest.mark.parametrize("version", ["0.0", "1", "1.1"])
def test_the_version_of_an_xml_declaration_says_nothing(version: str, read: Reader) -> None:
    """Both engines read such files, and a quarter of a public collection is written so."""
    assert MJCF.startswith('<?xml version="1.0"?>')
    text = MJCF.replace('version="1.0"', f'version="{version}"')
    model, plain = read(text, "mjcf"), read(MJCF, "mjcf")
    assert model.text == text and model.joint_lines == plain.joint_lines and model.force_elements == plain.force_elements


@pytest.mark.parametrize("model_format", ["mjcf", "urdf"])
def test_a_file_with_one_number_changed_has_the_other_numbers_of_the_file(model_format: str) -> None:
    """A diagnosis reads it a thousand times: the numbers are made once, each at its own place, defaults among them."""
    model = read_model(Library.built_in().model_path("double_pendulum", model_format), model_format)
    tag, name = ("inertial", "mass") if model_format == "mjcf" else ("mass", "value")
    number = next(one for one in find_numbers(model.text, model_format) if (one.element, one.attribute) == (tag, name))
    changed = model.with_text(with_values(model.text, {number: 2 * number.value}))
    pairs = list(zip(*(every_number_in(meaning_of(one).tree) for one in (model, changed)), strict=True))
    assert [one.key for one, _ in pairs] == [other.key for _, other in pairs]
    assert [(float(one), float(other)) for one, other in pairs if one != other] == [(number.value, 2 * number.value)]
    # Those that stand for nothing in the file, as the gravity of a URDF, are made anew.
    assert len(pairs) > 20 and sum(one is not other for one, other in pairs) <= len(pairs) / 10
