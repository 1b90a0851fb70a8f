"""The text of a user's URDF as adapters change it: prefixes need not be declared, and a default namespace is none of the tags."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from catalogue import CALLED_HERE

from harness.engines import load_engine
from harness.engines.reading import elements_of, moving_mass, root_link
from harness.engines.request import AskedJoint, Request, in_columns
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
