"""The joints of a tree as nodes, each with what moves with it, as instructions of a program.

Source: Featherstone, Rigid Body Dynamics Algorithms, chapter 4 (trees and joint models).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from harness.files.tree import WORLD, Body, Coupling, Direction, Joint, Placement, Pose, Spring, Tree
from harness.robots.bounds import bounded
from harness.robots.rigid import BodyWriter, Rigid
from harness.robots.spatial import Matrix, Three, transposed

# A motion or a force as its two vectors.
Pair = tuple[Three, Three]

# Positions and velocities.
SIZES = {"hinge": (1, 1), "slide": (1, 1), "planar": (3, 3), "ball": (4, 3), "free": (7, 6)}


@dataclass
class Node:
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


class NodeWriter(BodyWriter):
    """Writes the nodes of one tree, parents before their children.

    ``INPUTS`` names the three vectors that stand before the time: positions, velocities, and one more as long as these; ``further``
    inputs stand between them and the time.
    """

    INPUTS = ("q", "v", "tau")

    def __init__(self, tree: Tree, joints: Sequence[str], linear_velocity_in_body: bool, further: Sequence[str] = ()) -> None:
        self._in_body = linear_velocity_in_body
        self._order = order = list(dict.fromkeys(joints))
        kinds = {joint.name: joint.kind for body in tree.bodies for joint in body.joints if not joint.follows}
        if sorted(order) != sorted(kinds):
            raise ValueError(f"the tree has the joints {sorted(kinds)}; expected {sorted(order)}")
        sizes = [SIZES[kinds[name]] for name in order]
        nq, self.nv = sum(positions for positions, _ in sizes), sum(velocities for _, velocities in sizes)
        names = [f"{kind}{i}" for kind, count in zip(self.INPUTS, (nq, self.nv, self.nv), strict=True) for i in range(count)]
        super().__init__((*names, *further, "t"))
        self._first_rate = nq
        self._places: dict[str, tuple[list[int], list[int]]] = {}
        q = v = 0
        for name, (positions, velocities) in zip(order, sizes, strict=True):
            self._places[name] = list(range(q, q + positions)), list(range(v, v + velocities))
            q, v = q + positions, v + velocities
        self.tree = tree = bounded(tree)
        self.scale_to(tree)
        self._plant(tree)

    # The tree.

    def _plant(self, tree: Tree) -> None:
        """Write the nodes of a tree, in place of any others."""
        self.planted = tree
        self.nodes: list[Node] = []
        # Node, and the body's frame in that of the node.
        self.frames: dict[str, tuple[int, Matrix, Three]] = {WORLD: (-1, self.identity, self.still)}
        for body in tree.bodies:
            self.frames[body.name] = self._grow(body.parent, body.pose, body.joints)
            if self.frames[body.name][0] >= 0:
                self._load(self.frames[body.name], body)

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
        self.nodes.append(Node(parent, turn, shift, joint, motions, columns, bias, empty))

    def _load(self, frame: tuple[int, Matrix, Three], body: Body) -> None:
        """Add a body's inertia to that of its node."""
        number, turn, shift = frame
        node = self.nodes[number]
        for part in self.parts(body):
            node.rigid = self.joined(node.rigid, self.moved(part, turn, shift))

    def _position(self, joint: Joint) -> int:
        """The position of a hinge or slide, of those that follow another too."""
        (place,), _ = self._places[joint.follows or joint.name]
        return self.sum(self.product(self.given(joint.multiplier), place), self.given(joint.offset))

    def _tension(self, line: Spring | Coupling, stretch: int, rate: int) -> int:
        """The tension of a spring and damper on a length, by how much it is beyond the free one and how fast it grows."""
        return self.sum(self.product(self.given(line.stiffness), stretch), self.product(self.given(line.damping), rate))
