"""Engines reading the format that is not their own: every element and attribute that a model file may hold is read, supplied or refused.

The native reader of each format is the measure. Each entry of the tables changes one thing in a small model, and says what
the other engine makes of it; that the tables leave nothing out is held against ``harness.files.lint.formats``.
"""

from __future__ import annotations

import contextlib
import io
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from comparison.robots import record_of
from scipy.spatial.transform import Rotation

from harness.arrays import Array
from harness.engines import Subject, Unsupported, is_native, load_engine, select_subjects
from harness.errors import InvalidModel
from harness.files.equalities import Linkage
from harness.files.lint.formats import SUPPORTED
from harness.files.model_file import JointDamper, JointSpring, ModelFile, PointSpring, parse_model
from harness.library import Library

LIBRARY = Library.built_in()
NATIVE, OTHER = {"mjcf": "mujoco", "urdf": "pinocchio"}, {"mjcf": "pinocchio", "urdf": "mujoco"}
JOINTS = ("shoulder", "slider")
COUNT = 4
SECTIONS = "sections that are read once"
# What rounding in two engines leaves, and what a change that is felt exceeds by far.
SAME, FELT = 1e-11, 1e-7

MJCF = """\
<mujoco model="base">
  <compiler angle="radian"/>
  <option gravity="1 2 -9.81"><flag constraint="disable"/></option>
  <default>
    <joint armature="0.01"/>
    <default class="other"><joint armature="0.02"/></default>
  </default>
  <worldbody>
    <site name="wall" pos="0.3 -0.2 0.9"/>
    <body name="upper" pos="0.1 0.2 0.3">
      <joint name="shoulder" axis="0 1 0"/>
      <inertial pos="0.1 0 -0.2" mass="2" diaginertia="0.1 0.2 0.25"/>
      <body name="fore" pos="0 0.1 -0.5">
        <joint name="slider" type="slide" axis="1 0 0" stiffness="8"/>
        <inertial pos="0 0.05 -0.1" mass="0.5" diaginertia="0.02 0.03 0.04"/>
        <site name="eye" pos="0.1 0 -0.3"/>
      </body>
    </body>
  </worldbody>
  <tendon>
    <spatial name="cord" stiffness="30" springlength="0.4"><site site="wall"/><site site="eye"/></spatial>
  </tendon>
</mujoco>
"""
URDF = """\
<robot name="base" xmlns:drake="http://drake.mit.edu">
  <link name="world"/>
  <link name="upper"><inertial>
    <origin xyz="0.1 0 -0.2"/>
    <mass value="2"/>
    <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.2" iyz="0" izz="0.25"/>
  </inertial></link>
  <link name="fore"><inertial>
    <mass value="0.5"/>
    <inertia ixx="0.02" ixy="0" ixz="0" iyy="0.03" iyz="0" izz="0.04"/>
  </inertial></link>
  <joint name="shoulder" type="revolute">
    <parent link="world"/>
    <child link="upper"/>
    <origin xyz="0.1 0.2 0.3"/>
    <axis xyz="0 1 0"/>
    <limit effort="5" velocity="1"/>
  </joint>
  <joint name="slider" type="prismatic">
    <parent link="upper"/>
    <child link="fore"/>
    <axis xyz="1 0 0"/>
    <limit effort="5" velocity="1"/>
  </joint>
</robot>
"""
SPRING = """<drake:linear_spring_damper>
    <drake:linear_spring_damper_body_A name="world"/>
    <drake:linear_spring_damper_p_AP value="0.3 -0.2 0.9"/>
    <drake:linear_spring_damper_body_B name="fore"/>
    <drake:linear_spring_damper_p_BQ value="0.1 0 -0.3"/>
    <drake:linear_spring_damper_free_length value="0.4"/>
    <drake:linear_spring_damper_stiffness value="30"/>
    <drake:linear_spring_damper_damping value="2"/>
  </drake:linear_spring_damper>"""
ROTOR = """<transmission name="gear"><type>transmission_interface/SimpleTransmission</type><joint name="shoulder"/>
    <actuator name="motor"><drake:rotor_inertia value="0.01"/><drake:gear_ratio value="3"/></actuator></transmission>"""
TYPED_ROTOR = re.sub("<type>.*</type>", "", ROTOR).replace('"gear"', '"gear" type="transmission_interface/SimpleTransmission"')
BALL = '<drake:joint name="shoulder" type="ball"><parent link="world"/><child link="upper"/></drake:joint>'
GAZEBO = '<gazebo reference="shoulder"><springStiffness>7</springStiffness><springReference>0.3</springReference></gazebo>'
BASES = {"mjcf": MJCF, "urdf": URDF}

# What comes of a change: both engines feel it alike, neither feels it, the other engine reads it otherwise as a reading says, or by a
# finding that no tree expresses, or else it refuses it with these words.
ALIKE, UNFELT, READ, APART = "felt alike", "not felt", "read otherwise: ", "read as no tree"
NO_SITE = "line 21: <site> is not the name of a site right inside a named body"
# A file that is nobody's to compare.
NATIVE_REFUSES = "native refuses"
# Texts, what stands in their place, what comes of it.
Variant = tuple[Sequence[str], Sequence[str], str]

SHOULDER, SLIDER, UPPER = '<joint name="shoulder" axis="0 1 0"', '<joint name="slider"', '<body name="upper" pos="0.1 0.2 0.3"'
INERTIAL, EYE, CORD = 'mass="2" diaginertia="0.1 0.2 0.25"', '<site name="eye" pos="0.1 0 -0.3"', '<spatial name="cord"'
JOINT_DEFAULT, RADIANS = '<joint armature="0.01"', '<compiler angle="radian"/>'
TURNS = {
    "quat": "0.9 0.1 -0.3 0.2",
    "axisangle": "0.6 0 0.8 0.7",
    "euler": "0.3 -0.4 0.5",
    "xyaxes": "0.6 0.8 0.1 0 1 0.3",
}
# Both engines read it, by formulas that differ near z and -z.
ZAXIS = "0.3 0.4 0.9"


def one(old: str, new: str, outcome: str = ALIKE) -> Variant:
    """A change in one place."""
    return [old], [new], outcome


# Dry friction and limits, which act where a mechanism declares them.
BOUNDS = {
    "frictionloss": "0.3",
    "limited": "false",
    "range": "-0.1 0.1",
    **dict.fromkeys(("solreffriction", "solreflimit"), "0.05 1"),
    **dict.fromkeys(("solimpfriction", "solimplimit"), "0.8 0.9 0.01 0.5 2"),
}


def driving() -> dict[str, list[Variant]]:
    """Actuators, which act where a mechanism declares them."""
    shared = {"name": "drive", "joint": "slider", "gear": "3", "ctrlrange": "-1 2", "forcerange": "-3 4"}
    shared |= dict.fromkeys(("ctrllimited", "forcelimited"), "false")
    of_kinds: dict[str, dict[str, str]] = {"motor": {}, "position": {"kp": "5", "kv": "2"}, "velocity": {"kv": "2"}}
    found = {}
    for tag, own in of_kinds.items():
        for name, value in {**shared, **own}.items():
            attributes = {"name": "drive", "joint": "slider", name: value}
            written = " ".join(f'{key}="{text}"' for key, text in attributes.items())
            found[f"actuator/{tag}@{name}"] = [one("</mujoco>", f"<actuator><{tag} {written}/></actuator></mujoco>", UNFELT)]
        pulled = [
            f'<fixed name="sum"><joint joint="slider" coef="2"/></fixed></tendon><actuator><{tag} name="drive" tendon="sum"/></actuator>'
        ]
        found[f"actuator/{tag}@tendon"] = [(["</tendon>"], pulled, UNFELT)]
    return found


