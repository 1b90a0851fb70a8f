"""Motions of a stage by PhysX's own steps, as its user loads it, in float32 on a CPU.

The solver, its iterations, the damping of angular velocities, sleep and stabilisation are those of the stage, or PhysX's where it gives
none. Before a motion, PhysX takes a step of a nanosecond where the stage stands, and one at the start, at rest.

Source: ovphysx documentation, ``PhysX.step_sync``, and Warmup and determinism.
"""

from __future__ import annotations

import numpy as np
from ovphysx.types import TensorType
from pxr import Usd, UsdPhysics

from harness.arrays import Array
from harness.engines.adapters.physx.articulations import articulations_of, physx_at
from harness.engines.moving import MotionsRequest, SimulatedFile
from harness.engines.request import Refused

# Steps of a motion, of which each takes milliseconds on a CPU.
MOST_STEPS = 20_000
# A step in which nothing moves [s].
_MOMENT = 1e-9


def moved(motion: SimulatedFile, request: MotionsRequest) -> tuple[Array, Array]:
    """q and v, (k, nq) and (k, nv) over the joints of the request, after the recorded steps of one motion.

    Raises:
        Refused: PhysX does not load the stage, it has no such joints in one articulation on a base, or the motion is too long for a CPU.
    """
    if motion.counts[-1] > MOST_STEPS:
        raise Refused(f"PhysX is asked for {MOST_STEPS:,} steps at most on a CPU, and this motion has {motion.counts[-1]:,}")
    assert motion.file.length is not None
    physx = physx_at(motion.file.path.resolve())
    # Else it warns that it takes that step.
    physx.warmup()
    paths = {path.rpartition("/")[2]: (one, place) for one in articulations_of(physx) for place, path in enumerate(one.joints)}
    if missing := [name for name in request.joints if name not in paths]:
        raise Refused(f"it makes no joint of an articulation of {missing[0]!r}")
    owners = {id(paths[name][0]): paths[name][0] for name in request.joints}
    if len(owners) != 1:
        raise Refused(f"it is asked to move one articulation, and the joints are of {len(owners)}")
    [one] = owners.values()
    places = [paths[name][1] for name in request.joints]
    q, v = np.zeros((2, len(one.joints)))
    q[places], v[places] = request.q, request.v
    # PhysX solves a step with contacts that it has found before: those of where the stage stands, where shapes may be sunk.
    one.move(q, np.zeros(len(v)))
    physx.step_sync(_MOMENT)
    one.move(q, v)
    positions, velocities, done = [q[places]], [v[places]], 0
    for until in motion.counts:
        for _ in range(done, until):
            physx.step_sync(motion.file.length)
        done = until
        positions.append(one.read(TensorType.ARTICULATION_DOF_POSITION)[places])
        velocities.append(one.read(TensorType.ARTICULATION_DOF_VELOCITY)[places])
    recorded = np.array(positions)
    stage = Usd.Stage.Open(str(motion.file.path))
    # Angles are told within one turn of zero.
    turning = [bool(UsdPhysics.RevoluteJoint(stage.GetPrimAtPath(one.joints[place]))) for place in places]
    recorded[:, turning] = np.unwrap(recorded[:, turning], axis=0)
    return recorded[1:], np.array(velocities[1:])
