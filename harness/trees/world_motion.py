"""The bodies of a tree as they move in the world: positions, velocities and accelerations along its axes, as terms of a program.

Accelerations are the classical ones, of points. Nothing here is a spatial vector, and no inertia is carried from one frame to
another: each lump of a body keeps its own centre of mass. What the bodies behind a joint need for their motion are moments and forces,
each with how large the parts of it are that cancel.

Source: Goldstein, Classical Mechanics, sections 1.1 and 1.2 (momentum and angular momentum of a system of particles), 4.9 and 4.10
(rates in turning frames) and 5.1 (rigid bodies).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from harness.files.given import Pose
from harness.files.tree import WORLD, Tree
from harness.programs.terms import Matrix, Term, Vector, cross, length, vector
from harness.trees.bodies.rigid import Lump, Spatial, spatial
from harness.trees.bodies.spatial import Frame, placed
from harness.trees.nodes import Kinematics, Node
from harness.trees.recursion import tension_between


@dataclass(frozen=True)
class Moving:
    """The frame of one node in the world, everything along the world's axes.

    Attributes:
        node: what it is in the tree. orientation, position: of the frame. arm: from the origin of the parent's frame to its own.
        spin, velocity: angular velocity, and velocity of the origin.
        rates: what each velocity of the joint adds to spin and velocity, and its place in v.
        bias: what (angular, linear) acceleration there is beyond that of the parent and that along ``rates``.
        lumps: the bodies that move with it, whose centres are measured from the origin.
    """

    node: Node
    orientation: Matrix
    position: Vector
    arm: Vector
    spin: Vector
    velocity: Vector
    rates: list[tuple[Spatial, int]]
    bias: Spatial
    lumps: list[Lump]

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
        return map(self.moving.__getitem__, self.kinematics.up_from(number))

    def behind(self, number: int) -> Iterator[int]:
        """The nodes that a joint carries, its own first."""
        return (other for other in range(number, len(self.moving)) if number in self.kinematics.up_from(other))

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
        bodies = ((self.kinematics.frames[body.name][0], body) for body in self.kinematics.tree.bodies)
        return {joint.name: self.moving[number].position for number, body in bodies for joint in body.joints}

    def of_other(self, tree: Tree) -> World:
        """Another tree with the same joints, at the same coordinates."""
        return in_world(self.kinematics.with_tree(tree))

    # Springs between points, and what carries weights.

    def pulls(self) -> list[Spatial]:
        """Wrench of springs between points and gravity compensation on each node: moment about the origin of its frame, and force."""
        builder, found = self.kinematics.builder, [self.kinematics.still for _ in self.moving]
        for number, mass, centre in self.kinematics.compensated():
            force = mass * -builder.vector(self.kinematics.tree.gravity)
            found[number] = found[number] + spatial(cross(self.moving[number].orientation @ centre, force), force)
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
        rates = [(spatial(orientation @ angular, orientation @ linear), column) for (angular, linear), column in node.rates]
        turning, sliding = builder.still, builder.still
        for (angular, linear), column in rates:
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
                rates=rates,
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


# Of each node, moments about its origin, and forces.
Parts = list[list[Spatial]]


def wrench(world: World, parts: Parts, number: int, point: Vector) -> Spatial:
    """The moment about a point, and the force, of all parts of the bodies behind a joint."""
    total, push = world.still, world.still
    for other in world.behind(number):
        arm = world.moving[other].position + -point
        for moment, force in parts[other]:
            total, push = total + (moment + cross(arm, force)), push + force
    return spatial(total, push)


def size_of_wrench(world: World, parts: Parts, number: int, point: Vector, start: Vector) -> tuple[Term, Term]:
    """Sizes of the parts of moment and force that cancel, see ``Reactions.sizes``, with arms from where the tree starts."""
    moment = force = world.kinematics.builder.zero
    for other in world.behind(number):
        one = world.moving[other]
        arm = length(one.position + -start)
        forces = world.kinematics.builder.zero
        for part in parts[other]:
            moment, forces = moment + length(part[0]), forces + length(part[1])
        for lump in one.lumps:
            # A force through the axis has no moment about it, and its arm does.
            arm = arm + length(lump.centre)
            # An acceleration that is measured in the moving frame lacks spin times velocity.
            velocity = one.velocity_at(lump.centre)
            forces = forces + lump.mass * length(cross(one.spin, velocity))
        moment, force = moment + arm * forces, force + forces
    shift = length(point + -start)
    return moment + shift * force, force


def root(world: World, number: int, nodes: Kinematics | None = None) -> Vector:
    """The start of a node's tree: the first joint, or the origin of the body that is fixed to the world and has it.

    What slides from there or floats is measured from the world's origin. ``nodes`` are those of the file that has the body, by default
    of the tree itself.
    """
    *_, first = world.up_from(number)
    if first.node.joint.kind.linear:
        return world.still
    nodes = nodes or world.kinematics
    bodies, joint = {body.name: body for body in nodes.tree.bodies}, first.node.joint.name
    top = next(body for body in nodes.tree.bodies if joint in {one.name for one in body.joints})
    while top.parent != WORLD:
        top = bodies[top.parent]
    fixed, frame = nodes.frames[top.name]
    return frame.shift if fixed < 0 else first.position


def parts_of_motion(world: World, accelerations: Sequence[Term]) -> Parts:
    """Wrenches that each node's lumps need for their motion at given accelerations of the joints, beyond their weight."""
    found = []
    of_nodes = zip(world.moving, accelerations_of_nodes(world, accelerations), weights(world), strict=True)
    for one, (spin, acceleration), own_weights in of_nodes:
        parts: list[Spatial] = []
        for lump, weight in zip(one.lumps, own_weights, strict=True):
            centripetal = cross(one.spin, cross(one.spin, lump.centre))
            of_centre = acceleration + (cross(spin, lump.centre) + centripetal)
            force = lump.mass * of_centre
            parts += [spatial(cross(lump.centre, force), force), weight]
            parts.append(spatial(lump.moments @ spin, world.still))
            parts.append(spatial(cross(one.spin, lump.moments @ one.spin), world.still))
        found.append(parts)
    return found