def added(key: str, after: str, attributes: Mapping[str, tuple[str, str]]) -> dict[str, list[Variant]]:
    """Attributes, each with its value and outcome, put behind a text."""
    return {f"{key}@{name}": [one(after, f'{after} {name}="{value}"', outcome)] for name, (value, outcome) in attributes.items()}


def alike(attributes: Mapping[str, str], outcome: str = ALIKE) -> dict[str, tuple[str, str]]:
    return {name: (value, outcome) for name, value in attributes.items()}


def with_default(tag: str, attribute: str, value: str, own: str, outcome: str = ALIKE) -> Variant:
    """An attribute that a default class gives instead of the element."""
    return [JOINT_DEFAULT, own], [f'<{tag} {attribute}="{value}"/>{JOINT_DEFAULT}', ""], outcome


def partial(default: str, own: str, attribute: str, outcome: str = ALIKE) -> Variant:
    """A list in a default class, and one in the element."""
    return [JOINT_DEFAULT, own], [default, f"{own} {attribute}"], outcome


def fixed(attributes: str, outcome: str = UNFELT) -> list[Variant]:
    joints = '<joint joint="shoulder" coef="2"/><joint joint="slider" coef="-1"/>'
    return [one(CORD, f'<fixed name="coupling"{attributes}>{joints}</fixed>{CORD}', outcome)]


