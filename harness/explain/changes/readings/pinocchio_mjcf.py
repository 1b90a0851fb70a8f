"""Elements that Pinocchio's reader of MJCF passes over without a word, or reads otherwise than the format's documentation says.

Each law is the behaviour of the reader's source, and ``tests/explain/test_pinocchio_mjcf.py`` holds it against the installed version.
"""

import contextlib
import math
from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from itertools import zip_longest
from typing import Any

from lxml import etree

from harness.errors import InvalidModel
from harness.explain.changes.readings import (
    _left_out,
    element_at,
    law,
    readings_of,
    with_bodies,
    with_inertias,
    with_joints,
    with_poses,
    with_solids,
    without_bodies,
)
from harness.files.document.source import read_any
from harness.files.given import ORIGIN, Given, Placement, vector
from harness.files.joint_kinds import JointKind
from harness.files.mjcf.attributes import KINDS, ORIENTATIONS, childclass_of, of_class, resolved, resolved_text
from harness.files.reading import EXPECTED
from harness.files.tree import WORLD, Body, Inertia, Joint, Solid, Tree
from harness.trees.bodies.inertias import bounded
from harness.trees.robot import Robot, robot_in

_GRAPH, _GEOMS = "Pinocchio 4.1, parsers/mjcf/mjcf-graph.cpp", "Pinocchio 4.1, parsers/mjcf/mjcf-graph-geom.cpp"
_ONE = Fraction(1)
_SECTIONS = f"{_GRAPH}, parseGraph: get_child, which gives the first, in the order of the file; no element include"
# Of joints, which no algorithm applies.
_FORCES = ("damping", "stiffness", "spring_reference")


def _of_first_sections(robot: Robot) -> Tree:
    """Without what is included, and without each <compiler> and <default> but the first, and those behind <worldbody>."""
    document = read_any(robot.path, EXPECTED)
    if _pass_over_sections(document.root):
        # Without compiled meshes, or without names that are used elsewhere, the rest is no robot.
        with contextlib.suppress(InvalidModel):
            return replace(robot_in(document).tree, actuators=robot.tree.actuators, force_limits=robot.tree.force_limits)
    return robot.tree


def _with(robot: Robot, read: Tree, *numbers: str) -> Tree:
    """The tree that was read, but for these numbers of its joints, which are those of the robot."""
    own = {joint.name: joint for joint in robot.tree.joints}
    return with_joints(
        read, lambda joint: replace(joint, **{name: getattr(own[joint.name], name) for name in numbers}) if joint.name in own else joint
    )


@law("sections that are read once", "elements", first=True)
def _first_sections(robot: Robot) -> Tree:
    return _with(robot, _of_first_sections(robot), "armature", *_FORCES)


@law("rotor inertias of sections that are not read", "joints", supplied=True, first=True)
def _rotors_of_first_sections(robot: Robot) -> Tree:
    read = {joint.name: joint.armature for joint in _of_first_sections(robot).joints}
    return with_joints(robot.tree, lambda joint: replace(joint, armature=read.get(joint.name, joint.armature)))


def _pass_over_sections(root: etree._Element) -> bool:
    """Change the elements so that they say what is read of them, each in its place; True where anything is passed over."""
    gone = [*root.iter("include")]
    for element in gone:
        element.tag = "custom"
    worlds = [*root.iterchildren("worldbody")]
    for tag in ("compiler", "default"):
        late = worlds[0].itersiblings(tag) if worlds else ()
        for section in dict.fromkeys([*root.findall(tag)[1:], *late]):
            gone.append(section)
            for element in section.iter("*"):
                element.attrib.clear()
                element.tag = "custom"
    return bool(gone)


