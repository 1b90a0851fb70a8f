"""Pinocchio's reader of MJCF passes over ``<frame>`` and ``<replicate>`` with all that they hold."""

from dataclasses import replace

from harness.comparison.readings import Reading, without_bodies
from harness.robots.robot import Robot
from harness.robots.tree import Body, Joint, Solid, Tree


def _is_framed(part: Body | Solid) -> bool:
    """An element's own placement stands behind those of the frames around it."""
    return len(part.pose) > 1


def _has_no_frame(joint: Joint) -> bool:
    return not joint.pose


def _tree(robot: Robot) -> Tree:
    tree = without_bodies(robot.tree, [body.name for body in robot.tree.bodies if _is_framed(body)])
    if not any(joint.pose for joint in tree.joints) and not any(_is_framed(solid) for body in tree.bodies for solid in body.solids):
        return tree
    return replace(
        tree,
        bodies=tuple(
            replace(
                body,
                joints=tuple(filter(_has_no_frame, body.joints)),
                solids=tuple(solid for solid in body.solids if not _is_framed(solid)),
            )
            for body in tree.bodies
        ),
    )


READING = Reading(
    name="frames",
    engine="pinocchio",
    formats=("mjcf",),
    sentence="Pinocchio's MJCF reader passes over <frame> and <replicate> with all that they hold",
    concerns="elements",
    source="Pinocchio 4.1, parsers/mjcf/mjcf-graph.cpp, parseJointAndBody, which knows neither element",
    tree=_tree,
)