NOT_STRAIGHT, INERTIA = "line 21: .*does not run straight from one site to another", "is an inertia in a tendon"
FLAGS = {
    f"flag@{flag}": [one("<flag ", f'<flag {flag}="disable" ', UNFELT)]
    for flag in SUPPORTED["mjcf"]["option"]["flag"]
    if flag not in ("constraint", "diagexact")
}
MJCF_VARIANTS: dict[str, list[Variant]] = {
    "mujoco@model": [one('model="base"', 'model="x"', UNFELT), one(' model="base"', "", UNFELT)],
    "compiler@angle": [
        one(RADIANS, '<compiler angle="degree"/>', UNFELT),
        ([RADIANS, SHOULDER], ["", f'{SHOULDER} stiffness="9" springref="30" ref="10"'], ALIKE),
        ([RADIANS, UPPER], ["", f'{UPPER} euler="20 30 -40"'], ALIKE),
        ([RADIANS, UPPER], ["", f'{UPPER} axisangle="0 0 1 20"'], ALIKE),
    ],
    "compiler@eulerseq": [
        ([RADIANS, UPPER], ['<compiler angle="radian" eulerseq="zyx"/>', f'{UPPER} euler="0.3 -0.4 0.5"'], ALIKE),
        (
            [RADIANS, UPPER],
            ['<compiler angle="radian" eulerseq="XYZ"/>', f'{UPPER} euler="0.3 -0.4 0.5"'],
            f"{READ}Euler angles about fixed axes",
        ),
        one(RADIANS, '<compiler angle="radian" eulerseq="XYZ"/>', UNFELT),
    ],
    "compiler@fusestatic": [
        one(RADIANS, '<compiler angle="radian" fusestatic="true"/>', UNFELT),
        (
            [RADIANS, f"{EYE}/>"],
            [
                '<compiler angle="radian" fusestatic="true"/>',
                f'{EYE}/><body name="tip" pos="0.1 0.2 -0.3" quat="0.9 0.1 -0.3 0.2">'
                '<inertial pos="0 0.1 0" mass="0.4" diaginertia="0.01 0.02 0.025"/></body>',
            ],
            ALIKE,
        ),
    ],
    "option@gravity": [one('gravity="1 2 -9.81"', 'gravity="-3 1 4"'), one(' gravity="1 2 -9.81"', "")],
    **FLAGS,
    "flag@constraint": [one('constraint="disable"', 'constraint="enable"', UNFELT)],
    "flag@gravity": [one("<flag ", '<flag gravity="disable" ')],
    "flag@spring": [one("<flag ", '<flag spring="disable" ')],
    "flag@damper": [
        (["<flag ", SHOULDER], ['<flag damper="enable" ', f'{SHOULDER} damping="2"'], ALIKE),
        (["<flag ", SHOULDER], ['<flag damper="disable" ', f'{SHOULDER} damping="2"'], UNFELT),
    ],
    "default@class": [one("<default>", '<default class="main">', UNFELT)],
    "default/default@class": [one('class="other"', 'class="another"', UNFELT)],
    **added("body", UPPER, {**alike(TURNS), "childclass": ("other", ALIKE)}),
    "body@zaxis": [
        one(UPPER, f'{UPPER} zaxis="0 0 2"', UNFELT),
        one(UPPER, f'{UPPER} zaxis="{ZAXIS}"'),
        one(UPPER, f'{UPPER} zaxis="0 0 -2"'),
        # About another axis, or with fewer digits.
        *(one(UPPER, f'{UPPER} zaxis="{zaxis}"', APART) for zaxis in ("1e-7 0 -1", "1e-5 0 -1")),
    ],
    "body@name": [one('name="fore"', 'name="hand"', UNFELT), one(' name="fore"', "", NO_SITE)],
    "body@pos": [one('pos="0 0.1 -0.5"', 'pos="0.2 0.3 -0.5"'), one(' pos="0 0.1 -0.5"', "")],
    "body@axisangle": [
        one(UPPER, f'{UPPER} axisangle="0.6 0 0.8 0.7"'),
        one(UPPER, f'{UPPER} axisangle="3 0 4 0.7"', APART),
    ],
    **added("inertial", INERTIAL, alike(TURNS | {"zaxis": ZAXIS})),
    "inertial@pos": [one('pos="0.1 0 -0.2"', 'pos="0.1 0.3 -0.4"')],
    "inertial@mass": [one('mass="2"', 'mass="3"')],
    "inertial@diaginertia": [one('diaginertia="0.1 0.2 0.25"', 'diaginertia="0.1 0.25 0.2"')],
    "inertial@fullinertia": [one('diaginertia="0.1 0.2 0.25"', 'fullinertia="0.1 0.22 0.25 0.01 0.02 -0.03"')],
    **added("joint", SHOULDER, alike({"pos": "0.1 0.3 -0.2", "stiffness": "4", "damping": "5", "armature": "0.5", "class": "other"})),
    **added("joint", SHOULDER, alike(BOUNDS, UNFELT)),
    "joint@springref": [one(SHOULDER, f'{SHOULDER} springref="0.3"', UNFELT), one(SLIDER, f'{SLIDER} springref="0.3"')],
    "joint@name": [one('name="slider"', 'name="glider"', UNFELT)],
    "joint@type": [one('type="slide"', 'type="hinge"'), one(' type="slide"', "")],
    "joint@axis": [one('axis="0 1 0"', 'axis="0.6 0 0.8"'), one(' axis="0 1 0"', "")],
    "joint@stiffness": [
        one(SHOULDER, f'{SHOULDER} stiffness="4" springref="0.3"'),
        one(SLIDER, f'{SLIDER} springref="0.3" ref="0.2"'),
        one(SHOULDER, f'{SHOULDER} stiffness="4 1"', 'line 11: <joint name="shoulder"> stiffness="4 1" is not linear'),
        # A shorter list takes the rest from the class, and the class from that around it.
        partial(
            f'{JOINT_DEFAULT} stiffness="4 1"', SHOULDER, 'stiffness="5"', 'line 5: <joint name="shoulder"> stiffness="4 1" is not linear'
        ),
        partial(
            f'{JOINT_DEFAULT} stiffness="4 1"', SHOULDER, 'stiffness="5 0"', 'line 5: <joint name="slider"> stiffness="4 1" is not linear'
        ),
        partial(f'{JOINT_DEFAULT} stiffness="4 0"', SHOULDER, 'stiffness="5"'),
    ],
    "joint@damping": [
        one(SHOULDER, f'{SHOULDER} damping="4 0 0"'),
        one(SHOULDER, f'{SHOULDER} damping="0 0 1"', 'line 11: <joint name="shoulder"> damping="0 0 1" is not linear'),
        partial(f'{JOINT_DEFAULT} damping="4 1"', SHOULDER, 'damping="5"', 'line 5: <joint name="shoulder"> damping="4 1" is not linear'),
    ],
    "joint@ref": [
        one(SHOULDER, f'{SHOULDER} ref="0.4"'),
        one(SLIDER, f'{SLIDER} ref="0.4"'),
    ],
    "joint@class": [one(SHOULDER, f'{SHOULDER} class="other"')],
    **added("site", EYE, {**alike(TURNS, UNFELT), "zaxis": (ZAXIS, UNFELT), "class": ("other", UNFELT)}),
    "site@name": [(['name="eye"', 'site="eye"'], ['name="hook"', 'site="hook"'], UNFELT)],
    "site@pos": [one('pos="0.1 0 -0.3"', 'pos="0.4 0 -0.3"'), one(' pos="0.1 0 -0.3"', "")],
    "frame": [
        one(f"{SHOULDER}/>", f'<frame pos="0 0 0.1">{SHOULDER}/></frame>', f"{READ}frames"),
        one(f"{EYE}/>", f'<frame name="f" pos="0 0 0.1">{EYE}/></frame>', NO_SITE),
    ],
    **added("default/joint", JOINT_DEFAULT, alike({"stiffness": "4", "damping": "5", "type": "slide"})),
    **added("default/joint", JOINT_DEFAULT, {"springref": ("0.3", ALIKE)} | alike(BOUNDS, UNFELT)),
    "default/joint@axis": [([JOINT_DEFAULT, ' axis="0 1 0"'], [f'{JOINT_DEFAULT} axis="0.6 0 0.8"', ""], ALIKE)],
    "default/joint@pos": [one(JOINT_DEFAULT, f'{JOINT_DEFAULT} pos="1 3 2"', f"{READ}position of a default class")],
    "default/joint@ref": [one(JOINT_DEFAULT, f'{JOINT_DEFAULT} ref="0.4"')],
    "default/joint@armature": [one(JOINT_DEFAULT, '<joint armature="0.3"')],
    "default/joint@class": [one(JOINT_DEFAULT, f'{JOINT_DEFAULT} class="main"', NATIVE_REFUSES)],
    "default/site@pos": [with_default("site", "pos", "0.2 0.2 0", ' pos="0.1 0 -0.3"')],
    **{f"default/site@{name}": [with_default("site", name, value, "", UNFELT)] for name, value in (TURNS | {"zaxis": ZAXIS}).items()},
    "spatial@damping": [
        one(CORD, f'{CORD} damping="2"'),
        partial(
            f'<tendon damping="10 9"/>{JOINT_DEFAULT}', CORD, 'damping="3"', 'line 5: <spatial name="cord"> damping="10 9" is not linear'
        ),
    ],
    **added("spatial", CORD, {"frictionloss": ("0", UNFELT), "class": ("other", UNFELT)}),
    "spatial@armature": [one(CORD, f'{CORD} armature="0.1"', f'line 21: <spatial> armature="0.1" {INERTIA}')],
    "spatial@name": [one('name="cord"', 'name="rope"', UNFELT)],
    "spatial@stiffness": [
        one('stiffness="30"', 'stiffness="60"'),
        one('stiffness="30"', 'stiffness="60 0 0"'),
        one('stiffness="30"', 'stiffness="30 10"', 'line 21: .*stiffness="30 10" is not linear'),
        partial(f'<tendon stiffness="10 9"/>{JOINT_DEFAULT}', CORD, "", 'line 5: <spatial name="cord"> stiffness="10 9" is not linear'),
    ],
    "spatial@springlength": [
        one('springlength="0.4"', 'springlength="0.6"'),
        one('springlength="0.4"', 'springlength="0.6 0.6"'),
        one('springlength="0.4"', 'springlength="0.4 0.6"', "line 21: .*is slack between two lengths"),
        one(' springlength="0.4"', "", "line 21: .*leaves its springlength to the reader"),
        one('stiffness="30" springlength="0.4"', 'damping="3"'),
    ],
    "spatial/site@site": [one('<site site="wall"/><site site="eye"/>', '<site site="eye"/><site site="wall"/>', UNFELT)],
    "spatial/pulley@divisor": [one("</spatial>", '<pulley divisor="2"/><site site="wall"/><site site="eye"/></spatial>', NOT_STRAIGHT)],
    "default/tendon@stiffness": [with_default("tendon", "stiffness", "60", ' stiffness="30"')],
    "default/tendon@springlength": [with_default("tendon", "springlength", "0.6", ' springlength="0.4"')],
    "default/tendon@damping": [with_default("tendon", "damping", "2", "")],
    "default/tendon@frictionloss": [with_default("tendon", "frictionloss", "0", "", UNFELT)],
    "default/tendon@armature": [with_default("tendon", "armature", "0.1", "", f"line 5: .*{INERTIA}")],
    "default/tendon@class": [with_default("tendon", "class", "main", "", NATIVE_REFUSES)],
    "fixed@stiffness": fixed(' stiffness="5"', NOT_STRAIGHT),
    "fixed@damping": fixed(' damping="5"', NOT_STRAIGHT),
    "fixed@armature": fixed(' armature="5"', NOT_STRAIGHT),
    **{
        f"fixed@{name}": fixed(f' {name}="{value}"')
        for name, value in {"springlength": "0.3", "frictionloss": "0", "class": "other"}.items()
    },
    **{key: fixed("") for key in ("fixed@name", "fixed/joint@joint", "fixed/joint@coef")},
    **driving(),
}


def of_spring(part: str, attribute: str, old: str, new: str, outcome: str = ALIKE) -> dict[str, list[Variant]]:
    return {f"drake:linear_spring_damper{part}@{attribute}": [one("</robot>", SPRING.replace(old, new) + "</robot>", outcome)]}


