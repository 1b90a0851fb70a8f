"""The rows of points in which bodies touch.

Source: MuJoCo documentation, Computation, section Friction cones: the contact force acts from the first body to the second.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from harness.files.touching import Touch
from harness.programs.terms import Term, Vector, cross
from harness.trees.bodies.rigid import Spatial, spatial
from harness.trees.row import Row, plus
from harness.trees.world_motion import World


def touching_rows(world: World, name: str, touch: Touch) -> list[Row]:
    """The rows of a contact; what each leaves is the distance less the margin where it pushes bodies apart, and nothing else."""
    builder = world.kinematics.builder
    point = builder.vector(touch.point)
    normal = replace(
        Row(name, builder.zero, builder.zero, tuple(_acts(world, touch, point, builder.vector(touch.frame[0]), is_turn=False))),
        residual=builder.number(touch.distance) - builder.number(touch.margin),
    )
    found = [normal]
    for friction, (axis, is_turn) in zip(touch.friction, touch.directions, strict=True):
        acts = tuple(_acts(world, touch, point, builder.vector(axis), is_turn))
        if touch.is_elliptic:
            found.append(Row(name, builder.zero, builder.zero, acts))
        else:
            factor = builder.number(friction)
            found += [plus(normal, sign * factor, acts) for sign in (builder.number(1), builder.number(-1))]
    return found if touch.is_elliptic or not touch.friction else found[1:]


def _acts(world: World, touch: Touch, point: Vector, axis: Vector, is_turn: bool) -> Iterator[tuple[int, Spatial]]:
    """Actions of a multiplier of 1 on the nodes of both bodies: a force along an axis at the point, or a moment about it."""
    builder = world.kinematics.builder
    for body, sign in zip(touch.bodies, (-1, 1), strict=True):
        number, _ = world.kinematics.frames[body]
        if number >= 0:
            along: Term = builder.number(sign) * axis
            arm = point - world.moving[number].position
            yield number, spatial(along, builder.still) if is_turn else spatial(cross(arm, along), along)
