"""The static audit: sound readers hold the same, and a planted difference is told with its quantity, joint and line."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest
from catalogue import BUILT_IN, MODELLED, MODELS, TREES, is_misread

from harness.arrays import Array
from harness.crosscheck.expected import load_expectations
from harness.crosscheck.held import SOUND, Difference, differences
from harness.crosscheck.held_quantities import OF_BODIES
from harness.engines import EQUATIONS, HeldBody, HeldModel, Subject, Unsupported, is_native, load_engine, subjects
from harness.engines.adapters.mujoco.quantities import fused
from harness.engines.interface import audit
from harness.errors import InvalidModel
from harness.explain.changes.mistakes import mended_mistakes
from harness.files.model_file import ModelFile, parse_model, read_model
from harness.files.text import lines as quantities
from harness.lagrange.derivation import load_mechanism
from harness.truth.sampling import generic_sample

READERS = [subject for subject in subjects(BUILT_IN) if subject.format != EQUATIONS]
# Every bar of a chain is like the first ones.
LONG = {name for name in BUILT_IN.system_names() if name.startswith("chain_") and name != "chain_3"}
MJCF_READERS = {"mujoco/mjcf", "pinocchio/mjcf"}

MJCF = """<mujoco model="crane">
  <compiler angle="radian"/>
  <option gravity="0 0 -9.81">
    <flag constraint="disable" contact="disable" actuation="disable" sensor="disable"/>
  </option>
  <worldbody>
    <site name="wall" pos="-1 0 0.5"/>
    <body name="turret" pos="0 0 0.5">
      <joint name="yaw" type="hinge" axis="0 0 1" damping="0.3" armature="0.02"/>
      <joint name="lift" type="slide" axis="0 0 1" stiffness="40" springref="0.25"/>
      <inertial pos="0.1 0 0.05" mass="3" fullinertia="0.05 0.06 0.07 0.004 -0.003 0.002"/>
      <body name="plate" pos="0 0.2 0">
        <inertial pos="0 0 0.1" mass="0.5" diaginertia="0.01 0.01 0.005"/>
      </body>
      <body name="arm" pos="0.3 0 0.1" quat="0.8 0.6 0 0">
        <joint name="elbow" type="hinge" axis="0 1 0" damping="0.1" stiffness="7" springref="0.4"/>
        <inertial pos="0.2 0 0" quat="0.6 0 0.8 0" mass="1.5" diaginertia="0.01 0.02 0.025"/>
        <site name="hook" pos="0.4 0 0"/>
      </body>
    </body>
  </worldbody>
  <tendon>
    <spatial name="rope" stiffness="20" damping="0.5" springlength="0.75">
      <site site="wall"/>
      <site site="hook"/>
    </spatial>
  </tendon>
</mujoco>
"""

# The angles are 2 atan2(0.6, 0.8) and 2 atan2(0.8, 0.6).
URDF = """<robot name="crane" xmlns:drake="http://drake.mit.edu">
  <link name="world"/>
  <link name="column">
    <inertial>
      <mass value="0"/>
      <inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/>
    </inertial>
  </link>
  <link name="turret">
    <inertial>
      <origin xyz="0.1 0 0.05"/>
      <mass value="3"/>
      <inertia ixx="0.05" ixy="0.004" ixz="-0.003" iyy="0.06" iyz="0.002" izz="0.07"/>
    </inertial>
  </link>
  <link name="plate">
    <inertial>
      <origin xyz="0 0 0.1"/>
      <mass value="0.5"/>
      <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.005"/>
    </inertial>
  </link>
  <link name="arm">
    <inertial>
      <origin xyz="0.2 0 0" rpy="0 1.8545904360032246 0"/>
      <mass value="1.5"/>
      <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.025"/>
    </inertial>
  </link>
  <joint name="yaw" type="revolute">
    <parent link="world"/>
    <child link="column"/>
    <origin xyz="0 0 0.5"/>
    <axis xyz="0 0 1"/>
    <limit effort="1" velocity="0"/>
    <dynamics damping="0.3"/>
  </joint>
  <transmission name="yaw_drive">
    <type>transmission_interface/SimpleTransmission</type>
    <joint name="yaw"/>
    <actuator name="yaw_motor">
      <drake:rotor_inertia value="0.02"/>
    </actuator>
  </transmission>
  <joint name="lift" type="prismatic">
    <parent link="column"/>
    <child link="turret"/>
    <axis xyz="0 0 1"/>
    <limit effort="0" velocity="0"/>
  </joint>
  <gazebo reference="lift">
    <springStiffness>40</springStiffness>
    <springReference>0.25</springReference>
  </gazebo>
  <joint name="weld" type="fixed">
    <parent link="turret"/>
    <child link="plate"/>
    <origin xyz="0 0.2 0"/>
  </joint>
  <joint name="elbow" type="revolute">
    <parent link="turret"/>
    <child link="arm"/>
    <origin xyz="0.3 0 0.1" rpy="1.2870022175865687 0 0"/>
    <axis xyz="0 1 0"/>
    <limit effort="0" velocity="0"/>
    <dynamics damping="0.1"/>
  </joint>
  <gazebo reference="elbow">
    <springStiffness>7</springStiffness>
    <springReference>0.4</springReference>
  </gazebo>
  <drake:linear_spring_damper>
    <drake:linear_spring_damper_body_A name="world"/>
    <drake:linear_spring_damper_p_AP value="-1 0 0.5"/>
    <drake:linear_spring_damper_body_B name="arm"/>
    <drake:linear_spring_damper_p_BQ value="0.4 0 0"/>
    <drake:linear_spring_damper_free_length value="0.75"/>
    <drake:linear_spring_damper_stiffness value="20"/>
    <drake:linear_spring_damper_damping value="0.5"/>
  </drake:linear_spring_damper>
