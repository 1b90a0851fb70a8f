"""Where a model's joints and centres of mass are, from an engine's own kinematics, for a picture of it.

MJCF is placed by MuJoCo, URDF by Pinocchio. Everything is in the world's frame [m].
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from harness.equations.mechanism import Mechanism
from harness.models.model_file import ModelFile

Vector = tuple[float, float, float]
WORLD = -1
ANGLE_SHOWN = 0.4
SLIDE_SHOWN = 0.25


@dataclass(frozen=True)
class PlacedJoint:
    """A joint at one configuration.

    Attributes:
        kind: "hinge", "slide", "ball" or "free". body: index of the body it moves.
        anchor: its point on the side of the body's parent. moved: the same point on the body's own side.
        axis: unit vector; of no meaning for ball and free joints.
    """

    name: str
    kind: str
    body: int
    anchor: Vector
    moved: Vector
    axis: Vector


@dataclass(frozen=True)
class PlacedBody:
    """A moving body at one configuration; ``parent`` is an index, or ``WORLD``. Mass in kg."""

    name: str
    parent: int
    mass: float
    centre: Vector


@dataclass(frozen=True)
class Placement:
    """A mechanism at one configuration; the joints of a body stand in their order from its parent.

    ``springs`` are the lines of springs between points, from end to end.
    """

    bodies: tuple[PlacedBody, ...]
    joints: tuple[PlacedJoint, ...]
    springs: tuple[tuple[Vector, ...], ...]

    def points(self) -> list[Vector]:
        """Everything that a picture must hold."""
        ends = [point for joint in self.joints for point in (joint.anchor, joint.moved)]
        return ends + [body.centre for body in self.bodies if body.mass > 0] + [point for line in self.springs for point in line]


def place(model: ModelFile, mechanism: Mechanism, note: Callable[[str], None]) -> tuple[Placement, Placement]:
    """The model at its zero configuration, and with every coordinate moved a little in its positive direction.

    A coordinate whose range does not hold 0 stands in the middle of it. Raises what the engine raises.
    """
    placer = _PLACERS[model.format](model, mechanism)
    singles = {
        joint: bounds
        for joint, bounds in zip(mechanism.joints, mechanism.position_ranges, strict=True)
        if mechanism.joint_sizes[joint] == (1, 1)
    }
    middle = {
        joint: sum(bounds) / 2 if bounds is not None and not bounds[0] <= 0.0 <= bounds[1] else 0.0 for joint, bounds in singles.items()
    }
    resting = placer(middle, {})
    step = SLIDE_SHOWN * _extent(resting, singles)
    steps: dict[str, list[float]] = {}
    for joint in resting.joints:
        wanted = {"slide": [step], "hinge": [ANGLE_SHOWN], "ball": [ANGLE_SHOWN] * 3, "free": [step] * 3 + [ANGLE_SHOWN] * 3}[joint.kind]
        bounds = singles.get(joint.name)
        steps[joint.name] = wanted if bounds is None else [min(wanted[0], bounds[1] - middle[joint.name])]
    return resting, placer(middle, steps)


def _extent(placement: Placement, ranges: Mapping[str, tuple[float, float] | None]) -> float:
    span = float(np.linalg.norm(np.ptp(np.array(placement.points()), axis=0)))
    return span or max((abs(bound) for bounds in ranges.values() if bounds for bound in bounds), default=0.0) or 1.0


def _vector(values: Any) -> Vector:
    x, y, z = (float(value) for value in values)
    return x, y, z


_Placer = Callable[[Mapping[str, float], Mapping[str, Sequence[float]]], Placement]


def _placer_of_mjcf(model: ModelFile, mechanism: Mechanism) -> _Placer:
    import mujoco

    from harness.engines._mujoco_held import joint_kinds
    from harness.engines.mujoco import ENGINE

    loaded = ENGINE.load(model, mechanism.joints, mechanism.gravity).model
    kinds = joint_kinds()
    moving = [body for body in range(1, loaded.nbody) if loaded.body_weldid[body] != 0]

    def placed(positions: Mapping[str, float], steps: Mapping[str, Sequence[float]]) -> Placement:
        data = mujoco.MjData(loaded)
        for name, value in positions.items():
            data.joint(name).qpos[:] = value
        velocity = np.zeros(loaded.nv)
        for name, step in steps.items():
            address = loaded.joint(name).dofadr[0]
            velocity[address : address + len(step)] = step
        mujoco.mj_integratePos(loaded, data.qpos, velocity, 1.0)
        mujoco.mj_kinematics(loaded, data)
        mujoco.mj_comPos(loaded, data)
        mujoco.mj_tendon(loaded, data)
        # A body without joints of its own is part of the one it is welded to.
        solid = [body for body in moving if loaded.body_jntnum[body]]
        bodies = [
            PlacedBody(
                loaded.body(body).name or f"body {body}",
                WORLD
                if loaded.body_weldid[loaded.body_parentid[body]] == 0
                else solid.index(loaded.body_weldid[loaded.body_parentid[body]]),
                *_mass_and_centre([(loaded.body_mass[part], data.xipos[part]) for part in moving if loaded.body_weldid[part] == body]),
            )
            for body in solid
        ]
        joints = []
        for number in range(loaded.njnt):
            joint, kind = loaded.joint(number), kinds[int(loaded.jnt_type[number])]
            anchor, axis = data.xanchor[number], data.xaxis[number]
            slid = data.qpos[joint.qposadr[0]] - loaded.qpos0[joint.qposadr[0]] if kind == "slide" else 0.0
            joints.append(
                PlacedJoint(
                    joint.name, kind, solid.index(int(joint.bodyid[0])), _vector(anchor), _vector(anchor + slid * axis), _vector(axis)
                )
            )
        springs = []
        for tendon in range(loaded.ntendon):
            first, count = data.ten_wrapadr[tendon], data.ten_wrapnum[tendon]
            if count > 1:
                springs.append(tuple(_vector(point) for point in data.wrap_xpos.reshape(-1, 3)[first : first + count]))
        return Placement(tuple(bodies), tuple(joints), tuple(springs))

    return placed


def _mass_and_centre(parts: list[tuple[float, Any]]) -> tuple[float, Vector]:
    mass = float(sum(part for part, _ in parts))
    return mass, _vector(sum(part * centre for part, centre in parts) / mass if mass else parts[0][1])


def _placer_of_urdf(model: ModelFile, mechanism: Mechanism) -> _Placer:
    import pinocchio

    from harness.engines.pinocchio import ENGINE

    subject = ENGINE.load(model, mechanism.joints, mechanism.gravity)
    loaded = subject.model

    def placed(positions: Mapping[str, float], steps: Mapping[str, Sequence[float]]) -> Placement:
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
            bodies.append(PlacedBody(names[0] if names else f"body {number}", parent - 1, inertia.mass, _vector(after.act(inertia.lever))))
            joint = loaded.joints[number]
            # A single column comes back with one axis.
            motion = pinocchio.getJointJacobian(loaded, data, number, pinocchio.LOCAL).reshape(6, -1)[:, joint.idx_v]
            linear, angular = after.rotation @ motion[:3], after.rotation @ motion[3:]
            kind = {3: "ball", 6: "free"}.get(joint.nv) or ("hinge" if angular.any() else "slide")
            joints.append(
                PlacedJoint(
                    loaded.names[number], kind, number - 1, _vector(before.translation), _vector(after.translation),
                    _vector(angular if kind == "hinge" else linear),
                )
            )  # fmt: skip
        springs = [(_vector(a), _vector(b)) for _, (a, b) in subject.force_elements.ends_of_point_springs(configuration)]
        return Placement(tuple(bodies), tuple(joints), tuple(springs))

    return placed


_PLACERS: Mapping[str, Callable[[ModelFile, Mechanism], _Placer]] = {"mjcf": _placer_of_mjcf, "urdf": _placer_of_urdf}
