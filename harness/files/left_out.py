"""Contents of a file besides the equations of motion of its tree.

Sources: MuJoCo documentation, XML reference, and Modeling, section URDF extensions; http://wiki.ros.org/urdf/XML; SDFormat extensions to
URDF.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace

from lxml import etree

from harness.files.document.source import Source
from harness.files.document.xml import describe, literal_tag
from harness.files.findings import ACTUATORS, CONTACTS, EFFORT, EQUALITIES, FRICTION, LIMITS, TENDON_LIMITS, TRANSMISSIONS, LeftOut
from harness.files.given import Place
from harness.files.mjcf.attributes import JOINTS, Attributes, resolved_text
from harness.files.tree import WORLD, Tree
from harness.files.urdf.beside import FORCES_WITHOUT_AXIS, UNREAD_ROTORS, has_rotor
from harness.files.urdf.kinds import BALL_CONSTRAINT, FIXED, JOINT_TAGS, LIMITED, POINT_SPRING
from harness.files.urdf.reading import DAMPING_OF_SEVERAL

_VISUAL = "visual geometry"

# MJCF. What each is, and whether an engine that has it switched on could give other accelerations for it.
_SECTIONS = {
    "equality": (EQUALITIES, True),
    "actuator": (ACTUATORS, True),
    "deformable": ("deformable bodies", True),
    "sensor": ("sensors", False),
    "keyframe": ("keyframes", False),
    "asset": ("meshes, textures and materials", False),
    "custom": ("custom data", False),
    "extension": ("plugins", True),
    "contact": ("contacts that are excluded", False),
}
_OTHERWISE = {"contact/pair": (CONTACTS, True), "deformable/skin": (_VISUAL, False)}
_ALONE = {"visual": "settings of the picture", "statistic": "settings of the picture", "size": "sizes of memory"}
_IN_BODIES = {"camera": "cameras and lights", "light": "cameras and lights"}
_SECTIONS_READ = ("compiler", "option", "default", "worldbody", "tendon")
_OF_FLUID = ("density", "viscosity", "wind")

# URDF, in the order in which it is told.
_UNKNOWN, _XACRO = "elements that URDF does not know", "xacro leftovers"
_SAFETY, _GAZEBO = "safety controllers and calibration", "gazebo elements"
_MUJOCO, _LOOPS = "options of MuJoCo's own reader", "Drake's ball constraints, which no engine's reader reads"
_BEARS_ON_MOTION = {
    **dict.fromkeys((CONTACTS, LIMITS, FRICTION, DAMPING_OF_SEVERAL, FORCES_WITHOUT_AXIS, UNREAD_ROTORS, _MUJOCO, _LOOPS), True),
    **dict.fromkeys((EFFORT, TRANSMISSIONS, _SAFETY, _VISUAL, _GAZEBO, _XACRO, _UNKNOWN), False),
}
_OF_PATH = {
    "link/visual": _VISUAL,
    "link/collision": CONTACTS,
    "robot/material": _VISUAL,
    "robot/transmission": TRANSMISSIONS,
    "robot/gazebo": _GAZEBO,
    "robot/mujoco": _MUJOCO,
    f"robot/{BALL_CONSTRAINT}": _LOOPS,
    "joint/safety_controller": _SAFETY,
    "joint/calibration": _SAFETY,
}
_PATHS_READ = frozenset(
    ["robot/link", *(f"robot/{tag}" for tag in JOINT_TAGS), f"robot/{POINT_SPRING}", "link/inertial"]
    + [f"{tag}/{part}" for tag in JOINT_TAGS for part in ("parent", "child", "origin", "axis", "limit", "dynamics", "mimic")]
)

Found = Iterator[tuple[str, bool, etree._Element]]
# Of elements that are left out: told by the tree and its equalities, and of no bearing.
_TOLD, _LOOKS = (LIMITS, FRICTION, EQUALITIES), ("class", "childclass", "group", "material", "name", "rgba", "user")
_TARGETS = ("joint", "jointinparent", "tendon", "body", "site", "cranksite", "geom1", "geom2", "body1", "body2")


@dataclass(frozen=True)
class Declared:
    """An element that no equation of motion holds and that bears on the motion.

    Attributes:
        what: as of ``LeftOut``. owner: the link, joint or other things that it is about, as "link hand" or "joint elbow".
        values: its attributes, default classes applied; of a URDF those of its parts too.
    """

    what: str
    owner: str
    values: Mapping[str, str]
    place: Place

    def about(self, names: Mapping[str, str]) -> Declared:
        """The same where joints have other names, ``{joint: new name}``."""
        kind, _, name = self.owner.partition(" ")
        values = {key: names.get(value, value) if key in ("joint", "jointinparent") else value for key, value in self.values.items()}
        return replace(self, owner=f"{kind} {names.get(name, name)}" if kind == "joint" else self.owner, values=values)


def _declared(source: Source, elements: Iterable[tuple[str, etree._Element]]) -> tuple[Declared, ...]:
    attributes: dict[str, set[str]] = {}
    for default in source.root.iter("default"):
        for part in default.iterchildren("*"):
            attributes.setdefault(str(part.tag), set()).update(part.attrib)
    found = []
    for what, element in elements:
        names = _OF_FLUID if element.tag == "option" else sorted({*element.attrib, *attributes.get(str(element.tag), ())})
        values = {name: text for name in names if (text := resolved_text(element, name))}
        for part in element.iterdescendants("*"):
            if part.tag == "config":
                values[f"config {part.get('key')}"] = str(part.get("value"))
            else:
                values |= {f"{literal_tag(part)} {name}": str(value) for name, value in part.attrib.items()}
        targets = [(name, element.get(name)) for name in _TARGETS if element.get(name)]
        holder = next(element.iterancestors("body", "link", "worldbody"), None)
        if targets:
            owner = f"{targets[0][0]} {' and '.join(str(value) for _, value in targets)}"
        elif holder is not None:
            owner = f"link {holder.get('name') or 'without name' if holder.tag != 'worldbody' else WORLD}"
        else:
            owner = describe(element)
        found.append(Declared(what, owner, {key: text for key, text in values.items() if key not in _LOOKS}, source.place(element)))
    return tuple(found)


def left_out_of_mjcf(source: Source, tree: Tree) -> tuple[tuple[LeftOut, ...], tuple[Declared, ...]]:
    """The parts that are left out, those that bear on the motion first; and their elements that neither tree nor equalities tell."""
    found: dict[tuple[str, bool], list[etree._Element]] = {}
    for what, bears, element in (*_of_sections(source.root), *_of_bodies(source.root), *_of_tendons(source), *_of_joints(source, tree)):
        found.setdefault((what, bears), []).append(element)
    parts = [LeftOut(what, source.lines(elements), bears) for (what, bears), elements in found.items()]
    own = [(what, element) for (what, bears), elements in found.items() if bears and what not in _TOLD for element in elements]
    return tuple(sorted(parts, key=lambda part: not part.bears_on_motion)), _declared(source, own)


def _of_sections(root: etree._Element) -> Found:
    for section in root.iterchildren("*"):
        if section.tag in _SECTIONS:
            for element in section.iterchildren("*"):
                yield (*_OTHERWISE.get(f"{section.tag}/{element.tag}", _SECTIONS[section.tag]), element)
        elif section.tag == "option" and any(_is_felt(section.get(name, "")) for name in _OF_FLUID):
            yield "fluid", True, section
        elif section.tag not in _SECTIONS_READ:
            yield _ALONE.get(section.tag, "elements that MJCF does not know"), False, section


def _is_felt(text: str) -> bool:
    """True where a list of numbers holds another one than 0."""
    return any(word.strip("+-0.") for word in text.split())


def _of_bodies(root: etree._Element) -> Found:
    """Geoms, and what bodies hold besides."""
    for world in root.iterchildren("worldbody"):
        for element in world.iterdescendants("*"):
            if element.tag == "geom":
                touches = any(resolved_text(element, name, "1") != "0" for name in ("contype", "conaffinity"))
                yield CONTACTS if touches else _VISUAL, touches, element
            elif element.tag in _IN_BODIES:
                yield _IN_BODIES[element.tag], False, element
            elif element.tag == "body" and element.get("mocap") == "true":
                yield "bodies moved from outside", False, element


def _of_tendons(source: Source) -> Found:
    attributes = Attributes(source)
    for tendon in source.root.iterfind("tendon/*"):
        if attributes.is_limited(tendon):
            yield TENDON_LIMITS, True, tendon
        if _is_felt(resolved_text(tendon, "frictionloss")):
            yield FRICTION, True, tendon


def _of_joints(source: Source, tree: Tree) -> Found:
    """Friction and limits, which the tree knows."""
    elements = {source.place(joint): joint for world in source.root.iterchildren("worldbody") for joint in world.iter(*JOINTS)}
    for joint in tree.joints:
        assert joint.place is not None
        element = elements[joint.place]
        if joint.friction_loss:
            yield FRICTION, True, element
        if joint.limits is not None:
            yield LIMITS, True, element


def left_out_of_urdf(source: Source) -> tuple[tuple[LeftOut, ...], tuple[Declared, ...]]:
    """The same of a tree that has been read from a URDF."""
    found: dict[str, set[int]] = {}
    findings = list(_findings(source))
    for what, element in findings:
        found.setdefault(what, set()).update(source.lines([element]))
    for one in source.passed_over:
        found.setdefault(one.what, set()).add(one.line)
    own = _declared(source, [(what, element) for what, element in findings if _BEARS_ON_MOTION[what] and what not in _TOLD])
    return tuple(LeftOut(what, tuple(sorted(found[what])), bears) for what, bears in _BEARS_ON_MOTION.items() if what in found), own


def _findings(source: Source) -> Iterator[tuple[str, etree._Element]]:
    for element in source.root.iterchildren("*"):
        tag = literal_tag(element)
        yield from _of_path("robot", [element])
        if tag in ("link", *JOINT_TAGS):
            yield from _of_path(tag, element.iterchildren("*"))
        if tag == "joint":
            yield from _of_joint(source, element)


def _of_path(holder: str, elements: Iterable[etree._Element]) -> Iterator[tuple[str, etree._Element]]:
    for element in elements:
        path = f"{holder}/{literal_tag(element)}"
        if literal_tag(element).startswith("xacro:"):
            yield _XACRO, element
        elif path not in _PATHS_READ and not _is_read(path, element):
            yield _OF_PATH.get(path, _UNKNOWN), element


def _is_read(path: str, element: etree._Element) -> bool:
    """True for springs and rotors, which the equations of motion hold, or which are passed over for a reason of their own."""
    if path == "robot/gazebo":
        return {literal_tag(part) for part in element.iterchildren("*")} - {"springReference"} == {"springStiffness"}
    return path == "robot/transmission" and has_rotor(element)


def _of_joint(source: Source, joint: etree._Element) -> Iterator[tuple[str, etree._Element]]:
    kind, limit, dynamics = joint.get("type"), joint.find("limit"), joint.find("dynamics")
    if limit is not None:
        if kind in LIMITED and source.number(limit, "lower", 0.0) < source.number(limit, "upper", 0.0):
            yield LIMITS, limit
        if {"effort", "velocity"} & set(limit.attrib):
            yield EFFORT, limit
    if dynamics is not None and kind != FIXED and source.number(dynamics, "friction", 0.0):
        yield FRICTION, dynamics
