"""The bodies of a tree as they move in the world: positions, velocities and accelerations along its axes, as terms of a program.

Accelerations are the classical ones, of points. Nothing here is a spatial vector, and no inertia is carried from one frame to
another: each lump of a body keeps its own centre of mass.

Source: Goldstein, Classical Mechanics, sections 4.9 and 4.10 (rates in turning frames) and 5.1 (rigid bodies).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from harness.equations.term import Matrix, Vector, cross
from harness.files.tree import Pose, Tree
from harness.robots.joint_forces import tension_between
from harness.robots.nodes import Kinematics, Node
from harness.robots.rigid import Lump, Spatial, spatial
from harness.robots.spatial import Frame, placed


@dataclass(frozen=True)
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
    position: Vector
    arm: Vector
    spin: Vector
    velocity: Vector
    motions: list[Spatial]
    bias: Spatial
    lumps: list[Lump]

    @property
    def rates(self) -> list[tuple[Spatial, int]]:
        """The motion of each velocity, and its place in v."""
        return list(zip(self.motions, self.node.columns, strict=True))

    def velocity_at(self, arm: Vector) -> Vector:
        """The velocity of the point at an arm from the origin."""
        return self.velocity + cross(self.spin, arm)


@dataclass(frozen=True)
class World:
    """The nodes of one tree as they move in the world."""

    kinematics: Kinematics
    moving: Sequence[Moving]

    @property
    def still(self) -> Vector:
        return self.kinematics.builder.still

    def up_from(self, number: int) -> Iterator[Moving]:
        """A node, those before it, and the first of its tree."""
        while number >= 0:
            yield self.moving[number]
            number = self.moving[number].node.parent

    def behind(self, number: int) -> Iterator[int]:
        """The nodes that a joint carries, its own first."""
        for other in range(number, len(self.moving)):
            at = other
            while at > number:
                at = self.moving[at].node.parent
            if at == number:
                yield other

    def frame_of(self, body: str) -> Frame:
        """The frame of a body in the world."""
        number, frame = self.kinematics.frames[body]
        if number < 0:
            return frame
        one = self.moving[number]
        return Frame(one.orientation @ frame.turn, one.position + one.orientation @ frame.shift)

    @property
    def points(self) -> dict[str, Vector]:
        """By the name of a joint, the anchor in the world of the last joint of its body, which moves with the body."""
        nodes = self.kinematics
        found = {}
        for one in self.moving:
            name = one.node.joint.name
            body = next(body for body in nodes.tree.bodies if name in {joint.name for joint in body.joints})
            found[name] = self.moving[nodes.frames[body.name][0]].position
        return found

    def of_other(self, tree: Tree) -> World:
        """Another tree with the same joints, at the same coordinates."""
        return in_world(self.kinematics.with_tree(tree))

    # Springs between points.

    def pulls(self) -> list[Spatial]:
        """What springs between points do to each node: moment about the origin of its frame, and force."""
        builder, found = self.kinematics.builder, [self.kinematics.still for _ in self.moving]
        for spring in self.kinematics.tree.springs:
            ends = [self.end(body, pose) for body, pose in spring.ends]
            tension, along, _ = tension_between(builder, spring, [(position, rate) for _, _, position, rate in ends])
            pull = tension * along
            for (number, arm, _, _), force in zip(ends, (pull, -pull), strict=True):
                if number >= 0:
                    found[number] = found[number] + spatial(cross(arm, force), force)
        return found

    def end(self, body: str, pose: Pose) -> tuple[int, Vector, Vector, Vector]:
        """Node of a point, and along the world's axes its arm from the node's origin, its position and its velocity."""
        number, frame = self.kinematics.frames[body]
        local = placed(self.kinematics.builder, pose, frame).shift
        if number < 0:
            return number, local, local, self.still
        one = self.moving[number]
        arm = one.orientation @ local
        return number, arm, one.position + arm, one.velocity_at(arm)


def in_world(nodes: Kinematics) -> World:
    """The motion of the nodes of a tree in the world."""
    found: list[Moving] = []
    builder, lumps = nodes.builder, _lumps(nodes)
    for node, own in zip(nodes.nodes, lumps, strict=True):
        parent = found[node.parent] if node.parent >= 0 else None
        turn, position, spin, velocity = (
            (builder.identity, builder.still, builder.still, builder.still)
            if parent is None
            else (parent.orientation, parent.position, parent.spin, parent.velocity)
        )
        orientation, arm = turn @ node.frame.turn, turn @ node.frame.shift
        motions = [spatial(orientation @ angular, orientation @ linear) for angular, linear in node.motions]
        turning, sliding = builder.still, builder.still
        for (angular, linear), column in zip(motions, node.columns, strict=True):
            rate = nodes.coordinates.velocities[column]
            turning, sliding = turning + rate * angular, sliding + rate * linear
        own_spin, carried = spin + turning, cross(spin, arm) + sliding
        bias_of_spin = cross(spin, turning) + orientation @ node.bias[0]
        bias = cross(spin, carried) + (cross(own_spin, sliding) + orientation @ node.bias[1])
        found.append(
            Moving(
                node=node,
                orientation=orientation,
                position=position + arm,
                arm=arm,
                spin=own_spin,
                velocity=velocity + carried,
                motions=motions,
                bias=spatial(bias_of_spin, bias),
                lumps=[one.in_frame(Frame(orientation, builder.still)) for one in own],
            )
        )
    return World(nodes, found)


def _lumps(nodes: Kinematics) -> list[list[Lump]]:
    """The bodies that move with each node, in the node's frame."""
    found: list[list[Lump]] = [[] for _ in nodes.nodes]
    for body in nodes.tree.bodies:
        number, frame = nodes.frames[body.name]
        for lump in nodes.weights.lumps(body) if number >= 0 else ():
            found[number].append(lump.in_frame(frame))
    return found