MASS_2, LIMIT, SHOULDER_TYPE = (
    '<mass value="2"/>',
    '<limit effort="5" velocity="1"/>\n  </joint>\n</robot>',
    'name="shoulder" type="revolute"',
)
MOMENTS = 'ixx="0.1" ixy="0" ixz="0" iyy="0.2" iyz="0" izz="0.25"'
URDF_VARIANTS: dict[str, list[Variant]] = {
    "robot@name": [one('name="base"', 'name="x"', UNFELT)],
    "robot@version": [one('name="base"', 'name="base" version="1.0"', UNFELT)],
    "link@name": [(['<link name="fore"', 'link="fore"'], ['<link name="hand"', 'link="hand"'], UNFELT)],
    "joint@name": [one('name="slider"', 'name="glider"', UNFELT)],
    "joint@type": [
        one(SHOULDER_TYPE, 'name="shoulder" type="prismatic"'),
        one('type="prismatic"', 'type="revolute"'),
        one('type="prismatic"', 'type="planar"', 'line 19: <joint name="slider"> is planar'),
        one(SHOULDER_TYPE, 'name="shoulder" type="floating"', 'line 12: <joint name="shoulder"> floats from another origin'),
    ],
    "gazebo@reference": [one("</robot>", GAZEBO.replace("shoulder", "slider") + "</robot>")],
    "gazebo/springStiffness@": [one("</robot>", GAZEBO + "</robot>")],
    "gazebo/springReference@": [one("</robot>", GAZEBO.replace("0.3", "0.7") + "</robot>")],
    "transmission@name": [one("</robot>", ROTOR + "</robot>")],
    "transmission@type": [one("</robot>", TYPED_ROTOR + "</robot>")],
    "transmission/type@": [one("</robot>", ROTOR + "</robot>")],
    "transmission/joint@name": [one("</robot>", ROTOR.replace('"shoulder"', '"slider"') + "</robot>")],
    "transmission/actuator@name": [one("</robot>", ROTOR.replace("motor", "drive") + "</robot>")],
    "actuator/drake:rotor_inertia@value": [one("</robot>", ROTOR.replace("0.01", "0.03") + "</robot>")],
    "actuator/drake:gear_ratio@value": [one("</robot>", ROTOR.replace('"3"', '"4"') + "</robot>")],
    **of_spring("_body_A", "name", "world", "upper"),
    **of_spring("_p_AP", "value", "0.3 -0.2 0.9", "0.4 -0.2 0.9"),
    **of_spring("_body_B", "name", "fore", "upper"),
    **of_spring("_p_BQ", "value", "0.1 0 -0.3", "0.1 0.3 -0.3"),
    **of_spring("_free_length", "value", '"0.4"', '"0.5"'),
    **of_spring("_stiffness", "value", '"30"', '"60"'),
    **of_spring("_damping", "value", '"2"', '"5"'),
    "inertial/origin@xyz": [one('<origin xyz="0.1 0 -0.2"/>', '<origin xyz="0.1 0.3 -0.4"/>'), one('<origin xyz="0.1 0 -0.2"/>', "")],
    "inertial/origin@rpy": [one('<origin xyz="0.1 0 -0.2"/>', '<origin xyz="0.1 0 -0.2" rpy="0.3 -0.4 0.5"/>')],
    "inertial/mass@value": [one('<mass value="2"/>', '<mass value="3"/>')],
    **{
        f"inertial/inertia@{name}": [
            ([MOMENTS, 'xyz="0 1 0"'], [re.sub(f'{name}="[^"]*"', f'{name}="{value}"', MOMENTS), 'xyz="0.6 0 0.8"'], ALIKE)
        ]
        for name, value in {"ixx": 0.12, "ixy": 0.03, "ixz": -0.02, "iyy": 0.3, "iyz": 0.03, "izz": 0.2}.items()
    },
    "joint/origin@xyz": [one('<child link="fore"/>', '<child link="fore"/><origin xyz="0.1 0.3 -0.4"/>')],
    "joint/origin@rpy": [one('<origin xyz="0.1 0.2 0.3"/>', '<origin xyz="0.1 0.2 0.3" rpy="0.3 -0.4 0.5"/>')],
    "joint/parent@link": [(['<link name="world"/>', 'link="world"'], ['<link name="base"/>', 'link="base"'], UNFELT)],
    "joint/child@link": [(['<link name="upper"', 'link="upper"'], ['<link name="arm"', 'link="arm"'], UNFELT)],
    "joint/axis@xyz": [one('<axis xyz="0 1 0"/>', '<axis xyz="0.6 0 0.8"/>'), one('<axis xyz="0 1 0"/>', "")],
    "joint/limit@lower": [one(LIMIT, LIMIT.replace("effort", 'lower="0.01" upper="0.02" effort'), UNFELT)],
    "joint/limit@upper": [one(LIMIT, LIMIT.replace("effort", 'upper="-3" effort'), UNFELT)],
    "joint/limit@effort": [one(LIMIT, LIMIT.replace('"5"', '"0"'), UNFELT)],
    "joint/limit@velocity": [one(LIMIT, LIMIT.replace('"1"', '"0"'), UNFELT)],
    "joint/dynamics@damping": [one(LIMIT, '<dynamics damping="4"/>' + LIMIT)],
    "joint/dynamics@friction": [one(LIMIT, '<dynamics damping="0" friction="0"/>' + LIMIT, UNFELT)],
}
# Elements that hold others of which the tag alone does not tell what they are.
TOLD_BY_HOLDER = {"default", "equality", "spatial", "fixed", "inertial", "joint", "gazebo", "transmission", "actuator"}
VARIANTS = {"mjcf": MJCF_VARIANTS, "urdf": URDF_VARIANTS}
ALL = [(model_format, key, number) for model_format, table in VARIANTS.items() for key in table for number in range(len(table[key]))]


def keys(model_format: str) -> Iterator[str]:
    """A key of the tables for each attribute that the validator lets stand."""
    for holder, elements in SUPPORTED[model_format].items():
        for tag, attributes in elements.items():
            for name in attributes:
                if model_format == "mjcf" and "frame" in (holder, tag):
                    yield "frame"
                elif "drake:joint" in (holder, tag):
                    yield "drake:joint"
                else:
                    yield f"{holder}/{tag}@{name}" if holder in TOLD_BY_HOLDER else f"{tag}@{name}"


def changed(model_format: str, old: Sequence[str], new: Sequence[str]) -> str:
    text = BASES[model_format]
    for before, after in zip(old, new, strict=True):
        assert before in text
        text = text.replace(before, after) if before else text
    assert text != BASES[model_format]
    return text


def parsed(text: str) -> ModelFile:
    model_format = "mjcf" if "<mujoco" in text else "urdf"
    return parse_model(Path(f"model.{model_format}"), text, model_format)


def accelerations(engine: str, file: ModelFile, states: tuple[Array, Array, Array] | None = None, joints: Sequence[str] = ()) -> Array:
    joints = joints or tuple(file.joint_lines)
    if states is None:
        generator = np.random.default_rng(0)
        states = tuple(generator.uniform(-1, 1, (COUNT, len(joints))) for _ in range(3))  # type: ignore[assignment]
    assert states is not None
    return load_engine(LIBRARY, engine).load(file, joints, 9.81).forward_dynamics(*states)


def difference(one: Array, other: Array) -> float:
    return float((np.abs(one - other) / np.abs(one).max()).max())


def require_misread(folder: Path, text: str, reading: str) -> None:
    """An aided Pinocchio answers for what one of its readings makes of a file, and not for the file."""
    path = folder / "model.xml"
    path.write_text(text)
    record = record_of(path, "pinocchio", aided=True)
    assert record.explained and record.verdict != "agrees" and reading in [one.name for one in record.readings]


@pytest.mark.parametrize("model_format", VARIANTS)
def test_nothing_that_may_stand_in_a_file_is_left_out(model_format: str) -> None:
    assert set(keys(model_format)) == set(VARIANTS[model_format]) | set(TESTED_ALONE[model_format])
    assert all(VARIANTS[model_format].values())


