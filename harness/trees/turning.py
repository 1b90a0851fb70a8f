"""Rows of constraints over a step in which linear velocities are components along the axes of bodies, which turn.

Such a step adds the rates of these components to them, and leaves out that the axes turn: with the velocity v of a free or planar joint in
the frame of its parent and the angular velocity w there, J v after a step h is J (v + h (a - w x v)).

Source: Featherstone, Rigid Body Dynamics Algorithms, section 2.10 (the apparent derivative of a moving coordinate system).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from harness.files.joint_kinds import JointKind
from harness.programs.mechanisms.mechanism import BIAS, JACOBIAN, Constraints
from harness.programs.program import position_count
from harness.programs.terms import Builder, cross, vector
from harness.trees.bodies.spatial import of_quaternion
from harness.trees.nodes import Coordinates
from harness.trees.robot import Robot


def turning_with_bodies(rows: Constraints, robot: Robot) -> Constraints:
    """The rows of a robot, whose ``bias`` is -J (w x v) in place of J' v."""
    builder = Builder(rows.program.inputs)
    known, count = builder.append(rows.program), position_count(rows.tree)
    nv = len(rows.assembly)
    kinds = {name: robot.joint(name).kind for name in robot.joints}
    inputs = vector(builder.inputs)
    placed = Coordinates.of(kinds, inputs[:count], inputs[count : count + nv], (), ())
    turning = builder.zeros(nv)
    for name, kind in kinds.items():
        linear, spin = np.split(placed.velocities[placed.columns[name]], [kind.linear])
        if kind == JointKind.FREE:
            turning[placed.columns[name][:3]] = cross(of_quaternion(placed.positions[name][-4:]) @ spin, linear)
        elif kind == JointKind.PLANAR:
            turning[placed.columns[name][:2]] = vector([-(spin[0] * linear[1]), spin[0] * linear[0]])
    jacobian = np.array(known[JACOBIAN], dtype=object).reshape(-1, nv)
    outputs = {name: known[name] for name in rows.program.outputs} | {BIAS: [-(row @ turning) for row in jacobian]}
    return replace(rows, program=builder.program(outputs))