</robot>
"""
TEXTS = {"mjcf": MJCF, "urdf": URDF}


def held_by_all(models: Mapping[str, ModelFile], gravity: float, readers: Sequence[Subject] = READERS) -> dict[str, HeldModel]:
    """The quantities of each subject that can express the mechanism."""
    held = {}
    for subject in readers:
        if subject.format not in models:
            continue
        model = models[subject.format]
        # A joint that mimics another is one where a system asks for it, and no line of its own says so.
        joints = max((list(each.joint_lines) for each in models.values()), key=len)
        try:
            loaded = load_engine(BUILT_IN, subject.engine).load(model, joints, gravity)
        except Unsupported:
            continue
        held[str(subject)] = loaded.held()  # type: ignore[attr-defined]
    return held


def audited(texts: Mapping[str, str], above: float = SOUND) -> list[Difference]:
    models = {name: parse_model(Path(f"crane.{name}"), text, name) for name, text in texts.items()}
    held = held_by_all(models, 9.81)
    assert len(held) == len(READERS)
    return differences(held, models, above)


def test_the_readers_of_the_catalogue_hold_the_same(modelled_name: str) -> None:
    """At most 69 ulps, in inertias of arm_7r that MuJoCo reads from URDF; everything else is equal to the last bit or nearly."""
    models = {name: read_model(BUILT_IN.model_path(modelled_name, name), name) for name in TEXTS}
    assert models["mjcf"].gravity is not None
    mechanism = load_mechanism(BUILT_IN, modelled_name)
    held = held_by_all(models, -models["mjcf"].gravity[2], [subject for subject in READERS if not is_misread(subject, mechanism)])
    assert {"mujoco/mjcf", "pinocchio/urdf"} <= set(held)
    assert differences(held, models) == []
    rounded = differences(held, models, above=4.0)
    assert {row.quantity for row in rounded} <= {"inertia"}
    assert all(set(held[subject].joints) == set(models["mjcf"].joint_lines) for subject in held)


@pytest.mark.parametrize("name", [name for name in MODELLED if name not in LONG])
def test_coordinates_are_angles_where_the_models_turn(name: str) -> None:
    """What a system does not say of an angle, its range would let pass for a length, whose velocity terms round otherwise."""
    mechanism, model = load_mechanism(BUILT_IN, name), read_model(BUILT_IN.model_path(name, "mjcf"), "mjcf")
    held = load_engine(BUILT_IN, "mujoco").load(model, mechanism.joints, mechanism.gravity).held()  # type: ignore[attr-defined]
    kinds = {joint: one.kind for joint, one in held.joints.items()}
    for place, (joint, rotates) in enumerate(zip(mechanism.joints, mechanism.rotating, strict=True)):
        turns = kinds[joint] in ("hinge", "ball") or (kinds[joint] == "free" and place - mechanism.joints.index(joint) > 2)
        assert rotates == turns, joint


SAME_BUT_FOR_WORDS = [(name, form) for name, form in MODELS if BUILT_IN.is_variant(name) and not name.endswith(".mimic")]


@pytest.mark.parametrize(("name", "model_format"), SAME_BUT_FOR_WORDS)
def test_the_readers_of_a_variant_hold_what_its_plain_model_says_to_its_own_engine(name: str, model_format: str) -> None:
    plain, variant = (read_model(BUILT_IN.model_path(one, model_format), model_format) for one in (BUILT_IN.system_of(name), name))
    native = next(str(subject) for subject in READERS if subject.format == model_format and is_native(BUILT_IN, subject))
    expected = held_by_all({model_format: plain}, 9.81)[native]
    held = held_by_all({model_format: variant}, 9.81)
    assert native in held
    misread = {subject for subject in held if load_expectations(BUILT_IN).of(name, subject).verdict == "misreads"}
    for subject, found in ((subject, found) for subject, found in held.items() if subject not in misread):
        # Only what a motion feels: a pin may stand elsewhere, and about its own length a planar bar has any inertia.
        assert dict.fromkeys(found.joints) == dict.fromkeys(expected.joints)
        for joint, (ours, theirs) in {joint: (found.joints[joint], expected.joints[joint]) for joint in expected.joints}.items():
            assert (ours.kind, ours.parent, ours.damping) == (theirs.kind, theirs.parent, theirs.damping), (subject, joint)
            np.testing.assert_allclose(ours.axis, theirs.axis, rtol=0, atol=1e-15)
            masses = [one.bodies[joint].mass if joint in one.bodies else 0.0 for one in (found, expected)]
            np.testing.assert_allclose(*masses, rtol=1e-15, atol=1e-14)
            if joint in expected.bodies:
                arms = [one.bodies[joint].centre - one.joints[joint].moved for one in (found, expected)]
                np.testing.assert_allclose(*arms, rtol=0, atol=1e-15)


def test_joints_of_one_body_welds_and_turned_frames_come_out_alike() -> None:
    assert audited(TEXTS) == []
    held = held_by_all({name: parse_model(Path(name), text, name) for name, text in TEXTS.items()}, 9.81)
    for model in held.values():
        assert [(model.joints[name].kind, model.joints[name].parent) for name in ("yaw", "lift", "elbow")] == [
            ("hinge", ""),
            ("slide", "yaw"),
            ("hinge", "lift"),
        ]
        assert model.bodies["lift"].mass == 3.5
        assert "yaw" not in model.bodies or model.bodies["yaw"].mass <= 1e-15
        np.testing.assert_allclose(model.joints["elbow"].axis, [0, 0.28, 0.96], rtol=0, atol=1e-15)
        np.testing.assert_allclose(model.springs[0].points[1] if model.springs[0].points[0, 0] == -1 else model.springs[0].points[0],
                                   [0.7, 0, 0.6], rtol=0, atol=1e-15)  # fmt: skip


# format, text found, text planted, quantity, joint; the first line of the text found is the one to be named
PLANTED = [
    ("mjcf", 'mass="3"', 'mass="3.000000000003"', "mass", "lift"),
    ("mjcf", 'mass="0.5"', 'mass="0.6"', "mass", "lift"),
    ("urdf", '<mass value="0.5"/>', '<mass value="0.500000000001"/>', "mass", "lift"),
    ("mjcf", 'pos="0.2 0 0"', 'pos="0.2000000000002 0 0"', "centre", "elbow"),
    ("urdf", '<origin xyz="0.1 0 0.05"/>', '<origin xyz="0.1 0.01 0.05"/>', "centre", "lift"),
    ("mjcf", "0.05 0.06 0.07", "0.05 0.0600000000001 0.07", "inertia", "lift"),
    ("mjcf", "0.004 -0.003", "0.004 0.003", "inertia", "lift"),
    ("urdf", 'ixy="0.004"', 'ixy="-0.004"', "inertia", "lift"),
    ("urdf", '<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.02"', '<inertia ixx="0.02" ixy="0" ixz="0" iyy="0.01"', "inertia", "elbow"),
    ("mjcf", 'quat="0.6 0 0.8 0" mass', "mass", "inertia", "elbow"),
    ("urdf", 'rpy="0 1.8545904360032246 0"', 'rpy="0 -1.8545904360032246 0"', "inertia", "elbow"),
    ("mjcf", 'axis="0 1 0"', 'axis="0 -1 0"', "axis", "elbow"),
    ("urdf", '<axis xyz="0 1 0"/>', '<axis xyz="0 1 1e-11"/>', "axis", "elbow"),
    ("mjcf", 'quat="0.8 0.6 0 0"', 'quat="0.8 -0.6 0 0"', "axis", "elbow"),
    ("urdf", 'rpy="1.2870022175865687 0 0"', 'rpy="1.2870022175870 0 0"', "axis", "elbow"),
    ("mjcf", 'pos="0.3 0 0.1"', 'pos="0.3 0 0.100000000001"', "anchor", "elbow"),
    ("urdf", '<origin xyz="0.3 0 0.1"', '<origin xyz="0.31 0 0.1"', "anchor", "elbow"),
    ("mjcf", 'gravity="0 0 -9.81"', 'gravity="0 0 -9.80665"', "gravity", ""),
    ("mjcf", 'gravity="0 0 -9.81"', 'gravity="0 -9.81 0"', "gravity", ""),
    ("mjcf", 'armature="0.02"', 'armature="0.02000000000002"', "armature", "yaw"),
    ("urdf", '<drake:rotor_inertia value="0.02"/>', '<drake:rotor_inertia value="0"/>', "armature", "yaw"),
    ("mjcf", 'damping="0.1"', "", "damping", "elbow"),
    ("urdf", '<dynamics damping="0.1"/>', '<dynamics damping="0.2"/>', "damping", "elbow"),
    ("mjcf", 'stiffness="7"', 'stiffness="7.00000000001"', "stiffness", "elbow"),
    ("urdf", "<springStiffness>40</springStiffness>", "<springStiffness>0</springStiffness>", "stiffness", "lift"),
    ("mjcf", 'springref="0.4"', 'springref="-0.4"', "spring reference", "elbow"),
    ("urdf", "<springReference>0.25</springReference>", "<springReference>0.25000000001</springReference>", "spring reference", "lift"),
    ("mjcf", 'type="slide"', 'type="hinge"', "joint", "lift"),
    ("urdf", '<joint name="elbow" type="revolute">', '<joint name="elbow" type="prismatic">', "joint", "elbow"),
    ("mjcf", 'stiffness="20"', 'stiffness="20.0000000001"', "point spring stiffness", "1"),
    ("urdf", 'p_AP value="-1 0 0.5"', 'p_AP value="-1 0.1 0.5"', "point spring ends", "1"),
    ("urdf", 'stiffness value="20"', 'stiffness value="40"', "point spring stiffness", "1"),
    ("mjcf", '<site name="wall" pos="-1 0 0.5"/>', '<site name="wall" pos="-1 0 0.4"/>', "point spring ends", "1"),
    ("mjcf", 'springlength="0.75"', 'springlength="0.8"', "point spring length", "1"),
    ("mjcf", 'damping="0.5"', 'damping="0.25"', "point spring damping", "1"),
]  # fmt: skip


@pytest.mark.parametrize(("model_format", "found", "planted", "quantity", "joint"), PLANTED)
def test_a_planted_difference_is_told_with_quantity_joint_and_line(
    model_format: str, found: str, planted: str, quantity: str, joint: str
) -> None:
    text = TEXTS[model_format]
    assert text.count(found) == 1
    first, *others = audited({**TEXTS, model_format: text.replace(found, planted)})
    assert (first.quantity, first.joint, first.follows) == (quantity, joint, "")
    assert first.ulps > SOUND
    # Whatever else differs hangs on the same joint, or on a point of what it moves.
    assert all(row.follows == joint or row.joint == joint or row.quantity == "point spring ends" for row in others)
    groups = {frozenset(group) for group in first.subjects}
    assert groups == {frozenset(MJCF_READERS), frozenset({str(reader) for reader in READERS} - MJCF_READERS)}
    if quantity != "gravity" or model_format == "mjcf":
        assert text.count("\n", 0, text.index(found)) + 1 in first.lines[model_format]
    shown = str(first)
    assert f"{quantity} " in shown and f"crane.{model_format}:" in shown and all(reader in shown for reader in MJCF_READERS)
    json.dumps(asdict(first))


def random_chain(seed: int, links: int) -> dict[str, str]:
    """A chain of hinges and slides along any axes, every frame turned, as a quaternion in one file and as angles in the other."""
    random = np.random.default_rng(seed)

    def written(*values: float) -> str:
        return " ".join(repr(float(value)) for value in values)

    def turn() -> tuple[str, str]:
        # Roll, pitch and yaw about fixed axes make q_z q_y q_x.
        angles = random.uniform(-1.5, 1.5, 3)
        (a, b, c), (x, y, z) = np.cos(angles / 2), np.sin(angles / 2)
        return written(a * b * c + x * y * z, x * b * c - a * y * z, a * y * c + x * b * z, a * b * z - x * y * c), written(*angles)

    bodies, parts = "", '<link name="link"/>'
    for number in range(links):
        (quat, rpy), (inner_quat, inner_rpy) = turn(), turn()
        place, centre = written(*random.normal(size=3)), written(*random.normal(size=3))
        axis = random.normal(size=3)
        axis = written(*axis / np.linalg.norm(axis))
        mass, (a, b, c) = written(random.uniform(0.1, 10)), random.uniform(0.5, 0.9, 3) * 10 ** random.uniform(-3, 1)
        kind, urdf_kind = [("hinge", "revolute"), ("slide", "prismatic")][random.integers(2)]
        if seed % 2:
            parts_of_inertia = written(a, b, c, *random.uniform(-0.2, 0.2, 3) * a)
            inertia, tensor, inner_rpy = f'fullinertia="{parts_of_inertia}"', parts_of_inertia.split(), "0 0 0"
        else:
            inertia, tensor = f'diaginertia="{written(a, b, c)}" quat="{inner_quat}"', [*written(a, b, c).split(), "0", "0", "0"]
        bodies += (
            f'<body name="body{number}" pos="{place}" quat="{quat}"><joint name="joint{number}" type="{kind}" axis="{axis}"/>'
            f'<inertial pos="{centre}" mass="{mass}" {inertia}/>'
        )
        entries = " ".join(f'i{name}="{value}"' for name, value in zip(("xx", "yy", "zz", "xy", "xz", "yz"), tensor, strict=True))
        child = f"link{number}"
        parent = f"link{number - 1}" if number else "link"
        parts += (
            f'<link name="{child}"><inertial><origin xyz="{centre}" rpy="{inner_rpy}"/><mass value="{mass}"/><inertia {entries}/>'
            f'</inertial></link><joint name="joint{number}" type="{urdf_kind}"><parent link="{parent}"/><child link="{child}"/>'
            f'<origin xyz="{place}" rpy="{rpy}"/><axis xyz="{axis}"/><limit effort="0" velocity="0"/></joint>'
        )
    return {
        "mjcf": f'<mujoco><compiler angle="radian"/><worldbody>{bodies}{"</body>" * links}</worldbody></mujoco>',
        "urdf": f'<robot name="chain">{parts}</robot>',
    }


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.ci) for seed in (1, 2, 3))])
def test_roundings_of_a_deep_chain_are_sound_and_a_mistake_of_1e_10_is_not(seed: int) -> None:
    """More than 256 ulps, but no more than (30 / 8)^2 times that, where a planted mistake makes hundreds of thousands."""
    texts = random_chain(seed, links=30)
    assert audited(texts) == []
    assert max(row.ulps for row in audited(texts, above=1.0)) > SOUND
    for name in ("mass", "axis"):
        *_, last = re.finditer(rf'{name}="([^ "]*)', texts["mjcf"])
        number = repr(float(last[1]) * (1 + 1e-10))
        wrong = texts["mjcf"][: last.start(1)] + number + texts["mjcf"][last.end(1) :]
        rows = audited({**texts, "mjcf": wrong})
        assert (name, "joint29") in {(row.quantity, row.joint) for row in rows}
    # The bound does not grow near the root.
    (row,) = audited(
        {**texts, "mjcf": re.sub('mass="([^"]*)"', lambda found: f'mass="{float(found[1]) * (1 + 1e-13)!r}"', texts["mjcf"], count=1)}
    )
    assert (row.quantity, row.joint) == ("mass", "joint0") and row.ulps < SOUND * (30 / 8) ** 2


@pytest.mark.parametrize("seed", [0, 1, *(pytest.param(seed, marks=pytest.mark.ci) for seed in range(2, 12))])
def test_quaternions_and_angles_make_the_same_chain(seed: int) -> None:
    """Up to 25 ulps in axes and points after six turns, and 89 in inertias, where MuJoCo's reader takes a tensor apart."""
    texts = random_chain(seed, links=6)
    assert audited(texts) == []
    assert audited(texts, above=0.0) != []
    assert {row.quantity for row in audited(texts, above=64.0)} <= {"inertia"}


