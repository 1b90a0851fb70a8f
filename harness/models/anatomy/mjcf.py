"""Anatomy of an MJCF model.

Source: MuJoCo 4 XML reference: body, joint, inertial, option, tendon.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from harness.models.anatomy.parts import Anatomy, Body, Edit, Inertial, Joint, Parts, Slot
from harness.models.text import Element

STAGES = ("gravity", "spring", "damper")
ORIENTATIONS = ("quat", "axisangle", "euler", "xyaxes", "zaxis")
_GRAVITY = "0 0 -9.81"


def anatomy(parts: Parts) -> Anatomy:
    """Take the model apart."""
    stages = {stage: _stage(parts, stage) for stage in STAGES}
    bodies = [element for element in parts.elements if element.tag == "body"]
    world = next(parts.all("mujoco", "worldbody"))
    option = next((element for element in parts.all("mujoco", "option")), None)
    compiler = next(iter(parts.all("mujoco", "compiler")), None)
    root = parts.elements[0]
    on = _switched_on(stages["gravity"])
    gravity = parts.slot_inside(root, "option", "gravity", _GRAVITY) if option is None else parts.slot(option, "gravity", _GRAVITY, on)
    angle = parts.slot_inside(root, "compiler", "angle", "degree") if compiler is None else parts.slot(compiler, "angle", "degree")
    tendons = [*parts.all("tendon", "spatial"), *parts.all("tendon", "fixed")]
    return Anatomy(
        model=parts.model,
        bodies=tuple(_body(parts, element, bodies, stages) for element in bodies),
        positions=tuple(
            parts.slot(element, "pos") for element in parts.elements if element.tag in ("site", "joint") and element.start > world.start
        ),
        others=tuple(
            (
                parts.slot(tendon, "stiffness", "0", _switched_on(stages["spring"])),
                parts.slot(tendon, "damping", "0", _switched_on(stages["damper"])),
                parts.slot(tendon, "springlength", "-1"),
            )
            for tendon in tendons
        ),
        gravity=gravity,
        stages=stages,
        angle=angle,
        euler_sequence=(compiler and compiler.get("eulerseq")) or "xyz",
    )


def _stage(parts: Parts, stage: str) -> Slot:
    flag = next((element for element in parts.all("option", "flag") if element.get(stage) is not None), None)
    flag = flag or next(iter(parts.all("option", "flag")), None)
    if flag is not None:
        return parts.slot(flag, stage, "enable")
    option = next(iter(parts.all("mujoco", "option")), None)
    slot = parts.slot_inside(option or parts.elements[0], "flag", stage, "enable")
    return slot if option is not None and option.closed > option.opened else _in_new_option(slot)


def _in_new_option(slot: Slot) -> Slot:
    """A flag where no option can hold it; options may stand in the file more than once."""
    return replace(slot, head=f"<option>{slot.head}", tail=f"{slot.tail}</option>")


def _switched_on(stage: Slot) -> tuple[Edit, ...]:
    return tuple(stage.written(["enable"])) if stage.words == ("disable",) else ()


def _body(parts: Parts, element: Element, bodies: list[Element], stages: dict[str, Slot]) -> Body:
    around = [body for body in bodies if body.start < element.start < body.end]
    own = [joint for joint in parts.elements if joint.tag in ("joint", "freejoint") and _holder(joint, bodies) is element]
    inertial = parts.inside(element, "inertial")
    return Body(
        name=element.get("name") or "",
        parent=around[-1].get("name") if around else None,
        offset=parts.slot(element, "pos"),
        rotation=_orientation(parts, element),
        inertial=None if inertial is None else _inertial(parts, element, inertial),
        joints=tuple(_joint(parts, joint, stages) for joint in own),
    )


def _holder(joint: Element, bodies: list[Element]) -> Element | None:
    return next((body for body in reversed(bodies) if body.start < joint.start < body.end), None)


def _orientation(parts: Parts, element: Element) -> Slot:
    """Whichever attribute says it, or the place for a quaternion."""
    return parts.slot(element, next((name for name in ORIENTATIONS if element.get(name) is not None), "quat"), "1 0 0 0")


def _inertial(parts: Parts, body: Element, element: Element) -> Inertial:
    entries = parts.slot(element, "fullinertia" if element.get("fullinertia") is not None else "diaginertia")
    mass, centre = parts.slot(element, "mass"), parts.slot(element, "pos")
    return Inertial(body.get("name") or "", mass, centre, (entries,), _orientation(parts, element))


def _joint(parts: Parts, element: Element, stages: dict[str, Slot]) -> Joint:
    name, kind = parts.slot(element, "name", ""), "free" if element.tag == "freejoint" else element.get("type") or "hinge"
    if kind in ("ball", "free"):
        return Joint(name, kind, np.zeros(3), None)
    return Joint(
        name,
        kind,
        parts.slot(element, "pos").values,
        parts.slot(element, "axis", "0 0 1"),
        damping=parts.slot(element, "damping", "0", _switched_on(stages["damper"])),
        stiffness=parts.slot(element, "stiffness", "0", _switched_on(stages["spring"])),
        spring_reference=parts.slot(element, "springref", "0"),
        armature=parts.slot(element, "armature", "0"),
        friction=parts.slot(element, "frictionloss", "0"),
    )
