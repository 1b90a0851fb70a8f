"""Positions and velocities of joints stand at different places in Pinocchio behind a free, ball or continuous joint: forces, couplings and
rotor inertias act where the velocities are."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio
import pytest

from harness.engines.adapters.pinocchio.constraints import MimicJoints
from harness.engines.adapters.pinocchio.forces import ForceElements, places_of
from harness.engines.request import AskedJoint, in_columns
from harness.files.facts import JointDamper, JointSpring
from harness.files.joint_kinds import JointKind
from harness.files.model_file import read_model

LINK = """<link name="{name}"><inertial><origin xyz="0.1 0.2 0.3"/><mass value="2"/>
<inertia ixx="0.1" iyy="0.2" izz="0.25" ixy="0" ixz="0" iyz="0"/></inertial></link>"""
JOINT = """<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/><origin xyz="0.5 0 0"/><axis xyz="0 1 0"/>
<limit lower="-1" upper="1" effort="1" velocity="1"/>{further}</joint>"""
# Joints by name with their kind, each behind the one before.
CHAIN = {"wheel": "continuous", "elbow": "revolute", "rail": "prismatic", "last": "revolute"}


def urdf(**further: str) -> str:
    names = ["base", *CHAIN]
    joints = [
        JOINT.format(name=name, kind=kind, parent=parent, child=name, further=further.get(name, ""))
        for parent, (name, kind) in zip(names, CHAIN.items(), strict=False)
    ]
    return f'<robot name="chain">{"".join(LINK.format(name=name) for name in names)}{"".join(joints)}</robot>'


def model_and_joints(root: str) -> tuple[pinocchio.Model, tuple[AskedJoint, ...]]:
    root_joint = {"free": pinocchio.JointModelFreeFlyer, "ball": pinocchio.JointModelSpherical}[root]()
    kinds = {"base": JointKind.FREE if root == "free" else JointKind.BALL, **dict.fromkeys(CHAIN, JointKind.HINGE), "rail": JointKind.SLIDE}
    model = pinocchio.buildModelFromXML(urdf(), root_joint, "base")
    return model, in_columns([AskedJoint(name, kind, (), ()) for name, kind in kinds.items()])


@pytest.mark.parametrize("root", ["free", "ball"])
def test_dampers_and_springs_act_on_their_own_joint(root: str) -> None:
    model, joints = model_and_joints(root)
    places = places_of(model, joints)
    # The wheel has two positions here, cosine and sine.
    damping = {joint.name: 0.5 + number for number, joint in enumerate(joints)}
    elements = [*(JointDamper(name, value, 1) for name, value in damping.items()), JointSpring("last", 7.0, 0.2, 1)]
    forces = ForceElements(model, elements, places)
    generator = np.random.default_rng(3)
    q = pinocchio.integrate(model, pinocchio.neutral(model), generator.normal(size=model.nv))
    angle = float(q[-1])
    for number, joint in enumerate(joints):
        v = np.zeros(model.nv)
        rows = slice(model.idx_vs[number + 1], model.idx_vs[number + 1] + model.nvs[number + 1])
        v[rows] = generator.normal(size=model.nvs[number + 1])
        expected = -damping[joint.name] * v
        expected[-1] -= 7.0 * (angle - 0.2)
        np.testing.assert_allclose(forces.at(q, v), expected, atol=1e-14)
        np.testing.assert_allclose(forces.generalised_forces(q[:, None], v[:, None])[:, 0], expected, atol=1e-14)
        by_position, by_velocity = forces.derivatives(q, v)
        np.testing.assert_allclose(by_velocity @ v, -damping[joint.name] * v, atol=1e-14)
        assert by_position[-1, -1] == -7.0 and np.count_nonzero(by_position) == 1
    assert forces.potential_energy(q) == pytest.approx(7.0 * (angle - 0.2) ** 2 / 2)


@pytest.mark.parametrize("root", ["free", "ball"])
def test_a_follower_behind_a_base_that_turns_has_the_accelerations_of_its_leader(root: str, tmp_path: Path) -> None:
    """As of the equations of the whole tree, projected on what the coupling leaves free."""
    model, _ = model_and_joints(root)
    model.armature = 0.1 * np.arange(model.nv, 0.0, -1.0)
    # A follower with a rotor of its own is another matter.
    model.armature[-1] = 0.0
    path = tmp_path / "chain.urdf"
    path.write_text(urdf(last='<mimic joint="elbow" multiplier="-0.5" offset="0.3"/>'))
    root_joint = (pinocchio.JointModelFreeFlyer if root == "free" else pinocchio.JointModelSpherical)()
    mimics = MimicJoints(model, read_model(path, "urdf"), (root_joint, "base"))
    generator = np.random.default_rng(4)
    v, tau = generator.normal(size=(2, model.nv))
    q = pinocchio.integrate(model, pinocchio.neutral(model), v)
    coupling = np.eye(model.nv)[:, :-1]
    coupling[-1, model.idx_vs[model.getJointId("elbow")]] = -0.5
    v, q[-1] = coupling @ v[:-1], -0.5 * q[model.idx_qs[model.getJointId("elbow")]] + 0.3
    data = model.createData()
    mass = np.triu(pinocchio.crba(model, data, q))
    mass += np.triu(mass, 1).T
    bias = pinocchio.nonLinearEffects(model, data, q, v)
    expected = coupling @ np.linalg.solve(coupling.T @ mass @ coupling, coupling.T @ (tau - bias))
    [found] = mimics.accelerations((q[:, None], v[:, None], tau[:, None]))
    np.testing.assert_allclose(found, expected, atol=1e-12)
    assert np.abs(mimics.gaps(q[:, None])["last"]).max() < 1e-15
