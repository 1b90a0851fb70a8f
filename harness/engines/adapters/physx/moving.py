"""Motions of a stage by PhysX's own steps, as its user loads it, in float32 on a CPU.

The solver, its iterations, the damping of angular velocities, sleep and stabilisation are those of the stage, or PhysX's where it gives
none. Before a motion, PhysX takes a step of a nanosecond where the stage stands, and one at the start, at rest.

Source: ovphysx documentation, ``PhysX.step_sync``, and Warmup and determinism.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from ovphysx.types import TensorType
from pxr import Usd, UsdPhysics

from harness.arrays import Array
from harness.engines.adapters.physx.articulations import Articulation, articulations_of, physx_at
from harness.engines.coordinates import rotation
from harness.engines.moving import MotionsRequest, SimulatedFile
from harness.engines.request import Refused

# Steps of a motion, of which each takes milliseconds on a CPU.
MOST_STEPS = 20_000
# A step in which nothing moves [s].
_MOMENT = 1e-9


class _Joints:
    """The hinges and slides of an articulation, in the order of a request."""

    def __init__(self, one: Articulation, joints: Sequence[str], path: Path) -> None:
        self._one, stage = one, Usd.Stage.Open(str(path))
        names = [joint.rpartition("/")[2] for joint in one.joints]
        self._places = [names.index(joint) for joint in joints]
        self._turning = [bool(UsdPhysics.RevoluteJoint(stage.GetPrimAtPath(one.joints[place]))) for place in self._places]

    def move(self, q: Array, v: Array) -> None:
        positions, velocities = np.zeros((2, len(self._one.joints)))
        positions[self._places], velocities[self._places] = q, v
        self._one.move(positions, velocities)

    def state(self) -> tuple[Array, Array]:
        kinds = TensorType.ARTICULATION_DOF_POSITION, TensorType.ARTICULATION_DOF_VELOCITY
        q, v = (self._one.read(kind)[self._places] for kind in kinds)
        return q, v

    def continued(self, q: Array) -> Array:
        """Positions (k, nq) without the jumps of angles, which are told within one turn of zero."""
        q[:, self._turning] = np.unwrap(q[:, self._turning], axis=0)
        return q


class _FloatingBody:
    """A body that floats alone: its position and (w, x, y, z), and the velocity of its origin and its angular velocity in its own frame."""

    def __init__(self, one: Articulation) -> None:
        self._one = one

    def move(self, q: Array, v: Array) -> None:
        turn = rotation(q[3:])
        angular = turn @ v[3:]
        self._one.place(q, np.concatenate([v[:3] + np.cross(angular, turn @ self._one.centres[0]), angular]))

    def state(self) -> tuple[Array, Array]:
        kinds = TensorType.ARTICULATION_ROOT_POSE, TensorType.ARTICULATION_ROOT_VELOCITY
        pose, velocity = (self._one.read(kind) for kind in kinds)
        q = pose[[0, 1, 2, 6, 3, 4, 5]]
        turn, angular = rotation(q[3:]), velocity[3:]
        linear = velocity[:3] - np.cross(angular, turn @ self._one.centres[0])
        return q, np.concatenate([linear, turn.T @ angular])

    def continued(self, q: Array) -> Array:
        return q


def moved(motion: SimulatedFile, request: MotionsRequest) -> tuple[Array, Array]:
    """q and v, (k, nq) and (k, nv) over the joints of the request, after the recorded steps of one motion.

    Raises:
        Refused: PhysX does not load the stage, the joints are not those of one articulation, or the motion is too long for a CPU.
    """
    if motion.counts[-1] > MOST_STEPS:
        raise Refused(f"PhysX is asked for {MOST_STEPS:,} steps at most on a CPU, and this motion has {motion.counts[-1]:,}")
    assert motion.file.length is not None
    path = motion.file.path.resolve()
    physx = physx_at(path)
    # Else it warns that it takes that step.
    physx.warmup()
    moving = _moving(articulations_of(physx), request.joints, path)
    # PhysX solves a step with contacts that it has found before: those of where the stage stands, where shapes may be sunk.
    moving.move(request.q, np.zeros(len(request.v)))
    physx.step_sync(_MOMENT)
    moving.move(request.q, request.v)
    states, done = [(request.q, request.v)], 0
    for until in motion.counts:
        for _ in range(done, until):
            physx.step_sync(motion.file.length)
        done = until
        states.append(moving.state())
    return moving.continued(np.array([q for q, _ in states]))[1:], np.array([v for _, v in states[1:]])


def _moving(articulations: Sequence[Articulation], joints: Sequence[str], path: Path) -> _Joints | _FloatingBody:
    """The articulation that has all of these joints, as it is moved; a body that floats is the joint of its own name."""
    for one in articulations:
        if one.floats and [*joints] == [one.links[0]] and not one.joints:
            return _FloatingBody(one)
        if not one.floats and {*joints} <= {joint.rpartition("/")[2] for joint in one.joints}:
            return _Joints(one, joints, path)
    raise Refused(f"it makes no articulation that stands on the world with joints {', '.join(joints)}, nor one body that floats so called")
