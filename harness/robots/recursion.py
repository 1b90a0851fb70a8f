"""The equations of motion of a tree of bodies by recursion over it: M by composite bodies, forces by Newton and Euler.

Everything is written in the frames of the bodies, with motions as (angular velocity, velocity of the frame's origin) and
forces as (moment about it, force). It shares no expression with Lagrange's equations: no energy, no derivative.

Source: Featherstone, Rigid Body Dynamics Algorithms, sections 5.3 (recursive Newton-Euler), 6.2 (composite rigid bodies) and
2.8 to 2.13 (the vectors and their products).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from harness.equations.program import StraightLineProgram, upper_triangle, without_unused
from harness.files.tree import Given, Pose, Spring, Tree
from harness.robots.joint_forces import JointForceWriter
from harness.robots.nodes import Node, Pair
from harness.robots.rigid import Rigid
from harness.robots.spatial import Matrix, Three


@dataclass(frozen=True)
class Recursion:
    """The program of a tree, and the numbers of the file that are its last inputs."""

    program: StraightLineProgram
    parameters: tuple[Given, ...]


def recursion_program(tree: Tree, joints: Sequence[str], linear_velocity_in_body: bool = False) -> Recursion:
    """The program of a tree; q, v and tau follow ``joints``, inputs and outputs are those of ``harness.equations.kernels``.

    A rotation stands in q as a quaternion (w, x, y, z) of any length, its velocity in v in the body's frame, both behind the
    position of a free joint, whose velocity is in the frame of the parent, or in that of the body. A planar joint has its position
    in its plane, x and y, and its turn. The parameters are the numbers of the file, but for zeros and the lengths of directions
    along an axis.

    Raises:
        ValueError: the tree has other joints.
    """
    return RecursionWriter(tree, joints, linear_velocity_in_body).written()


class RecursionWriter(JointForceWriter):
    """Writes the program of one tree."""

    def _down(self, node: Node, motion: Pair) -> Pair:
        """A motion of the parent's frame, as one of the node's."""
        angular, linear = motion
        return self.turned_back(node.turn, angular), self.turned_back(node.turn, self.added(linear, self.cross(angular, node.shift)))

    def _up(self, node: Node, force: Pair) -> Pair:
        """A force on the node's frame, as one on the parent's."""
        moment, linear = self.turned(node.turn, force[0]), self.turned(node.turn, force[1])
        return self.added(moment, self.cross(node.shift, linear)), linear

    def _momentum(self, rigid: Rigid, motion: Pair) -> Pair:
        angular, linear = motion
        moment = self.added(self.turned(rigid.second, angular), self.cross(rigid.first, linear))
        return moment, self.added(self.times(rigid.mass, linear), self.cross(angular, rigid.first))

    def _power(self, motion: Pair, force: Pair) -> int:
        return self.sum(self.dot(motion[0], force[0]), self.dot(motion[1], force[1]))

    def _both(self, one: Pair, other: Pair) -> Pair:
        return self.added(one[0], other[0]), self.added(one[1], other[1])

    def _of_joint(self, node: Node) -> Pair:
        """The motion that the joint's velocities give its frame."""
        found: Pair = (self.still, self.still)
        for (angular, linear), column in zip(node.motions, node.columns, strict=True):
            rate = self._first_rate + column
            found = self._both(found, (self.times(rate, angular), self.times(rate, linear)))
        return found

    def _velocities(self) -> list[Pair]:
        found: list[Pair] = []
        for node in self.nodes:
            before = found[node.parent] if node.parent >= 0 else (self.still, self.still)
            found.append(self._both(self._down(node, before), self._of_joint(node)))
        return found

    def _generalised(self, forces: list[Pair]) -> Three:
        """The generalised forces that hold the given forces on the nodes."""
        found, carried = [self.zero] * self.nv, list(forces)
        for number in reversed(range(len(self.nodes))):
            node = self.nodes[number]
            for motion, column in zip(node.motions, node.columns, strict=True):
                # A joint and those that mimic it share a column.
                found[column] = self.sum(found[column], self._power(motion, carried[number]))
            if node.parent >= 0:
                carried[node.parent] = self._both(carried[node.parent], self._up(node, carried[number]))
        return found

    def _velocity_terms(self, velocities: list[Pair]) -> Three:
        accelerations: list[Pair] = []
        forces = []
        for node, velocity in zip(self.nodes, velocities, strict=True):
            angular, linear = velocity
            of_joint = self._of_joint(node)
            before = accelerations[node.parent] if node.parent >= 0 else (self.still, self.still)
            turning = (
                self.cross(angular, of_joint[0]),
                self.added(self.cross(angular, of_joint[1]), self.cross(linear, of_joint[0])),
            )
            accelerations.append(self._both(self._both(self._down(node, before), turning), node.bias))
            moment, momentum = self._momentum(node.rigid, velocity)
            gyroscopic = (self.added(self.cross(angular, moment), self.cross(linear, momentum)), self.cross(angular, momentum))
            forces.append(self._both(self._momentum(node.rigid, accelerations[-1]), gyroscopic))
        return self._generalised(forces)

    def _gravity_terms(self) -> Three:
        upward = self.minus(self.numbers(self.tree.gravity))
        accelerations: list[Pair] = []
        for node in self.nodes:
            before = accelerations[node.parent] if node.parent >= 0 else (self.still, upward)
            accelerations.append(self._down(node, before))
        return self._generalised([self._momentum(node.rigid, one) for node, one in zip(self.nodes, accelerations, strict=True)])

    def _mass_matrix(self) -> Three:
        composite = [node.rigid for node in self.nodes]
        entries: dict[tuple[int, int], int] = {}
        for number in reversed(range(len(self.nodes))):
            node = self.nodes[number]
            if node.parent >= 0:
                composite[node.parent] = self.joined(composite[node.parent], self.moved(composite[number], node.turn, node.shift))
            own = list(zip(node.motions, node.columns, strict=True))
            for place, (motion, column) in enumerate(own):
                force, at, others = self._momentum(composite[number], motion), number, own[: place + 1]
                while at >= 0:
                    for other, row in others:
                        # Of two nodes that share a column, both products are part of its entry.
                        times = self.number(2 if row == column and at != number else 1)
                        entry = min(row, column), max(row, column)
                        entries[entry] = self.sum(entries.get(entry, self.zero), self.product(times, self._power(other, force)))
                    force, at = self._up(self.nodes[at], force), self.nodes[at].parent
                    others = list(zip(self.nodes[at].motions, self.nodes[at].columns, strict=True))
            multiplier = self.given(node.joint.multiplier)
            armature = self.product(self.product(multiplier, multiplier), self.given(node.joint.armature))
            for column in node.columns:
                entries[column, column] = self.sum(entries[column, column], armature)
        return [entries.get(pair, self.zero) for pair in upper_triangle(self.nv)]

    # Springs and dampers.

    def _passive_forces(self, velocities: list[Pair]) -> Three:
        found = self.forces_of_joints()
        on_nodes: list[Pair] = [(self.still, self.still)] * len(self.nodes)
        for spring in self.tree.springs:
            self._pull(spring, velocities, on_nodes)
        return self.added(found, self._generalised(on_nodes))

    def _pull(self, spring: Spring, velocities: list[Pair], on_nodes: list[Pair]) -> None:
        """Add the forces of a spring between two points to those on their nodes."""
        ends = [self._end(body, pose, velocities) for body, pose in spring.ends]
        (first, rate_of_first), (second, rate_of_second) = ((position, rate) for _, _, position, rate, _ in ends)
        between = self.added(second, self.minus(first))
        length = self.add("sqrt", self.dot(between, between))
        along = [self.quotient(value, length) for value in between]
        rate = self.dot(along, self.added(rate_of_second, self.minus(rate_of_first)))
        stretch = self.difference(length, self.given(spring.free_length))
        tension = self._tension(spring, stretch, rate)
        for sign, (node, arm, _, _, turn) in zip((1, -1), ends, strict=True):
            if node >= 0:
                force = self.turned_back(turn, self.times(self.product(self.number(sign), tension), along))
                on_nodes[node] = self._both(on_nodes[node], (self.cross(arm, force), force))

    def _end(self, body: str, pose: Pose, velocities: list[Pair]) -> tuple[int, Three, Three, Three, Matrix]:
        """Node of a point, the point in its frame, its position and velocity in the world, and the frame's orientation there."""
        node, turn, shift = self.frames[body]
        _, arm = self.placed(turn, shift, pose)
        if node < 0:
            return node, arm, arm, self.still, self.identity
        angular, linear = velocities[node]
        rate, position, orientation, at = self.added(linear, self.cross(angular, arm)), arm, self.identity, node
        while at >= 0:
            above = self.nodes[at]
            position = self.added(above.shift, self.turned(above.turn, position))
            orientation, at = self.multiplied(above.turn, orientation), above.parent
        return node, arm, position, self.turned(orientation, rate), orientation

    def written(self) -> Recursion:
        """The program of what the tree says."""
        return Recursion(without_unused(self.program(self.outputs_of_tree())), self.parameters)

    def outputs_of_tree(self) -> Mapping[str, Three]:
        """The places of what the equations of motion hold."""
        velocities = self._velocities()
        return {
            "mass": self._mass_matrix(),
            "velocity": self._velocity_terms(velocities),
            "gravity": self._gravity_terms(),
            "passive": self._passive_forces(velocities),
        }