def cancelling_in_motion(world: World, parts: Parts) -> Parts:
    """Vectors as long as what cancels in wrenches of motion: these, and a moment of twice the kinetic energy of each lump.

    v x (m v) is 0 in exact numbers alone, as is what the spin has of it, where momenta are taken about the world's origin.
    """
    found, nothing = [], world.kinematics.builder.zero
    for one, own in zip(world.moving, parts, strict=True):
        velocities = [one.velocity_at(lump.centre) for lump in one.lumps]
        twice = [
            lump.mass * (velocity @ velocity) + length(one.spin) * length(lump.moments @ one.spin)
            for lump, velocity in zip(one.lumps, velocities, strict=True)
        ]
        found.append([*own, *(spatial(vector([energy, nothing, nothing]), world.still) for energy in twice)])
    return found


def weights(world: World) -> Parts:
    """Wrenches that hold each of a node's lumps against gravity."""
    gravity = world.kinematics.builder.vector(world.kinematics.tree.gravity)
    forces = [[-(lump.mass * gravity) for lump in one.lumps] for one in world.moving]
    return [
        [spatial(cross(lump.centre, force), force) for lump, force in zip(one.lumps, own, strict=True)]
        for one, own in zip(world.moving, forces, strict=True)
    ]


def accelerations_of_nodes(world: World, accelerations: Sequence[Term]) -> list[Spatial]:
    """Rate of each node's spin and acceleration of its origin at given accelerations of the joints."""
    found: list[Spatial] = []
    for one in world.moving:
        spin, acceleration = found[one.node.parent] if one.node.parent >= 0 else world.kinematics.still
        acceleration = (acceleration + cross(spin, one.arm)) + one.bias[1]
        spin = spin + one.bias[0]
        for (angular, linear), column in one.rates:
            given = accelerations[column]
            spin, acceleration = spin + given * angular, acceleration + given * linear
        found.append(spatial(spin, acceleration))
    return found