@law("bodies without attributes", "bodies", after=("frames", "further trees"))
def _without_bare_bodies(robot: Robot) -> Tree:
    """The bodies that such a body carries hang on the world, in the pose that they have in that body."""
    elements = {body.name: element_at(body.place) for body in robot.tree.bodies}
    bare = {name for name, element in elements.items() if element is not None and not element.attrib}
    joints = {joint.name for body in robot.tree.bodies if body.name in bare for joint in body.joints}
    kept = (body for body in robot.tree.bodies if body.name not in bare)
    return replace(
        robot.tree,
        bodies=tuple(replace(body, parent=WORLD) if body.parent in bare else body for body in kept),
        springs=tuple(spring for spring in robot.tree.springs if not bare & {end for end, _ in spring.ends}),
        couplings=tuple(one for one in robot.tree.couplings if not joints & {name for name, _ in one.joints}),
    )


@law("bodies without names", "bodies", after=("bodies without attributes", "frames", "further trees", "pose of a body fixed to the world"))
def _of_the_first_of_a_name(robot: Robot) -> Tree:
    """Such a body is called after its parent, and of several that get one name each is read as the first, which carries what all carry.

    Masses are added to that one alone, so that joints of the others move nothing.
    """
    tree, names, first = robot.tree, {WORLD: ""}, dict[str, Body]()
    for body in tree.bodies:
        names[body.name] = f"{names[body.parent]}Bis" if body.is_unnamed else body.name
        first.setdefault(names[body.name], body)

    def read(body: Body) -> Body:
        like = first[names[body.name]]
        parent = body.parent if body.parent == WORLD else first[names[body.parent]].name
        if like is body:
            return replace(body, parent=parent)
        named = zip_longest(like.joints, body.joints[: len(like.joints)])
        joints = (replace(one, name=own.name if own else f"{one.name} in {body.name}", armature=Fraction(0)) for one, own in named)
        return replace(body, parent=parent, pose=like.pose, joints=tuple(joints), inertia=None, solids=())

    return tree if len(first) == len(tree.bodies) else with_bodies(tree, read)


@law("pose of a body fixed to the world", "bodies", after=("bodies without attributes", "further trees"))
def _with_root_in_the_origin(robot: Robot) -> Tree:
    root = next((body for body in robot.tree.bodies if body.parent == WORLD), None)
    if root is None or root.joints:
        return robot.tree
    return with_bodies(robot.tree, lambda body: replace(body, pose=()) if body.name == root.name else body)


@law("reference of the first of several joints", "joints", each=with_bodies)
def _without_first_references(body: Body) -> Body:
    if len(body.joints) < 2 or not body.joints[0].reference:
        return body
    return replace(body, joints=(replace(body.joints[0], reference=Fraction(0)), *body.joints[1:]))


@law("reference of a slide from a default class", "joints", after=("reference of the first of several joints",), each=with_joints)
def _with_reference_in_degrees(joint: Joint) -> Joint:
    """The class is read before the joint's own type, and until then the joint is a hinge."""
    element = element_at(joint.place) if joint.kind == JointKind.SLIDE and joint.place else None
    is_of_class = isinstance(joint.reference, Given) and joint.reference.place != joint.place
    if element is None or not is_of_class or "type" not in element.attrib:
        return joint
    compilers = element.getroottree().getroot().iterchildren("compiler")
    in_degrees = next((one.get("angle") for one in compilers), None) != "radian"
    return replace(joint, reference=joint.reference * Fraction(math.pi) / 180) if in_degrees else joint


@law("least masses and inertias", "links")
def _raised(robot: Robot) -> Tree:
    """The entries of the diagonal are raised of full moments, whatever the principal moments are."""
    tree, bounds = robot.tree, robot.tree.bounds
    if bounds is None:
        return tree

    def read(body: Body) -> Inertia | None:
        if body.inertia is None:
            return None
        moments = (*(max(moment, bounds.moment) for moment in body.inertia.moments[:3]), *body.inertia.moments[3:])
        return replace(body.inertia, mass=max(body.inertia.mass, bounds.mass), moments=moments)

    raised = replace(with_inertias(tree, read), bounds=None)
    return tree if raised == bounded(tree) else raised


