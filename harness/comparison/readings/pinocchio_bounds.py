"""Pinocchio's reader of MJCF raises the numbers of ``<inertial>`` as they stand there, and passes over what bounds say of other bodies."""

from dataclasses import replace

from harness.comparison.readings import Reading
from harness.robots.bounds import bounded
from harness.robots.robot import Robot
from harness.robots.tree import Bounds, Inertia, Tree


def _raised(inertia: Inertia, bounds: Bounds) -> Inertia:
    """Of full moments the entries of the diagonal, whatever the principal moments are."""
    diagonal = tuple(max(moment, bounds.moment) for moment in inertia.moments[:3])
    return replace(inertia, mass=max(inertia.mass, bounds.mass), moments=(*diagonal, *inertia.moments[3:]))


def _tree(robot: Robot) -> Tree:
    tree, bounds = robot.tree, robot.tree.bounds
    if bounds is None:
        return tree
    bodies = (replace(body, inertia=_raised(body.inertia, bounds)) if body.inertia else body for body in tree.bodies)
    read = replace(tree, bodies=tuple(bodies), bounds=None)
    return tree if read == bounded(tree) else read


READING = Reading(
    name="least masses and inertias",
    engine="pinocchio",
    formats=("mjcf",),
    sentence=(
        "Pinocchio's MJCF reader takes boundmass and boundinertia of <compiler> for the numbers of an <inertial> alone, "
        "and passes over balanceinertia"
    ),
    concerns="links",
    source="Pinocchio 4.1, parsers/mjcf/mjcf-graph.cpp, convertInertiaFromMjcf and parseCompiler",
    tree=_tree,
)
