"""Places of a robot for a picture, from what its file means: no engine is asked."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from fractions import Fraction
from pathlib import Path

import numpy as np

from harness.comparison.robot_library import robot_at
from harness.engines import HeldBody, HeldJoint
from harness.files.joint_kinds import JointKind
from harness.files.tree import Joint, Tree
from harness.programs.terms import Term
from harness.show.picture import draw
from harness.show.placement import ANGLE_SHOWN, SLIDE_SHOWN, Pose, choose_view, extent_of
from harness.trees.bodies.spatial import Frame
from harness.trees.nodes import standing

_BITS = 64


def draw_robot(path: Path, note: Callable[[str], None]) -> str:
    """A robot moved a little, over its shadow at zero or in the middle of its limits; "" where nothing moves.

    Raises:
        InvalidModel: the file is no robot.
    """
    tree = robot_at(path).tree
    if not tree.joints:
        return ""
    resting = pose_of(tree, {joint.name: middle(joint) for joint in tree.joints})
    slide = SLIDE_SHOWN * extent_of(resting)
    moved = pose_of(tree, {joint.name: _shifted(joint, slide) for joint in tree.joints})
    return draw(moved, [resting], choose_view((resting, moved)), float(-tree.gravity[2]), ghost=resting)


def middle(joint: Joint) -> Fraction:
    """Zero, or the middle of limits that do not hold it [m or rad]."""
    low, high = _limits(joint)
    return Fraction(0) if low <= 0 <= high else (low + high) / 2


def _shifted(joint: Joint, slide: float) -> Fraction:
    step = Fraction(ANGLE_SHOWN if joint.kind == JointKind.HINGE else slide)
    return min(middle(joint) + step, _limits(joint)[1])


def _limits(joint: Joint) -> tuple[Fraction, Fraction]:
    unit = Fraction(np.pi / 180) if joint.in_degrees else Fraction(1)
    low, high = joint.limits or (Fraction(-100), Fraction(100))
    return low * unit, high * unit


def pose_of(tree: Tree, positions: Mapping[str, Fraction]) -> Pose:
    """The tree with its hinges and slides at ``positions`` [m or rad], in the world; a joint and what moves with it is a body.

    Joints of several axes stand where the file has them, and one that follows another where that leads it.
    """
    nodes = standing(tree, positions)
    builder, frames, outputs = nodes.builder, list[Frame](), dict[str, list[Term]]()
    for number, node in enumerate(nodes.nodes):
        parent = frames[node.parent] if node.parent >= 0 else Frame(builder.identity, builder.still)
        frames.append(Frame(parent.turn @ node.frame.turn, parent.at(node.frame.shift)))
        rigid = node.rigid.moved(frames[-1])
        # Of a slide the linear part, of all others the angular one.
        axis = frames[-1].turn @ node.motions[0][int(node.joint.kind == JointKind.SLIDE)]
        outputs[str(number)] = [*frames[-1].shift, *axis, rigid.mass, *rigid.first]
    found = builder.evaluated(outputs, _BITS)
    joints, bodies = {}, []
    owner = {joint.name: (body.name, joint) for body in tree.bodies for joint in body.joints}
    for number, node in enumerate(nodes.nodes):
        values = np.array([float(value) for value in found[str(number)]])
        place, axis, mass, first = values[:3], values[3:6], float(values[6]), values[7:]
        name, joint = owner[node.joint.name]
        length = float(np.linalg.norm(axis))
        unit = axis / length if joint.kind.is_single and length else np.zeros(3)
        back = float(positions[joint.follows or joint.name]) * length * unit if joint.kind == JointKind.SLIDE else np.zeros(3)
        above = nodes.nodes[node.parent].joint.name if node.parent >= 0 else ""
        joints[joint.name] = HeldJoint(joint.kind, above, place - back, place, unit, 0.0, 0.0, 0.0, 0.0, np.eye(3))
        bodies.append(HeldBody(mass, first / mass if mass else place, np.zeros((3, 3)), name))
    return Pose(joints, bodies, [], {name: number for number, name in enumerate(joints)}, [node.parent for node in nodes.nodes])