def test_the_odd_one_out_stands_last() -> None:
    """A reader that holds something else than the three others, whatever its place."""
    models = {name: parse_model(Path(name), text, name) for name, text in TEXTS.items()}
    held = held_by_all(models, 9.81)
    for odd in held:
        wrong = parse_model(Path("wrong"), TEXTS[odd.split("/")[1]].replace('damping="0.3"', 'damping="0.4"'), odd.split("/")[1])
        mixed = {**held, odd: held_by_all({**models, wrong.format: wrong}, 9.81)[odd]}
        (row,) = differences(mixed, models)
        assert (row.quantity, row.joint, row.subjects[1:], row.values) == ("damping", "yaw", ((odd,),), (0.3, 0.4))


# What constraints hold is no part of the audit.
@pytest.mark.nightly(nights=4)
@pytest.mark.parametrize("name", [name for name in TREES if name not in LONG])
def test_a_mistake_that_the_audit_does_not_see_moves_nothing(name: str) -> None:
    """Every mistake that a hypothesis can plant is in what engines hold, or no acceleration feels it."""
    mechanism = load_mechanism(BUILT_IN, name)
    states = generic_sample(mechanism, 8, 1)
    models = {model_format: read_model(BUILT_IN.model_path(name, model_format), model_format) for model_format in TEXTS}
    seen = 0
    for model in models.values():
        engine = load_engine(BUILT_IN, "pinocchio" if model.format == "urdf" else "mujoco")
        for planted in (planted for hypothesis in mended_mistakes() for planted in hypothesis.plant(model)):
            try:
                wrong = parse_model(model.path, planted.text(1e-6), model.format)
                changed = held_by_all({**models, model.format: wrong}, mechanism.gravity)
            except (InvalidModel, ValueError):
                continue
            if differences(changed, {**models, model.format: wrong}):
                seen += 1
                continue
            answers = [
                engine.load(file, mechanism.joints, mechanism.gravity).forward_dynamics(states.q, states.v, states.tau)
                for file in (model, wrong)
            ]
            np.testing.assert_allclose(*answers, rtol=1e-9, atol=1e-9, err_msg=planted.statement)
    assert seen > 10