@law("position of a default class", "joints", each=with_joints)
def _without_anchors_of_classes(joint: Joint) -> Joint:
    is_of_class = any(isinstance(number, Given) and number.place != joint.place for number in joint.anchor)
    return replace(joint, anchor=ORIGIN) if is_of_class else joint


def _from_childclass(numbers: dict[str, str]) -> Callable[[Joint], Joint]:
    """A joint with a class of its own takes what that leaves open from the childclass around it.

    ``numbers``: the fields of a joint by their attributes.
    """

    def read(joint: Joint) -> Joint:
        element = element_at(joint.place)
        around = None if element is None or not element.get("class") else childclass_of(element)
        found: dict[str, Any] = {}
        for attribute, field in numbers.items() if around else ():
            other = None if resolved(element, attribute) else of_class(element, str(around), attribute)
            if other is not None and attribute == "type":
                found[field] = KINDS[other.text]
            elif other is not None and joint.place is not None:
                values = [Given(float(word), joint.place, f"{attribute} of {around}", k) for k, word in enumerate(other.text.split())]
                found[field] = vector(values) if field == "axis" else values[0]
        return replace(joint, **found)

    return read


_with_class_around = law("class beside a childclass", "joints", each=with_joints)(
    _from_childclass({"axis": "axis", "ref": "reference", "type": "kind"})
)
_with_rotor_around = law("rotor inertia beside a childclass", "joints", supplied=True, each=with_joints)(
    _from_childclass({"armature": "armature"})
)


@law("Euler angles about fixed axes", "elements", after=("frames",))
def _turned_about_moving_axes(robot: Robot) -> Tree:
    """Three turns in the order of ``eulerseq``, those about axes that stay too."""
    root = element_at(robot.tree.place)
    sequences = [] if root is None else [one.get("eulerseq") for one in root.iterchildren("compiler") if one.get("eulerseq")]
    if not sequences or sequences[-1].islower():
        return robot.tree
    order: list[int] = []
    for number, letter in enumerate(sequences[-1]):
        order = [*order, number] if letter.islower() else [number, *order]

    def read(placement: Placement) -> Placement:
        if len(placement.rotation) != len(order):
            return placement
        return replace(placement, rotation=tuple(placement.rotation[order.index(number)] for number in range(len(order))))

    return with_poses(robot.tree, lambda pose: tuple(map(read, pose)))


@law("mass of a default class", "geoms", each=with_solids)
def _without_masses_of_classes(solid: Solid) -> Solid:
    is_of_class = isinstance(solid.mass, Given) and solid.mass.place != solid.place
    return replace(solid, mass=None) if is_of_class else solid


@law("pose of a default class", "geoms", each=with_solids)
def _without_poses_of_classes(solid: Solid) -> Solid:
    """Ends of a class are read; of a mesh nobody here knows where it would be otherwise."""
    element = element_at(solid.place)
    if element is None or solid.ends is not None or solid.kind == "mesh":
        return solid
    *around, own = solid.pose
    if "pos" not in element.attrib:
        own = replace(own, position=ORIGIN)
    if not any(name in element.attrib for name in ORIENTATIONS):
        own = replace(own, rotation=())
    return replace(solid, pose=(*around, own))


@law("further trees", "bodies")
def _of_the_first_tree(robot: Robot) -> Tree:
    return without_bodies(robot.tree, [body.name for body in robot.tree.bodies if body.parent == WORLD][1:])


