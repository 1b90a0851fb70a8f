"""Robots in USD: one tree with those in MJCF and URDF, each number at its line, and a sentence for what has no meaning."""

from __future__ import annotations

import math
import os
import re
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from hypothesis import given, settings
from hypothesis import strategies as st
from pxr import Sdf, UsdUtils
from scipy.spatial.transform import Rotation
from support import InThisProcess

from harness.cli import main
from harness.comparison.collection import find_files
from harness.comparison.quantities import quantities
from harness.comparison.sameness import hold_against
from harness.comparison.study import ComparisonSettings, RobotComparison
from harness.errors import InvalidModel
from harness.explain.meant import meant
from harness.files.document import stage
from harness.files.document.layer_lines import lines_of
from harness.files.document.xml import MAXIMUM_DEPTH
from harness.files.joint_kinds import JointKind
from harness.results.pair_conclusion import conclude_pair
from harness.results.survey_conclusion import conclude_survey
from harness.study import complete
from harness.trees.robot import Robot, read_robot

HEAD = '#usda 1.0\n(\n    metersPerUnit = 1\n    upAxis = "Z"\n)\n'
SCENE = 'def PhysicsScene "scene"\n{\n    vector3f physics:gravityDirection = (0, 0, -1)\n    float physics:gravityMagnitude = 9.81\n}\n'
BODY = 'prepend apiSchemas = ["PhysicsRigidBodyAPI", "PhysicsMassAPI"]'
ARM = (
    HEAD
    + SCENE
    + f"""def Xform "arm" (prepend apiSchemas = ["PhysicsArticulationRootAPI"])
{{
    def Xform "upper" ({BODY})
    {{
        float physics:mass = 17.4
        point3f physics:centerOfMass = (0.068, 0.006, -0.016)
        float3 physics:diagonalInertia = (0.13, 0.524, 0.539)
    }}
    def Xform "fore" ({BODY})
    {{
        float physics:mass = 4.8
        point3f physics:centerOfMass = (0, -0.07, 0.014)
        float3 physics:diagonalInertia = (0.066, 0.0125, 0.086)
    }}
    def PhysicsRevoluteJoint "shoulder"
    {{
        rel physics:body1 = </arm/upper>
        uniform token physics:axis = "Y"
        point3f physics:localPos0 = (0, 0.2435, 0.3)
        float physics:lowerLimit = -90
        float physics:upperLimit = 90
        float newton:armature = 0.25
        float newton:damping = 0.05
    }}
    def PhysicsPrismaticJoint "slide" (prepend apiSchemas = ["PhysicsDriveAPI:linear"])
    {{
        rel physics:body0 = </arm/upper>
        rel physics:body1 = </arm/fore>
        uniform token physics:axis = "X"
        point3f physics:localPos0 = (0.4318, 0, -0.0934)
        double mjc:stiffness = 8
        float drive:linear:physics:stiffness = 40
        float drive:linear:physics:damping = 3
    }}
}}
"""
)
TWIN = f"""<mujoco model="arm">
  <compiler angle="radian"/>
  <option gravity="0 0 -9.81"/>
  <worldbody>
    <body name="upper" pos="0 0.2435 0.3">
      <joint name="shoulder" axis="0 1 0" armature="0.25" damping="{0.05 * 180 / math.pi!r}" range="{-math.pi / 2!r} {math.pi / 2!r}"/>
      <inertial mass="17.4" pos="0.068 0.006 -0.016" diaginertia="0.13 0.524 0.539"/>
      <body name="fore" pos="0.4318 0 -0.0934">
        <joint name="slide" type="slide" axis="1 0 0" stiffness="8"/>
        <inertial mass="4.8" pos="0 -0.07 0.014" diaginertia="0.066 0.0125 0.086"/>
      </body>
    </body>
  </worldbody>
  <actuator><position joint="slide" kp="40" kv="3"/></actuator>
</mujoco>
"""


def written(folder: Path, text: str, name: str = "arm.usda") -> Path:
    path = folder / name
    path.write_text(text)
    return path


def robot(folder: Path, text: str, name: str = "arm.usda") -> Robot:
    return read_robot(written(folder, text, name))


def held(folder: Path, text: str, twin: str = TWIN) -> tuple[bool, str]:
    """Whether the arm in USD is the twin, and the sentence on both."""
    found = hold_against(meant(robot(folder, twin, "arm.xml"), 8, 0), robot(folder, text), {})
    return found.same, conclude_pair(found).sentence


def line_of(text: str, part: str) -> int:
    (line,) = [number for number, content in enumerate(text.splitlines(), start=1) if part in content]
    return line


def changed(old: str, new: str, text: str = ARM) -> str:
    assert text.count(old) == 1, (old, text.count(old))
    return text.replace(old, new)


def test_the_arm_is_that_of_the_mjcf(tmp_path: Path) -> None:
    same, sentence = held(tmp_path, ARM)
    assert same and "data roundoffs of" not in sentence, sentence


def test_each_number_stands_at_its_line_and_means_its_shortest_decimal(tmp_path: Path) -> None:
    upper = robot(tmp_path, ARM).tree.bodies[0]
    assert upper.inertia is not None
    mass = upper.inertia.places["mass"]
    assert (mass.line, mass.tag, float(upper.inertia.mass)) == (line_of(ARM, "17.4"), "/arm/upper", 17.4)
    assert upper.joints[0].places["damping"].line == line_of(ARM, "newton:damping")
    assert upper.joints[0].places["limits"].line == line_of(ARM, "lowerLimit")


