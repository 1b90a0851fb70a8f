"""A stage as Newton's importer reads it: its trees in articulations, without the joints that close loops.

Source: Newton documentation, ``ModelBuilder.add_usd`` and ``add_articulation``; its sources of 1.8.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import newton
from pxr import Usd, UsdPhysics

from harness.engines.request import AskedJoint, Refused, Request
from harness.files.joint_kinds import JointKind


def read_stage(request: Request, builder: Callable[[], Any]) -> tuple[Any, Mapping[int, Sequence[AskedJoint]]]:
    """The builder with the stage of a request, and what each of its joints is made of.

    For an aided one the first body of each tree that is in no articulation is the root of one. ``builder`` makes a ``ModelBuilder``.

    Raises:
        Refused: there is such a tree, and the request is not aided; or one of a body by itself, of which the solver would take another
            body's inertia.
    """
    stage, robot = Usd.Stage.Open(str(request.path)), builder()
    paths, tree = robot.add_usd(stage)["path_joint_map"], {joint.tag for joint in request.joints}
    moving = [path for path, number in paths.items() if robot.joint_type[number] != newton.JointType.FIXED]
    closing = [f"{re.escape(path)}$" for path in moving if path not in tree]
    loose = [path for path in moving if path in tree and robot.joint_articulation[paths[path]] < 0]
    if loose and request.aid is None:
        raise Refused(
            f"{loose[0]} is in no articulation, and SolverFeatherstone moves nothing else; "
            "apply PhysicsArticulationRootAPI to the root of the robot"
        )
    if loose or closing:
        stage.SetEditTarget(stage.GetSessionLayer())
        for number in {paths[path] for path in loose if robot.joint_parent[paths[path]] < 0}:
            UsdPhysics.ArticulationRootAPI.Apply(stage.GetPrimAtPath(robot.body_label[robot.joint_child[number]]))
        robot = builder()
        paths = robot.add_usd(stage, ignore_paths=closing)["path_joint_map"]
    if request.aid is not None:
        _articulate(robot)
    return robot, _joined(robot, request, paths)


def _articulate(robot: Any) -> None:
    """Make an articulation of each body by itself: it is none for the importer, whatever its schemas are."""
    for number in [number for number, articulation in enumerate(robot.joint_articulation) if articulation < 0]:
        if robot.joint_child[number] != number:
            raise Refused(
                f"{robot.joint_label[number]} is joint {number}, and moves body {robot.joint_child[number]}; SolverFeatherstone takes the "
                "inertia of the body with the number of the joint"
            )
        robot.add_articulation([number])


def _joined(robot: Any, request: Request, paths: Mapping[str, int]) -> Mapping[int, Sequence[AskedJoint]]:
    """The joints of the request that each joint of Newton is made of, in its order; ``paths`` of prims to its numbers, in this order.

    It is not that of the file, docs/issues/newton-usd-sequence-of-joints.md. A free joint has no prim.
    """
    carried = {robot.body_label[child]: number for number, child in enumerate(robot.joint_child)}
    by_path = {joint.tag: joint for joint in request.joints}
    found: dict[int, list[AskedJoint]] = {}
    for path, number in paths.items():
        if path in by_path:
            found.setdefault(number, []).append(by_path[path])
    free = {carried[joint.tag]: [joint] for joint in request.joints if joint.kind == JointKind.FREE and joint.tag in carried}
    return found | free
