"""What Pinocchio's dynamics and its reader of URDF leave out; what its reader of MJCF passes over, and reads otherwise than MuJoCo."""

from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from typing import Any

from harness.explain.changes.readings import (
    _left_out,
    element_at,
    law,
    readings_of,
    with_inertias,
    with_joints,
    with_poses,
    with_solids,
    without_bodies,
)
from harness.files.joint_kinds import JointKind
from harness.files.mjcf.attributes import childclass_of, of_class, resolved, resolved_text
from harness.files.tree import ORIGIN, WORLD, Body, Given, Inertia, Joint, Placement, Solid, Tree, vector
from harness.trees.bodies.inertias import bounded
from harness.trees.robot import Robot

_BOTH, _URDF, _MJCF = ("urdf", "mjcf"), ("urdf",), ("mjcf",)
_NO_FORCE = "and aba.hxx, which has no such force"
_GRAPH, _GEOMS = "Pinocchio 4.1, parsers/mjcf/mjcf-graph.cpp", "Pinocchio 4.1, parsers/mjcf/mjcf-graph-geom.cpp"
_ONE = Fraction(1)
_UPWARD = vector((0, 0, 1))

# pinocchio::Model::gravity981.
_gravity = _left_out.gravity_along_z(-9.81, "Pinocchio")


@law("axis of planar joints", "joints", each=with_joints)
def _in_the_plane_of_the_frame(joint: Joint) -> Joint:
    x, y, z = joint.axis
    return replace(joint, axis=_UPWARD) if joint.kind == JointKind.PLANAR and (x or y or z < 0) else joint


@law("least masses and inertias", "links")
def _raised(robot: Robot) -> Tree:
    """Of full moments the entries of the diagonal, whatever the principal moments are."""
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
            if other is not None and joint.place is not None:
                values = [Given(float(word), joint.place, f"{attribute} of {around}", k) for k, word in enumerate(other.text.split())]
                found[field] = vector(values) if field == "axis" else values[0]
        return replace(joint, **found)

    return read


_with_class_around = law("class beside a childclass", "joints", each=with_joints)(_from_childclass({"axis": "axis", "ref": "reference"}))
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


_unscaled = law("settotalmass", "files")(lambda robot: replace(robot.tree, total_mass=None))