def test_the_axes_of_a_ball_joint_are_its_frame() -> None:
    models = {name: read_model(BUILT_IN.model_path("heavy_top", name), name) for name in TEXTS}
    # About its own axis, a symmetric top's centre and inertia stay.
    turned = parse_model(Path("top"), models["mjcf"].text.replace('<body name="top">', '<body name="top" quat="0.8 0 0 0.6">'), "mjcf")
    models["mjcf"] = turned
    (row,) = differences(held_by_all(models, 9.81), models)
    assert (row.quantity, row.joint, row.lines["mjcf"]) == ("frame", "pivot", (turned.text[: turned.text.index("<body")].count("\n") + 1,))


def test_zero_is_that_of_the_columns_and_not_of_the_drawing() -> None:
    """A joint with ``ref`` is drawn at that position; the audit looks at position 0."""
    mjcf = MJCF.replace('axis="0 1 0" damping', 'axis="0 1 0" ref="0.3" damping')
    held = held_by_all({"mjcf": parse_model(Path("a"), mjcf, "mjcf"), "urdf": parse_model(Path("b"), URDF, "urdf")}, 9.81)
    centre = held["mujoco/mjcf"].bodies["elbow"].centre
    # R_x(1.287) R_y(-0.3) (0.2, 0, 0), from the arm's place.
    x, z = 0.2 * math.cos(0.3), 0.2 * math.sin(0.3)
    np.testing.assert_allclose(centre, [0.3 + x, -0.96 * z, 0.6 + 0.28 * z], rtol=0, atol=1e-15)
    if "pinocchio/mjcf" in held:
        np.testing.assert_allclose(held["pinocchio/mjcf"].bodies["elbow"].centre, centre, rtol=0, atol=1e-15)


