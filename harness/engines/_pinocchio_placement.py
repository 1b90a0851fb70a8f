"""Places of joints, bodies and springs by Pinocchio's kinematics."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from harness.engines._pinocchio_forces import ForceElements
from harness.engines._placement import PlacedBody, PlacedJoint, Placement, as_vector


def place(loaded: Any, forces: ForceElements, positions: Mapping[str, float], steps: Mapping[str, Sequence[float]]) -> Placement:
    """A loaded model with joints of one position at ``positions`` [m or rad], then moved by ``steps`` along its velocities."""
    import pinocchio

    data = loaded.createData()
    configuration, velocity = pinocchio.neutral(loaded), np.zeros(loaded.nv)
    for name, value in positions.items():
        configuration[loaded.joints[loaded.getJointId(name)].idx_q] = value
    for name, step in steps.items():
        joint = loaded.joints[loaded.getJointId(name)]
        velocity[joint.idx_v : joint.idx_v + joint.nv] = step
    configuration = pinocchio.integrate(loaded, configuration, velocity)
    pinocchio.computeJointJacobians(loaded, data, configuration)
    bodies, joints = [], []
    for number in range(1, loaded.njoints):
        parent, inertia, after = loaded.parents[number], loaded.inertias[number], data.oMi[number]
        before = data.oMi[parent] * loaded.jointPlacements[number]
        names = [frame.name for frame in loaded.frames if frame.type == pinocchio.FrameType.BODY and frame.parentJoint == number]
        bodies.append(PlacedBody(names[0] if names else f"body {number}", parent - 1, inertia.mass, as_vector(after.act(inertia.lever))))
        joint = loaded.joints[number]
        # A single column comes back with one axis.
        motion = pinocchio.getJointJacobian(loaded, data, number, pinocchio.LOCAL).reshape(6, -1)[:, joint.idx_v]
        linear, angular = after.rotation @ motion[:3], after.rotation @ motion[3:]
        kind = {3: "ball", 6: "free"}.get(joint.nv) or ("hinge" if angular.any() else "slide")
        joints.append(
            PlacedJoint(
                loaded.names[number], kind, number - 1, as_vector(before.translation), as_vector(after.translation),
                as_vector(angular if kind == "hinge" else linear),
            )
        )  # fmt: skip
    springs = [(as_vector(a), as_vector(b)) for _, (a, b) in forces.ends_of_point_springs(configuration)]
    return Placement(tuple(bodies), tuple(joints), tuple(springs))
