"""A robot without the frames that its author chose: everything in axes parallel to the world's, with every joint at zero.

Files of one robot place and turn the frames of their links as they like, and split what moves together into links as they like.
What is left when all joints stand at zero and every vector is given in the world's axes is the same for all of them: for each joint,
where it stands from the joint before it, its axis, and the mass, centre and moments of what moves with it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.files.given import Direction, Placement
from harness.files.tree import WORLD, Body, Joint
from harness.programs.terms import Term
from harness.trees.bodies.inertias import bounded
from harness.trees.bodies.rigid import Weights, about_centre, joined
from harness.trees.bodies.spatial import FileBuilder, Frame, about, angle, direction, placed, rotation
from harness.trees.robot import Robot

_BITS = 160


@dataclass(frozen=True)
class Mass:
    """Mass [kg], centre (3,) from the joint's anchor [m], and moments (3, 3) about the centre [kg m^2]."""

    mass: float
    centre: Array
    moments: Array

    def turned(self, turn: Array) -> Mass:
        return Mass(self.mass, turn @ self.centre, turn @ self.moments @ turn.T)


@dataclass(frozen=True)
class CanonicalNode:
    """One joint and what moves with it.

    Attributes:
        parent: name of the joint before it, "" for none. body: that the file gives the joint to.
        anchor: (3,) from the parent's anchor, or from the world's origin [m]. axis: (3,), unit; zeros for ball and free joints.
        frame: (3, 3) orientation of the axes in which a ball, free or planar joint has its velocity: x and y of a planar joint in its
            plane, and its axis.
        bodies: each body that moves with it and not with a later joint. elements: these bodies in the file.
    """

    parent: str
    joint: Joint
    body: Body
    anchor: Array
    axis: Array
    frame: Array
    bodies: dict[str, Mass]
    elements: dict[str, Body]

    @property
    def total(self) -> Mass:
        """All bodies in one."""
        mass = sum(one.mass for one in self.bodies.values())
        first = sum((one.mass * one.centre for one in self.bodies.values()), np.zeros(3))
        centre = first / mass if mass else np.zeros(3)
        arms = ((one, one.centre - centre) for one in self.bodies.values())
        moments = sum((one.moments + one.mass * (np.dot(arm, arm) * np.eye(3) - np.outer(arm, arm)) for one, arm in arms), np.zeros((3, 3)))
        return Mass(mass, centre, np.asarray(moments))


def canonical(robot: Robot) -> dict[str, CanonicalNode]:
    """The nodes of a robot by the name of their joint, parents first; each number to the last bit or two."""
    tree, builder = bounded(robot.tree), FileBuilder(())
    weights = Weights(builder, tree)
    # Of each body, the joint that moves it, and its frame in the world at zero; of the joints, terms from the world's origin.
    frames = {WORLD: ("", placed(builder, ()))}
    joints: dict[str, CanonicalNode] = {}
    for body in tree.bodies:
        frames[body.name] = _grown(builder, body, *frames[body.parent], joints)
    outputs: dict[str, list[Term]] = {f"joint {name}": [*one.anchor, *one.axis, *one.frame.flat] for name, one in joints.items()}
    moving = [body for body in tree.bodies if frames[body.name][0]]
    for body in moving:
        name, frame = frames[body.name]
        from_anchor = Frame(frame.turn, frame.shift + -joints[name].anchor)
        total = joined(builder, (part.moved(from_anchor) for part in weights.parts(body)))
        outputs[f"body {body.name}"] = [total.mass, *total.first, *total.second.flat]
    values = builder.evaluated(outputs, _BITS)
    found: dict[str, CanonicalNode] = {}
    anchors: dict[str, list[Any]] = {"": [0.0] * 3}
    for name, one in joints.items():
        anchors[name], rest = values[f"joint {name}"][:3], [float(value) for value in values[f"joint {name}"][3:]]
        arm = [float(own - before) for own, before in zip(anchors[name], anchors[one.parent], strict=True)]
        found[name] = replace(one, anchor=np.array(arm), axis=np.array(rest[:3]), frame=np.array(rest[3:]).reshape(3, 3))
    for body in moving:
        mass, *moments = values[f"body {body.name}"]
        node = found[frames[body.name][0]]
        centre, about_it = about_centre(mass, moments)
        node.bodies[body.name] = Mass(float(mass), np.array(centre, dtype=np.float64), np.array(about_it, dtype=np.float64))
        node.elements[body.name] = body
    return found


def _grown(builder: FileBuilder, body: Body, moved_by: str, parent: Frame, joints: dict[str, CanonicalNode]) -> tuple[str, Frame]:
    """Add the joints of a body; the last of them, and the body's frame in the world."""
    frame = placed(builder, body.pose, parent)
    for joint in body.joints:
        own = placed(builder, joint.pose)
        local = own.at(builder.vector(joint.anchor))
        anchor = frame.at(local)
        axis = own.turn @ direction(builder, joint.axis) if any(joint.axis) else builder.still
        at_zero = builder.number(joint.offset) - angle(builder, joint.reference, joint.in_degrees)
        is_planar = joint.kind.has_axis and not joint.kind.is_single
        axes = frame.turn @ rotation(builder, Placement(rotation=(Direction(joint.axis),))) if is_planar else frame.turn
        joints[joint.name] = CanonicalNode(moved_by, joint, body, anchor, frame.turn @ axis, axes, {}, {})
        if joint.kind.is_single and joint.kind.linear:
            frame = Frame(frame.turn, frame.shift + at_zero * (frame.turn @ axis))
        elif joint.kind.is_single:
            turn = frame.turn if at_zero.value == 0 else frame.turn @ about(axis, at_zero)
            frame = Frame(turn, anchor + -(turn @ local))
        moved_by = joint.name
    return moved_by, frame
