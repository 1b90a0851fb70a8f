"""Pinocchio before 4.0: what its reader of MJCF passed over, and later ones read."""

from dataclasses import replace
from fractions import Fraction

from harness.explain.changes.readings import law, readings_of, with_bodies, with_joints
from harness.files.tree import Body, Joint


@law("references of joints", "joints", each=with_joints)
def _without_references(joint: Joint) -> Joint:
    return replace(joint, reference=Fraction(0))


@law("pose of a body that floats", "bodies", each=with_bodies)
def _measured_from_start(body: Body) -> Body:
    is_placed = any(any(placement.position) or placement.rotation for placement in body.start)
    return replace(body, pose=body.start, start=()) if is_placed else body


READINGS = readings_of(
    "pinocchio",
    {
        ("mjcf",): {
            _without_references: (
                "Pinocchio's MJCF reader before 4.0 ignores the ref of a joint",
                "call Pinocchio 4.0 or later, or write the body where its joint is at zero, without ref",
                "the versions themselves: jointPlacements is not turned; harness upgrade pinocchio 3.9.0 4.0.0 mjcf/arm_2r.offset_ref.xml",
            ),
            _measured_from_start: (
                "Pinocchio's MJCF reader before 4.0 measures the position of a free joint from the pose of its body",
                "call Pinocchio 4.0 or later, or leave the pose of a body with a free joint out",
                "the versions themselves: jointPlacements is that pose; harness upgrade pinocchio 3.9.0 4.0.0 mjcf/free_body.turned.xml",
            ),
        },
    },
    "<4",
    is_misread=True,
)
