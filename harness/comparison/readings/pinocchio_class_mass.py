"""Pinocchio's reader of MJCF passes over the mass that a geom takes from a default class."""

from dataclasses import replace

from harness.comparison.readings import Reading
from harness.robots.robot import Robot
from harness.robots.tree import Given, Solid, Tree


def _read(solid: Solid) -> Solid:
    is_of_class = isinstance(solid.mass, Given) and solid.mass.place != solid.place
    return replace(solid, mass=None) if is_of_class else solid


def _tree(robot: Robot) -> Tree:
    bodies = (replace(body, solids=tuple(map(_read, body.solids))) if body.solids else body for body in robot.tree.bodies)
    return replace(robot.tree, bodies=tuple(bodies))


READING = Reading(
    name="mass of a default class",
    engine="pinocchio",
    formats=("mjcf",),
    sentence="Pinocchio's MJCF reader passes over a geom's mass from a default class, and takes its density",
    concerns="geoms",
    source="Pinocchio 4.1, parsers/mjcf/mjcf-graph-geom.cpp: only the geom's own attribute mass is read",
    tree=_tree,
)
