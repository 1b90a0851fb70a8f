"""From an MJCF to its tree of bodies.

A file is included once, and looked for from the folder of the main file, as MuJoCo does, which takes a backslash for a slash. A replica
becomes a ``<frame>`` of its own, in the frame of the one before; its names end with its number. MuJoCo 4.0.0 departs from that
documentation where replicas turn about several axes: it multiplies the angles by the number of the replica. Bodies and joints without names
get names from their place, which no author's name can be.

Source: MuJoCo documentation, XML reference, ``include``, ``replicate``, ``body``, ``inertial``, ``joint``, ``frame``, ``compiler`` and
``option/flag``;
Modeling, section Frame orientations.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

from lxml import etree

from harness.errors import InvalidModel
from harness.files.document.source import Numbers, Source, not_negative, not_zero, read_any, refuse_irregular_files
from harness.files.document.xml import MAXIMUM_ELEMENTS, describe, shorten
from harness.files.equalities import Equality
from harness.files.given import ORIGIN, Given, Vector, vector
from harness.files.joint_kinds import JointKind
from harness.files.mjcf.actuators import ActuatorReader
from harness.files.mjcf.attributes import JOINTS, KINDS, REPEATED, Attributes, inside, is_on, resolved_text
from harness.files.mjcf.between import ElementsBetween
from harness.files.mjcf.inertias import CompileMeshes, Inertias
from harness.files.tree import WORLD, Actuator, Body, ForceLimits, Joint, SpringDampers, Tree

# What MuJoCo takes without an option.
GRAVITY = (0.0, 0.0, -9.81)
MOST_FILES = 100
# Elements that make bodies by rules that only a simulator's program spells out.
_MAKERS = ("attach", "composite", "flexcomp")


@dataclass(frozen=True)
class MjcfMeaning:
    """The statements of an MJCF.

    Attributes:
        tree: without what follows. spring_dampers: joints whose stiffness and damping follow from their inertia.
        force_limits: as of ``Tree``.
    """

    tree: Tree
    equalities: tuple[Equality, ...]
    spring_dampers: SpringDampers
    actuators: tuple[Actuator, ...]
    force_limits: ForceLimits


def read_tree(source: Source, compile_meshes: CompileMeshes | None = None) -> MjcfMeaning:
    """The tree of an MJCF, and what is no part of it.

    Included files and replicas are put into its elements, in place.

    ``compile_meshes`` gives the inertias of meshes, which no file states; without it a body that has its inertia from one is refused.

    Raises:
        InvalidModel: what has no meaning, or one that is that of MuJoCo's program alone.
    """
    _expand(source)
    refuse_irregular_files(source)
    attributes = Attributes(source)
    _refuse_other_frames(source, attributes)
    reader = _MjcfReader(source, attributes, compile_meshes)
    bodies = tuple(reader.body(body) for world in source.root.iterchildren("worldbody") for body in world.iter("body"))
    between, inertias = ElementsBetween(source, attributes, reader.name, bodies), reader.inertias
    springs, couplings = between.springs()
    by_name = {str(one.get("name")): one for one in source.root.iterfind("tendon/*") if one.get("name")}
    driving = ActuatorReader(source, attributes, between, [joint for body in bodies for joint in body.joints], by_name)
    couplings = (*couplings, *driving.rotors())
    place, tendons = source.place(source.root), between.bound_tendons()
    tree = Tree(bodies, _gravity(source), springs, couplings, inertias.total_mass, place, inertias.bounds, tendons=tendons)
    if source.root.find("sensor/*") is not None:
        # Mechanisms have none.
        from harness.files.mjcf.sensors import sensors_of

        tree = replace(tree, sensors=tuple(sensors_of(source, attributes, between, tree)))
    dampers = SpringDampers(reader.spring_dampers, attributes.acts("spring"), attributes.acts("damper"))
    actuators = driving.actuators()
    limits = tuple(driving.force_limits(reader.elements_of(tree.joints))) if actuators else ()
    return MjcfMeaning(tree, between.equalities(), dampers, actuators, limits)


def _refuse_other_frames(source: Source, attributes: Attributes) -> None:
    """Refuse what makes positions mean something else."""
    for attribute, word in (("coordinate", "global"), ("alignfree", "true")):
        if attributes.compiler(attribute, "") == word:
            compiler = next(one for one in source.root.iterchildren("compiler") if one.get(attribute) == word)
            source.refuse(compiler, f'<compiler {attribute}="{word}"> changes the frames of bodies, which is not read; write them out')
    for joint in source.root.iter("freejoint"):
        if joint.get("align") == "true":
            source.refuse(joint, f'{describe(joint)} with align="true" turns the frame of its body, which is not read; write it out')


def _gravity(source: Source) -> Vector:
    root = source.root
    options = [*root.iterchildren("option")]
    if not is_on(root, "gravity"):
        return ORIGIN
    given = [option for option in options if "gravity" in option.attrib]
    return vector(source.numbers(given[-1], "gravity", GRAVITY) if given else source.default(([*options, root])[0], "gravity", GRAVITY))


class _MjcfReader:
    """Bodies of one file."""

    def __init__(self, source: Source, attributes: Attributes, compile_meshes: CompileMeshes | None) -> None:
        self._source, self.attributes = source, attributes
        self.inertias = Inertias(source, attributes, compile_meshes)
        # Time constant and damping ratio by joint.
        self.spring_dampers: dict[str, tuple[Given, Given]] = {}
        self._names: dict[etree._Element, str] = {}
        self._taken: dict[str, etree._Element] = {}

    def body(self, element: etree._Element) -> Body:
        parent, holder = next(element.iterancestors("body", "worldbody")), next(element.iterancestors())
        if holder.tag not in ("body", "frame", "worldbody"):
            self._source.refuse(
                element, f"{describe(element)} stands in {describe(holder)}; expected it in a body, a frame or the worldbody"
            )
        joints = tuple(map(self._joint, inside(element, *JOINTS)))
        if any(joint.kind is JointKind.FREE for joint in joints) and (len(joints) > 1 or parent.tag != "worldbody"):
            self._source.refuse(element, f"{describe(element)} has a free joint; expected it alone, in a body right inside the worldbody")
        pose, start = self.attributes.pose(element), ()
        if joints and joints[0].kind is JointKind.FREE:
            # Its position is that of the body in the world.
            pose, start = (), pose
        # Without springs and dampers MuJoCo has no passive force at all.
        acts = self.attributes.acts("spring") or self.attributes.acts("damper")
        compensation = self.attributes.number(element, "gravcomp", 0.0) if acts else Fraction(0)
        place = self._source.place(element)
        body = Body(self.name(element), self.name(parent), pose, joints, None, place, gravity_compensation=compensation, start=start)
        return self.inertias.of_body(element, body)

    def name(self, element: etree._Element) -> str:
        """The name of a body or joint.

        One without a name has such as "(joint 2 of thigh)" or "(body 1 of world)", which stay the same when lines are added.
        """
        if element.tag == "worldbody":
            return WORLD
        if element not in self._names:
            kind, tags = ("body", ("body",)) if element.tag == "body" else ("joint", JOINTS)
            name = str(element.get("name") or "")
            if not name:
                owner = next(element.iterancestors("body", "worldbody"))
                # An included file has a worldbody of its own.
                owners = [owner] if owner.tag == "body" else self._source.root.iterchildren("worldbody")
                beside = [one for each in owners for one in inside(each, *tags)]
                name = f"({kind} {beside.index(element) + 1} of {self.name(owner)})"
            other = self._taken.setdefault(f"{kind} {name}", element)
            if kind == "body" and name == WORLD:
                self._source.refuse(element, f"{describe(element)} has the name of the world itself; give each its own")
            if other is not element:
                line = self._source.place(other).line
                self._source.refuse(element, f"{describe(element)} repeats the name of line {line}; give each its own")
            self._names[element] = name
        return self._names[element]

    def elements_of(self, joints: Sequence[Joint]) -> dict[str, etree._Element]:
        """The elements of joints by their names."""
        names = {joint.name for joint in joints}
        return {name: element for element, name in self._names.items() if element.tag in JOINTS and name in names}

    def _joint(self, element: etree._Element) -> Joint:
        name, place, attributes = self.name(element), self._source.place(element), self.attributes
        written = JointKind.FREE if element.tag == "freejoint" else resolved_text(element, "type", JointKind.HINGE)
        if written not in KINDS:
            self._source.refuse(element, f"{describe(element)} is of type {written!r}; expected one of {', '.join(KINDS)}")
        kind = KINDS[written]
        joint = Joint(
            name,
            kind,
            # Those of a free or ball joint belong to all of its velocities.
            armature=attributes.number(element, "armature", 0.0, not_negative),
            compensated_by_actuators=resolved_text(element, "actuatorgravcomp") == "true",
            damping=attributes.coefficient(element, "damping", "damper"),
            stiffness=attributes.coefficient(element, "stiffness", "spring"),
            friction_loss=attributes.number(element, "frictionloss", 0.0, not_negative),
            friction_softness=attributes.softness(element, "friction"),
            place=place,
        )
        time, ratio = attributes.numbers(element, "springdamper", (0, 0))
        if time or ratio:
            if min(time, ratio) <= 0:
                self._source.refuse(
                    element, f"{describe(element)} has springdamper {float(time):g} {float(ratio):g}; expected two positive numbers"
                )
            if not kind.has_axis:
                self._source.refuse(element, f"{describe(element)} is a {kind} joint with springdamper, which is not read; remove it")
            self.spring_dampers[name] = time, ratio
        if kind is JointKind.FREE:
            return joint
        axis = vector(attributes.numbers(element, "axis", (0, 0, 1), not_zero)) if kind.has_axis else ORIGIN
        reference, spring_reference = (
            attributes.number(element, name, 0.0) if kind.has_axis else Fraction(0) for name in ("ref", "springref")
        )
        return replace(
            joint,
            axis=axis,
            anchor=vector(attributes.numbers(element, "pos", (0, 0, 0))),
            # A joint has no placement of its own.
            pose=attributes.pose(element)[:-1],
            in_degrees=kind is not JointKind.SLIDE and attributes.in_degrees,
            limits=self._limits(element),
            margin=attributes.number(element, "margin", 0.0),
            limit_softness=attributes.softness(element, "limit"),
            reference=reference,
            spring_reference=spring_reference,
        )

    def _limits(self, element: etree._Element) -> tuple[Fraction, Fraction] | None:
        """The range of a joint that is limited."""
        lower, upper = self.attributes.numbers(element, "range", (0, 0))
        return (lower, upper) if self.attributes.is_limited(element) and lower < upper else None


# Included files and replicas.


def _expand(source: Source) -> None:
    """Put included files and replicas into the elements of a file, in place.

    Raises:
        InvalidModel: a file that cannot be read or is included again, more elements than a model needs, or an element that makes
            bodies by the rules of MuJoCo's program.
    """
    put_included(source)
    for element in source.root.iter(*_MAKERS):
        source.refuse(element, f"{describe(element)} makes bodies by the rules of MuJoCo's program, which is not read; write them out")
    # The innermost first, as MuJoCo numbers names.
    for element in reversed(list(source.root.iter("replicate"))):
        _replicate(source, element)


def put_included(source: Source) -> None:
    """Put included files into the elements of a file, in place; raises InvalidModel as of a file that is read."""
    path = source.document.path
    seen = {path.resolve()}
    while (element := next(source.root.iter("include"), None)) is not None:
        name = element.get("file")
        if not name:
            source.refuse(element, "<include> has no file; add its name")
        # Either slash stands between folders, on every system.
        file = path.parent / name.replace("\\", "/")
        if file.resolve() in seen:
            source.refuse(element, f'<include file="{shorten(name)}"> stands for the second time, or in itself; include a file once')
        if len(seen) > MOST_FILES:
            source.refuse(element, f"<include> is file {len(seen)}; expected at most {MOST_FILES}, no robot needs more")
        seen.add(file.resolve())
        try:
            included = source.add(read_any(file, "elements of an MJCF"), included_by=element)
        except InvalidModel as error:
            if error.path == file and error.line is None:
                source.refuse(element, f'<include file="{shorten(name)}">: {file} {error.problem}')
            raise
        _put_in_place(element, list(included.iterchildren("*")))
        _bound(source, source.root)


def _put_in_place(element: etree._Element, parts: list[etree._Element]) -> None:
    parent = element.getparent()
    at = parent.index(element)
    parent.remove(element)
    for number, part in enumerate(parts):
        parent.insert(at + number, part)


def _bound(source: Source, element: etree._Element, further: int = 0) -> None:
    count = further + sum(1 for _ in source.root.iter("*"))
    if count > MAXIMUM_ELEMENTS:
        source.refuse(
            element, f"{describe(element)} makes {count} elements; expected at most {MAXIMUM_ELEMENTS}, for no robot needs that many"
        )


def _replicate(source: Source, element: etree._Element) -> None:
    (count,) = source.read(element, "count", element.get("count", ""), Numbers(check=not_negative))
    if count.denominator != 1 or count > MAXIMUM_ELEMENTS:
        source.refuse(element, f'<replicate count="{shorten(str(element.get("count")))}">: expected a whole number of replicas')
    _bound(source, element, (int(count) - 1) * sum(1 for _ in element.iter("*")))
    separator, width = element.get("sep", ""), len(str(int(count) - 1))
    frames = []
    for number in range(int(count)):
        frame = copy.deepcopy(element)
        source.add_copy(element, frame)
        frame.tag = "frame"
        frame.set(REPEATED, str(number))
        for part in frame.iterdescendants("*"):
            if part.get("name"):
                part.set("name", f"{part.get('name')}{separator}{number:0{width}}")
        frames.append(frame)
    _put_in_place(element, frames)
