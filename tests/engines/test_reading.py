"""What adapters make of a request before they ask their engine: the text of a URDF, its gravity, and what an MJCF switches off."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from catalogue import CALLED_HERE

from harness.engines import load_engine
from harness.engines.adapters.mujoco.versions import keep_what_is_on
from harness.engines.reading import elements_of, moving_mass, root_link
from harness.engines.request import Aid, AskedJoint, JointForces, Request, in_columns
from harness.files.joint_kinds import JointKind

TEXT = """<robot name="arm"{declared}>
  <link name="base"><inertial><mass value="2"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="bar"><inertial><mass value="3"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="pin" type="continuous"><parent link="base"/><child link="bar"/><axis xyz="0 0 1"/></joint>
  <drake:unheard_of value="1"/>
</robot>
"""
DECLARED = {"nothing": "", "the prefix": ' xmlns:drake="drake"', "a default namespace": ' xmlns="http://www.ros.org/urdf"'}


@pytest.mark.parametrize("declared", DECLARED.values(), ids=DECLARED)
def test_a_urdf_is_read_whatever_its_root_declares(declared: str, tmp_path: Path) -> None:
    path = tmp_path / "arm.urdf"
    path.write_text(TEXT.format(declared=declared))
    joints = in_columns([AskedJoint("base", JointKind.FREE, (), ()), AskedJoint("pin", JointKind.HINGE, (), ())])
    request = Request(path=path, format="urdf", joints=joints, moving=("base", "pin"), floating_base="base")
    assert root_link(elements_of(request)) == "base"
    assert moving_mass(request, {"base": 2.0, "bar": 3.0}) == 3.0
    loaded = load_engine(CALLED_HERE, "mujoco").read(request)
    q, v, tau = np.eye(1, 8, 3), np.zeros((1, 7)), np.eye(1, 7)
    np.testing.assert_allclose(loaded.forward_dynamics(q, v, tau), [[0.2, 0, -9.81, 0, 0, 0, 0]], atol=1e-12)


def test_an_engine_that_must_be_told_has_the_gravity_of_the_file_where_that_is_supplied() -> None:
    plain = Request(path=Path("arm.urdf"), format="urdf", joints=(), moving=())
    assert plain.gravity == (0.0, 0.0, -9.81)
    aid = Aid(np.array([0.5, 0.0, -1.62]), JointForces(np.zeros(0), ()), np.zeros(0))
    assert replace(plain, aid=aid).gravity == (0.5, 0.0, -1.62)


HELD = """<mujoco><option><flag {flags}/></option><worldbody>
  <site name="hook" pos="0.3 0 0.2"/>
  <body><joint type="slide" axis="1 0 0" stiffness="30" damping="0.4"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
    <body pos="0 0 -0.5"><joint type="ball" stiffness="2" damping="0.3"/><inertial pos="0 0 -0.4" mass="2" diaginertia="1 2 3"/>
      <site name="tip" pos="0 0 -0.8"/></body></body>
</worldbody><tendon><spatial stiffness="20" damping="0.6" springlength="0.1"><site site="hook"/><site site="tip"/></spatial></tendon>
</mujoco>"""


@pytest.mark.parametrize("off", [(), ("spring",), ("damper",), ("spring", "damper")], ids=lambda off: " and ".join(off) or "nothing")
def test_what_is_switched_off_weighs_nothing_with_both_switched_on(off: tuple[str, ...]) -> None:
    """In joints and tendons: MuJoCo itself computes what it did."""
    model = mujoco.MjModel.from_xml_string(HELD.format(flags=" ".join(f'{stage}="disable"' for stage in off)))
    data, generator = mujoco.MjData(model), np.random.default_rng(5)
    q, v = generator.normal(size=5), generator.normal(size=4)
    q[1:] /= np.linalg.norm(q[1:])

    def accelerations() -> np.ndarray:
        data.qpos, data.qvel = q, v
        mujoco.mj_forward(model, data)
        return data.qacc.copy()

    before = accelerations()
    keep_what_is_on(model)
    assert not model.opt.disableflags & (mujoco.mjtDisableBit.mjDSBL_SPRING | mujoco.mjtDisableBit.mjDSBL_DAMPER)
    np.testing.assert_allclose(accelerations(), before, rtol=1e-13)
    assert all(np.any(field) == ("spring" not in off) for field in (model.jnt_stiffness, model.tendon_stiffness))
    assert all(np.any(field) == ("damper" not in off) for field in (model.dof_damping, model.tendon_damping))