def test_a_missing_joint_and_spring_are_told() -> None:
    rope = URDF[URDF.index("  <drake:linear_spring_damper>") : URDF.index("</robot>")]
    rows = audited({**TEXTS, "urdf": URDF.replace(rope, "")})
    assert {row.quantity for row in rows} == {f"point spring {part}" for part in ("ends", "stiffness", "damping", "length")}
    assert all("none" in row.values and math.isinf(row.ulps) for row in rows)
    rows = audited({**TEXTS, "mjcf": MJCF.replace('name="elbow"', 'name="knee"')})
    assert {(row.quantity, row.joint) for row in rows} >= {("joint", "elbow"), ("joint", "knee")}


ROPE = MJCF[MJCF.index("    <spatial") : MJCF.index("  </tendon>")]
IDLE = ROPE.replace('name="rope" stiffness="20" damping="0.5" springlength="0.75"', 'name="idle"')
CORD = URDF[URDF.index("  <drake:linear_spring_damper>") : URDF.index("</robot>")]
# From the origin, to nearly the same point of the arm.
SECOND_ROPE = ROPE.replace('"rope"', '"cord"').replace('stiffness="20"', 'stiffness="30"').replace('"wall"', '"floor"')
SECOND_CORD = CORD.replace("-1 0 0.5", "0 0 0").replace('stiffness value="20"', 'stiffness value="30"')
FLOOR = '<site name="wall" pos="-1 0 0.5"/>', '<site name="floor" pos="0 0 0"/><site name="wall" pos="-1 0 0.5"/>'


