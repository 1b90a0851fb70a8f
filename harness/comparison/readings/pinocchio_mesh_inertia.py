"""Pinocchio's reader of MJCF gives every mesh that can collide one kilogram, with unit moments of inertia."""

from dataclasses import replace
from fractions import Fraction

from harness.comparison.readings import Reading, element_at
from harness.models.mjcf_defaults import resolved_text
from harness.robots.robot import Robot
from harness.robots.tree import Placement, Solid, Tree, vector

_ONE = Fraction(1)


def _read(solid: Solid) -> Solid:
    """In the geom's own position, wherever the centre of the mesh is; a box that has its size from a mesh is a box."""
    geom = element_at(solid.place) if solid.kind == "mesh" else None
    if geom is None or resolved_text(geom, "type", "mesh") != "mesh":
        return solid
    position = vector([float(word) for word in resolved_text(geom, "pos", "0 0 0").split()])
    return replace(solid, pose=(Placement(position),), mass=_ONE, density=_ONE, moments=(_ONE,) * 3)


def _tree(robot: Robot) -> Tree:
    bodies = (replace(body, solids=tuple(map(_read, body.solids))) if body.solids else body for body in robot.tree.bodies)
    return replace(robot.tree, bodies=tuple(bodies))


READING = Reading(
    name="inertia of meshes",
    engine="pinocchio",
    formats=("mjcf",),
    sentence="Pinocchio's MJCF reader computes no inertia of a mesh, and gives the geom 1 kg and moments of 1 kg m^2 in its position",
    concerns="geoms",
    source="Pinocchio 4.1, parsers/mjcf/mjcf-graph-geom.cpp, MjcfGeom::computeInertia leaves a mesh Inertia::Identity()",
    tree=_tree,
    after=("geoms that cannot collide", "frames"),
)
