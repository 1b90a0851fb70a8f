"""Joints, bodies and springs that a ``pinocchio.Model`` holds after loading, placed in the world by Pinocchio's own kinematics.

Source: Featherstone, Rigid Body Dynamics Algorithms, sections 4.4 (joint models) and 7.3; Pinocchio 4 documentation.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import pinocchio

from harness.engines import HeldBody, HeldJoint, HeldModel, HeldSpring, Unsupported
from harness.engines.adapters.pinocchio.forces import ForceElements
from harness.engines.adapters.pinocchio.versions import armature, parent_joint
from harness.files.joint_kinds import JointKind
from harness.files.model_file import JointDamper, JointSpring

_KINDS = {"JointModelSpherical": JointKind.BALL, "JointModelFreeFlyer": JointKind.FREE, "JointModelPlanar": JointKind.PLANAR}


def held(model: Any, added: ForceElements, positions: Mapping[str, float], steps: Mapping[str, Sequence[float]]) -> HeldModel:
    """``model`` in the configuration of ``Model``, which leaves composite joints at zero; their parts share one ``moved``.

    ``added`` is what the harness adds to ABA.
    """
    elements, places, data = added.elements, added.places, model.createData()
    if not hasattr(data, "joints"):
        raise Unsupported(f"Pinocchio {pinocchio.__version__} does not show how its joints move")
    configuration, velocity = pinocchio.neutral(model), np.zeros(model.nv)
    for name, value in positions.items():
        configuration[places[name].idx_q] = value
    for name, step in steps.items():
        velocity[places[name].idx_v : places[name].idx_v + len(step)] = step
    if steps:
        configuration = pinocchio.integrate(model, configuration, velocity)
    pinocchio.forwardKinematics(model, data, configuration)
    body_names = {parent_joint(frame): frame.name for frame in reversed(model.frames) if frame.type == pinocchio.FrameType.BODY}
    names = {place.idx_v: name for name, place in places.items()}
    joints: dict[str, HeldJoint] = {}
    bodies: dict[str, HeldBody] = {}
    # The last joint of each of Pinocchio's, which may be composed of several.
    last = [""]
    for number in range(1, model.njoints):
        after, above = data.oMi[number], model.parents[number]
        # Not from Jacobians, which rotations that are off by roundings enter three times.
        motions = np.array(data.joints[number].S).reshape(6, -1)
        parent, frame = last[above], data.oMi[above] * model.jointPlacements[number]
        first = model.joints[number].idx_v
        for part, shift in _parts(model.joints[number]):
            frame = frame * shift
            name = names[part.idx_v]
            column = motions[:, part.idx_v - first]
            linear, angular = after.rotation @ column[:3], after.rotation @ column[3:]
            kind = _KINDS.get(part.shortname(), JointKind.HINGE if angular.any() else JointKind.SLIDE)
            turning = not kind.is_single
            springs = [element for element in elements if isinstance(element, JointSpring) and element.joint == name]
            joints[name] = HeldJoint(
                kind=kind,
                parent=parent,
                anchor=frame.translation.copy(),
                moved=after.translation.copy(),
                axis=np.zeros(3) if turning else angular if kind == JointKind.HINGE else linear,
                armature=float(armature(model)[part.idx_v]),
                damping=sum(element.damping for element in elements if isinstance(element, JointDamper) and element.joint == name),
                stiffness=sum(element.stiffness for element in springs),
                spring_reference=springs[-1].reference if springs else 0.0,
                frame=frame.rotation.copy() if turning else np.eye(3),
            )
            parent = name
        last.append(parent)
        inertia, turned = model.inertias[number], after.rotation.astype(np.longdouble)
        about_centre = (turned @ inertia.inertia @ turned.T).astype(np.float64)
        bodies[parent] = HeldBody(float(inertia.mass), after.act(inertia.lever), about_centre, body_names.get(number, ""))
    springs_between_points = tuple(
        HeldSpring(ends, spring.stiffness, spring.damping, spring.free_length)
        for spring, ends in added.ends_of_point_springs(configuration)
        if spring.stiffness or spring.damping
    )
    return HeldModel(model.gravity.linear.copy(), joints, bodies, springs_between_points)


def _parts(joint: Any) -> Iterator[tuple[Any, Any]]:
    """The joints that make up one of Pinocchio's, each with its frame in the one before at zero."""
    if joint.shortname() != "JointModelComposite":
        yield joint, pinocchio.SE3.Identity()
        return
    composite = joint.extract()
    yield from zip(composite.joints, composite.jointPlacements, strict=True)