@pytest.mark.parametrize("stage", ["spring", "damper", "both"])
def test_springs_that_do_nothing_are_not_held(stage: str) -> None:
    """Switched off in MJCF, of no stiffness and damping in URDF, or idle tendons: whatever the engine, there is no spring."""
    off = {"spring": ["spring"], "damper": ["damper"], "both": ["spring", "damper"]}[stage]
    flags = " ".join(f'{flag}="disable"' for flag in off)
    mjcf, urdf = MJCF.replace("<flag ", f"<flag {flags} "), URDF
    if "spring" in off:
        urdf = urdf.replace('stiffness value="20"', 'stiffness value="0"')
        urdf = urdf.replace("<springStiffness>40<", "<springStiffness>0<").replace("<springStiffness>7<", "<springStiffness>0<")
    if "damper" in off:
        urdf = urdf.replace('damping value="0.5"', 'damping value="0"').replace('<dynamics damping="0.1"/>', "")
        urdf = urdf.replace('<dynamics damping="0.3"/>', "")
    for texts in ({"mjcf": mjcf.replace(ROPE, IDLE + ROPE), "urdf": urdf}, {"mjcf": mjcf, "urdf": urdf}):
        assert audited(texts) == []
        models = {name: parse_model(Path(name), text, name) for name, text in texts.items()}
        assert {len(model.springs) for model in held_by_all(models, 9.81).values()} == {0 if stage == "both" else 1}
    # One without the other is a difference, of which the flag is the line.
    (line,) = (number for number, text in enumerate(mjcf.splitlines(), 1) if "<flag" in text)
    rows = [row for row in audited({"mjcf": mjcf, "urdf": URDF}) if row.quantity.startswith("point spring")]
    assert rows and all(line in row.lines["mjcf"] for row in rows if "none" in row.values or "stiffness" in row.quantity)


