"""Readings that several engines have: elements that an engine leaves out, and what it takes where nothing stands in a file.

Each takes the engine, its formats, the sentence and the source.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from typing import Any

from harness.explain.changes.readings import freed, law, with_bodies, with_inertias, with_joints, without_bodies
from harness.explain.changes.readings._inertias import moving
from harness.files.joint_kinds import JointKind
from harness.files.tree import Body, Inertia, Solid, Tree
from harness.trees.robot import Robot

_ONE = Fraction(1)


def _without(number: str) -> Callable[[Robot], Tree]:
    """The tree of a robot in which that number of every joint is zero."""

    nothing: dict[str, Any] = {number: Fraction(0)}

    def tree(robot: Robot) -> Tree:
        return with_joints(robot.tree, lambda joint: replace(joint, **nothing) if getattr(joint, number) else joint)

    return tree


@law("mimic joints", "joints", supplied=True)
def mimics(robot: Robot) -> Tree:
    return with_joints(robot.tree, freed)


@law("tendons", "tendons", supplied=True)
def point_springs(robot: Robot) -> Tree:
    return replace(robot.tree, springs=()) if robot.tree.springs else robot.tree


@law("tendons on joints", "tendons")
def linear_tendons(robot: Robot) -> Tree:
    return replace(robot.tree, couplings=()) if robot.tree.couplings else robot.tree


@law("ball joint", "joints", supplied=True)
def ball_joints(robot: Robot) -> Tree:
    def read(body: Body) -> Body:
        return replace(body, joints=tuple(joint for joint in body.joints if joint.kind != JointKind.BALL))

    return with_bodies(robot.tree, read)


def _is_framed(part: Body | Solid) -> bool:
    """An element's own placement stands behind those of the frames around it."""
    return len(part.pose) > 1


@law("frames", "elements")
def frames(robot: Robot) -> Tree:
    def read(body: Body) -> Body:
        joints = tuple(joint for joint in body.joints if not joint.pose)
        return replace(body, joints=joints, solids=tuple(solid for solid in body.solids if not _is_framed(solid)))

    return with_bodies(without_bodies(robot.tree, [body.name for body in robot.tree.bodies if _is_framed(body)]), read)


dampers = law("joint damping", "joints", supplied=True)(_without("damping"))
springs = law("springs", "joints", supplied=True)(_without("stiffness"))
rotors = law("rotor inertias", "joints", supplied=True)(_without("armature"))


@law("links without inertia", "links", supplied=True)
def unit_inertias(robot: Robot) -> Tree:
    """1 kg and moments of 1 kg m^2 about the origin of each moving body to which the file gives no inertia."""
    moved = moving(robot.tree)

    def read(body: Body) -> Inertia | None:
        if body.inertia is not None or body.name not in moved:
            return body.inertia
        return Inertia((), _ONE, (*(_ONE,) * 3, *(Fraction(0),) * 3), body.place)

    return with_inertias(robot.tree, read)
