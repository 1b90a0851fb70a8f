"""MuJoCo drops the inertia of a link without mass when it fuses it with its parent."""

from harness.comparison.readings import Reading, with_inertias
from harness.robots.bounds import bounded
from harness.robots.robot import Robot
from harness.robots.tree import Body, Inertia, Tree

# mjMINVAL.
_LEAST = 1e-15


def _tree(robot: Robot) -> Tree:
    def kept(body: Body) -> Inertia | None:
        is_dropped = not body.joints and body.inertia is not None and float(body.inertia.mass) < _LEAST and any(body.inertia.moments)
        return None if is_dropped else body.inertia

    tree = bounded(robot.tree)
    read = with_inertias(tree, kept)
    return robot.tree if read == tree else read


READING = Reading(
    name="inertia without mass",
    engine="mujoco",
    formats=("urdf",),
    sentence="MuJoCo drops the inertia of a link of mass 0 when it fuses the link with its parent",
    concerns="links",
    source="MuJoCo 4.0, user/user_objects.cc, mjCBody::ToFrame: a fused body's inertia is added where its mass is mjMINVAL or more",
    tree=_tree,
    supplied=True,
    after=("least masses and inertias",),
)