def test_a_rope_of_no_stiffness_is_not_one_where_only_springs_are_off() -> None:
    mjcf = MJCF.replace("<flag ", '<flag spring="disable" ').replace(' damping="0.5"', "")
    held = held_by_all({name: parse_model(Path(name), text, name) for name, text in {"mjcf": mjcf, "urdf": URDF}.items()}, 9.81)
    assert {name: len(model.springs) for name, model in held.items()} == {
        "mujoco/mjcf": 0, "pinocchio/mjcf": 0, "mujoco/urdf": 1, "pinocchio/urdf": 1,
    }  # fmt: skip


def test_springs_are_compared_by_their_ends_whatever_their_order() -> None:
    mjcf, urdf = MJCF.replace(*FLOOR).replace(ROPE, ROPE + SECOND_ROPE), URDF.replace(CORD, SECOND_CORD + CORD)
    assert audited({"mjcf": mjcf, "urdf": urdf}) == []
    wrong = urdf.replace('stiffness value="30"', 'stiffness value="31"')
    (row,) = audited({"mjcf": mjcf, "urdf": wrong})
    assert (row.quantity, row.joint, sorted(row.values)) == ("point spring stiffness", "2", [30.0, 31.0])
    found = {"mjcf": mjcf.index('stiffness="30"'), "urdf": wrong.index('stiffness value="31"')}
    assert {name: lines[0] for name, lines in row.lines.items()} == {
        name: text.count("\n", 0, found[name]) + 1 for name, text in {"mjcf": mjcf, "urdf": wrong}.items()
    }
    # Moved by more than the two are apart, the second is still the partner that is left.
    rows = audited({"mjcf": mjcf, "urdf": urdf.replace('p_AP value="0 0 0"', 'p_AP value="-1 0 0.6"')})
    assert [(row.quantity, row.joint) for row in rows] == [("point spring ends", "2")]


def test_a_spring_behind_an_idle_one_has_its_own_line() -> None:
    idle = CORD.replace('stiffness value="20"', 'stiffness value="0"').replace('damping value="0.5"', 'damping value="0"')
    mjcf, urdf = MJCF.replace(ROPE, IDLE + ROPE).replace('stiffness="20"', 'stiffness="21"'), URDF.replace(CORD, idle + CORD)
    (row,) = audited({"mjcf": mjcf, "urdf": urdf})
    assert row.lines["mjcf"] == (mjcf[: mjcf.index('stiffness="21"')].count("\n") + 1,)
    assert row.lines["urdf"][0] == urdf[: urdf.index('stiffness value="20"')].count("\n") + 1


@pytest.mark.parametrize(
    ("default", "own", "quantity", "joint"),
    [
        ('<joint damping="0.2"/>', ' damping="0.1"', "damping", "elbow"),
        ('<joint axis="0 0.8 0.6"/>', ' axis="0 1 0"', "axis", "elbow"),
        ('<tendon stiffness="21"/>', ' stiffness="20"', "point spring stiffness", "1"),
        ('<tendon springlength="0.7"/>', ' springlength="0.75"', "point spring length", "1"),
        ('<site pos="-1 0 0.6"/>', ' pos="-1 0 0.5"', "point spring ends", "1"),
    ],
)
def test_what_a_default_class_says_is_told_with_the_line_of_the_class(default: str, own: str, quantity: str, joint: str) -> None:
    mjcf = MJCF.replace("  <worldbody>", f"  <default>\n    {default}\n  </default>\n  <worldbody>").replace(own, "")
    rows = {(row.quantity, row.joint): row for row in audited({"mjcf": mjcf, "urdf": URDF})}
    assert mjcf[: mjcf.index(default)].count("\n") + 1 in rows[quantity, joint].lines["mjcf"][: 1 if "ends" not in quantity else None]


