"""The equations of motion of a tree of bodies by recursion over it: M by composite bodies, forces by Newton and Euler.

Everything is written in the frames of the bodies, with motions as (angular velocity, velocity of the frame's origin) and
forces as (moment about it, force). It shares no expression with Lagrange's equations: no energy, no derivative.

Source: Featherstone, Rigid Body Dynamics Algorithms, sections 5.3 (recursive Newton-Euler), 6.2 (composite rigid bodies) and
2.8 to 2.13 (the vectors and their products).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from harness.equations.program import StraightLineProgram, upper_triangle, without_unused
from harness.robots.rigid import BodyWriter, Rigid
from harness.robots.spatial import Matrix, Three, transposed
from harness.robots.tree import WORLD, Body, Coupling, Direction, Given, Joint, Placement, Pose, Spring, Tree

# A motion or a force as its two vectors.
Pair = tuple[Three, Three]

# Positions and velocities.
SIZES = {"hinge": (1, 1), "slide": (1, 1), "planar": (3, 3), "ball": (4, 3), "free": (7, 6)}


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
    return _Recursion(tree, joints, linear_velocity_in_body).written()


@dataclass
class _Node:
    """One joint with what moves with it; its frame stands in the joint's anchor.

    Attributes:
        parent: index of the node before it, -1 for the world. turn, shift: its frame in that of the parent.
        motions: the motion of the frame for each velocity; columns: their places in v.
        bias: the part of the acceleration of those motions that is due to their turning in the frame, for free joints.
    """

    parent: int
    turn: Matrix
    shift: Three
    joint: Joint
    motions: list[Pair]
    columns: list[int]
    bias: Pair
    rigid: Rigid


class _Recursion(BodyWriter):
    """Writes the program of one tree."""

    def __init__(self, tree: Tree, joints: Sequence[str], linear_velocity_in_body: bool) -> None:
        self._in_body = linear_velocity_in_body
        order = list(dict.fromkeys(joints))
        kinds = {joint.name: joint.kind for body in tree.bodies for joint in body.joints if not joint.follows}
        if sorted(order) != sorted(kinds):
            raise ValueError(f"the tree has the joints {sorted(kinds)}; expected {sorted(order)}")
        sizes = [SIZES[kinds[name]] for name in order]
        nq, self.nv = sum(positions for positions, _ in sizes), sum(velocities for _, velocities in sizes)
        names = [f"{kind}{i}" for kind, count in (("q", nq), ("v", self.nv), ("tau", self.nv)) for i in range(count)]
        super().__init__((*names, "t"))
        self._first_rate = nq
        self._places: dict[str, tuple[list[int], list[int]]] = {}
        q = v = 0
        for name, (positions, velocities) in zip(order, sizes, strict=True):
            self._places[name] = list(range(q, q + positions)), list(range(v, v + velocities))
            q, v = q + positions, v + velocities
        self.tree = tree
        self.scale_to(tree)
        self.nodes: list[_Node] = []
        # Node, and the body's frame in that of the node.
        self.frames: dict[str, tuple[int, Matrix, Three]] = {WORLD: (-1, self.identity, self.still)}
        for body in tree.bodies:
            self.frames[body.name] = self._grow(body.parent, body.pose, body.joints)
            if self.frames[body.name][0] >= 0:
                self._load(self.frames[body.name], body)

    # The tree.

    def _grow(self, parent: str, pose: Pose, joints: Iterable[Joint]) -> tuple[int, Matrix, Three]:
        """Add the nodes of a body's joints; the body's frame in the last of them."""
        node, turn, shift = self.frames[parent]
        turn, shift = self.placed(turn, shift, pose)
        for joint in joints:
            frame, offset = self.placed(self.identity, self.still, joint.pose)
            anchor = self.added(offset, self.turned(frame, self.numbers(joint.anchor)))
            axis = self.turned(frame, self.direction(joint.axis)) if any(joint.axis) else self.still
            self._add(node, turn, self.added(shift, self.turned(turn, anchor)), joint, axis)
            node, turn, shift = len(self.nodes) - 1, self.identity, self.minus(anchor)
        return node, turn, shift

    def _add(self, parent: int, turn: Matrix, shift: Three, joint: Joint, axis: Three) -> None:
        positions, columns = self._places[joint.follows or joint.name]
        about = [(row, self.still) for row in self.identity]
        bias: Pair = (self.still, self.still)
        if joint.kind in ("hinge", "slide"):
            multiplier = self.given(joint.multiplier)
            position = self._position(joint)
            moved, felt = self.difference(position, self.angle(joint.reference, joint.in_degrees)), self.times(multiplier, axis)
            if joint.kind == "hinge":
                turn, motions = self.multiplied(turn, self.about(axis, moved)), [(felt, self.still)]
            else:
                shift, motions = self.added(shift, self.turned(turn, self.times(moved, axis))), [(self.still, felt)]
        elif joint.kind == "planar":
            along = transposed(self.rotation(Placement(rotation=(Direction(joint.axis),))))
            own = self.about(axis, positions[2])
            moved_by = self.added(self.times(positions[0], along[0]), self.times(positions[1], along[1]))
            shift, turn = self.added(shift, self.turned(turn, moved_by)), self.multiplied(turn, own)
            motions = [*((self.still, self.turned_back(own, row)) for row in along[:2]), (axis, self.still)]
            rate = self.added(*(self.times(self._first_rate + columns[i], along[i]) for i in range(2)))
            # The velocity is given in the frame that does not turn.
            turning = self.times(self._first_rate + columns[2], axis)
            bias = (self.still, self.minus(self.cross(turning, self.turned_back(own, rate))))
        elif joint.kind == "ball":
            turn, motions = self.multiplied(turn, self.of_quaternion(positions)), about
        elif self._in_body:
            shift = self.added(shift, self.turned(turn, positions[:3]))
            turn = self.multiplied(turn, self.of_quaternion(positions[3:]))
            motions = [(self.still, row) for row in self.identity] + about
        else:
            shift = self.added(shift, self.turned(turn, positions[:3]))
            own = self.of_quaternion(positions[3:])
            turn = self.multiplied(turn, own)
            motions = [(self.still, self.turned_back(own, row)) for row in self.identity] + about
            rates = [self._first_rate + column for column in columns]
            # The velocity is given in the parent's frame, which turns in the body's.
            bias = (self.still, self.minus(self.cross(rates[3:], self.turned_back(own, rates[:3]))))
        empty = Rigid(self.zero, self.still, [self.still] * 3)
        self.nodes.append(_Node(parent, turn, shift, joint, motions, columns, bias, empty))

    def _load(self, frame: tuple[int, Matrix, Three], body: Body) -> None:
        """Add a body's inertia to that of its node."""
        number, turn, shift = frame
        node = self.nodes[number]
        for part in self.parts(body):
            node.rigid = self.joined(node.rigid, self.moved(part, turn, shift))

    # Motions and forces.

    def _down(self, node: _Node, motion: Pair) -> Pair:
        """A motion of the parent's frame, as one of the node's."""
        angular, linear = motion
        return self.turned_back(node.turn, angular), self.turned_back(node.turn, self.added(linear, self.cross(angular, node.shift)))

    def _up(self, node: _Node, force: Pair) -> Pair:
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

    def _of_joint(self, node: _Node) -> Pair:
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

    def _position(self, joint: Joint) -> int:
        """The position of a hinge or slide, of those that follow another too."""
        (place,), _ = self._places[joint.follows or joint.name]
        return self.sum(self.product(self.given(joint.multiplier), place), self.given(joint.offset))

    def _passive_forces(self, velocities: list[Pair]) -> Three:
        found = [self.zero] * self.nv
        for node in self.nodes:
            joint, multiplier = node.joint, self.given(node.joint.multiplier)
            for column in node.columns if joint.damping else ():
                rate = self.product(multiplier, self._first_rate + column)
                force = self.product(multiplier, self.product(self.given(joint.damping), rate))
                found[column] = self.difference(found[column], force)
            if joint.stiffness and joint.kind in ("hinge", "slide"):
                (column,) = node.columns
                moved = self.difference(self._position(joint), self.angle(joint.spring_reference, joint.in_degrees))
                force = self.product(multiplier, self.product(self.given(joint.stiffness), moved))
                found[column] = self.difference(found[column], force)
        for coupling in self.tree.couplings:
            self._couple(coupling, found)
        on_nodes: list[Pair] = [(self.still, self.still)] * len(self.nodes)
        for spring in self.tree.springs:
            self._pull(spring, velocities, on_nodes)
        return self.added(found, self._generalised(on_nodes))

    def _couple(self, coupling: Coupling, found: Three) -> None:
        """Add the forces of a coupling to the generalised forces ``found``."""
        joints = {node.joint.name: node for node in self.nodes}
        total, rate, rest, columns = self.zero, self.zero, self.zero, []
        for name, multiple in coupling.joints:
            node, factor = joints[name], self.given(multiple)
            slope = self.product(factor, self.given(node.joint.multiplier))
            total = self.sum(total, self.product(factor, self._position(node.joint)))
            rate = self.sum(rate, self.product(slope, self._first_rate + node.columns[0]))
            rest = self.sum(rest, self.product(factor, self.angle(node.joint.spring_reference, node.joint.in_degrees)))
            columns.append((node.columns[0], slope))
        stretch = self.difference(total, rest if coupling.rest is None else self.given(coupling.rest))
        tension = self.sum(self.product(self.given(coupling.stiffness), stretch), self.product(self.given(coupling.damping), rate))
        for column, slope in columns:
            found[column] = self.difference(found[column], self.product(slope, tension))

    def _pull(self, spring: Spring, velocities: list[Pair], on_nodes: list[Pair]) -> None:
        """Add the forces of a spring between two points to those on their nodes."""
        ends = [self._end(body, pose, velocities) for body, pose in spring.ends]
        (first, rate_of_first), (second, rate_of_second) = ((position, rate) for _, _, position, rate, _ in ends)
        between = self.added(second, self.minus(first))
        length = self.add("sqrt", self.dot(between, between))
        along = [self.quotient(value, length) for value in between]
        rate = self.dot(along, self.added(rate_of_second, self.minus(rate_of_first)))
        stretch = self.difference(length, self.given(spring.free_length))
        tension = self.sum(self.product(self.given(spring.stiffness), stretch), self.product(self.given(spring.damping), rate))
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
        velocities = self._velocities()
        outputs: Mapping[str, Three] = {
            "mass": self._mass_matrix(),
            "velocity": self._velocity_terms(velocities),
            "gravity": self._gravity_terms(),
            "passive": self._passive_forces(velocities),
        }
        return Recursion(without_unused(self.program(outputs)), self.parameters)
