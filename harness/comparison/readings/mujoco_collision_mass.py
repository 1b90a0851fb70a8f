"""MuJoCo gives a link of a URDF that has no inertial the mass of its collision geometry."""

from dataclasses import replace
from fractions import Fraction

from lxml import etree

from harness.comparison.readings import Reading, element_at
from harness.robots.robot import Robot
from harness.robots.tree import Body, Placement, Solid, Tree, Turn, vector

# mjGEOM's default density: that of water.
_DENSITY = Fraction(1000)
# Shape to the attributes that give its size, each halved or not, in the order of ``Solid``.
_SHAPES = {"sphere": (("radius", 1),), "cylinder": (("radius", 1), ("length", 2)), "box": (("size", 2),)}
_AXES = (vector((1, 0, 0)), vector((0, 1, 0)), vector((0, 0, 1)))


def _tree(robot: Robot) -> Tree:
    bodies = tuple(_weighed(body) if body.inertia is None else body for body in robot.tree.bodies)
    return replace(robot.tree, bodies=bodies)


def _weighed(body: Body) -> Body:
    link = element_at(body.place)
    solids = () if link is None else tuple(solid for one in link.iterfind("collision") for solid in _solids(one, body))
    return replace(body, solids=solids) if solids else body


def _solids(collision: etree._Element, body: Body) -> list[Solid]:
    origin, found = collision.find("origin"), []
    position, angles = (_numbers(origin, name) for name in ("xyz", "rpy"))
    # Roll, pitch and yaw are about axes that stay.
    turns = tuple(Turn(axis, angle) for axis, angle in reversed(list(zip(_AXES, angles, strict=True))) if angle)
    for shape in collision.iterfind("geometry/*"):
        if shape.tag in _SHAPES:
            size = [value / share for name, share in _SHAPES[shape.tag] for value in _numbers(shape, name)]
            found.append(Solid(shape.tag, tuple(size), (Placement(vector(position), turns),), None, _DENSITY, place=body.place))
    return found


def _numbers(element: etree._Element | None, name: str) -> list[Fraction]:
    text = "0 0 0" if element is None else element.get(name, "0 0 0")
    return [Fraction(float(word)) for word in text.split()]


READING = Reading(
    name="mass of collision geometry",
    engine="mujoco",
    formats=("urdf",),
    sentence="MuJoCo gives a link without <inertial> the mass of its collision geometry, at 1000 kg/m^3",
    concerns="links",
    source='MuJoCo documentation, XML reference, compiler, inertiafromgeom="auto", and geom, density',
    tree=_tree,
    supplied=True,
)