@law("further worlds", "bodies", after=("bodies without names", "further trees", "pose of a body fixed to the world"))
def _with_the_first_world_again(robot: Robot) -> Tree:
    """For each further <worldbody> the bodies of the first one once more, each on its parent there, as its name is that of the first.

    A body that moves has all its masses in the first, so that joints of the others move nothing.
    """
    # The file itself: worlds that it includes are not read.
    times = len(read_any(robot.path, EXPECTED).root.findall("worldbody"))
    moving = [body for body in robot.tree.bodies if body.joints]
    if times < 2 or not moving:
        return robot.tree

    def heavy(body: Body) -> Body:
        inertia = body.inertia
        if inertia is not None:
            inertia = replace(inertia, mass=inertia.mass * times, moments=tuple(moment * times for moment in inertia.moments))
        return replace(body, inertia=inertia, solids=body.solids * times) if body.joints else body

    def again(body: Body, name: str) -> Body:
        joints = (replace(joint, name=f"{joint.name} ({name})", armature=Fraction(0)) for joint in body.joints)
        return replace(body, name=f"{body.name} ({name})", joints=tuple(joints), inertia=None, solids=())

    copies = (again(body, f"world {number}") for number in range(2, times + 1) for body in moving)
    return replace(robot.tree, bodies=(*map(heavy, robot.tree.bodies), *copies))


@law("inertia of meshes", "geoms", after=("geoms that cannot collide", "frames"), each=with_solids)
def _with_unit_meshes(solid: Solid) -> Solid:
    """In the geom's own position, wherever the centre of the mesh is; a box that has its size from a mesh is a box."""
    geom = element_at(solid.place) if solid.kind == "mesh" else None
    if geom is None or resolved_text(geom, "type", "mesh") != "mesh":
        return solid
    position = vector([float(word) for word in resolved_text(geom, "pos", "0 0 0").split()])
    return replace(solid, pose=(Placement(position),), mass=_ONE, density=_ONE, moments=(_ONE,) * 3)


@law("geoms that cannot collide", "geoms", each=with_solids)
def _without_pictures(solid: Solid) -> Solid | None:
    geom = element_at(solid.place)
    collides = geom is None or any(resolved_text(geom, name, "1") != "0" for name in ("contype", "conaffinity"))
    return solid if collides else None


