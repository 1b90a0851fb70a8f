"""Readings that several engines have: elements that an engine leaves out, and that nothing stands for.

Each takes the engine, its formats, the sentence and the source, and whether the harness supplies it to an aided engine.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Any

from harness.explain.changes.readings import Reading, freed, with_bodies, with_joints, without_bodies
from harness.files.joint_kinds import JointKind
from harness.files.tree import Body, Solid, Tree
from harness.robots.robot import Robot

Declare = Callable[..., Reading]


def _without(number: str) -> Callable[[Robot], Tree]:
    """The tree of a robot in which that number of every joint is zero."""

    nothing: dict[str, Any] = {number: Fraction(0)}

    def tree(robot: Robot) -> Tree:
        return with_joints(robot.tree, lambda joint: replace(joint, **nothing) if getattr(joint, number) else joint)

    return tree


def _without_mimics(robot: Robot) -> Tree:
    return with_joints(robot.tree, freed)


def _without_tendons(robot: Robot) -> Tree:
    tree = robot.tree
    return replace(tree, springs=(), couplings=()) if tree.springs or tree.couplings else tree


def _without_point_springs(robot: Robot) -> Tree:
    return replace(robot.tree, springs=()) if robot.tree.springs else robot.tree


def _without_linear_tendons(robot: Robot) -> Tree:
    return replace(robot.tree, couplings=()) if robot.tree.couplings else robot.tree


def _without_ball_joints(robot: Robot) -> Tree:
    def read(body: Body) -> Body:
        return replace(body, joints=tuple(joint for joint in body.joints if joint.kind != JointKind.BALL))

    return with_bodies(robot.tree, read)


def _is_framed(part: Body | Solid) -> bool:
    """An element's own placement stands behind those of the frames around it."""
    return len(part.pose) > 1


def _without_frames(robot: Robot) -> Tree:
    def read(body: Body) -> Body:
        joints = tuple(joint for joint in body.joints if not joint.pose)
        return replace(body, joints=joints, solids=tuple(solid for solid in body.solids if not _is_framed(solid)))

    return with_bodies(without_bodies(robot.tree, [body.name for body in robot.tree.bodies if _is_framed(body)]), read)


def _declaring(name: str, concerns: str, tree: Callable[[Robot], Tree], is_supplied: bool = True) -> Declare:
    def declare(engine: str, formats: Sequence[str], sentence: str, source: str, supplied: bool = is_supplied) -> Reading:
        return Reading(name, engine, tuple(formats), sentence, concerns, source, tree, supplied)

    return declare


dampers = _declaring("joint damping", "joints", _without("damping"))
springs = _declaring("springs", "joints", _without("stiffness"))
rotors = _declaring("rotor inertias", "joints", _without("armature"))
mimics = _declaring("mimic joints", "joints", _without_mimics)
tendons = _declaring("tendons", "tendons", _without_tendons, is_supplied=False)
point_springs = _declaring("tendons", "tendons", _without_point_springs)
linear_tendons = _declaring("tendons on joints", "tendons", _without_linear_tendons, is_supplied=False)
ball_joints = _declaring("ball joint", "joints", _without_ball_joints)
frames = _declaring("frames", "elements", _without_frames, is_supplied=False)
