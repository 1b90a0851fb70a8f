"""A model in either format taken apart into its bodies, joints and inertias, each as places in its text that can be written.

A value that an MJCF joint inherits from a default class counts as absent.

Sources: MuJoCo 4 XML reference: body, joint, inertial, option, tendon; http://wiki.ros.org/urdf/XML; ``harness.files.model_file`` for
springs and rotors in a URDF.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from harness.files.joint_kinds import JointKind
from harness.files.mjcf.attributes import JOINTS, ORIENTATIONS
from harness.files.mjcf.attributes import KINDS as MJCF_KINDS
from harness.files.model_file import ModelFile
from harness.files.text.scan import Attribute, Edit, Element, TextPlace, find_elements, innermost
from harness.files.text.slots import ENTRIES, Anatomy, BodySlots, InertialSlots, JointSlots, Slot
from harness.files.urdf.kinds import BALL_CONSTRAINT, DRAKE_JOINT, KINDS, POINT_SPRING

STAGES = ("gravity", "spring", "damper")
_GRAVITY = "0 0 -9.81"
_NAMESPACE = ' xmlns:drake="http://drake.mit.edu"'
_ROTOR = (
    '<transmission name="{name}_transmission"><type>transmission_interface/SimpleTransmission</type>'
    '<joint name="{name}"/><actuator name="{name}_motor"><drake:rotor_inertia value="',
    '"/></actuator></transmission>',
)
_SPRING = ('<gazebo reference="{name}"><springStiffness>', "</springStiffness><springReference>0</springReference></gazebo>")


def anatomy(model: ModelFile) -> Anatomy:
    """Take a valid model apart."""
    return {"mjcf": _of_mjcf, "urdf": _of_urdf}[model.format](_Parts(model))


class _Parts:
    """The elements of a model, and slots for their attributes."""

    def __init__(self, model: ModelFile) -> None:
        self.model, self.text = model, model.text
        self.elements = find_elements(model.text, model.format)

    def all(self, *path: str) -> list[Element]:
        """Elements whose path ends so."""
        return [element for element in self.elements if element.path[-len(path) :] == path]

    def inside(self, holder: Element, tag: str) -> Element | None:
        """The first child of ``holder`` with that tag."""
        path = (*holder.path, tag)
        return next((element for element in self.elements if element.path == path and holder.holds(element)), None)

    def slot(self, element: Element, name: str, default: str = "0 0 0", along: tuple[Edit, ...] = (), alone: bool = False) -> Slot:
        """Attribute ``name`` of an element that is there; ``alone``: the element goes with it where it has no other attribute."""
        found = next((attribute for attribute in element.attributes if attribute.name == name), None)
        if found is None:
            end = element.opened - (2 if self.text[element.opened - 2] == "/" else 1)
            return self.missing(element, end, (element.tag, name), (f' {name}="', '"'), default, along)
        span = (element.start, element.end) if alone and len(element.attributes) == 1 else (found.start, found.end)
        return self._standing(element, found, span, element.line, along)

    def slot_inside(
        self, holder: Element, tag: str, name: str, default: str = "0 0 0", along: tuple[Edit, ...] = (), alone: bool = True
    ) -> Slot:
        """Attribute ``name`` of the child ``tag`` of an element, which itself may be absent."""
        child = self.inside(holder, tag)
        if child is None:
            return self.missing(holder, holder.opened, (tag, name), (f'<{tag} {name}="', '"/>'), default, along)
        slot = self.slot(child, name, default, along, alone)
        return replace(slot, absent_line=holder.line) if slot.removed == (child.start, child.end) else slot

    def text_slot(self, element: Element, holder: Element, absent_line: int) -> Slot:
        """The text between the tags of an element that goes with ``holder``."""
        found = next(attribute for attribute in element.attributes if attribute.name == "")
        return self._standing(element, found, (holder.start, holder.end), absent_line, ())

    def missing(
        self, owner: Element, at: int, what: tuple[str, str], around: tuple[str, str], default: str = "0", along: tuple[Edit, ...] = ()
    ) -> Slot:
        """An attribute that is not there, and would stand at a position of the text with ``around`` before and behind its value."""
        line = self.text.count("\n", 0, at) + 1
        return Slot(TextPlace(owner.line, *what, None, ""), at, at, *around, line, owner.line, tuple(default.split()), (at, at), along)

    def _standing(self, element: Element, found: Attribute, removed: tuple[int, int], absent_line: int, along: tuple[Edit, ...]) -> Slot:
        place = TextPlace(found.line, element.tag, found.name, None, found.value)
        whole = self.text[found.start : found.end]
        before = whole.rindex(found.value, 0, len(whole) - bool(found.name)) if found.value else len(whole) - 1
        head, tail = whole[:before], whole[before + len(found.value) :]
        words = tuple(found.value.split())
        return Slot(place, found.start, found.end, head, tail, found.line, absent_line, words, removed, along)


# MJCF.


def _of_mjcf(parts: _Parts) -> Anatomy:
    stages = {stage: _stage(parts, stage) for stage in STAGES}
    on = {stage: tuple(slot.written(["enable"])) if slot.words == ("disable",) else () for stage, slot in stages.items()}
    root, (world, *_) = parts.elements[0], parts.all("mujoco", "worldbody")
    compiler = parts.inside(root, "compiler")
    placed = [element for element in parts.elements if element.tag in ("site", "joint") and element.start > world.start]
    return Anatomy(
        model=parts.model,
        bodies=tuple(_body(parts, element, on) for element in parts.all("body")),
        positions=tuple(parts.slot(element, "pos") for element in placed),
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


def _stage(parts: _Parts, stage: str) -> Slot:
    flags = parts.all("option", "flag")
    if flags:
        return parts.slot(next((flag for flag in flags if flag.get(stage) is not None), flags[0]), stage, "enable")
    option = parts.inside(parts.elements[0], "option")
    slot = parts.slot_inside(option or parts.elements[0], "flag", stage, "enable")
    if option is not None and option.end > option.opened:
        return slot
    # No option can hold the flag; options may stand in the file more than once.
    return replace(slot, head=f"<option>{slot.head}", tail=f"{slot.tail}</option>")


def _body(parts: _Parts, element: Element, on: Mapping[str, tuple[Edit, ...]]) -> BodySlots:
    bodies = parts.all("body")
    name, parent, inertial, slots = element.get("name") or "", innermost(bodies, element), parts.inside(element, "inertial"), None
    if inertial is not None:
        entries = parts.slot(inertial, "fullinertia" if inertial.get("fullinertia") is not None else "diaginertia")
        mass, centre = parts.slot(inertial, "mass"), parts.slot(inertial, "pos")
        slots = InertialSlots(name, mass, centre, (entries,), _orientation(parts, inertial))
    own = [joint for tag in JOINTS for joint in parts.all(tag) if innermost(bodies, joint) is element]
    return BodySlots(
        name=name,
        parent=None if parent is None else parent.get("name"),
        offset=parts.slot(element, "pos"),
        rotation=_orientation(parts, element),
        inertial=slots,
        joints=tuple(_mjcf_joint(parts, joint, on) for joint in own),
    )


def _orientation(parts: _Parts, element: Element) -> Slot:
    """Whichever attribute says it, or the place for a quaternion."""
    return parts.slot(element, next((name for name in ORIENTATIONS if element.get(name) is not None), "quat"), "1 0 0 0")


def _mjcf_joint(parts: _Parts, element: Element, on: Mapping[str, tuple[Edit, ...]]) -> JointSlots:
    name = parts.slot(element, "name", "")
    kind = JointKind.FREE if element.tag == "freejoint" else MJCF_KINDS[element.get("type") or JointKind.HINGE]
    if not kind.has_axis:
        return JointSlots(name, kind)
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


# URDF.


def _of_urdf(parts: _Parts) -> Anatomy:
    carried = {_link(parts, joint, "child"): joint for tag in (DRAKE_JOINT, "joint") for joint in parts.all("robot", tag)}
    points = [
        parts.slot(point, "value")
        for tag in (POINT_SPRING, BALL_CONSTRAINT)
        for pair in parts.all("robot", tag)
        for end in ("p_AP", "p_BQ")
        if (point := parts.inside(pair, f"{tag}_{end}")) is not None
    ]
    others = []
    for spring in parts.all("robot", POINT_SPRING):
        stiffness, damping, length = (
            parts.slot_inside(spring, f"{POINT_SPRING}_{name}", "value", "0", alone=False)
            for name in ("stiffness", "damping", "free_length")
        )
        others.append((stiffness, damping, length))
    links = parts.all("robot", "link")
    bodies = tuple(_link_body(parts, link, carried.get(link.get("name"))) for link in links)
    return Anatomy(parts.model, bodies, positions=tuple(points), others=tuple(others))


def _link(parts: _Parts, joint: Element, tag: str) -> str | None:
    """The link that the parent or child of a joint names."""
    part = parts.inside(joint, tag)
    return None if part is None else part.get("link")


def _link_body(parts: _Parts, link: Element, joint: Element | None) -> BodySlots:
    """A link with the joint that carries it."""
    name, inertial, slots = link.get("name") or "", parts.inside(link, "inertial"), None
    if inertial is not None:
        slots = InertialSlots(
            body=name,
            mass=parts.slot_inside(inertial, "mass", "value", "0", alone=False),
            centre=parts.slot_inside(inertial, "origin", "xyz"),
            entries=tuple(parts.slot_inside(inertial, "inertia", f"i{entry}", "0", alone=False) for entry in ENTRIES),
            rotation=parts.slot_inside(inertial, "origin", "rpy"),
        )
    # Drake's joint knows the world by itself.
    carrier = None if joint is None or joint.tag == DRAKE_JOINT else joint
    return BodySlots(
        name=name,
        parent=None if carrier is None else _link(parts, carrier, "parent"),
        offset=None if carrier is None else parts.slot_inside(carrier, "origin", "xyz"),
        rotation=None if carrier is None else parts.slot_inside(carrier, "origin", "rpy"),
        inertial=slots,
        joints=() if joint is None else _urdf_joints(parts, joint),
    )


def _urdf_joints(parts: _Parts, joint: Element) -> tuple[JointSlots, ...]:
    kind = JointKind.BALL if joint.tag == DRAKE_JOINT else KINDS.get(joint.get("type") or "")
    if kind is None or kind is JointKind.PLANAR:
        return ()
    name, called = parts.slot(joint, "name", ""), joint.get("name")
    if not kind.has_axis:
        return (JointSlots(name, kind),)
    stiffness, reference = _joint_spring(parts, joint, called)
    slots = JointSlots(
        name,
        kind,
        axis=parts.slot_inside(joint, "axis", "xyz", "1 0 0", alone=False),
        damping=parts.slot_inside(joint, "dynamics", "damping", "0"),
        stiffness=stiffness,
        spring_reference=reference,
        armature=_armature(parts, joint, called),
        friction=parts.slot_inside(joint, "dynamics", "friction", "0"),
    )
    return (slots,)


def _joint_spring(parts: _Parts, joint: Element, called: str | None) -> tuple[Slot, Slot | None]:
    """Stiffness and reference of the spring in a joint, or the place for one."""
    for spring in parts.all("robot", "gazebo"):
        if spring.get("reference") == called:
            stiffness, reference = (parts.inside(spring, tag) for tag in ("springStiffness", "springReference"))
            assert stiffness is not None and reference is not None
            # Both numbers must be there: a reference that is left out is zero.
            return parts.text_slot(stiffness, spring, joint.line), parts.text_slot(reference, spring, joint.line)
    head, tail = _SPRING
    return parts.missing(joint, joint.end, ("springStiffness", ""), (head.format(name=called), tail)), None


def _armature(parts: _Parts, joint: Element, called: str | None) -> Slot:
    """Rotor inertia of the transmission that drives the joint, or the place for one."""
    for transmission in parts.all("robot", "transmission"):
        driven, actuator = parts.inside(transmission, "joint"), parts.inside(transmission, "actuator")
        if driven is None or actuator is None or driven.get("name") != called:
            continue
        slot = parts.slot_inside(actuator, "drake:rotor_inertia", "value", "0", alone=False)
        return replace(slot, removed=(transmission.start, transmission.end), absent_line=joint.line)
    # A transmission does nothing without a limit that lets it act, and the namespace of its elements.
    along: list[Edit] = []
    limit, root = parts.inside(joint, "limit"), parts.elements[0]
    if limit is not None and float(limit.get("effort") or 0) == 0:
        along += parts.slot(limit, "effort", "0").written(["1"])
    if "xmlns:drake" not in parts.text[root.start : root.opened]:
        along.append((root.opened - 1, root.opened - 1, _NAMESPACE))
    head, tail = _ROTOR
    return parts.missing(joint, joint.end, ("drake:rotor_inertia", "value"), (head.format(name=called), tail), along=tuple(along))
