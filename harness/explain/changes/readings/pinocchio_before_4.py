"""Pinocchio before 4.0: what its reader of MJCF passed over, and later ones read."""

from dataclasses import replace
from fractions import Fraction

from harness.explain.changes.readings import law, readings_of, with_joints
from harness.files.tree import Joint


@law("references of joints", "joints", each=with_joints)
def _without_references(joint: Joint) -> Joint:
    return replace(joint, reference=Fraction(0))


READINGS = readings_of(
    "pinocchio",
    {
        ("mjcf",): {
            _without_references: (
                "Pinocchio's MJCF reader before 4.0 passes over the ref of a joint",
                "call Pinocchio 4.0 or later, or write the body where its joint is at zero, without ref",
                "the versions themselves: jointPlacements is not turned; harness upgrade pinocchio 3.9.0 4.0.0 mjcf/arm_2r.offset_ref.xml",
            ),
        },
    },
    "<4",
    is_misread=True,
)