@pytest.mark.parametrize(("model_format", "key", "number"), ALL, ids=[f"{f}-{key}-{number}" for f, key, number in ALL])
def test_what_may_stand_in_a_file_is_read_supplied_or_refused(model_format: str, key: str, number: int, tmp_path: Path) -> None:
    old, new, outcome = VARIANTS[model_format][key][number]
    healthy, file = map(parsed, (BASES[model_format], changed(model_format, old, new)))
    if outcome == NATIVE_REFUSES:
        with pytest.raises(ValueError, match="class"):
            accelerations(NATIVE[model_format], file)
        return
    if outcome.startswith(READ):
        require_misread(tmp_path, file.text, outcome.removeprefix(READ))
        return
    if outcome == APART:
        assert difference(*(accelerations(engine, file) for engine in (NATIVE[model_format], OTHER[model_format]))) > FELT
        return
    if outcome not in (ALIKE, UNFELT):
        # The file is sound, and its own engine reads it.
        load_engine(LIBRARY, NATIVE[model_format]).load(file, tuple(file.joint_lines), 9.81)
        with pytest.raises(Unsupported, match=outcome):
            accelerations(OTHER[model_format], file)
        return
    before, after = accelerations(NATIVE[model_format], healthy), accelerations(NATIVE[model_format], file)
    assert (difference(before, after) > FELT) == (outcome == ALIKE)
    assert difference(after, accelerations(OTHER[model_format], file)) < SAME


def places(number: int, sizes: Sequence[tuple[int, int]]) -> tuple[Array, Array, Array]:
    """States of joints of the given sizes; four positions are a rotation, or end in one."""
    generator = np.random.default_rng(number)
    columns = []
    for nq, _ in sizes:
        column = generator.uniform(-1, 1, (COUNT, nq))
        if nq >= 4:
            column[:, -4:] /= np.linalg.norm(column[:, -4:], axis=1, keepdims=True)
        columns.append(column)
    velocities = sum(nv for _, nv in sizes)
    return np.hstack(columns), generator.uniform(-1, 1, (COUNT, velocities)), generator.uniform(-1, 1, (COUNT, velocities))


def test_a_body_with_several_joints_is_one_composite_joint() -> None:
    """Springs and dampers find the parts."""
    two = f'{SHOULDER} damping="2"/><joint name="turn" axis="0 0 1" pos="0.1 0.2 0" stiffness="3" springref="0.2" armature="0.3"'
    file = parsed(MJCF.replace(SHOULDER, two))
    joints = ("turn", "slider", "shoulder")
    states = places(1, [(1, 1)] * 3)
    assert difference(accelerations("mujoco", file, states, joints), accelerations("pinocchio", file, states, joints)) < SAME
    loaded = load_engine(LIBRARY, "pinocchio").load(file, joints, 9.81).loaded()
    assert loaded is not None and dict(loaded.joints) == dict.fromkeys(("shoulder", "turn", "slider"), (1, 1))
    turned = parsed(MJCF.replace(SHOULDER, two + ' ref="0.2"'))
    assert difference(accelerations("mujoco", turned, states, joints), accelerations("pinocchio", turned, states, joints)) < SAME


@pytest.mark.parametrize("pose", ["", ' quat="0.9 0.1 -0.3 0.2"'])
def test_a_ball_joint_in_mjcf_is_damped_and_a_spring_in_it_is_refused(pose: str) -> None:
    ball = MJCF.replace(SHOULDER, '<joint name="shoulder" type="ball" damping="0.7" pos="0.1 0.2 0.3"').replace(UPPER, UPPER + pose)
    file = parsed(ball)
    sound = accelerations("mujoco", file, states := places(2, [(4, 3), (1, 1)]), joints := ("shoulder",) * 3 + ("slider",))
    assert difference(sound, accelerations("pinocchio", file, states, joints)) < SAME
    assert difference(sound, accelerations("pinocchio", without(JointDamper)(file), states, joints)) > FELT
    sprung = parsed(ball.replace("damping", "stiffness"))
    with pytest.raises(Unsupported, match=r'line 11: <joint name="shoulder"> stiffness="0\.7" is a spring in a ball joint'):
        accelerations("pinocchio", sprung, states, joints)


@pytest.mark.parametrize("pose", ["", ' pos="1 2 3"', ' quat="0.9 0.1 -0.3 0.2"'])
@pytest.mark.parametrize("joint", ['<freejoint name="shoulder"', '<joint name="shoulder" type="free" damping="0.8" armature="0"'])
def test_a_free_joint_in_mjcf_stands_where_mujoco_puts_it(joint: str, pose: str) -> None:
    """Pinocchio's linear velocities and forces are in the body's frame."""
    file = parsed(MJCF.replace(SHOULDER, joint).replace(' pos="0.1 0.2 0.3"', pose))
    joints = ("shoulder",) * 6 + ("slider",)
    q, v, tau = places(3, [(7, 6), (1, 1)])
    answers = accelerations("mujoco", file, (q, v, tau), joints)
    turned = [part.copy() for part in (v, tau, answers)]
    for row, (w, x, y, z) in enumerate(q[:, 3:7]):
        rotation = Rotation.from_quat([x, y, z, w]).as_matrix()
        for part in turned:
            part[row, :3] = rotation.T @ part[row, :3]
        # The body's frame turns: d(R' v)/dt = R' a - omega x R' v.
        turned[2][row, :3] -= np.cross(v[row, 3:6], turned[0][row, :3])
    assert difference(turned[2], accelerations("pinocchio", file, (q, turned[0], turned[1]), joints)) < SAME


def test_a_ball_joint_in_urdf_is_hung_on_the_world_in_mujoco() -> None:
    text = re.sub('  <joint name="shoulder".*?</joint>', BALL, URDF, flags=re.DOTALL).replace('  <link name="world"/>\n', "")
    file = parsed(text)
    states, joints = places(4, [(4, 3), (1, 1)]), ("shoulder",) * 3 + ("slider",)
    assert difference(accelerations("pinocchio", file, states, joints), accelerations("mujoco", file, states, joints)) < SAME


# What needs other states than two joints, or has no native reader.
@pytest.mark.parametrize("engine", ["pinocchio", "mujoco"])
def test_a_joint_that_mimics_another_is_supported_by_no_engine(engine: str) -> None:
    """Neither may take it for a joint of its own, nor for a soft constraint."""
    text = URDF.replace(LIMIT, '<mimic joint="shoulder" multiplier="-2" offset="0.5"/>' + LIMIT)
    file = parsed(text)
    assert tuple(file.joint_lines) == ("shoulder",)
    (mimic,) = file.mimics
    assert isinstance(mimic.says, Linkage)
    assert (mimic.name, mimic.says.leader, [*map(float, mimic.says.coefficients)]) == ("slider", "shoulder", [0.5, -2.0, 0, 0, 0])
    with pytest.raises(Unsupported, match="mimics"):
        load_engine(LIBRARY, engine).load(file, ("shoulder",), 9.81)


