"""Pinocchio's reader of MJCF takes geoms that cannot collide for pictures, which weigh nothing."""

from dataclasses import replace

from harness.comparison.readings import Reading, element_at
from harness.models.mjcf_defaults import resolved_text
from harness.robots.robot import Robot
from harness.robots.tree import Solid, Tree


def _collides(solid: Solid) -> bool:
    geom = element_at(solid.place)
    return geom is None or any(resolved_text(geom, name, "1") != "0" for name in ("contype", "conaffinity"))


def _tree(robot: Robot) -> Tree:
    if all(_collides(solid) for body in robot.tree.bodies for solid in body.solids):
        return robot.tree
    bodies = (replace(body, solids=tuple(filter(_collides, body.solids))) for body in robot.tree.bodies)
    return replace(robot.tree, bodies=tuple(bodies))


READING = Reading(
    name="geoms that cannot collide",
    engine="pinocchio",
    formats=("mjcf",),
    sentence='Pinocchio\'s MJCF reader gives a geom with contype="0" and conaffinity="0" no mass, as to a picture',
    concerns="geoms",
    source="Pinocchio 4.1, parsers/mjcf/mjcf-graph-geom.cpp: such a geom is VISUAL, and its inertia is not computed",
    tree=_tree,
)
