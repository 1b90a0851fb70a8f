"""Laws of readers of USD that know no attribute of the namespace mjc, which is MuJoCo's."""

from dataclasses import replace
from fractions import Fraction
from typing import Any

from harness.explain.changes.readings import law, with_bodies, with_joints
from harness.files.given import Given
from harness.files.tree import Body, Joint

_NOTHING = Fraction(0)


def _is_mujocos(value: Fraction) -> bool:
    return isinstance(value, Given) and value.attribute.startswith("mjc:")


@law("attributes of MuJoCo", "joints", supplied=True, each=with_joints)
def attributes_of_joints(joint: Joint) -> Joint:
    """Without springs, dampers and rotors that the namespace of MuJoCo alone gives."""
    gone: dict[str, Any] = {name: _NOTHING for name in ("stiffness", "damping", "armature") if _is_mujocos(getattr(joint, name))}
    return replace(joint, **gone)


@law("gravity compensation", "bodies", each=with_bodies)
def gravity_compensation(body: Body) -> Body:
    return replace(body, gravity_compensation=_NOTHING) if _is_mujocos(body.gravity_compensation) else body


@law("reference positions", "joints", each=with_joints)
def references(joint: Joint) -> Joint:
    """Joints are at zero where their frames meet."""
    return replace(joint, reference=_NOTHING) if _is_mujocos(joint.reference) else joint