@law("further trees", "bodies")
def _of_the_first_tree(robot: Robot) -> Tree:
    return without_bodies(robot.tree, [body.name for body in robot.tree.bodies if body.parent == WORLD][1:])


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
        _BOTH: {
            _gravity: (
                "Pinocchio takes 9.81 m/s^2 along -z for gravity, whatever the file says",
                "set model.gravity.linear to the gravity of the file",
                "Pinocchio 4.1, multibody/model.hpp, gravity981; its MJCF reader reads no <option gravity>",
            ),
            _left_out.dampers: (
                "Pinocchio's ABA applies no joint damping",
                _left_out.ADD_DAMPING,
                "stack-of-tasks/pinocchio issues 1291 and 1147: damping and friction are the user's, in tau; Model.damping is data only",
            ),
            _left_out.springs: (
                "Pinocchio applies no springs",
                _left_out.ADD_SPRINGS,
                f"Pinocchio 4.1, parsers/mjcf/mjcf-graph.cpp, which does not read stiffness, {_NO_FORCE}",
            ),
            _left_out.point_springs: (
                "Pinocchio has no springs between points, and no tendons",
                _left_out.ADD_POINT_SPRINGS,
                f"Pinocchio 4.1, parsers/mjcf/mjcf-graph.cpp, which reads no <tendon>, {_NO_FORCE}",
            ),
        },
        _URDF: {
            _in_the_plane_of_the_frame: (
                "Pinocchio moves a planar joint in the xy plane of the joint's frame, whatever axis the file gives it",
                "turn the joint's origin so that its z is the axis",
                "Pinocchio 4.1, multibody/joint/joint-planar.hpp, without axis; parsers/urdf/model.cpp: planar, with normal axis along Z",
            ),
            _left_out.rotors: (
                "Pinocchio's reader of URDF reads no rotor inertias",
                "set model.armature to the rotor inertias",
                "Pinocchio 4.1, parsers/urdf/model.cpp, which reads no <transmission>",
            ),
            _left_out.ball_joints: (
                "Pinocchio's reader of URDF passes over Drake's ball joint, and fixes the root link to the world",
                "build the model with pin.JointModelSpherical() as its root joint",
                "Pinocchio 4.1, parsers/urdf/model.cpp, which reads the joints of URDF alone",
            ),
            _left_out.mimics: (
                "Pinocchio's URDF reader takes a joint that mimics another for one that moves by itself",
                "build the model with mimic=True, and solve with pin.crba and pin.nonLinearEffects",
                "Pinocchio 4.1, parsers/urdf.hpp, buildModel: mimic is false unless the caller asks; aba refuses models with mimic joints",
            ),
        },
        _MJCF: {
            _left_out.linear_tendons: (
                "Pinocchio has no tendons on joints",
                _left_out.ADD_TENDONS,
                f"Pinocchio 4.1, parsers/mjcf/mjcf-graph.cpp, which reads no <tendon>, {_NO_FORCE}",
            ),
            _raised: (
                (
                    "Pinocchio's MJCF reader takes boundmass and boundinertia of <compiler> for the numbers of an <inertial> alone, "
                    "and passes over balanceinertia"
                ),
                "write the bounded masses and inertias into each <inertial>",
                f"{_GRAPH}, convertInertiaFromMjcf and parseCompiler",
            ),
            _without_anchors_of_classes: (
                "Pinocchio's MJCF reader passes over a joint's pos from a default class, and puts the joint into the body's origin",
                "write pos on the joint itself",
                f"{_GRAPH}, MjcfJoint::fill: only the joint's own attribute pos is read",
            ),
            _with_class_around: (
                "Pinocchio's MJCF reader gives a joint with a class of its own what the childclass around it says besides",
                "write axis and ref on the joint itself",
                f"{_GRAPH}, MjcfJoint::fill: default < ChildClass < Class < Real Joint",
            ),
            _with_rotor_around: (
                "Pinocchio's MJCF reader gives a joint with a class of its own the armature of the childclass around it, if it has none",
                "write armature on the joint itself",
                f"{_GRAPH}, MjcfJoint::fill: default < ChildClass < Class < Real Joint",
            ),
            _turned_about_moving_axes: (
                "Pinocchio's MJCF reader takes the capital letters of eulerseq, which turn about axes that stay, for small ones",
                "write these turns as quat",
                f"{_GRAPH}, MjcfCompiler::convertEuler, which multiplies the three turns in their order",
            ),
            _without_masses_of_classes: (
                "Pinocchio's MJCF reader passes over a geom's mass from a default class, and takes its density",
                "write mass on the geom itself",
                f"{_GEOMS}: only the geom's own attribute mass is read",
            ),
            _of_the_first_tree: (
                "Pinocchio's MJCF reader reads the first body in <worldbody> with what it carries, and passes over the others",
                "put all trees under one body without joint and pose",
                f"{_GRAPH}, parseGraph: get_child(worldbody).get_child(body), of which there is one",
            ),
            _left_out.frames: (
                "Pinocchio's MJCF reader passes over <frame> and <replicate> with all that they hold",
                _left_out.WRITE_OUT_FRAMES,
                f"{_GRAPH}, parseJointAndBody, which knows neither element",
            ),
            _with_unit_meshes: (
                "Pinocchio's MJCF reader computes no inertia of a mesh, and gives the geom 1 kg and moments of 1 kg m^2 in its position",
                _left_out.WRITE_INERTIA,
                f"{_GEOMS}, MjcfGeom::computeInertia leaves a mesh Inertia::Identity()",
            ),
            _unscaled: (
                "Pinocchio's MJCF reader passes over <compiler settotalmass>",
                "write the scaled masses and inertias into each <inertial>",
                f"{_GRAPH}, parseCompiler, which does not read it",
            ),
            _without_pictures: (
                'Pinocchio\'s MJCF reader gives a geom with contype="0" and conaffinity="0" no mass, as to a picture',
                _left_out.WRITE_INERTIA,
                f"{_GEOMS}: such a geom is VISUAL, and its inertia is not computed",
            ),
        },
    },
)
