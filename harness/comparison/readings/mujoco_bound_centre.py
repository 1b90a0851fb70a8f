"""MuJoCo puts the mass that it gives a massless body where that body stands in its parent."""

from dataclasses import replace
from fractions import Fraction

from harness.comparison.readings import Reading
from harness.robots.robot import Robot
from harness.robots.tree import Body, Inertia, Tree

_NOTHING = (Fraction(0),) * 6


def centred(tree: Tree) -> Tree:
    """The tree whose bodies without inertia have their centre of mass at their position in the parent, taken in their own frame."""
    if tree.bounds is None or not (tree.bounds.mass > 0 or tree.bounds.moment > 0):
        return tree
    return replace(tree, bodies=tuple(_centred(body) for body in tree.bodies))


def _centred(body: Body) -> Body:
    """An element's own placement stands behind those of the frames around it."""
    is_empty = body.inertia is None and body.is_massless and any(body.pose[-1:])
    return replace(body, inertia=Inertia(body.pose[-1:], Fraction(0), _NOTHING, body.place), solids=()) if is_empty else body


def _tree(robot: Robot) -> Tree:
    return centred(robot.tree)


READING = Reading(
    name="centre of a massless body",
    engine="mujoco",
    formats=("mjcf",),
    sentence="MuJoCo takes the position of a body in its parent for the centre of the mass that boundmass gives it",
    concerns="bodies",
    source="MuJoCo 4.0, user/user_objects.cc, mjCBody::Compile: where ipos is undefined, the body's pos and quat are copied into it",
    tree=_tree,
)
