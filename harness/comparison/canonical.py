"""A robot without the frames that its author chose: everything in axes parallel to the world's, with every joint at zero.

Files of one robot place and turn the frames of their links as they like, and split what moves together into links as they like.
What is left when all joints stand at zero and every vector is given in the world's axes is the same for all of them: for each joint,
where it stands from the joint before it, its axis, and the mass, centre and moments of what moves with it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.equations.kernels import BallKernel
from harness.equations.program import without_unused
from harness.files.tree import WORLD, Body, Direction, Joint, Placement
from harness.robots.bounds import bounded
from harness.robots.rigid import BodyWriter, Rigid
from harness.robots.robot import Robot
from harness.robots.spatial import Matrix, Three

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
class Node:
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
        moments = sum((one.moments + one.mass * _square(one.centre - centre) for one in self.bodies.values()), np.zeros((3, 3)))
        return Mass(mass, centre, np.asarray(moments))


def _square(arm: Array) -> Array:
    return np.asarray(np.dot(arm, arm) * np.eye(3) - np.outer(arm, arm))


def canonical(robot: Robot) -> dict[str, Node]:
    """The nodes of a robot by the name of their joint, parents first; each number to the last bit or two."""
    return _Writer(robot).nodes()


class _Writer(BodyWriter):
    """Writes the frames of a tree in the world at zero."""

    def __init__(self, robot: Robot) -> None:
        super().__init__(())
        self.tree = bounded(robot.tree)
        self.scale_to(self.tree)
        self._outputs: list[int] = []
        # Of each body, the joint that moves it, and its frame in the world.
        self._frames: dict[str, tuple[str, Matrix, Three]] = {WORLD: ("", self.identity, self.still)}
        self._joints: dict[str, tuple[str, Joint, Body, Three, Three, Matrix]] = {}
        for body in self.tree.bodies:
            self._frames[body.name] = self._grow(body)

    def _grow(self, body: Body) -> tuple[str, Matrix, Three]:
        moved_by, turn, shift = self._frames[body.parent]
        turn, shift = self.placed(turn, shift, body.pose)
        for joint in body.joints:
            frame, offset = self.placed(self.identity, self.still, joint.pose)
            local = self.added(offset, self.turned(frame, self.numbers(joint.anchor)))
            anchor = self.added(shift, self.turned(turn, local))
            axis = self.turned(frame, self.direction(joint.axis)) if any(joint.axis) else self.still
            at_zero = self.difference(self.given(joint.offset), self.angle(joint.reference, joint.in_degrees))
            own = self.multiplied(turn, self.rotation(Placement(rotation=(Direction(joint.axis),)))) if joint.kind == "planar" else turn
            self._joints[joint.name] = moved_by, joint, body, anchor, self.turned(turn, axis), own
            if joint.kind == "hinge":
                turn = self.multiplied(turn, self.about(axis, at_zero)) if self._values.get(at_zero) != 0 else turn
                shift = self.added(anchor, self.minus(self.turned(turn, local)))
            elif joint.kind == "slide":
                shift = self.added(shift, self.times(at_zero, self.turned(turn, axis)))
            moved_by = joint.name
        return moved_by, turn, shift

    def _place(self, values: Three) -> None:
        self._outputs += values

    def nodes(self) -> dict[str, Node]:
        """Evaluated in balls."""
        for _, _, _, anchor, axis, frame in self._joints.values():
            self._place([*anchor, *axis, *(entry for row in frame for entry in row)])
        moving = [body for body in self.tree.bodies if self._frames[body.name][0]]
        for body in moving:
            name, turn, shift = self._frames[body.name]
            from_anchor = self.added(shift, self.minus(self._joints[name][3]))
            total = Rigid(self.zero, self.still, [self.still] * 3)
            for part in self.parts(body):
                total = self.joined(total, self.moved(part, turn, from_anchor))
            self._place([total.mass, *total.first, *(entry for row in total.second for entry in row)])
        values = iter(self._evaluated())
        found: dict[str, Node] = {}
        anchors: dict[str, list[Any]] = {"": [0.0] * 3}
        for name, (parent, joint, body, *_) in self._joints.items():
            anchors[name] = [next(values) for _ in range(3)]
            arm = [float(one - other) for one, other in zip(anchors[name], anchors[parent], strict=True)]
            own_axis, own_frame = (np.array([float(next(values)) for _ in range(count)]) for count in (3, 9))
            found[name] = Node(parent, joint, body, np.array(arm), own_axis, own_frame.reshape(3, 3), {}, {})
        for body in moving:
            mass, first, second = next(values), [next(values) for _ in range(3)], [next(values) for _ in range(9)]
            node = found[self._frames[body.name][0]]
            node.bodies[body.name] = _mass(mass, first, second)
            node.elements[body.name] = body
        return found

    def _evaluated(self) -> list[Any]:
        import flint

        program = without_unused(self.program({"all": self._outputs}))
        with flint.ctx.workprec(_BITS):
            evaluate = BallKernel(program, len(self.parameters)).bind([float(value) for value in self.parameters])
            return list(evaluate())


def _mass(mass: Any, first: list[Any], second: list[Any]) -> Mass:
    """Float64 of moments about the centre, which are formed in balls."""
    centre = [part / mass for part in first] if float(mass) else [mass * 0] * 3
    squared = sum((part * part for part in centre), mass * 0)
    moments = [second[3 * i + j] - mass * ((squared if i == j else 0) - centre[i] * centre[j]) for i in range(3) for j in range(3)]
    return Mass(float(mass), np.array([float(part) for part in centre]), np.array([float(part) for part in moments]).reshape(3, 3))
