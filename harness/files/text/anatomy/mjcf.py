"""Anatomy of an MJCF model.

Source: MuJoCo 4 XML reference: body, joint, inertial, option, tendon.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from harness.files.joint_kinds import JointKind
from harness.files.mjcf.options import KINDS, ORIENTATIONS
from harness.files.text.anatomy.parts import Anatomy, BodySlots, InertialSlots, JointSlots, Parts, Slot
from harness.files.text.scan import Edit, Element, innermost

STAGES = ("gravity", "spring", "damper")
_GRAVITY = "0 0 -9.81"


def anatomy(parts: Parts) -> Anatomy:
    """Take the model apart."""
    stages = {stage: _stage(parts, stage) for stage in STAGES}
    on = {stage: tuple(slot.written(["enable"])) if slot.words == ("disable",) else () for stage, slot in stages.items()}
    bodies = [element for element in parts.elements if element.tag == "body"]
    world = parts.all("mujoco", "worldbody")[0]
    root = parts.elements[0]
    compiler = parts.inside(root, "compiler")
    return Anatomy(
        model=parts.model,
        bodies=tuple(_body(parts, element, bodies, on) for element in bodies),
        positions=tuple(
            parts.slot(element, "pos") for element in parts.elements if element.tag in ("site", "joint") and element.start > world.start
        ),
        others=tuple(
            (
                parts.slot(tendon, "stiffness", "0", on["spring"]),
                parts.slot(tendon, "damping", "0", on["damper"]),
                parts.slot(tendon, "springlength", "-1"),
            )
            for tendon in (*parts.all("tendon", "spatial"), *parts.all("tendon", "fixed"))
        ),
        gravity=parts.slot_inside(root, "option", "gravity", _GRAVITY, on["gravity"], alone=False),
        stages=stages,
        angle=parts.slot_inside(root, "compiler", "angle", "degree", alone=False),
        euler_sequence=(compiler and compiler.get("eulerseq")) or "xyz",
    )


def _stage(parts: Parts, stage: str) -> Slot:
    flags = parts.all("option", "flag")
    if flags:
        return parts.slot(next((flag for flag in flags if flag.get(stage) is not None), flags[0]), stage, "enable")
    option = parts.inside(parts.elements[0], "option")
    slot = parts.slot_inside(option or parts.elements[0], "flag", stage, "enable")
    if option is not None and option.closed > option.opened:
        return slot
    # No option can hold the flag; options may stand in the file more than once.
    return replace(slot, head=f"<option>{slot.head}", tail=f"{slot.tail}</option>")


def _body(parts: Parts, element: Element, bodies: list[Element], on: Mapping[str, tuple[Edit, ...]]) -> BodySlots:
    parent, inertial = innermost(bodies, element), parts.inside(element, "inertial")
    own = [joint for joint in parts.elements if joint.tag in ("joint", "freejoint") and innermost(bodies, joint) is element]
    return BodySlots(
        name=element.get("name") or "",
        parent=None if parent is None else parent.get("name"),
        offset=parts.slot(element, "pos"),
        rotation=_orientation(parts, element),
        inertial=None if inertial is None else _inertial(parts, element, inertial),
        joints=tuple(_joint(parts, joint, on) for joint in own),
    )


def _orientation(parts: Parts, element: Element) -> Slot:
    """Whichever attribute says it, or the place for a quaternion."""
    return parts.slot(element, next((name for name in ORIENTATIONS if element.get(name) is not None), "quat"), "1 0 0 0")


def _inertial(parts: Parts, body: Element, element: Element) -> InertialSlots:
    entries = parts.slot(element, "fullinertia" if element.get("fullinertia") is not None else "diaginertia")
    mass, centre = parts.slot(element, "mass"), parts.slot(element, "pos")
    return InertialSlots(body.get("name") or "", mass, centre, (entries,), _orientation(parts, element))


def _joint(parts: Parts, element: Element, on: Mapping[str, tuple[Edit, ...]]) -> JointSlots:
    name = parts.slot(element, "name", "")
    kind = JointKind.FREE if element.tag == "freejoint" else KINDS[element.get("type") or JointKind.HINGE]
    if not kind.has_axis:
        return JointSlots(name, kind, np.zeros(3), None)
    return JointSlots(
        name,
        kind,
        parts.slot(element, "pos").values,
        parts.slot(element, "axis", "0 0 1"),
        damping=parts.slot(element, "damping", "0", on["damper"]),
        stiffness=parts.slot(element, "stiffness", "0", on["spring"]),
        spring_reference=parts.slot(element, "springref", "0"),
        armature=parts.slot(element, "armature", "0"),
        friction=parts.slot(element, "frictionloss", "0"),
    )
