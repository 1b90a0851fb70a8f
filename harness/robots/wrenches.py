"""What the bodies behind a joint need for their motion, as moments and forces along the world's axes, and how large the parts of it are.

Source: Goldstein, Classical Mechanics, sections 1.1 and 1.2 (momentum and angular momentum of a system of particles).
"""

from __future__ import annotations

from collections.abc import Sequence

from harness.equations.term import Term, Vector, cross, length
from harness.files.tree import WORLD
from harness.robots.nodes import Kinematics
from harness.robots.rigid import Spatial, spatial
from harness.robots.world_motion import World

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
    """How large the parts of moment and force are that cancel, see ``Reactions.sizes``, with arms from where the tree starts."""
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
    """Of each node, what its lumps need for their motion at given accelerations of the joints, beyond their weight."""
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


def weights(world: World) -> Parts:
    """Of each node, what holds each of its lumps against gravity."""
    gravity = world.kinematics.builder.vector(world.kinematics.tree.gravity)
    forces = [[-(lump.mass * gravity) for lump in one.lumps] for one in world.moving]
    return [
        [spatial(cross(lump.centre, force), force) for lump, force in zip(one.lumps, own, strict=True)]
        for one, own in zip(world.moving, forces, strict=True)
    ]


def accelerations_of_nodes(world: World, accelerations: Sequence[Term]) -> list[Spatial]:
    """Of each node, the change of its spin and the acceleration of its origin at given accelerations of the joints."""
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