# A loop in the model: both engines read it, Pinocchio as rigid and MuJoCo as soft, so that each is held against itself. What
# the values mean is tested in tests/engines/test_constraints.py.
CONNECT, SECOND_EYE = '<connect name="loop" site1="wall" site2="eye"/>', '<site name="other" pos="0 0.1 0"/><site name="eye"'
KINDS = {
    "connect": CONNECT,
    "weld": CONNECT.replace("connect", "weld"),
    "joint": '<joint name="loop" joint1="slider" joint2="shoulder"/>',
    "tendon": '<tendon name="loop" tendon1="cord"/>',
    "default/equality": CONNECT,
    "option": CONNECT,
    "flag": CONNECT,
}
COUPLES = r"line \d+: constraint 'loop' couples (joint|tendon)s"
_SOFT = {
    "active": ('name="loop"', 'name="loop" active="true"', False, False),
    "class": ('name="loop"', 'name="loop" class="stiff"', True, False),
    "name": ('name="loop"', 'name="hoop"', False, False),
    "solref": ('name="loop"', 'name="loop" solref="0.05 1"', True, False),
    "solimp": ('name="loop"', 'name="loop" solimp="0.8 0.85"', True, False),
}
_STIFF = '<default class="stiff"><equality solref="0.05"/></default>'
# Key to what is changed into what, and whether MuJoCo and Pinocchio feel it. A rigid constraint says J qdd = -J' v, where the place
# of a point of the world has no part; the rows of a weld are those of the twist of the second body against the first frame.
CONSTRAINTS: dict[str, tuple[str, str, bool, bool]] = {
    **{f"equality/{kind}@{name}": change for kind in ("connect", "weld", "joint", "tendon") for name, change in _SOFT.items()},
    **{
        f"equality/{kind}@{name}": (name + ended, name + other, True, (name == "site2") == (kind == "connect"))
        for kind in ("connect", "weld")
        for name, ended, other in (("site1", '="wall"', '="ceiling"'), ("site2", '="eye"', '="other"'))
    },
    "equality/weld@torquescale": ('name="loop"', 'name="loop" torquescale="0.5"', True, False),
    "equality/joint@joint1": ('joint1="slider" joint2="shoulder"', 'joint1="shoulder"', True, True),
    "equality/joint@joint2": (' joint2="shoulder"', "", True, True),
    "equality/joint@polycoef": ('name="loop"', 'name="loop" polycoef="0.1 2"', True, True),
    "equality/tendon@tendon1": ('tendon1="cord"', 'tendon1="sum"', True, True),
    "equality/tendon@tendon2": ('tendon1="cord"', 'tendon1="cord" tendon2="sum"', True, True),
    "equality/tendon@polycoef": ('name="loop"', 'name="loop" polycoef="0.1"', True, True),
    "default/equality@class": (_STIFF, _STIFF.replace('"stiff"', '"stiffer"'), False, False),
    "default/equality@active": (_STIFF, _STIFF + '<equality active="true"/>', False, False),
    "default/equality@solref": (_STIFF, _STIFF + '<equality solref="0.05"/>', True, False),
    "default/equality@solimp": (_STIFF, _STIFF + '<equality solimp="0.8 0.85"/>', True, False),
    "flag@diagexact": ('gravity="1 2 -9.81">', 'gravity="1 2 -9.81"><flag diagexact="enable"/>', True, False),
    "option@timestep": ('gravity="1 2 -9.81"', 'gravity="1 2 -9.81" timestep="0.05"', True, False),
    "option@solver": ('gravity="1 2 -9.81"', 'gravity="1 2 -9.81" solver="CG"', False, False),
    "option@iterations": ('gravity="1 2 -9.81"', 'gravity="1 2 -9.81" iterations="10"', False, False),
    "option@tolerance": ('gravity="1 2 -9.81"', 'gravity="1 2 -9.81" tolerance="0"', False, False),
}


@pytest.mark.parametrize("key", CONSTRAINTS)
def test_a_constraint_is_read_by_both_engines_or_refused(key: str) -> None:
    kind = key.partition("@")[0].removeprefix("equality/")
    old, new, *felt = CONSTRAINTS[key]
    tendons = (
        '<spatial name="cord"><site site="wall"/><site site="eye"/></spatial><fixed name="sum"><joint joint="slider" coef="2"/></fixed>'
    )
    text = re.sub("<tendon>.*</tendon>", f"<tendon>{tendons}</tendon><equality>{KINDS[kind]}</equality>", MJCF, flags=re.DOTALL)
    text = text.replace('<flag constraint="disable"/>', "").replace("<default>", f"<default>{_STIFF}", 1)
    text = text.replace('<site name="eye"', SECOND_EYE).replace("<worldbody>", '<worldbody><site name="ceiling" pos="0 0 3"/>')
    assert old in text
    sound, file = parsed(text), parsed(text.replace(old, new))
    for engine, is_felt in zip(("mujoco", "pinocchio"), felt, strict=True):
        if engine == "pinocchio" and kind in ("joint", "tendon"):
            for each in (sound, file):
                with pytest.raises(Unsupported, match=COUPLES.replace("loop", "(l|h)oop")):
                    accelerations(engine, each)
        else:
            assert (difference(accelerations(engine, sound), accelerations(engine, file)) > FELT) == is_felt


BALL_CONSTRAINT = """<drake:ball_constraint name="loop">
    <drake:ball_constraint_body_A name="world"/>
    <drake:ball_constraint_p_AP value="0.3 -0.2 0.9"/>
    <drake:ball_constraint_body_B name="fore"/>
    <drake:ball_constraint_p_BQ value="0.1 0 -0.3"/>
  </drake:ball_constraint>"""
# Key to what is changed into what, and whether MuJoCo and Pinocchio feel it.
BALL_CONSTRAINTS = {
    "drake:ball_constraint@name": ('name="loop"', 'name="hoop"', False, False),
    "drake:ball_constraint_body_A@name": ('body_A name="world"', 'body_A name="upper"', True, True),
    "drake:ball_constraint_p_AP@value": ('"0.3 -0.2 0.9"', '"0.3 -0.2 0.5"', True, False),
    "drake:ball_constraint_body_B@name": ('body_B name="fore"', 'body_B name="upper"', True, True),
    "drake:ball_constraint_p_BQ@value": ('"0.1 0 -0.3"', '"0.1 0 -0.7"', True, True),
}


@pytest.mark.parametrize("key", BALL_CONSTRAINTS)
def test_a_ball_constraint_is_read_by_both_engines(key: str) -> None:
    old, new, *felt = BALL_CONSTRAINTS[key]
    text = URDF.replace("</robot>", f"{BALL_CONSTRAINT}</robot>")
    sound, file = parsed(text), parsed(text.replace(old, new))
    for engine, is_felt in zip(("mujoco", "pinocchio"), felt, strict=True):
        assert (difference(accelerations(engine, sound), accelerations(engine, file)) > FELT) == is_felt


TESTED_ALONE: Mapping[str, Mapping[str, Callable[..., None]]] = {
    "mjcf": {
        "freejoint@name": test_a_free_joint_in_mjcf_stands_where_mujoco_puts_it,
        **dict.fromkeys(CONSTRAINTS, test_a_constraint_is_read_by_both_engines_or_refused),
    },
    "urdf": {
        "drake:joint": test_a_ball_joint_in_urdf_is_hung_on_the_world_in_mujoco,
        **dict.fromkeys(BALL_CONSTRAINTS, test_a_ball_constraint_is_read_by_both_engines),
        **{f"joint/mimic@{name}": test_a_joint_that_mimics_another_is_supported_by_no_engine for name in ("joint", "multiplier", "offset")},
    },
}


def test_a_continuous_joint_is_refused_where_its_position_would_be_two_numbers() -> None:
    """Pinocchio's q holds its cosine and sine; what does not ask for accelerations still sees the joint."""
    file = parsed(URDF.replace(SHOULDER_TYPE, 'name="shoulder" type="continuous"'))
    loaded = load_engine(LIBRARY, "pinocchio").load(file, JOINTS, 9.81)
    held = loaded.loaded()
    assert held is not None and held.joints["shoulder"] == (2, 1)
    for ask in (loaded.forward_dynamics, loaded.terms):  # type: ignore[attr-defined]
        with pytest.raises(InvalidModel, match=r"model.urdf:12: joint 'shoulder' is continuous.* make it revolute"):
            ask(*(np.zeros((COUNT, 2)) for _ in range(3)))
    assert difference(accelerations("mujoco", parsed(URDF)), accelerations("mujoco", file)) == 0