READINGS = readings_of(
    "pinocchio",
    {
        ("mjcf",): {
            _first_sections: (
                "Pinocchio's MJCF reader reads only the first <compiler> and the first <default>, if they are before <worldbody>, "
                "and no <include>",
                "write one <compiler> and one <default> before <worldbody>, and no <include>",
                _SECTIONS,
            ),
            _rotors_of_first_sections: (
                "Pinocchio's MJCF reader reads rotor inertias only from the first <default>, if it is before <worldbody>, and from "
                "no <include>",
                "write armature on the joint itself",
                _SECTIONS,
            ),
            _without_bare_bodies: (
                "Pinocchio's MJCF reader drops a body without any attribute, and attaches its children to the world",
                "give the body a name",
                f"{_GRAPH}, parseJointAndBody: names and lists a body where it meets its attributes",
            ),
            _with_root_in_the_origin: (
                "Pinocchio's MJCF reader ignores the pose of a body that is fixed to the world, and puts it at the world's origin",
                "put the pose on the body's children",
                f"{_GRAPH}, parseRootTree: addRootJoint, which takes no placement",
            ),
            _without_first_references: (
                "Pinocchio's MJCF reader ignores the ref of the first of several joints of a body",
                "give the first joint a body of its own",
                f"{_GRAPH}, fillModel: the first joint of a composite has the identity for its placement",
            ),
            _with_reference_in_degrees: (
                "Pinocchio's MJCF reader takes the ref of a slide, in metres, as an angle if it comes from a default class",
                "write ref on the joint itself",
                f"{_GRAPH}, MjcfJoint::fill: the classes go before the joint's own type, which is hinge until then",
            ),
            _raised: (
                (
                    "Pinocchio's MJCF reader applies boundmass and boundinertia of <compiler> only to the numbers of an <inertial>, and "
                    "ignores balanceinertia"
                ),
                "write the bounded masses and inertias into each <inertial>",
                f"{_GRAPH}, convertInertiaFromMjcf and parseCompiler",
            ),
            _without_anchors_of_classes: (
                "Pinocchio's MJCF reader ignores a joint's pos from a default class, and puts the joint at the body's origin",
                "write pos on the joint itself",
                f"{_GRAPH}, MjcfJoint::fill: only the joint's own attribute pos is read",
            ),
            _with_class_around: (
                "Pinocchio's MJCF reader also applies the childclass around a joint that has a class of its own",
                "write type, axis and ref on the joint itself",
                f"{_GRAPH}, MjcfJoint::fill: default < ChildClass < Class < Real Joint",
            ),
            _with_rotor_around: (
                "Pinocchio's MJCF reader gives a joint with a class of its own the armature of the childclass around it, if it has none",
                "write armature on the joint itself",
                f"{_GRAPH}, MjcfJoint::fill: default < ChildClass < Class < Real Joint",
            ),
            _turned_about_moving_axes: (
                "Pinocchio's MJCF reader takes the capital letters of eulerseq, for rotations about fixed axes, as small letters",
                "write these rotations as quat",
                f"{_GRAPH}, MjcfCompiler::convertEuler, which multiplies the three turns in their order",
            ),
            _without_masses_of_classes: (
                "Pinocchio's MJCF reader ignores a geom's mass from a default class, and uses its density",
                "write mass on the geom itself",
                f"{_GEOMS}: only the geom's own attribute mass is read",
            ),
            _without_poses_of_classes: (
                "Pinocchio's MJCF reader ignores a geom's position and orientation from a default class",
                "write pos, and quat or the like, on the geom itself",
                f"{_GEOMS}: the pose is that of the geom's own attributes; size, type and fromto of a class are read",
            ),
            _of_the_first_tree: (
                "Pinocchio's MJCF reader reads only the first body in <worldbody>, with its children",
                "put all trees under one body without joint and pose",
                f"{_GRAPH}, parseGraph: get_child(worldbody).get_child(body), of which there is one",
            ),
            _with_the_first_world_again: (
                "Pinocchio's MJCF reader reads the first <worldbody> again for each further one, with joints that carry no mass",
                "write one <worldbody>",
                f"{_GRAPH}, parseGraph: get_child(worldbody), the first, for each; frames of one name are one, that of the first",
            ),
            _left_out.frames: (
                "Pinocchio's MJCF reader ignores <frame> and <replicate> with all their contents",
                _left_out.WRITE_OUT_FRAMES,
                f"{_GRAPH}, parseJointAndBody, which knows neither element",
            ),
            _with_unit_meshes: (
                "Pinocchio's MJCF reader does not compute the inertia of a mesh, and gives the geom 1 kg and moments of 1 kg m^2 at "
                "its position",
                _left_out.WRITE_INERTIA,
                f"{_GEOMS}, MjcfGeom::computeInertia leaves a mesh Inertia::Identity()",
            ),
            _of_the_first_of_a_name: (
                "Pinocchio's MJCF reader names a nameless body after its parent, and takes the first of several such bodies for all "
                "of them",
                "give each body a name of its own",
                f"{_GRAPH}, parseJointAndBody: bodyName = parentName + Bis; mapOfBodies.insert, which keeps the first",
            ),
            _left_out.total_mass: (
                "Pinocchio's MJCF reader ignores <compiler settotalmass>",
                "write the scaled masses and inertias into each <inertial>",
                f"{_GRAPH}, parseCompiler, which does not read it",
            ),
            _without_pictures: (
                'Pinocchio\'s MJCF reader gives no mass to a geom with contype="0" and conaffinity="0", as if it were only visual',
                _left_out.WRITE_INERTIA,
                f"{_GEOMS}: such a geom is VISUAL, and its inertia is not computed",
            ),
        },
    },
    is_misread=True,
)
