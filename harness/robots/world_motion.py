"""The bodies of a tree as they move in the world: positions, velocities and accelerations along its axes, as instructions of a program.

Accelerations are the classical ones, of points. Nothing here is a spatial vector, and no inertia is carried from one frame to
another: each lump of a body keeps its own centre of mass.

Source: Goldstein, Classical Mechanics, sections 4.9 and 4.10 (rates in turning frames) and 5.1 (rigid bodies).
"""

from __future__ import annotations

from dataclasses import dataclass

from harness.files.tree import Pose, Tree
from harness.robots.joint_forces import JointForceWriter
from harness.robots.nodes import Node, Pair
from harness.robots.rigid import Lump
from harness.robots.spatial import Matrix, Three, transposed


@dataclass
class Moving:
    """The frame of one node in the world, everything along the world's axes.

    Attributes:
        node: what it is in the tree. orientation, position: of the frame. arm: from the origin of the parent's frame to its own.
        spin, velocity: angular velocity, and velocity of the origin.
        motions: what each velocity of the joint adds to spin and velocity.
        bias: what (angular, linear) acceleration there is beyond that of the parent and that along ``motions``.
        lumps: the bodies that move with it, whose centres are measured from the origin.
    """

    node: Node
    orientation: Matrix
    position: Three
    arm: Three
    spin: Three
    velocity: Three
    motions: list[Pair]
    bias: Pair
    lumps: list[Lump]


class WorldWriter(JointForceWriter):
    """Writes the motion of the nodes of one tree in the world."""

    def less(self, first: Three, second: Three) -> Three:
        return self.added(first, self.minus(second))

    def moving(self) -> list[Moving]:
        """The frames of the nodes, parents before their children."""
        found: list[Moving] = []
        lumps = self._lumps()
        for node, own in zip(self.nodes, lumps, strict=True):
            parent = found[node.parent] if node.parent >= 0 else None
            turn, position, spin, velocity = self._of_parent(parent)
            orientation, arm = self.multiplied(turn, node.turn), self.turned(turn, node.shift)
            motions = [(self.turned(orientation, angular), self.turned(orientation, linear)) for angular, linear in node.motions]
            turning, sliding = self.still, self.still
            for (angular, linear), column in zip(motions, node.columns, strict=True):
                rate = self._first_rate + column
                turning = self.added(turning, self.times(rate, angular))
                sliding = self.added(sliding, self.times(rate, linear))
            own_spin, carried = self.added(spin, turning), self.added(self.cross(spin, arm), sliding)
            bias_of_spin = self.added(self.cross(spin, turning), self.turned(orientation, node.bias[0]))
            bias = self.added(self.cross(spin, carried), self.added(self.cross(own_spin, sliding), self.turned(orientation, node.bias[1])))
            found.append(
                Moving(
                    node=node,
                    orientation=orientation,
                    position=self.added(position, arm),
                    arm=arm,
                    spin=own_spin,
                    velocity=self.added(velocity, carried),
                    motions=motions,
                    bias=(bias_of_spin, bias),
                    lumps=[Lump(one.mass, self.turned(orientation, one.centre), self._axes(orientation, one.moments)) for one in own],
                )
            )
        return found

    def positions_of(self, tree: Tree) -> dict[str, Three]:
        """The origin of the joint frame that is fixed in each jointed body, of another tree with the same joints; see ``points``."""
        self._plant(tree)
        return self.points(self.moving())

    def points(self, moving: list[Moving]) -> dict[str, Three]:
        """By the name of a joint, the anchor in the world of the last joint of its body, which moves with the body."""
        last = [self._last_of_body(number) for number in range(len(self.nodes))]
        return {one.node.joint.name: moving[number].position for one, number in zip(moving, last, strict=True)}

    def _last_of_body(self, number: int) -> int:
        """Of the nodes that the joints of one body are, the last."""
        name = self.nodes[number].joint.name
        body = next(body for body in self.planted.bodies if name in {joint.name for joint in body.joints})
        return self.frames[body.name][0]

    def _lumps(self) -> list[list[Lump]]:
        """The bodies that move with each node, in the node's frame."""
        found: list[list[Lump]] = [[] for _ in self.nodes]
        for body in self.planted.bodies:
            number, turn, shift = self.frames[body.name]
            for lump in self.lumps(body) if number >= 0 else ():
                centre = self.added(shift, self.turned(turn, lump.centre))
                found[number].append(Lump(lump.mass, centre, self._axes(turn, lump.moments)))
        return found

    def _axes(self, turn: Matrix, moments: Matrix) -> Matrix:
        """Moments of inertia along other axes."""
        return self.multiplied(self.multiplied(turn, moments), transposed(turn))

    def _of_parent(self, parent: Moving | None) -> tuple[Matrix, Three, Three, Three]:
        if parent is None:
            return self.identity, self.still, self.still, self.still
        return parent.orientation, parent.position, parent.spin, parent.velocity

    # Springs between points.

    def pulls(self, moving: list[Moving]) -> list[Pair]:
        """What springs between points do to each node: moment about the origin of its frame, and force."""
        found: list[Pair] = [(self.still, self.still) for _ in moving]
        for spring in self.tree.springs:
            ends = [self._end(moving, body, pose) for body, pose in spring.ends]
            (_, _, first, rate_of_first), (_, _, second, rate_of_second) = ends
            between = self.less(second, first)
            length = self.add("sqrt", self.dot(between, between))
            along = [self.quotient(value, length) for value in between]
            rate = self.dot(along, self.less(rate_of_second, rate_of_first))
            stretch = self.difference(length, self.given(spring.free_length))
            tension = self._tension(spring, stretch, rate)
            pull = self.times(tension, along)
            for (number, arm, _, _), force in zip(ends, (pull, self.minus(pull)), strict=True):
                if number >= 0:
                    moment, before = found[number]
                    found[number] = self.added(moment, self.cross(arm, force)), self.added(before, force)
        return found

    def _end(self, moving: list[Moving], body: str, pose: Pose) -> tuple[int, Three, Three, Three]:
        """Node of a point, and along the world's axes its arm from the node's origin, its position and its velocity."""
        number, turn, shift = self.frames[body]
        _, local = self.placed(turn, shift, pose)
        if number < 0:
            return number, local, local, self.still
        one = moving[number]
        arm = self.turned(one.orientation, local)
        return number, arm, self.added(one.position, arm), self.added(one.velocity, self.cross(one.spin, arm))