def test_a_free_joint_in_urdf_that_mujoco_counts_from_elsewhere_is_refused() -> None:
    text = URDF.replace(SHOULDER_TYPE, 'name="shoulder" type="floating"')
    for where in ('<origin xyz="0 0 0"/>', ""):
        load_engine(LIBRARY, "mujoco").load(parsed(text.replace('<origin xyz="0.1 0.2 0.3"/>', where)), JOINTS, 9.81)
    fixed_base = (
        '<link name="base"/><joint name="mount" type="fixed"><parent link="world"/><child link="base"/><origin rpy="0.3 0 0"/></joint>'
    )
    behind = text.replace('<origin xyz="0.1 0.2 0.3"/>', "").replace('<parent link="world"/>', '<parent link="base"/>')
    behind = behind.replace('<link name="world"/>', f'<link name="world"/>{fixed_base}')
    with pytest.raises(Unsupported, match=r'line 12: <joint name="shoulder"> floats from another origin .* behind <joint name="mount">'):
        load_engine(LIBRARY, "mujoco").load(parsed(behind), JOINTS, 9.81)


# Every kind of what the harness supplies: a model that has it, and the same file without it being supplied.
LOADED_URDF = URDF.replace(LIMIT, '<dynamics damping="2"/>' + LIMIT).replace("</robot>", GAZEBO + SPRING + ROTOR + "</robot>")
LOADED_MJCF = MJCF.replace(SHOULDER, f'{SHOULDER} stiffness="4" springref="0.2"').replace(SLIDER, f'{SLIDER} damping="3"')


def without(kind: type) -> Any:
    return lambda file: replace(file, force_elements=tuple(one for one in file.force_elements if not isinstance(one, kind)))


SUPPLIED = {
    "gravity in mjcf": (LOADED_MJCF, lambda file: replace(file, gravity=(0.0, 0.0, -9.81))),
    "joint spring in mjcf": (LOADED_MJCF, without(JointSpring)),
    "joint damper in mjcf": (LOADED_MJCF, without(JointDamper)),
    "point spring in mjcf": (LOADED_MJCF, without(PointSpring)),
    "joint spring in urdf": (LOADED_URDF, without(JointSpring)),
    "point spring in urdf": (LOADED_URDF, without(PointSpring)),
    "armature in urdf": (LOADED_URDF, lambda file: replace(file, armatures=())),
}


@pytest.mark.parametrize("kind", SUPPLIED)
def test_what_is_supplied_is_missed_where_it_is_dropped(kind: str) -> None:
    text, drop = SUPPLIED[kind]
    file = parsed(text)
    native = accelerations(NATIVE[file.format], file)
    assert difference(native, accelerations(OTHER[file.format], file)) < SAME
    assert difference(native, accelerations(OTHER[file.format], drop(file))) > 1e-3


def test_mujoco_itself_damps_the_joints_of_a_urdf() -> None:
    """It would be damped twice if the harness supplied that, too."""
    file = parsed(LOADED_URDF)
    assert difference(accelerations("mujoco", file), accelerations("mujoco", without(JointDamper)(file))) == 0
    assert (
        difference(accelerations("mujoco", file), accelerations("mujoco", parsed(LOADED_URDF.replace('damping="2"', 'damping="0"')))) > 1e-3
    )


def test_gravity_of_a_urdf_is_what_the_harness_says() -> None:
    file, still = parsed(URDF), tuple(np.zeros((1, 2)) for _ in range(3))
    on_the_moon, here = (load_engine(LIBRARY, "mujoco").load(file, JOINTS, gravity).forward_dynamics(*still) for gravity in (1.62, 9.81))
    assert np.allclose(here, on_the_moon * 9.81 / 1.62, rtol=1e-13, atol=1e-15) and here.any()


TURNED = f'{UPPER} euler="0.3 0 0"'
MISREAD = {
    "second body": (
        MJCF.replace("</worldbody>", f'<body name="more"><joint name="third"/><inertial pos="0 0 1" {INERTIAL}/></body></worldbody>'),
        "further trees",
    ),
    "second compiler": (
        MJCF.replace("<tendon>", '<compiler angle="degree"/><tendon>').replace(UPPER, TURNED),
        SECTIONS,
    ),
    "compiler behind worldbody": (
        MJCF.replace(RADIANS, "").replace("<tendon>", f"{RADIANS}<tendon>").replace(UPPER, TURNED),
        SECTIONS,
    ),
    **{
        f"fixed base with {pose}": (
            MJCF.replace(UPPER, f'<body name="base" {pose}>{UPPER}').replace("</worldbody>", "</body></worldbody>"),
            "pose of a body fixed to the world",
        )
        for pose in ('pos="1 2 3"', 'quat="0.8 0.6 0 0"', 'euler="0.3 0 0"')
    },
    # MuJoCo takes nothing from a childclass once a class is named; Pinocchio takes what that leaves open.
    "class beside childclass": (
        MJCF.replace('<joint armature="0.01"/>', '<default class="turned"><joint axis="0.6 0 0.8"/></default>')
        .replace(UPPER, f'{UPPER} childclass="turned"')
        .replace(' axis="0 1 0"', ' class="other"'),
        "class beside a childclass",
    ),
}


@pytest.mark.parametrize("what", MISREAD)
def test_what_is_read_otherwise_is_a_reading(what: str, tmp_path: Path) -> None:
    require_misread(tmp_path, *MISREAD[what])


REFUSED = {
    "reference in a ball joint": (
        MJCF.replace(SHOULDER, '<joint name="shoulder" type="ball" ref="1"'),
        "Reference position can only be used with hinge or slide joints",
    ),
    "link world": (
        URDF.replace('<link name="world"/>', '<link name="base"/>').replace('"world"', '"base"').replace('"upper"', '"world"'),
        "line 12: <joint name=\"shoulder\"> carries the link 'world'",
    ),
}


@pytest.mark.parametrize("what", REFUSED)
def test_what_is_neither_read_nor_supplied_is_refused_with_its_line(what: str) -> None:
    text, words = REFUSED[what]
    file = parsed(text)
    with pytest.raises(Unsupported, match=words):
        load_engine(LIBRARY, OTHER[file.format]).load(file, JOINTS, 9.81)


RODS = {
    "point": ('ixx="0.02" ixy="0" ixz="0" iyy="0.03" iyz="0" izz="0.04"', 'ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"'),
    "rod": ('ixx="0.02" ixy="0" ixz="0" iyy="0.03" iyz="0" izz="0.04"', 'ixx="0.04" ixy="0" ixz="0" iyy="0" iyz="0" izz="0.04"'),
    # 12.5 (1 - n n') of a heavy rod along n = (0.6, 0, 0.8), whose zero is a rounding.
    "tilted rod": ('ixx="0.02" ixy="0" ixz="0" iyy="0.03" iyz="0" izz="0.04"', 'ixx="8" ixy="0" ixz="-6" iyy="12.5" iyz="0" izz="4.5"'),
}


@pytest.mark.parametrize("kind", RODS)
def test_a_moving_link_without_inertia_gets_the_least_that_mujoco_takes(kind: str) -> None:
    text = URDF.replace(*RODS[kind]).replace('type="prismatic"', 'type="revolute"')
    file = parsed(text.replace('<mass value="0.5"/>', '<origin xyz="0 0 -0.3" rpy="0.1 0.2 0.3"/><mass value="0.5"/>'))
    assert difference(accelerations("pinocchio", file), accelerations("mujoco", file)) < SAME