def test_gravity_that_is_switched_off_is_none_for_every_question() -> None:
    """A gravity-free system may be written with the flag as well as with zeros, and no text says -0."""
    model = read_model(BUILT_IN.model_path("tora", "mjcf"), "mjcf")
    mechanism = load_mechanism(BUILT_IN, "tora")
    assert mechanism.gravity == 0
    falling = re.sub("<option[^>]*>", '<option gravity="0 0 -9.81">', model.text).replace(' gravity="disable"', "")
    still = falling.replace("<flag", '<flag gravity="disable"')
    assert falling != model.text and still != falling
    for engine in (load_engine(BUILT_IN, name) for name in ("mujoco", "pinocchio")):
        loaded = engine.load(parse_model(model.path, still, "mjcf"), mechanism.joints, 0.0)
        held = loaded.loaded()
        assert held is not None and held.gravity == tuple(loaded.held().gravity) == (0, 0, 0)  # type: ignore[attr-defined]
        audit(held, model, mechanism)
        fallen = engine.load(wrong := parse_model(model.path, falling, "mjcf"), mechanism.joints, 0.0).loaded()
        assert fallen is not None
        with pytest.raises(InvalidModel, match=r"gravity is 0 0 -9\.81 m/s\^2, expected 0 0 0 as"):
            audit(fallen, wrong, mechanism)


def test_links_of_no_mass_hold_none_however_light_what_they_carry() -> None:
    """A flange with a tool, and a cross between two hinges, that MuJoCo would not compile without a least inertia."""
    none = '<inertial><mass value="0"/><inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/></inertial>'
    light = none.replace('"0"/><inertia', '"0.02"/><inertia').replace('ixx="0"', 'ixx="1e-5"').replace('iyy="0"', 'iyy="1e-5"')
    light = light.replace('izz="0"', 'izz="1e-5"')
    links = "".join(f'<link name="{name}">{inertial}</link>' for name, inertial in (("cross", none), ("flange", none), ("tool", light)))
    joints = "".join(
        f'<joint name="to_{child}" type="{kind}"><parent link="{parent}"/><child link="{child}"/><axis xyz="{axis}"/>'
        '<limit effort="0" velocity="0"/></joint>'
        for kind, parent, child, axis in (
            ("revolute", "world", "cross", "1 0 0"), ("revolute", "cross", "flange", "0 1 0"), ("fixed", "flange", "tool", "0 0 1")
        )
    )  # fmt: skip
    text = f'<robot name="light"><link name="world"/>{links}{joints}</robot>'
    models = {"urdf": parse_model(Path("light.urdf"), text, "urdf")}
    held = held_by_all(models, 9.81)
    assert set(held) == {"mujoco/urdf", "pinocchio/urdf"}
    assert differences(held, models) == []
    assert held["mujoco/urdf"].bodies["to_cross"].mass == 0.0 and held["mujoco/urdf"].bodies["to_flange"].mass == 0.02


def test_what_no_motion_feels_is_not_compared() -> None:
    """A hinge's anchor along its axis, a slide's anchor, and MuJoCo's least mass against none."""
    assert audited({**TEXTS, "mjcf": MJCF.replace('<joint name="lift"', '<joint name="lift" pos="0.5 0 0"')}) == []
    assert audited({**TEXTS, "mjcf": MJCF.replace('<joint name="yaw"', '<joint name="yaw" pos="0 0 0.7"')}) == []
    (row,) = audited({**TEXTS, "mjcf": MJCF.replace('<joint name="yaw"', '<joint name="yaw" pos="0.5 0 0"')})
    assert (row.quantity, row.joint) == ("anchor", "yaw")


def test_welded_parts_are_summed_without_loss() -> None:
    """Two halves of a rod of 1 kg, far from the origin, make the rod about its centre, to the last bit but one."""
    half = np.diag([0.0, 0.5 * 0.25 / 12, 0.5 * 0.25 / 12])
    whole = fused([(0.5, np.array([1e3, 2e3, 3e3]), half), (0.5, np.array([1e3 + 0.5, 2e3, 3e3]), half)])
    assert whole.mass == 1.0
    np.testing.assert_array_equal(whole.centre, [1e3 + 0.25, 2e3, 3e3])
    np.testing.assert_allclose(whole.inertia, np.diag([0.0, 1 / 12, 1 / 12]), rtol=2**-52, atol=0)


@pytest.mark.parametrize("turn", [np.eye(3), np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]], ids=["principal", "turned"])
def test_a_moment_that_stands_for_zero_hides_no_change_of_the_others(turn: Array) -> None:
    """A thin rod of a few grams, as the links of a mechanism of centimetres are."""
    inertia = OF_BODIES[quantities.INERTIA]

    def ulps(*moments: float) -> float:
        one, other = (HeldBody(0.04, np.zeros(3), turn @ np.diag(each) @ turn.T) for each in (moments, (0.0, 2.194e-6, 2.194e-6)))
        return inertia.ulps(one, other, 0.1)

    assert ulps(1e-15, 2.194e-6, 2.194e-6) < 8
    assert ulps(1e-15, 2.194e-6 - 2.5e-16, 2.194e-6 - 2.5e-16) > SOUND
    assert ulps(2e-15, 2.194e-6, 2.194e-6) > SOUND
