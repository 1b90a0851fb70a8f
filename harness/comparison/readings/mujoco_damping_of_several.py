"""MuJoCo damps each velocity of a floating or planar joint of a URDF, whose format speaks of revolute and prismatic joints alone."""

from dataclasses import replace

from harness.comparison.readings import Reading, element_at, with_joints
from harness.robots.robot import Robot
from harness.robots.tree import Given, Joint, Tree


def _read(joint: Joint) -> Joint:
    element = element_at(joint.place) if joint.kind in ("planar", "free") else None
    dynamics = None if element is None else element.find("dynamics")
    damping = 0.0 if dynamics is None else float(dynamics.get("damping", "0"))
    return replace(joint, damping=Given(damping, joint.place, "damping")) if damping and joint.place else joint


def _tree(robot: Robot) -> Tree:
    return with_joints(robot.tree, _read)


READING = Reading(
    name="damping of joints of several degrees of freedom",
    engine="mujoco",
    formats=("urdf",),
    sentence="MuJoCo applies the damping of a floating or planar joint to each of its velocities",
    concerns="joints",
    source="MuJoCo 4.0, xml/xml_urdf.cc, mjXURDF::Joint; URDF: damping is for revolute and prismatic joints (wiki.ros.org/urdf/XML/joint)",
    tree=_tree,
)