# One change of the file, what the sentence says, and the text at whose line it says it.
FAULTS = {
    "degrees for radians in a damper": (
        ("newton:damping = 0.05", "newton:damping = 2.864789"),
        "damping of joint shoulder",
        "newton:damping",
    ),
    "radians for degrees in limits": (("upperLimit = 90", "upperLimit = 1.5707964"), "limits of joint shoulder", "lowerLimit"),
    "a floating base": (("rel physics:body1 = </arm/upper>", "uniform bool physics:jointEnabled = 0"), "floating_base", ""),
    "a lost armature": (("float newton:armature = 0.25\n", "\n"), "armature of joint shoulder, 0.25", "PhysicsRevoluteJoint"),
    "a mass in another unit": (("mass = 17.4", "mass = 17400"), "mass of link upper", "17400"),
    "a moment wrong by 1e-4": (("0.539)", "0.5390539)"), "moments of inertia of link upper", "0.5390539"),
    "gains per radian in a drive": (
        ("drive:linear:physics:stiffness = 40", "drive:linear:physics:stiffness = 4"),
        "gain of actuator of joint slide, 40",
        "stiffness = 4",
    ),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_planted_fault_is_named_with_its_line_and_both_numbers(tmp_path: Path, fault: str) -> None:
    (old, new), words, at = FAULTS[fault]
    text = changed(old, new)
    same, sentence = held(tmp_path, text)
    told = hold_against(meant(robot(tmp_path, TWIN, "arm.xml"), 8, 0), robot(tmp_path, text), {})
    assert not same or told.equivalent
    assert words in sentence or words in str(told.locked), sentence
    if at:
        one = next(one for one in (*told.differences, *told.constraints) if one.what in sentence or words.startswith(one.what))
        assert one.second_place == f"arm.usda:{line_of(text, at)}" and one.first and one.second


def test_a_share_of_gravity_that_is_lost_is_named(tmp_path: Path) -> None:
    twin = TWIN.replace('<body name="fore"', '<body name="fore" gravcomp="0.5"')
    shared = changed("float physics:mass = 4.8", "float physics:mass = 4.8\n        custom float mjc:body:gravcomp = 0.5")
    assert held(tmp_path, shared, twin)[0]
    same, sentence = held(tmp_path, ARM, twin)
    assert not same and "gravity compensation of link fore, 0.5 (arm.xml:8) against 0 (arm.usda:19)" in sentence


def test_a_spring_that_is_lost_is_named(tmp_path: Path) -> None:
    cord = '<tendon><fixed name="cord" stiffness="7"><joint joint="shoulder" coef="0.5"/><joint joint="slide" coef="2"/></fixed></tendon>'
    twin = TWIN.replace("  <actuator>", f"  {cord}\n  <actuator>")
    tendon = """def MjcTendon "cord"
{
    rel mjc:path = [</arm/shoulder>, </arm/slide>]
    uniform double[] mjc:path:coef = [0.5, 2]
    uniform double mjc:stiffness = 7
    uniform token mjc:type = "fixed"
}
"""
    assert held(tmp_path, ARM + tendon, twin)[0]
    same, sentence = held(tmp_path, ARM, twin)
    assert not same and "spring between shoulder and slide, stiffness 7 (arm.xml:14) against none" in sentence, sentence


# Random trees, written in three formats.


@dataclass(frozen=True)
class Part:
    """A body: where it hangs, its joint's frame there, the joint, its mass about that frame, and the frame of its prim in that."""

    parent: int
    at: tuple[float, ...]
    turn: tuple[float, ...]
    kind: str
    axis: int
    centre: tuple[float, ...]
    mass: float
    moments: tuple[float, ...]
    principal: tuple[float, ...]
    prim_at: tuple[float, ...]
    prim_turn: tuple[float, ...]


def short(low: float, high: float) -> st.SearchStrategy[float]:
    return st.integers(int(low * 1000), int(high * 1000)).map(lambda value: value / 1000)


VECTORS = st.tuples(*[short(-1, 1)] * 3)
QUATERNIONS = st.tuples(*[short(-1, 1)] * 4).filter(lambda q: np.linalg.norm(q) > 0.1)
MASSES = st.tuples(short(0.1, 1), short(0.1, 1), short(0.1, 1)).map(lambda m: (m[1] + m[2], m[0] + m[2], m[0] + m[1]))


def parts(number: int) -> st.SearchStrategy[Part]:
    kinds = st.sampled_from(("hinge", "slide", "fixed") if number else ("hinge", "slide"))
    axes, mass = st.integers(0, 2), short(0.1, 5)
    turns = VECTORS, QUATERNIONS, VECTORS, mass, MASSES, QUATERNIONS, VECTORS, QUATERNIONS
    at, turn, centre, weight, moments, principal, prim_at, prim_turn = turns
    return st.builds(
        Part,
        st.integers(0, number - 1) if number else st.just(-1),
        at,
        turn,
        kinds,
        axes,
        centre,
        weight,
        moments,
        principal,
        prim_at,
        prim_turn,
    )


TREES = st.integers(1, 5).flatmap(lambda count: st.tuples(*map(parts, range(count))))


def rotation(quaternion: Sequence[float]) -> Rotation:
    return Rotation.from_quat(quaternion, scalar_first=True)


def numbers(values: Sequence[float], between: str = " ") -> str:
    return between.join(repr(float(value)) for value in values)


def as_mjcf(tree: Sequence[Part]) -> str:
    def body(number: int) -> str:
        part = tree[number]
        axis = numbers(np.eye(3)[part.axis])
        joint = "" if part.kind == "fixed" else f'<joint name="joint_{number}" type="{part.kind}" axis="{axis}"/>'
        inertial = f'mass="{part.mass}" pos="{numbers(part.centre)}" quat="{numbers(part.principal)}" diaginertia="{numbers(part.moments)}"'
        inner = "".join(body(other) for other, one in enumerate(tree) if one.parent == number)
        return (
            f'<body name="body_{number}" pos="{numbers(part.at)}" quat="{numbers(part.turn)}">{joint}<inertial {inertial}/>{inner}</body>'
        )

    return f'<mujoco><compiler angle="radian"/><option gravity="0 0 -9.81"/><worldbody>{body(0)}</worldbody></mujoco>'


def as_urdf(tree: Sequence[Part]) -> str:
    found = ['<robot name="tree"><link name="world"/>']
    kinds = {"hinge": "continuous", "slide": "prismatic", "fixed": "fixed"}

    def origin(at: Sequence[float], turn: Sequence[float]) -> str:
        return f'<origin xyz="{numbers(at)}" rpy="{numbers(rotation(turn).as_euler("xyz"))}"/>'

    for number, part in enumerate(tree):
        names = ("ixx", "iyy", "izz")
        own = " ".join(f'{name}="{value!r}"' for name, value in zip(names, part.moments, strict=True))
        inertial = f'{origin(part.centre, part.principal)}<mass value="{part.mass}"/><inertia {own} ixy="0" ixz="0" iyz="0"/>'
        found.append(f'<link name="body_{number}"><inertial>{inertial}</inertial></link>')
        above = "world" if part.parent < 0 else f"body_{part.parent}"
        limit = '<limit effort="0" velocity="0"/>' if part.kind == "slide" else ""
        found.append(
            f'<joint name="joint_{number}" type="{kinds[part.kind]}"><parent link="{above}"/><child link="body_{number}"/>'
            f'{origin(part.at, part.turn)}<axis xyz="{numbers(np.eye(3)[part.axis])}"/>{limit}</joint>'
        )
    return "".join([*found, "</robot>"])


def as_usd(tree: Sequence[Part]) -> str:
    """The frame of each prim is not that of its joint, and stands elsewhere than its joint says."""
    kinds = {"hinge": "PhysicsRevoluteJoint", "slide": "PhysicsPrismaticJoint", "fixed": "PhysicsFixedJoint"}
    found = [HEAD, SCENE]
    for number, part in enumerate(tree):
        back = rotation(part.prim_turn).inv()

        def in_prim(at: Sequence[float], of: Part) -> np.ndarray:
            return rotation(of.prim_turn).inv().apply(np.array(at) - of.prim_at)

        principal = (back * rotation(part.principal)).as_quat(scalar_first=True)
        at, turn = np.array(part.at), rotation(part.turn)
        if part.parent >= 0:
            above = tree[part.parent]
            at, turn = in_prim(part.at, above), rotation(above.prim_turn).inv() * turn
        body0 = "" if part.parent < 0 else f"rel physics:body0 = </body_{part.parent}>"
        found.append(
            f"""def Xform "body_{number}" ({BODY})
{{
    float physics:mass = {part.mass}
    point3f physics:centerOfMass = ({numbers(in_prim(part.centre, part), ", ")})
    float3 physics:diagonalInertia = ({numbers(part.moments, ", ")})
    quatf physics:principalAxes = ({numbers(principal, ", ")})
    double3 xformOp:translate = (7, 8, 9)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}}
def {kinds[part.kind]} "joint_{number}"
{{
    {body0}
    rel physics:body1 = </body_{number}>
    uniform token physics:axis = "{"XYZ"[part.axis]}"
    point3f physics:localPos0 = ({numbers(at, ", ")})
    quatf physics:localRot0 = ({numbers(turn.as_quat(scalar_first=True), ", ")})
    point3f physics:localPos1 = ({numbers(in_prim((0, 0, 0), part), ", ")})
    quatf physics:localRot1 = ({numbers(back.as_quat(scalar_first=True), ", ")})
}}
"""
        )
    return "".join(found)


@settings(max_examples=30, deadline=None)
@given(tree=TREES)
def test_one_tree_in_three_formats_is_one_robot(tree: tuple[Part, ...], tmp_path_factory: pytest.TempPathFactory) -> None:
    folder = tmp_path_factory.mktemp("tree")
    mjcf, urdf, usd = (
        robot(folder, write(tree), f"tree.{suffix}") for write, suffix in ((as_mjcf, "xml"), (as_urdf, "urdf"), (as_usd, "usda"))
    )
    for one, other in ((mjcf, usd), (urdf, usd)):
        differing = {key: quantity.texts for key, quantity in quantities(one, other).items() if quantity.differs}
        assert not differing


@pytest.mark.parametrize("first", [True, False])
def test_a_joint_turns_as_its_second_body_does_from_its_first(tmp_path: Path, first: bool) -> None:
    """A joint from the arm to the world is the same joint with its axis the other way."""
    text = ARM if first else changed("rel physics:body1 = </arm/upper>", "rel physics:body0 = </arm/upper>")
    text = text if first else changed("point3f physics:localPos0 = (0, 0.2435, 0.3)", "point3f physics:localPos1 = (0, 0.2435, 0.3)", text)
    upper = robot(tmp_path, text).tree.bodies[0]
    assert [float(x) for x in upper.joints[0].axis] == ([0, 1, 0] if first else [0, -1, 0])


# Units, namespaces, shapes and kinds.


def test_a_stage_in_centimetres_grams_and_y_up_is_the_same_robot(tmp_path: Path) -> None:
    text = changed("metersPerUnit = 1\n", "metersPerUnit = 0.01\n    kilogramsPerUnit = 0.001\n")
    for name, factor in {"centerOfMass": 100, "localPos0": 100, "diagonalInertia": 1e7}.items():
        text = re.sub(
            rf"(physics:{name} = )\(([^)]*)\)",
            lambda found, by=factor: f"{found[1]}({', '.join(f'{float(x) * by:.6g}' for x in found[2].split(','))})",
            text,
        )
    for name, factor in {
        "physics:mass": 1e3,
        "armature": 1e7,
        "newton:damping": 1e7,
        "stiffness": 1e3,
        "linear:physics:damping": 1e3,
    }.items():
        text = re.sub(rf"({name} = )([\d.]+)", lambda found, by=factor: f"{found[1]}{float(found[2]) * by:.6g}", text)
    text = text.replace("gravityMagnitude = 9.81", "gravityMagnitude = 981")
    assert held(tmp_path, text)[0]


def test_a_stage_that_does_not_say_is_in_centimetres_and_its_gravity_is_that_of_the_earth(tmp_path: Path) -> None:
    text = ARM.replace("    metersPerUnit = 1\n", "").replace('    upAxis = "Z"\n', "").replace(SCENE, "")
    tree = robot(tmp_path, text).tree
    assert [float(x) for x in tree.gravity] == [0, -9.81, 0]
    assert float(tree.bodies[1].pose[0].position[0]) == pytest.approx(0.004318, rel=1e-12)


def test_gravity_is_off_where_a_scene_says_so(tmp_path: Path) -> None:
    text = changed("float physics:gravityMagnitude", "bool newton:gravityEnabled = 0\n    float physics:gravityMagnitude")
    gravity = robot(tmp_path, text).tree.gravity
    assert not any(gravity) and robot(tmp_path, text).tree.places["gravity"].line == line_of(text, "gravityEnabled")


@pytest.mark.parametrize(("magnitude", "expected"), [("0", 0.0), ("0.25", 0.25), ("-inf", 9.81), ("-1", 9.81)])
def test_gravity_of_a_negative_size_is_that_of_the_earth(tmp_path: Path, magnitude: str, expected: float) -> None:
    text = changed("gravityMagnitude = 9.81", f"gravityMagnitude = {magnitude}")
    assert [float(x) for x in robot(tmp_path, text).tree.gravity] == [0, 0, -expected]


@pytest.mark.parametrize(("stiffness", "damping"), [(40.0, 0.0), (0.0, 3.0), (0.0, 0.0), (40.0, 3.0)])
def test_a_drive_acts_that_has_a_stiffness_or_a_damping(tmp_path: Path, stiffness: float, damping: float) -> None:
    text = changed("drive:linear:physics:stiffness = 40", f"drive:linear:physics:stiffness = {stiffness}")
    text = changed("drive:linear:physics:damping = 3", f"drive:linear:physics:damping = {damping}", text)
    found = robot(tmp_path, text).actuators
    acts = f'<position joint="slide" kp="{stiffness}" kv="{damping}"/>' if stiffness else f'<velocity joint="slide" kv="{damping}"/>'
    assert len(found) == bool(stiffness or damping)
    twin = re.sub("<actuator>.*</actuator>", f"<actuator>{acts}</actuator>" if found else "", TWIN)
    assert held(tmp_path, text, twin)[0]


def test_newton_is_stronger_than_mjc_and_that_is_told(tmp_path: Path) -> None:
    text = changed("float newton:armature = 0.25", "float newton:armature = 0.25\n        double mjc:armature = 0.3")
    found = robot(tmp_path, text)
    assert float(found.tree.joints[0].armature) == 0.25
    (told,) = [part for part in found.left_out if "namespace" in part.what]
    assert told.lines == (line_of(text, "mjc:armature"),)


@pytest.mark.parametrize(
    ("locked", "kind"),
    [
        (("transX", "transY", "transZ", "rotX", "rotY", "rotZ"), None),
        (("transX", "transY", "transZ", "rotX", "rotY"), JointKind.HINGE),
        (("transY", "transZ", "rotX", "rotY", "rotZ"), JointKind.SLIDE),
        (("transX", "transY", "transZ"), JointKind.BALL),
        (("transZ", "rotX", "rotY"), JointKind.PLANAR),
        ((), JointKind.FREE),
    ],
)
def test_a_joint_of_six_degrees_of_freedom_is_what_it_leaves_free(tmp_path: Path, locked: Sequence[str], kind: JointKind | None) -> None:
    limits = "\n".join(f"float limit:{one}:physics:low = 1\nfloat limit:{one}:physics:high = -1" for one in locked)
    text = changed('def PhysicsPrismaticJoint "slide"', 'def PhysicsJoint "slide"')
    text = re.sub(r"\n *(uniform token physics:axis = \"X\"|double mjc:stiffness.*|float drive.*)", "", text)
    text = changed("point3f physics:localPos0 = (0.4318", f"{limits}\npoint3f physics:localPos0 = (0.4318", text)
    joints = robot(tmp_path, text).tree.bodies[1].joints
    assert [joint.kind for joint in joints] == ([] if kind is None else [kind])


def test_shapes_of_even_density_weigh_what_those_of_an_mjcf_do(tmp_path: Path) -> None:
    shapes = (
        ("Sphere", "double radius = 0.1", 'type="sphere" size="0.1"'),
        ("Cube", "double size = 2\nfloat3 xformOp:scale = (0.1, 0.2, 0.3)", 'type="box" size="0.1 0.2 0.3"'),
        ("Cylinder", "double radius = 0.1\ndouble height = 0.4", 'type="cylinder" size="0.1 0.2"'),
        ("Capsule", "double radius = 0.1\ndouble height = 0.4", 'type="capsule" size="0.1 0.2"'),
    )
    for kind, size, twin in shapes:
        order = '["xformOp:translate", "xformOp:scale"]' if "scale" in size else '["xformOp:translate"]'
        collider = (
            f'def {kind} "shape" (prepend apiSchemas = ["PhysicsCollisionAPI", "PhysicsMassAPI"])\n{{\n{size}\n'
            "float physics:density = 500\n"
            f"double3 xformOp:translate = (0.3, 0, 0)\nuniform token[] xformOpOrder = {order}\n}}"
        )
        usd = re.sub(r'(def Xform "fore" \(.*\)\n    {)[^}]*}', rf"\1\n{collider}\n    }}", ARM)
        mjcf = re.sub(r'<inertial mass="4.8"[^>]*/>', f'<geom {twin} pos="0.3 0 0" density="500"/>', TWIN)
        found = hold_against(meant(robot(tmp_path, mjcf, "arm.xml"), 8, 0), robot(tmp_path, usd), {})
        assert found.alike and not found.differences, (kind, conclude_pair(found).sentence)


def test_shapes_share_the_mass_of_their_body_by_their_volumes(tmp_path: Path) -> None:
    shapes = (
        ("Sphere", "double radius = 0.1", 'type="sphere" size="0.1"', 4 / 3 * math.pi * 0.1**3),
        ("Cube", "double size = 0.2", 'type="box" size="0.1 0.1 0.1"', 0.2**3),
        ("Cylinder", "double radius = 0.1\ndouble height = 0.4", 'type="cylinder" size="0.1 0.2"', math.pi * 0.1**2 * 0.4),
        ("Capsule", "double radius = 0.1\ndouble height = 0.4", 'type="capsule" size="0.1 0.2"', math.pi * (0.1**2 * 0.4 + 4 / 3 * 0.1**3)),
    )
    colliders, geoms, whole = "", "", sum(volume for *_, volume in shapes)
    for place, (kind, size, twin, volume) in enumerate(shapes):
        at = f'double3 xformOp:translate = ({place}, 0, 0)\nuniform token[] xformOpOrder = ["xformOp:translate"]'
        colliders += f'def {kind} "shape_{place}" (prepend apiSchemas = ["PhysicsCollisionAPI"])\n{{\n{size}\n{at}\n}}\n'
        geoms += f'<geom {twin} pos="{place} 0 0" mass="{4.8 * volume / whole!r}"/>'
    usd = re.sub(
        r'(def Xform "fore" \(.*\)\n    {\n        float physics:mass = 4.8)[^}]*}', lambda found: f"{found[1]}\n{colliders}}}", ARM
    )
    compared = quantities(robot(tmp_path, re.sub(r'<inertial mass="4.8"[^>]*/>', geoms, TWIN), "arm.xml"), robot(tmp_path, usd))
    assert not {key: one.texts for key, one in compared.items() if one.differs}


# Operations of a prim as a geom of MJCF has them, the outermost first.
TURNED = Rotation.from_euler("xyz", (10, 20, 30), degrees=True)
OPERATIONS = {
    "translate": ("double3 {} = (0.3, 0.1, 0)", (0.3, 0.1, 0), Rotation.identity()),
    "!invert!translate": ("double3 {} = (0.3, 0.1, 0)", (-0.3, -0.1, 0), Rotation.identity()),
    "orient": ("quatd {} = (1.6, 1.2, 0, 0)", (0, 0, 0), rotation((0.8, 0.6, 0, 0))),
    "rotateY:of_the_shape": ("double {} = 40", (0, 0, 0), Rotation.from_euler("y", 40, degrees=True)),
    "rotateXYZ": ("double3 {} = (10, 20, 30)", (0, 0, 0), TURNED),
    "rotateZYX": ("double3 {} = (10, 20, 30)", (0, 0, 0), Rotation.from_euler("zyx", (30, 20, 10), degrees=True)),
    "!invert!rotateXYZ": ("double3 {} = (10, 20, 30)", (0, 0, 0), TURNED.inv()),
    "scale": ("double3 {} = (1, 1.0000001, 1)", (0, 0, 0), Rotation.identity()),
    "transform": (
        "matrix4d {} = (" + ", ".join(f"({numbers(row, ', ')}, 0)" for row in TURNED.as_matrix().T) + ", (0.3, 0.1, 0, 1))",
        (0.3, 0.1, 0),
        TURNED,
    ),
}


@pytest.mark.parametrize("outer", [*OPERATIONS])
def test_operations_of_prims_follow_one_another_inwards(tmp_path: Path, outer: str) -> None:
    """Of a capsule that gives its body its mass; it and a prim above it have an operation each, and the first is the outermost."""
    operations, at, turn = [], np.zeros(3), Rotation.identity()
    for name in (outer, "translate:inner", "rotateXYZ:inner"):
        text, shift, own = OPERATIONS[name.removesuffix(":inner")]
        operations.append((name.replace("!invert!", "!invert!xformOp:") if "!" in name else f"xformOp:{name}", text))
        at, turn = at + turn.apply(shift), turn * own
    (first, text), *inner = operations
    above, below = (
        "\n".join([*(text.format(name.removeprefix("!invert!")) for name, text in own), f"uniform token[] xformOpOrder = {words}"])
        for own, words in (([(first, text)], f'["{first}"]'), (inner, '["xformOp:translate:inner", "xformOp:rotateXYZ:inner"]'))
    )
    shape = (
        f'def Xform "above"\n{{\n{above}\ndef Capsule "shape" (prepend apiSchemas = ["PhysicsCollisionAPI", "PhysicsMassAPI"])\n{{\n'
        f"double radius = 0.1\ndouble height = 0.4\nfloat physics:density = 500\n{below}\n}}\n}}"
    )
    usd = re.sub(r'(def Xform "fore" \(.*\)\n    {)[^}]*}', lambda found: f"{found[1]}\n{shape}\n    }}", ARM)
    geom = f'<geom type="capsule" size="0.1 0.2" pos="{numbers(at)}" quat="{numbers(turn.as_quat(scalar_first=True))}" density="500"/>'
    mjcf = re.sub(r'<inertial mass="4.8"[^>]*/>', geom, TWIN)
    compared = quantities(robot(tmp_path, mjcf, "arm.xml"), robot(tmp_path, usd))
    assert not {key: one.texts for key, one in compared.items() if one.differs}


# One part each: how it is told, the text whose line is told, and the part.
PARTS = [
    ("dry friction", 'MjcTendon "rubs"', "uniform double mjc:frictionloss = 2"),
    ("tendon limits", 'MjcTendon "ends"', "uniform double mjc:range:min = -1\nuniform double mjc:range:max = 1"),
    ("", 'MjcTendon "free"', "uniform double mjc:range:min = 0\nuniform double mjc:range:max = 0\nuniform double mjc:frictionloss = 0"),
]
TENDON_PARTS = """def {}
{{
    rel mjc:path = [</arm/shoulder>, </arm/slide>]
    uniform double[] mjc:path:coef = [0.5, 2]
    uniform token mjc:type = "fixed"
    {}
}}
"""
FURTHER = [
    ("damping of bodies", "float physics:mass = 4.8", "float physxRigidBody:linearDamping = 0.05"),
    ("bodies moved from outside", "float physics:mass = 4.8", "bool physics:kinematicEnabled = 1"),
    ("", "float physics:mass = 4.8", "bool physics:kinematicEnabled = 0\nfloat physxRigidBody:angularDamping = 0"),
    ("effort and velocity limits", 'uniform token physics:axis = "X"', "float newton:velocityLimit = 3"),
    ("limits on one side", 'uniform token physics:axis = "X"', "float physics:lowerLimit = -1"),
    ("fluid", "float physics:gravityMagnitude", "double mjc:option:viscosity = 1"),
]


def test_parts_that_no_tree_holds_are_told_with_their_lines(tmp_path: Path) -> None:
    def told(text: str) -> dict[str, tuple[int, ...]]:
        return {one.what: one.lines for one in robot(tmp_path, text).left_out if one.lines != before.get(one.what)}

    before: dict[str, tuple[int, ...]] = {}
    before = told(ARM)
    for what, definition, part in PARTS:
        text = ARM + TENDON_PARTS.format(definition, part)
        assert told(text) == ({what: (line_of(text, definition),)} if what else {}), part
    for what, beside, part in FURTHER:
        # What follows on the same line moves no other one.
        text = changed(beside, "; ".join([*part.split("\n"), beside]))
        found = told(text)
        # A body that is moved from outside closes a loop with its joint.
        assert {*found} - {"equalities"} == ({what} if what else set()), part
        assert not what or {line_of(text, part), line_of(text, "PhysicsPrismaticJoint")} & {*found[what]}


GENERAL = """def MjcActuator "acts"
{{
    rel mjc:target = </{}>
    {}
}}
"""
# An actuator of MuJoCo's schema, and that of the MJCF.
ACTUATORS = {
    "by default": ("", ""),
    "of gains": ("uniform double[] mjc:gainPrm = [7, 2, 3]; uniform double[] mjc:biasPrm = [1, -2, -3]", 'gainprm="7"'),
    "of affine gains": (
        'uniform token mjc:gainType = "affine"; uniform double[] mjc:gainPrm = [7, 2]; uniform token mjc:biasType = "affine"; '
        "uniform double[] mjc:biasPrm = [1, -2, -3]; uniform double[] mjc:gear = [5]",
        'gaintype="affine" gainprm="7 2 0" biastype="affine" biasprm="1 -2 -3" gear="5"',
    ),
    "of bounds": (
        'uniform double mjc:ctrlRange:min = -1; uniform double mjc:ctrlRange:max = 2; uniform token mjc:forceLimited = "true"; '
        "uniform double mjc:forceRange:min = -3; uniform double mjc:forceRange:max = 4",
        'ctrllimited="true" ctrlrange="-1 2" forcelimited="true" forcerange="-3 4"',
    ),
    "of a filter": (
        'uniform token mjc:dynType = "filter"; uniform token mjc:actLimited = "true"; uniform double mjc:actRange:min = -1; '
        "uniform double mjc:actRange:max = 1",
        'dyntype="filter" dynprm="1" actlimited="true" actrange="-1 1"',
    ),
}


@pytest.mark.parametrize("what", ACTUATORS)
def test_an_actuator_of_mujocos_schema_is_that_of_the_mjcf(tmp_path: Path, what: str) -> None:
    usd, mjcf = ACTUATORS[what]
    own = robot(tmp_path, ARM + GENERAL.format("arm/shoulder", usd.replace("; ", "\n    "))).actuators[-1]
    twin = re.sub("<actuator>.*</actuator>", f'<actuator><general joint="shoulder" {mjcf}/></actuator>', TWIN)
    (other,) = robot(tmp_path, twin, "arm.xml").actuators
    fields = ("joints", "gear", "gain", "bias", "dynamics", "control_range", "activation_range", "force_range", "why_not")
    assert {one: getattr(own, one) for one in fields} == {one: getattr(other, one) for one in fields}


@pytest.mark.parametrize(
    ("usd", "why_not"),
    [
        ('uniform token mjc:gainType = "muscle"', "has gainType 'muscle', which is not read"),
        ("uniform double mjc:inheritRange = 1", "has mjc:inheritRange, which is not read"),
        (
            'uniform double[] mjc:gainPrm = [7]; uniform token mjc:biasType = "affine"; uniform double[] mjc:biasPrm = [0, -7, 0.5]',
            "has a ratio of damping, which is not read",
        ),
        ("", "drives </arm>, which is no joint of one degree of freedom and no fixed tendon"),
    ],
)
def test_an_actuator_that_is_not_read_says_why(tmp_path: Path, usd: str, why_not: str) -> None:
    text = ARM + GENERAL.format("arm/shoulder" if usd else "arm", usd.replace("; ", "\n    "))
    assert robot(tmp_path, text).actuators[-1].why_not == why_not


@pytest.mark.parametrize(
    ("old", "new", "why_not"),
    [
        ("drive:linear:physics:stiffness", "drive:angular:physics:stiffness", "drives angular of a slide joint, which is not read"),
        (
            "float drive:linear:physics:stiffness",
            'uniform token drive:linear:physics:type = "acceleration"\nfloat drive:linear:physics:stiffness',
            "is a drive of the type acceleration, whose gains an engine makes",
        ),
    ],
)
def test_a_drive_that_is_not_read_says_why(tmp_path: Path, old: str, new: str, why_not: str) -> None:
    assert robot(tmp_path, changed(old, new)).actuators[0].why_not == why_not


def test_a_tendon_drives_the_joints_it_leads_over(tmp_path: Path) -> None:
    text = ARM + TENDON_PARTS.format('MjcTendon "both"', "") + GENERAL.format("both", "")
    assert robot(tmp_path, text).actuators[-1].joints == (("shoulder", 0.5), ("slide", 2))


@pytest.mark.parametrize(
    ("follows", "coefficients"),
    [
        ("rel newton:mimicJoint = </arm/shoulder>; float newton:mimicCoef0 = 0.2; float newton:mimicCoef1 = 3", (0.2, 3)),
        ("rel newton:mimicJoint = </arm/shoulder>; double mjc:coef3 = 5", (0, 1, 0, 5)),
        # PhysX: position + gearing * position of the other + offset = 0.
        (
            "rel physxMimicJoint:rotX:referenceJoint = </arm/shoulder>; float physxMimicJoint:rotX:gearing = 3; "
            "float physxMimicJoint:rotX:offset = 0.2",
            (-0.2, -3),
        ),
    ],
)
def test_a_joint_that_mimics_follows_by_the_law_of_its_schema(tmp_path: Path, follows: str, coefficients: Sequence[float]) -> None:
    text = changed("double mjc:stiffness = 8", follows.replace("; ", "\n        "))
    (one,) = robot(tmp_path, text).equalities
    assert (one.says.joint, one.says.leader, one.line) == ("slide", "shoulder", line_of(text, "oint = </arm/shoulder>"))
    found = [*map(float, one.says.coefficients)]
    assert found == pytest.approx([*coefficients, *[0] * (len(found) - len(coefficients))], rel=1e-7)


def test_what_an_mjcf_says_of_a_slide_is_read_in_the_units_of_the_stage(tmp_path: Path) -> None:
    """Lengths of a stage in decimetres, and the numbers of MuJoCo's schema, against the MJCF that says the same."""
    usd = "; ".join(
        [
            "double mjc:stiffness = 8",
            "double mjc:ref = 3",
            "double mjc:springref = -2",
            "double mjc:margin = 0.5",
            "bool mjc:actuatorgravcomp = 1",
            "uniform double[] mjc:solreflimit = [0.03, 0.9]",
            "uniform double[] mjc:solimplimit = [0.8, 0.9]",
            "float physics:lowerLimit = -1",
            "float physics:upperLimit = 4",
        ]
    )
    text = changed("metersPerUnit = 1\n", "metersPerUnit = 0.1\n", changed("double mjc:stiffness = 8", usd.replace("; ", "\n        ")))
    said = 'ref="0.3" springref="-0.2" margin="0.05" actuatorgravcomp="true" solreflimit="0.03 0.9" solimplimit="0.8 0.9 0.001 0.5 2" '
    twin = changed('name="slide"', f'name="slide" {said} limited="true" range="-0.1 0.4"', TWIN)
    own, other = (found.tree.bodies[1].joints[0] for found in (robot(tmp_path, text), robot(tmp_path, twin, "arm.xml")))
    for one in ("reference", "spring_reference", "margin", "limits", "stiffness"):
        pair = np.array([getattr(joint, one) for joint in (own, other)], dtype=float)
        assert pair[0] == pytest.approx(pair[1], rel=1e-12), one
    assert own.compensated_by_actuators and other.compensated_by_actuators
    soft = [[*map(float, (*joint.limit_softness.solref, *joint.limit_softness.solimp))] for joint in (own, other)]
    assert soft[0] == soft[1]


@pytest.mark.parametrize(
    ("kind", "says"),
    [("PhysicsSphericalJoint", "Meeting"), ("PhysicsFixedJoint", "Weld"), ("PhysicsRevoluteJoint", ""), ("PhysicsPrismaticJoint", "")],
)
def test_a_joint_that_closes_a_loop_is_a_constraint_or_told(tmp_path: Path, kind: str, says: str) -> None:
    ties = "rel physics:body0 = </arm/{}>\nrel physics:body1 = </twin>"
    text = ARM + (
        f'def Xform "twin" ({BODY})\n{{\nfloat physics:mass = 3\nfloat3 physics:diagonalInertia = (1, 1, 1)\n}}\n'
        f'def PhysicsRevoluteJoint "beside"\n{{\n{ties.format("upper")}\n}}\n'
        f'def {kind} "closes"\n{{\n{ties.format("fore")}\npoint3f physics:localPos1 = (0, 0, 0.5)\n}}\n'
    )
    found = robot(tmp_path, text)
    (one,) = found.equalities
    assert (one.kind, type(one.says).__name__ if one.says else "", one.line) == (kind, says, line_of(text, "closes"))
    assert bool(one.why_not) == (not says)
    assert [part.lines for part in found.left_out if part.what == "equalities"] == [(one.line,)]


def test_a_stage_is_read_with_its_layers_and_in_binary(tmp_path: Path) -> None:
    layer = Sdf.Layer.CreateAnonymous(".usda")
    layer.ImportFromString(ARM)
    assert layer.Export(str(tmp_path / "arm.usdc"))
    over = written(
        tmp_path,
        f'{HEAD[:-2]}    subLayers = [@arm.usdc@]\n)\nover "arm"\n{{\n    over "upper"\n    {{\n        float physics:mass = 18\n'
        "    }\n}\n",
        "over.usda",
    )
    stronger, binary = read_robot(over), read_robot(tmp_path / "arm.usdc")
    masses = [(one.tree.bodies[0].inertia, one.tree.bodies[1].inertia) for one in (stronger, binary)]
    placed = [(inertia.places["mass"].path.name, float(inertia.mass)) for pair in masses for inertia in pair if inertia]
    assert placed == [("over.usda", 18.0), ("arm.usdc", 4.8), ("arm.usdc", 17.4), ("arm.usdc", 4.8)]
    assert masses[0][0] is not None and masses[0][0].places["mass"].line == line_of(over.read_text(), "= 18")
    # Of a binary layer, the line of its text, and the path of the prim.
    text = layer.ExportToString()
    assert masses[1][0] is not None and masses[1][0].places["mass"].line == line_of(text, "= 17.4")
    assert masses[1][0].places["mass"].tag == "/arm/upper"
    assert UsdUtils.CreateNewUsdzPackage(str(tmp_path / "arm.usdc"), str(tmp_path / "arm.usdz"))
    assert len(read_robot(tmp_path / "arm.usdz").tree.bodies) == 2
    # A survey takes the stages, not what they are made of.
    assert [path.name for path in find_files([str(tmp_path)])] == ["arm.usdz", "over.usda"]


def test_a_reference_within_a_layer_is_no_file(tmp_path: Path) -> None:
    """As converters write materials and parts that they use twice."""
    part = 'class "link" {{ float physics:mass = {mass} }}\n'
    text = changed("        float physics:mass = 17.4\n", "", ARM).replace(
        'def Xform "upper" (prepend apiSchemas', 'def Xform "upper" (prepend references = </link>\n    prepend apiSchemas'
    )
    (upper, _) = robot(tmp_path, text + part.format(mass="17.4;")).tree.bodies
    assert upper.inertia is not None and upper.inertia.mass == 17.4


LAYER = '''\
#usda 1.0
(
    doc = """def Xform "no"
"""
    metersPerUnit = 1
)
# def "no"
def Xform "a" (
    variants = {
        string v = "x"
    }
    prepend variantSets = "v"
)
{
    float[] no = [1,
 2]
    custom string s = "} {"
    float t.timeSamples = {
        0: 1,
    }
    variantSet "v" = {
        "x" {
            over "b"
            {
                float m = 2 (
                    doc = ")"
                )
                rel r = </a>
            }
        }
    }
}
'''


def test_lines_are_those_of_the_text() -> None:
    found = lines_of(LAYER)
    expected = {"/.metersPerUnit": 5, "/a": 8, "/a.no": 15, "/a.s": 17, "/a.t": 18, "/a{v=x}b": 23, "/a{v=x}b.m": 25, "/a{v=x}b.r": 28}
    assert {name: line for name, line in found.items() if name in expected} == expected
    assert not any("/no" in name for name in found)


# What has no meaning.

SCALE = 'float3 xformOp:scale = (2, 2, 2)\nuniform token[] xformOpOrder = ["xformOp:scale"]\n'
MIRRORED = (
    "matrix4d xformOp:transform = ((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, -1, 0), (0, 0, 0, 1))\n"
    'uniform token[] xformOpOrder = ["xformOp:transform"]\n'
)
LOCKED = "\n{\n" + "".join(
    f"float limit:{one}:physics:low = 1\nfloat limit:{one}:physics:high = -1\n" for one in ("transX", "transY", "transZ", "rotZ")
)
REFUSED = {
    "no text": ((ARM, "\n"), r"arm.usda: is no USD file"),
    "a syntax error": (("float physics:mass = 17.4", "float physics:mass = "), r"arm.usda:\d+: is not well-formed USD: .*; correct it"),
    "no body": (("PhysicsRigidBodyAPI", "FooAPI"), "has no prim with PhysicsRigidBodyAPI that is enabled; expected the bodies"),
    "a body that is not there": (
        ("rel physics:body1 = </arm/fore>", "rel physics:body1 = </arm/hand>"),
        r"arm.usda:{body1 = </arm/hand}: </arm/slide> physics:body1 names </arm/hand>; expected one prim",
    ),
    "one body twice": (
        ("rel physics:body0 = </arm/upper>", "rel physics:body0 = </arm/fore>"),
        "joins body </arm/fore> to itself; name two",
    ),
    "a negative mass": (
        ("mass = 17.4", "mass = -17.4"),
        r"arm.usda:{-17.4}: </arm/upper> physics:mass is -17.4; expected a finite number above zero",
    ),
    "an infinite mass": (("mass = 17.4", "mass = inf"), "physics:mass is inf; expected a finite number above zero"),
    "words for a number": (("float physics:mass = 17.4", 'string physics:mass = "much"'), "physics:mass is 'much'; expected a number"),
    "a unit of no size": (("metersPerUnit = 1", "metersPerUnit = 0"), r"arm.usda:{metersPerUnit}: metersPerUnit is no size of a unit"),
    "nan": (("mass = 17.4", "mass = nan"), "physics:mass is nan; expected a finite number"),
    "a quaternion of zeros": (
        ("point3f physics:localPos0 = (0.4318", "quatf physics:localRot0 = (0, 0, 0, 0)\npoint3f physics:localPos0 = (0.4318"),
        "physics:localRot0 is no rotation; expected a quaternion",
    ),
    "an axis that is none": (('physics:axis = "X"', 'physics:axis = "W"'), "physics:axis is 'W'; expected X, Y or Z"),
    "a distance": (
        ('def PhysicsPrismaticJoint "slide"', 'def PhysicsDistanceJoint "slide"'),
        "holds two points at a distance, which is not read",
    ),
    "two turns": (
        ('def PhysicsRevoluteJoint "shoulder"\n    {', f'def PhysicsJoint "shoulder"{LOCKED}'),
        "leaves rotX, rotY free, in which engines have other coordinates each",
    ),
    "a mesh that weighs": (
        ("float physics:mass = 4.8", 'def Mesh "m" (prepend apiSchemas = ["PhysicsCollisionAPI"])\n{\n}'),
        r"</arm/fore/m> is a Mesh that gives body </arm/fore> the inertia of an engine's making",
    ),
    "a centre without a mass": (
        ("float physics:mass = 4.8", "point3f physics:centerOfMass = (0.1, 0, 0)"),
        "states a centre or an inertia and not all of mass, centre and inertia; write all three",
    ),
    "a scaled body": (
        ("float physics:mass = 4.8", f"{SCALE}float physics:mass = 4.8"),
        "</arm/fore> xformOp:scale is 2 2 2; expected 1 1 1 on a body and above it",
    ),
    "a mirrored prim": (
        ("float physics:mass = 4.8", f"{MIRRORED}float physics:mass = 4.8"),
        "xformOp:transform scales, shears or mirrors; expected a rotation and a translation",
    ),
    "an operation that is not there": (
        ("float physics:mass = 4.8", 'uniform token[] xformOpOrder = ["xformOp:translate"]\nfloat physics:mass = 4.8'),
        "has the operation 'xformOp:translate' in its xformOpOrder and no such attribute",
    ),
    "a layer that is not there": (
        ("metersPerUnit = 1", "metersPerUnit = 1\n    subLayers = [@gone.usda@]"),
        r"arm.usda:{gone}: is not composed: .*gone.usda.*; name a file that is there",
    ),
    "two joints of one pair": (
        (
            'def PhysicsRevoluteJoint "shoulder"',
            'def PhysicsRevoluteJoint "again"\n{\nrel physics:body1 = </arm/upper>\n}\ndef PhysicsRevoluteJoint "shoulder"',
        ),
        "joins the bodies that </arm/again> joins",
    ),
}


NUMBERS = "point3f physics:centerOfMass = (0, -0.07, 0.014)\n        float3 physics:diagonalInertia = (0.066, 0.0125, 0.086)"
CENTRE, MOMENTS = NUMBERS.split("\n        ")


def shape(kind: str, text: str = "") -> str:
    return f'def {kind} "shape" (prepend apiSchemas = ["PhysicsCollisionAPI", "PhysicsMassAPI"])\n{{\n{text}\n}}\n'


SITES = "".join(f'def Xform "{name}" (prepend apiSchemas = ["MjcSiteAPI"])\n{{\n}}\n' for name in ("near", "far"))
REFUSED |= {
    "a negative inertia of a drive": (
        ("newton:armature = 0.25", "newton:armature = -0.25"),
        r"arm.usda:{-0.25}: </arm/shoulder> newton:armature is -0.25; expected zero or more",
    ),
    "a mass of weightless shapes": (
        (NUMBERS, shape("Plane")),
        "</arm/fore> states its mass, and its colliders weigh nothing; write its inertia",
    ),
    "five moments": (
        (MOMENTS, "float[] newton:inertia = [1, 2, 3, 4, 5]"),
        r"arm.usda:{newton:inertia}: </arm/fore> newton:inertia holds 5 numbers; expected 6: xx, yy, zz, xy, xz, yz",
    ),
    "an inertia about a centre of shapes": (
        (CENTRE, shape("Sphere")),
        "states its mass and inertia and no physics:centerOfMass, which engines take from its colliders; write it",
    ),
    "a shape with a centre": (
        (NUMBERS, shape("Sphere", "point3f physics:centerOfMass = (0, 0, 1)")),
        "</arm/fore/shape> is a collider with a centre or an inertia of its own, which is not read; write those of its body",
    ),
    "an ellipsoid": (
        (NUMBERS, shape("Sphere", SCALE.replace("(2, 2, 2)", "(1, 2, 1)"))),
        "</arm/fore/shape> is a round shape with a scale of its own along each axis, whose inertia is not read",
    ),
    "a negative radius": (
        (NUMBERS, shape("Sphere", "double radius = -0.1")),
        "</arm/fore/shape> has a size that is not positive; expected more than zero",
    ),
    "a shape that stands in the world": (
        (NUMBERS, shape("Sphere", 'uniform token[] xformOpOrder = ["!resetXformStack!"]')),
        "</arm/fore/shape> stands in the world, whatever is above it; leave !resetXformStack! out",
    ),
    "an operation that is not read": (
        (
            "float physics:mass = 4.8",
            'double3 xformOp:shear = (1, 2, 3)\nuniform token[] xformOpOrder = ["xformOp:shear"]\nfloat physics:mass = 4.8',
        ),
        r"arm.usda:{double3}: </arm/fore> xformOp:shear is no operation that is read; expected translate, orient, rotateXYZ or transform",
    ),
    "a second gravity": (
        (SCENE, SCENE + SCENE.replace('"scene"', '"moon"').replace("9.81", "1.62")),
        r"arm.usda:{1.62}: </moon> is a second scene with another gravity than </scene>; leave one of them out",
    ),
    "a leader that does not move": (
        ("float newton:armature", "rel newton:mimicJoint = </arm/upper>\n        float newton:armature"),
        r"arm.usda:{mimicJoint}: </arm/shoulder> newton:mimicJoint names </arm/upper>, which is no joint that moves; name one",
    ),
    "a slack tendon": (
        (
            HEAD,
            HEAD + TENDON_PARTS.format('MjcTendon "slack"', "uniform double mjc:stiffness = 3\nuniform double[] mjc:springlength = [0, 1]"),
        ),
        r"arm.usda:{MjcTendon}: </slack> is slack between two lengths, which is not read; write one mjc:springlength twice",
    ),
    "a tendon around a body": (
        (HEAD, HEAD + 'def MjcTendon "around"\n{\nrel mjc:path = </arm/upper>\nuniform double mjc:damping = 3\n}\n'),
        r"arm.usda:{MjcTendon}: </around> does not run straight from one site to another, which is not read; lead it through two sites",
    ),
    "a tendon of no length": (
        (
            HEAD,
            f'{HEAD}{SITES}def MjcTendon "straight"\n{{\nrel mjc:path = [</near>, </far>]\nuniform double mjc:stiffness = 3\n}}\n',
        ),
        r"arm.usda:{MjcTendon}: </straight> leaves its mjc:springlength to the reader, which is not read; write it",
    ),
    "a tendon with a number for two joints": (
        (HEAD, HEAD + TENDON_PARTS.format('MjcTendon "short"', "").replace("[0.5, 2]", "[0.5]")),
        "</short> has 2 joints in mjc:path and 1 numbers in mjc:path:coef; name joints that move, with one each",
    ),
}


@pytest.mark.parametrize("what", REFUSED)
def test_what_has_no_meaning_is_refused_in_a_sentence_with_its_line(tmp_path: Path, what: str) -> None:
    (old, new), sentence = REFUSED[what]
    text = ARM.replace(old, new)
    assert text != ARM
    expected = re.sub(r"{(.*?)}", lambda found: str(line_of(text, found[1])), sentence)
    with pytest.raises(InvalidModel, match=expected.replace("(", r"\(").replace(")", r"\)")):
        robot(tmp_path, text)


def test_prims_inside_one_another_and_layers_without_end_are_refused(tmp_path: Path) -> None:
    deep = 'def Xform "x"\n{\n' * (MAXIMUM_DEPTH + 1) + "}\n" * (MAXIMUM_DEPTH + 1)
    with pytest.raises(InvalidModel, match="is prim 200; no robot needs so many, or so deep ones"):
        robot(tmp_path, HEAD + deep)
    for number in range(MAXIMUM_DEPTH + 1):
        written(tmp_path, "#usda 1.0\n", f"{number}.usda")
    layers = ", ".join(f"@{number}.usda@" for number in range(MAXIMUM_DEPTH + 1))
    with pytest.raises(InvalidModel, match="is composed of more than 200 layers; no robot needs that many"):
        robot(tmp_path, changed("metersPerUnit = 1\n", f"metersPerUnit = 1\n    subLayers = [{layers}]\n"))


def test_a_fifo_is_refused_before_it_is_opened(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.usda")
    with pytest.raises(InvalidModel, match="is a FIFO"):
        read_robot(tmp_path / "pipe.usda")
    text = ARM.replace("metersPerUnit = 1", "metersPerUnit = 1\n    subLayers = [@pipe.usda@]")
    with pytest.raises(InvalidModel, match=rf"arm.usda:{line_of(text, 'pipe')}: @pipe.usda@ is a FIFO; expected a layer"):
        robot(tmp_path, text)


def test_a_file_that_cannot_be_read_is_refused_by_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def closed(self: Path, mode: str) -> None:
        raise PermissionError(13, "Permission denied")

    with pytest.raises(InvalidModel, match=r"gone.usda: there is no such file; write the model, or correct the path"):
        read_robot(tmp_path / "gone.usda")
    with pytest.raises(InvalidModel, match=r"arm.usda: is empty; expected a robot in USD"):
        robot(tmp_path, "")
    with monkeypatch.context() as patch:
        patch.setattr(stage, "MOST_BYTES", 10)
        with pytest.raises(InvalidModel, match=r"arm.usda: is larger than 10 bytes"):
            robot(tmp_path, ARM)
    path = written(tmp_path, ARM)
    monkeypatch.setattr(Path, "open", closed)
    with pytest.raises(InvalidModel, match=r"arm.usda: cannot be read: Permission denied"):
        read_robot(path)


def test_a_missing_package_is_named_with_its_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pxr", None)
    path = written(tmp_path, ARM)
    with pytest.raises(InvalidModel, match=r"is read by OpenUSD: pxr is not installed; pip install 'rigid-body-harness\[usd\]'"):
        stage.read_stage(path)


def test_bindings_that_another_package_broke_are_told(tmp_path: Path) -> None:
    """As usd-exchange leaves those of usd-core: a module that cannot be imported."""
    (tmp_path / "pxr").mkdir()
    (tmp_path / "pxr" / "__init__.py").write_text("raise ImportError('initialization failed')\n")
    code = (
        f"from pathlib import Path; from harness.files.document.stage import read_stage; read_stage(Path({str(written(tmp_path, ARM))!r}))"
    )
    paths = {"PYTHONPATH": os.pathsep.join([str(tmp_path), *sys.path])}
    done = subprocess.run([sys.executable, "-c", code], env=os.environ | paths, capture_output=True, text=True, timeout=60, check=False)
    assert "cannot be imported (initialization failed); usd-core and another package" in done.stderr


@pytest.mark.ci
def test_diagnose_takes_it_beside_an_mjcf(tmp_path: Path) -> None:
    files = [str(written(tmp_path, TWIN, "arm.xml")), "--usd", str(written(tmp_path, ARM.replace("17.4", "17.5")))]
    done = CliRunner().invoke(main, ["diagnose", *files])
    assert done.exit_code == 1 and "mass of link upper, 17.4 (arm.xml:7) against 17.5 (arm.usda:15)" in done.output, done.output
    done = CliRunner().invoke(main, ["check", "double_pendulum", "--usd", files[-1]])
    assert done.exit_code == 2 and "no mechanism has a model in usd" in done.output, done.output


def test_survey_tells_what_no_engine_reads(tmp_path: Path) -> None:
    written(tmp_path, ARM)
    study = RobotComparison(ComparisonSettings([tmp_path / "arm.usda"], 4, subjects=["mujoco/mjcf"]))
    sentence = conclude_survey(complete(study, InThisProcess())).sentence
    assert sentence.startswith("1 robot: no engine of the run reads 1"), sentence


@pytest.mark.ci
def test_compare_takes_it_beside_an_mjcf(tmp_path: Path) -> None:
    files = [str(written(tmp_path, TWIN, "arm.xml")), str(written(tmp_path, ARM))]
    done = CliRunner().invoke(main, ["compare", *files, "--subject", "mujoco/mjcf"])
    assert done.output.startswith("arm.xml and arm.usda are the same robot"), done.output


@pytest.mark.ci
@settings(max_examples=200, deadline=None)
@given(
    seed=st.integers(0, 10**6),
    put=st.sampled_from(["", "nan", "inf", "-1", "1e400", '"x"', "</a>", "None", "[1, 2]", "(1, 2)", "{", "}", "0"]),
)
def test_a_damaged_text_is_read_or_refused_in_a_sentence(seed: int, put: str, tmp_path_factory: pytest.TempPathFactory) -> None:
    words = re.findall(r"\s+|[\w:.\-]+|.", ARM)
    words[seed % len(words)] = put
    path = tmp_path_factory.getbasetemp() / "damaged.usda"
    path.write_text("".join(words))
    try:
        read_robot(path)
    except InvalidModel as error:
        assert str(error).startswith(str(path)) and re.search(r"; \w|expected", error.problem), str(error)
