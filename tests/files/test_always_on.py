"""What MuJoCo computes with constraints, actuators and contacts off is in the tree, or is refused at its line."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from harness.errors import InvalidModel
from harness.programs.states import States
from harness.trees.mechanism import accelerations_of
from harness.trees.recursion import recursion_program
from harness.trees.robot import read_robot

POSITIONS, VELOCITIES = (0.1, 0.2, 0.3, -0.4), (1.0, -2.0, 3.0, -4.0)

SLIDES = "".join(
    f'<body name="{name}" pos="{place}"><joint name="{name}" type="slide" axis="{axis}"/>'
    '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body>'
    for name, place, axis in (("a", ".1 0 0", "1 0 0"), ("b", "0 .1 0", "0 1 0"), ("c", "0 0 .1", "0 0 1"))
)
FIXED = '<site name="fixed" pos="0 3 2"/>'
MOVED = '<site name="moved" pos="1 0 0"/>'
MJCF = f"""<mujoco>
<compiler angle="radian"/>
<option gravity="0 0 0"/>
<worldbody>{FIXED}<body name="arm">{MOVED}<joint name="hinge"/><inertial pos="0.5 0 0" mass="1" diaginertia="1 1 1"/>{SLIDES}
</body></worldbody>
</mujoco>
"""
OFF = '<option><flag spring="disable"/></option>'
NO_DAMPER = '<option><flag damper="disable"/></option>'
PID = '<extension><plugin plugin="mujoco.pid"><instance name="i"><config key="kp" value="40"/></instance></plugin></extension>'
TENDON = '<tendon><fixed name="sum"><joint joint="hinge" coef="1.5"/><joint joint="b" coef="-2"/></fixed></tendon>'
SITES = '<tendon><spatial name="path"><site site="fixed"/><site site="moved"/></spatial></tendon>'
DEFAULT = '<default><motor damping="2"/></default>'


def flex(part: str, dim: int = 2) -> str:
    element = "0 1 2" if dim == 2 else "0 1 1 2"
    vertices = " ".join(["0"] * 9)
    return f'<deformable><flex name="net" dim="{dim}" body="a b c" vertex="{vertices}" element="{element}">{part}</flex></deformable>'


def actuator(inside: str) -> str:
    return f"<actuator>{inside}</actuator>"


# What is written before the last line of the file: what the refusal says, "" for what is read.
FILES = {
    "nothing": ("", ""),
    "a flex without forces": (flex(""), ""),
    "a flex with stiff edges": (flex('<edge stiffness="50"/>', 1), r'<edge stiffness="50"> of <flex name="net"> is a passive force that'),
    "a flex with stiff edges, springs off": (flex('<edge stiffness="50"/>', 1) + OFF, ""),
    "a flex with dampers": (flex('<edge damping="5"/>'), r'<edge damping="5"> of <flex name="net"> is a passive force'),
    "a flex with dampers that are off": (flex('<edge damping="5"/>') + NO_DAMPER, ""),
    "a cloth": (flex('<elasticity young="1e4" poisson="0.1" thickness="0.01" elastic2d="both"/>'), r'<elasticity young="1e4"> of'),
    "a limp cloth": (flex('<elasticity young="1e4" poisson="0.1" thickness="0.01"/>'), ""),
    "an actuator with armature": (actuator('<motor joint="hinge" gear="3" armature="0.1"/>'), ""),
    "a muscle with armature": (actuator('<muscle joint="hinge" gear="3" armature="0.1"/>'), ""),
    "a damper by default": (DEFAULT + actuator('<position joint="hinge" gear="0.5"/>'), ""),
    "a damper by default, off": (DEFAULT + actuator('<position joint="hinge"/>') + NO_DAMPER, ""),
    "two on one joint": (actuator('<motor joint="hinge" damping="2"/><motor joint="hinge" gear="2" armature="1" damping="3"/>'), ""),
    "an actuator on a tendon with armature": (TENDON + actuator('<motor tendon="sum" gear="3" armature="0.1" damping="2"/>'), ""),
    "a tendon with armature": (TENDON.replace("<fixed", '<fixed armature="0.3"'), ""),
    "a damper on a path": (SITES + actuator('<motor tendon="path" damping="2"/>'), r'<motor> damping="2" is on with actuators off'),
    "a damper that is not linear": (actuator('<motor joint="hinge" damping="2 1"/>'), r'<motor> damping="2 1" is not linear'),
    "a path with armature": (SITES.replace("<spatial", '<spatial armature="0.3"'), ""),
    "a servo": (actuator('<position joint="hinge" kp="100" kv="3"/>'), ""),
    "a plugin as actuator": (PID + actuator('<plugin joint="hinge" plugin="mujoco.pid" instance="i"/>'), ""),
}  # fmt: skip


def state_of(model: Any) -> tuple[Any, Any]:
    """Mass matrix, and passive forces beside velocity terms, with all stages off that no tree holds."""
    import mujoco

    flags, data = mujoco.mjtDisableBit, mujoco.MjData(model)
    model.opt.disableflags |= int(flags.mjDSBL_CONSTRAINT | flags.mjDSBL_CONTACT | flags.mjDSBL_ACTUATION)
    data.qpos[:], data.qvel[:] = POSITIONS, VELOCITIES
    mujoco.mj_forward(model, data)
    mujoco.mj_fullM(model, data, mass := np.empty((4, 4)))
    return mass, (data.qfrc_passive + data.qfrc_actuator) - data.qfrc_bias


@pytest.mark.parametrize("name", FILES)
def test_mujoco_computes_what_the_tree_of_a_file_holds_or_the_file_is_refused(name: str, tmp_path: Path) -> None:
    import mujoco

    written, message = FILES[name]
    path = tmp_path / "robot.xml"
    path.write_text(MJCF.replace("</mujoco>", f"{written}</mujoco>"))
    plain, found = (state_of(mujoco.MjModel.from_xml_string(text)) for text in (MJCF, path.read_text()))
    if not message:
        robot = read_robot(path)
        states = States.at(np.array([POSITIONS]), np.array([VELOCITIES]), np.zeros((1, 4)))
        computed = accelerations_of(recursion_program(robot.tree, robot.joints), states)
        np.testing.assert_allclose(computed[0], np.linalg.solve(found[0], found[1]), rtol=1e-12, atol=1e-12)
        return
    assert any(not np.array_equal(one, other) for one, other in zip(plain, found, strict=True))
    with pytest.raises(InvalidModel, match=message) as caught:
        read_robot(path)
    assert caught.value.line == 6
    assert re.search(r"which is not read; (compare a copy without it|remove it|write one number)", caught.value.problem)


@pytest.mark.parametrize(
    ("written", "message"),
    [
        ('<plugin plugin="mujoco.elasticity.cable"/></body>', "plugin 'mujoco.elasticity.cable' in <body name=\"arm\"> is code that may"),
        ('<plugin instance="rope"/></body>', "plugin 'their.rope' in <body name=\"arm\"> is code that may push"),
        ("</body>", "plugin 'their.rope' in <extension> is code that may push bodies with constraints and actuators off"),
    ],
)  # fmt: skip
def test_a_plugin_is_refused_that_may_be_a_passive_force(written: str, message: str, tmp_path: Path) -> None:
    declared = '<extension><plugin plugin="their.rope"><instance name="rope"/></plugin></extension></mujoco>'
    path = tmp_path / "robot.xml"
    path.write_text(MJCF.replace("\n</body>", f"\n{written}").replace("</mujoco>", declared))
    with pytest.raises(InvalidModel, match=re.escape(message)):
        read_robot(path)


def test_settings_of_a_plugin_are_held_against_each_other(tmp_path: Path) -> None:
    """Each by its key: a file with two of them differs by the first too."""
    keys = (
        '<actuator><plugin joint="hinge" plugin="mujoco.pid"><config key="kp" value="{}"/><config key="kd" value="1"/></plugin></actuator>'
    )
    values = []
    for gain in (40, 60):
        path = tmp_path / f"{gain}.xml"
        path.write_text(MJCF.replace("</mujoco>", f"{keys.format(gain)}</mujoco>"))
        (declared,) = read_robot(path).declared
        values.append(declared.values)
    assert [one["config kp"] for one in values] == ["40", "60"]
    assert [one["config kd"] for one in values] == ["1", "1"]
