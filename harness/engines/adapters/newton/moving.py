"""Motions of a file by steps of ``SolverFeatherstone`` in one world, with contacts as Newton's collision pipeline finds them, in float32.

Contacts are springs and dampers of each shape, and friction is a damper up to Coulomb's bound, by the numbers of ``ShapeConfig`` where the
file gives none. The importer of MJCF makes one joint of all that a body has, its slides before its hinges.

Source: Newton documentation, ``SolverFeatherstone``, ``CollisionPipeline`` and ``ModelBuilder.ShapeConfig``.
"""

from __future__ import annotations

import warnings
from typing import Any

import newton
import numpy as np
import warp
from lxml import etree

from harness.arrays import Array
from harness.engines.adapters.newton.importing import sanitized, spelt
from harness.engines.moving import MotionsRequest, MovedFile, SimulatedFile
from harness.engines.request import Refused
from harness.engines.warp_kernels import keep_compiled

# Steps of a motion, of which each takes milliseconds on a CPU.
MOST_STEPS = 2000


def moved(motion: SimulatedFile, request: MotionsRequest) -> tuple[Array, Array]:
    """q and v, (k, nq) and (k, nv) over the joints of the request, after the recorded steps of one motion.

    Raises:
        Refused: the importer does not read the file, it names joints otherwise, or the motion is too long for a CPU.
    """
    if motion.counts[-1] > MOST_STEPS:
        raise Refused(f"Newton is asked for {MOST_STEPS:,} steps at most on a CPU, and this motion has {motion.counts[-1]:,}")
    assert motion.file.length is not None
    keep_compiled(warp)
    found, done = [], 0
    with warp.ScopedDevice("cpu"), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        model, places = _read(motion.file, request.joints)
        solver, pipeline = newton.solvers.SolverFeatherstone(model), newton.CollisionPipeline(model)
        contacts, control = pipeline.contacts(), model.control()
        state, other = model.state(), model.state()
        q, v = (np.zeros(len(one), dtype=np.float32) for one in (model.joint_q, model.joint_qd))
        q[places], v[places] = request.q, request.v
        state.joint_q.assign(q)
        state.joint_qd.assign(v)
        newton.eval_fk(model, state.joint_q, state.joint_qd, state)
        for until in motion.counts:
            for _ in range(done, until):
                pipeline.collide(state, contacts)
                solver.step(state, other, control, contacts, motion.file.length)
                state, other = other, state
            done = until
            found.append((state.joint_q.numpy()[places].astype(np.float64), state.joint_qd.numpy()[places].astype(np.float64)))
    return np.array([q for q, _ in found]), np.array([v for _, v in found])


def _read(file: MovedFile, joints: tuple[str, ...]) -> tuple[Any, list[int]]:
    """The model of a file, and the place of each of its joints, hinges and slides, among Newton's coordinates.

    Raises:
        Refused: in the importer's words, or a joint is not found.
    """
    builder = newton.ModelBuilder()
    try:
        if file.format == "mjcf":
            builder.add_mjcf(str(file.path), skip_equality_constraints=True)
        else:
            builder.add_urdf(str(file.path))
    except Exception as error:
        raise Refused(f"{type(error).__name__}: {' '.join(str(error).split())}") from error
    root = etree.parse(file.path).getroot()
    slides = {str(joint.get("name")) for joint in root.iter("joint") if joint.get("type") in ("slide", "prismatic")}
    names = {sanitized(name, file.format): name for name in joints}
    starts: dict[str, int] = {}
    for number, label in enumerate(builder.joint_label):
        if newton.JointType(builder.joint_type[number]) == newton.JointType.FIXED:
            continue
        parts = spelt(label.rpartition("/")[2], list(names), sum(builder.joint_dof_dim[number])) or ()
        in_order = sorted((names[part] for part in parts), key=lambda name: name not in slides)
        starts |= {name: builder.joint_q_start[number] + place for place, name in enumerate(in_order)}
    if missing := [name for name in joints if name not in starts]:
        raise Refused(f"its importer makes no joint of {missing[0]!r}")
    return builder.finalize(), [starts[name] for name in joints]