INERTIA_OF = '<inertia ixx="{0}" ixy="0" ixz="0" iyy="{0}" iyz="0" izz="{0}"/>'
MASSLESS = f'<mass value="0"/>{INERTIA_OF.format(0)}'
LIGHT = f'<mass value="0.02"/>{INERTIA_OF.format("1e-5")}'
# Some roundings of numbers about 1, which 1e-15 kg m^2 beside 1e-5 kg m^2 exceeds a hundred thousand times.
ROUNDED = 1e-14


def urdf_of(links: Mapping[str, str], *joints: tuple[str, str, str]) -> ModelFile:
    """Links with what their inertials hold, and joints by type, parent and child along y, x, y, ... in turn."""
    parts = [f'<link name="{name}">{f"<inertial>{inertial}</inertial>" if inertial else ""}</link>' for name, inertial in links.items()]
    parts += [
        f'<joint name="{child}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<axis xyz="{"1 0 0" if number % 2 else "0 1 0"}"/><limit effort="0" velocity="0"/></joint>'
        for number, (kind, parent, child) in enumerate(joints)
    ]
    return parsed('<robot name="light">\n' + "\n".join(parts) + "\n</robot>")


LIGHT_MODELS = {
    "flange": urdf_of(
        {"world": "", "flange": MASSLESS, "tool": LIGHT}, ("revolute", "world", "flange"), ("fixed", "flange", "tool")
    ),
    "flange and adapter": urdf_of(
        {"world": "", "flange": MASSLESS, "adapter": MASSLESS, "tool": LIGHT},
        ("revolute", "world", "flange"), ("fixed", "flange", "adapter"), ("fixed", "adapter", "tool"),
    ),
    "cross": urdf_of({"world": "", "cross": MASSLESS, "body": LIGHT}, ("revolute", "world", "cross"), ("revolute", "cross", "body")),
    "two slides": urdf_of(
        {"world": "", "cross": MASSLESS, "body": f'<mass value="1e-9"/>{INERTIA_OF.format(0)}'},
        ("prismatic", "world", "cross"), ("prismatic", "cross", "body"),
    ),
    "next to nothing": urdf_of(
        {"world": "", "cross": f'<mass value="1e-17"/>{INERTIA_OF.format("3e-17")}', "body": LIGHT},
        ("revolute", "world", "cross"), ("revolute", "cross", "body"),
    ),
    "needle": urdf_of(
        {"world": "", "cross": MASSLESS, "body": '<mass value="1e-3"/><inertia ixx="1e-9" ixy="0" ixz="0" iyy="1e-9" iyz="0" izz="0"/>'},
        ("revolute", "world", "cross"), ("revolute", "cross", "body"),
    ),
}  # fmt: skip


@pytest.mark.parametrize("kind", LIGHT_MODELS)
def test_what_mujoco_compiles_with_the_least_inertia_moves_without_it(kind: str) -> None:
    """1e-15 kg m^2 would be felt by each of them; the reproducer's model is the same to the last bit."""
    file = LIGHT_MODELS[kind]
    joints = tuple(file.joint_lines)
    states = places(5, [(1, 1)] * len(joints))
    sound = accelerations("pinocchio", file, states, joints)
    loaded = load_engine(LIBRARY, "mujoco").load(file, joints, 9.81)
    answers = loaded.forward_dynamics(*states)
    assert difference(sound, answers) < ROUNDED
    names: dict[str, Any] = {}
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(loaded.reproducer(repr(file.text), *(part[0] for part in states), sound[0]), names)  # type: ignore[attr-defined]
    assert eval(printed.getvalue().splitlines()[0]) == answers[0].tolist()


def test_a_name_that_holds_nan_stays_a_name_in_the_reproducer() -> None:
    text = re.sub('  <joint name="shoulder".*?</joint>', BALL, URDF, flags=re.DOTALL).replace('  <link name="world"/>\n', "")
    text = text.replace('name="shoulder"', 'name="nano"').replace('"upper"', '"banana"').replace("0.02", "0.04")
    # What MuJoCo does not take as six numbers, which must then be none.
    file = parsed(text.replace('iyy="0.03"', 'iyy="0"'))
    (q, v, tau), joints = places(6, [(4, 3), (1, 1)]), ("nano",) * 3 + ("slider",)
    loaded = load_engine(LIBRARY, "mujoco").load(file, joints, 9.81)
    script = loaded.reproducer(repr(file.text), q[0], v[0], tau[0], tau[0])  # type: ignore[attr-defined]
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(script, {})
    assert "name='nano'" in script and "float('nan')" in script
    assert eval(printed.getvalue().splitlines()[0]) == loaded.forward_dynamics(q[:1], v[:1], tau[:1])[0].tolist()


def test_fixed_links_are_fused_and_springs_find_them() -> None:
    tool = """<link name="tool"><inertial><origin xyz="0.1 0 0"/><mass value="0.3"/>
        <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.02"/></inertial></link><link name="tip"><inertial>
        <mass value="0.1"/><inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/></inertial></link>
        <joint name="grip" type="fixed"><parent link="fore"/><child link="tool"/><origin xyz="0.2 0.1 0" rpy="0.3 0.4 0.5"/></joint>
        <joint name="end" type="fixed"><parent link="tool"/><child link="tip"/><origin xyz="0 0.1 0.2" rpy="-0.3 0 1"/></joint>"""
    file = parsed(URDF.replace("</robot>", tool + SPRING.replace('"fore"', '"tip"') + "</robot>"))
    assert difference(accelerations("pinocchio", file), accelerations("mujoco", file)) < SAME


def test_decoration_of_a_urdf_neither_weighs_nor_is_looked_for() -> None:
    """MuJoCo would take a link's missing inertia from its shape, and fetch the mesh."""
    shapes = """<link name="hull"><collision><geometry><box size="1 1 1"/></geometry></collision>
        <visual><geometry><mesh filename="nowhere.stl"/></geometry></visual>
        <collision><geometry><mesh filename="nowhere.stl"/></geometry></collision></link>
        <joint name="bolt" type="fixed"><parent link="fore"/><child link="hull"/></joint><!-- decoration: visual collision -->"""
    text = URDF.replace('<link name="world"/>', '<link name="world"/>' + shapes)
    with pytest.raises(InvalidModel, match="moves but has no <inertial>"):
        parsed(text)
    massless = '<inertial><mass value="0"/><inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/></inertial></link>'
    leaf = '<link name="leaf"><inertial><mass value="0.1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>'
    leaf += '<joint name="stem" type="fixed"><parent link="hull"/><child link="leaf"/></joint></robot>'
    file = parsed(text.replace("</link>\n        <joint", massless + "<joint").replace("</robot>", leaf))
    assert difference(accelerations("pinocchio", file), accelerations("mujoco", file)) < SAME


def test_only_native_subjects_are_asked_about_engines() -> None:
    every = select_subjects(LIBRARY, ())
    native = select_subjects(LIBRARY, (), native_only=True)
    assert {"mujoco/mjcf", "mujoco/urdf", "pinocchio/mjcf", "pinocchio/urdf", "lagrange"} <= set(map(str, every))
    assert {"mujoco/mjcf", "pinocchio/urdf", "lagrange"} <= set(map(str, native))
    assert not {"mujoco/urdf", "pinocchio/mjcf"} & set(map(str, native))
    assert [str(subject) for subject in select_subjects(LIBRARY, ["mujoco/urdf"], native_only=True)] == ["mujoco/urdf"]
    assert not is_native(LIBRARY, Subject("mujoco", "urdf"))
