"""Motions of a file by steps of one of Pinocchio's constraint solvers, with contacts, as both are set by default.

They are to solve the problem of complementarity, which is Coulomb's law over a step, and contacts have no compliance and no restitution.
Bodies that a joint connects touch: the ground may be what carries the first one.

Source: Pinocchio 4.1, examples/g1-constraint-simulation.py (the loop), algorithm/solvers (the settings).
"""

from __future__ import annotations

import numpy as np
import pinocchio
from lxml import etree

from harness.arrays import Array
from harness.engines.adapters.pinocchio.stepping import SolvedStep, StepProblem
from harness.engines.adapters.pinocchio.touching import TouchingShapes
from harness.engines.adapters.pinocchio.versions import reasons, require
from harness.engines.moving import MotionsRequest, SimulatedFile
from harness.engines.request import Refused

# Of a motion: each takes a millisecond in Python.
MOST_STEPS = 2000


def simulated(motion: SimulatedFile, request: MotionsRequest, solver: str, is_convex: bool) -> tuple[Array, Array]:
    """q and v, (k, joints) each, after the recorded steps of one motion; joints have one velocity each.

    Raises:
        Refused: Pinocchio does not read it, or the motion has more than ``MOST_STEPS``.
    """
    require("contacts", "PointContactConstraintModel", f"{solver}ConstraintSolver")
    if motion.counts[-1] > MOST_STEPS:
        raise Refused(f"Pinocchio's solvers are asked for {MOST_STEPS:,} steps at most, and this motion has {motion.counts[-1]:,}")
    assert motion.file.length is not None
    path = motion.file.path
    with reasons(lambda words: Refused(" ".join(words.split()))):
        model = pinocchio.buildModelFromUrdf(str(path))
    root = etree.parse(path, etree.XMLParser(resolve_entities=False)).getroot()
    shapes = TouchingShapes(model, path, root, among_neighbours=True)
    step = SolvedStep(model, ((), ()), solver, None, shapes, StepProblem(motion.file.length, compliance=0.0, is_convex=is_convex))
    if lacking := [name for name in request.joints if not model.existJointName(name)]:
        raise Refused(f"it has no joint {lacking[0]!r}")
    joints = [model.joints[model.getJointId(name)] for name in request.joints]
    q, v = pinocchio.neutral(model), np.zeros(model.nv)
    for joint, position, velocity in zip(joints, request.q.tolist(), request.v.tolist(), strict=True):
        q[joint.idx_q : joint.idx_q + joint.nq] = [position] if joint.nq == 1 else [np.cos(position), np.sin(position)]
        v[joint.idx_v] = velocity
    turns, found, done = np.zeros(len(joints)), [], 0
    for until in motion.counts:
        for _ in range(done, until):
            q, v = step.taken(q, v, 1)
            turns += motion.file.length * v[[joint.idx_v for joint in joints]]
        done = until
        own = [q[joint.idx_q] if joint.nq == 1 else start + turn for joint, start, turn in zip(joints, request.q, turns, strict=True)]
        found.append((own, v[[joint.idx_v for joint in joints]]))
    positions, velocities = (np.array([state[part] for state in found]) for part in range(2))
    return positions, velocities
