"""Readings of MuJoCo's reader of URDF: of its own element ``<mujoco>``, and of links; one reading of its MJCF, and MJX's."""

import contextlib
import itertools
from collections.abc import Mapping
from dataclasses import replace
from fractions import Fraction

from harness.explain.changes.readings import (
    _left_out,
    element_at,
    law,
    readings_of,
    with_bodies,
    with_inertias,
    with_joints,
)
from harness.explain.changes.readings._inertial_frames import near_those_of_bodies, near_those_of_links
from harness.files.given import Given, vector
from harness.files.joint_kinds import JointKind
from harness.files.tree import Body, Bounds, Coupling, Inertia, Joint, Spring, Tree
from harness.trees.bodies.inertias import bounded
from harness.trees.robot import Robot

_MJCF, _URDF = ("mjcf",), ("urdf",)
_EXTENSIONS = "MuJoCo documentation, Modeling, URDF extensions, and XML reference"
_URDF_READER = "MuJoCo 4.0, xml/xml_urdf.cc"
_OBJECTS = "MuJoCo 4.0, user/user_objects.cc"
_ONE_EXTENSION = "MuJoCo documentation, Modeling, URDF extensions: its own element <mujoco> is the one extension that is read"
_NOTHING = (Fraction(0),) * 6
# mjMINVAL.
_LEAST = 1e-15


def _settings(robot: Robot, tag: str) -> Mapping[str, list[Given]]:
    """The attributes of that part of a URDF's element ``<mujoco>`` that are numbers; MuJoCo takes one that is not finite for none."""
    place = robot.tree.place
    root = element_at(place)
    found: dict[str, list[Given]] = {}
    if place is None or root is None or (part := root.find(f"mujoco/{tag}")) is None:
        return found
    for name, text in part.attrib.items():
        with contextlib.suppress(ValueError, OverflowError):
            found[str(name)] = [Given(float(word), place, f"mujoco/{tag} {name}", index) for index, word in enumerate(text.split())]
    return found


def _centred(tree: Tree) -> Tree:
    """The tree whose bodies without inertia have their centre of mass at their position in the parent, taken in their own frame."""
    if tree.bounds is None or not (tree.bounds.mass > 0 or tree.bounds.moment > 0):
        return tree
    return with_bodies(tree, _centred_body)


def _centred_body(body: Body) -> Body:
    """An element's own placement stands behind those of the frames around it."""
    is_empty = body.inertia is None and body.is_massless and any(body.pose[-1:])
    return replace(body, inertia=Inertia(body.pose[-1:], Fraction(0), _NOTHING, body.place), solids=()) if is_empty else body


_massless_bodies_centred = law("centre of a massless body", "bodies")(lambda robot: _centred(robot.tree))


@law("least masses and inertias", "links", supplied=True, after=("mass of collision geometry",))
def _bounded_as_settings_say(robot: Robot) -> Tree:
    tree, root = robot.tree, element_at(robot.tree.place)
    settings = _settings(robot, "compiler")
    mass, moment = (next(iter(settings.get(name, ())), Fraction(0)) for name in ("boundmass", "boundinertia"))
    balances = root is not None and root.find("mujoco/compiler[@balanceinertia='true']") is not None
    read = _centred(replace(tree, bounds=Bounds(mass, moment, balances)))
    return tree if bounded(read) == tree else read


@law("damping of joints of several degrees of freedom", "joints", each=with_joints)
def _damped_in_each_velocity(joint: Joint) -> Joint:
    element = element_at(joint.place) if joint.kind in (JointKind.PLANAR, JointKind.FREE) else None
    dynamics = None if element is None else element.find("dynamics")
    damping = 0.0 if dynamics is None else float(dynamics.get("damping", "0"))
    return replace(joint, damping=Given(damping, joint.place, "damping")) if damping and joint.place else joint


@law("gravity", "files", supplied=True)
def _gravity_of_settings(robot: Robot) -> Tree:
    gravity = _settings(robot, "option").get("gravity", ())
    return replace(robot.tree, gravity=vector(gravity)) if len(gravity) == 3 else robot.tree


@law("inertia without mass", "links", supplied=True, after=("least masses and inertias",))
def _without_massless_inertias(robot: Robot) -> Tree:
    def kept(body: Body) -> Inertia | None:
        is_dropped = not body.joints and body.inertia is not None and float(body.inertia.mass) < _LEAST and any(body.inertia.moments)
        return None if is_dropped else body.inertia

    tree = bounded(robot.tree)
    read = with_inertias(tree, kept)
    return robot.tree if read == tree else read


@law("settotalmass", "files", supplied=True, after=("inertia without mass",))
def _scaled_as_settings_say(robot: Robot) -> Tree:
    total = next(iter(_settings(robot, "compiler").get("settotalmass", ())), Fraction(0))
    return replace(robot.tree, total_mass=total) if total > 0 else robot.tree


@law("flags of springs and dampers", "elements", supplied=True)
def _without_passive_forces(robot: Robot) -> Tree:
    """MJX applies no passive force where springs are switched off, nor where dampers are, and carries no weights."""
    root, nothing = element_at(robot.tree.place), Fraction(0)
    flags = [] if root is None else list(root.iterfind("option/flag"))
    if not any(flag.get(name) == "disable" for flag in flags for name in ("spring", "damper")):
        return robot.tree
    tree = with_joints(robot.tree, lambda joint: replace(joint, stiffness=nothing, damping=nothing))
    tree = with_bodies(tree, lambda body: replace(body, gravity_compensation=nothing))
    springs = tuple(replace(one, stiffness=nothing, damping=nothing) for one in tree.springs if one.armature)
    couplings = tuple(replace(one, stiffness=nothing, damping=nothing) for one in tree.couplings if one.armature)
    return replace(tree, springs=springs, couplings=couplings)


@law("inertias of tendons across branches", "tendons")
def _along_branches(robot: Robot) -> Tree:
    tree = robot.tree
    springs = tuple(replace(one, along_branches=bool(one.armature) and _is_across(tree, one)) for one in tree.springs)
    couplings = tuple(replace(one, along_branches=bool(one.armature) and _is_across(tree, one)) for one in tree.couplings)
    return replace(tree, springs=springs, couplings=couplings)


def _is_across(tree: Tree, part: Spring | Coupling) -> bool:
    """True where a tendon is moved by two joints neither of which carries the other."""
    before, carrying = tree.joints_before, {body.name: body for body in tree.bodies}

    def way(joint: str) -> list[str]:
        return [joint, *way(before[joint])] if joint else []

    def last(body: str) -> str:
        own = carrying.get(body)
        return "" if own is None else own.joints[-1].name if own.joints else last(own.parent)

    if isinstance(part, Spring):
        first, second = (set(way(last(body))) for body, _ in part.ends)
        return bool(first - second and second - first)
    ways = [way(name) for name, _ in part.joints]
    return any(one[0] not in other and other[0] not in one for one, other in itertools.combinations(ways, 2))


MUJOCO = readings_of(
    "mujoco",
    {
        _MJCF: {
            _massless_bodies_centred: (
                "MuJoCo puts the mass that boundmass gives a body at the body's position in its parent",
                _left_out.WRITE_INERTIA,
                f"{_OBJECTS}, mjCBody::Compile: where ipos is undefined, the body's pos and quat are copied into it",
            ),
        },
        _URDF: {
            _left_out.collision_masses: (
                "MuJoCo gives a link without <inertial> the mass of its collision geometry, at 1000 kg/m^3",
                _left_out.WRITE_INERTIA,
                'MuJoCo documentation, XML reference, compiler, inertiafromgeom="auto", and geom, density',
            ),
            _bounded_as_settings_say: (
                "MuJoCo bounds masses and inertias by the compiler settings of the file's element <mujoco>, before it fuses links",
                "leave boundmass, boundinertia and balanceinertia out of <mujoco>",
                f"{_EXTENSIONS}, compiler: boundmass, boundinertia, balanceinertia",
            ),
            _without_massless_inertias: (
                "MuJoCo drops the inertia of a link of mass 0 when it fuses the link with its parent",
                'give the link a mass, or set fusestatic="false" in <mujoco><compiler>',
                f"{_OBJECTS}, mjCBody::ToFrame: a fused body's inertia is added where its mass is mjMINVAL or more",
            ),
            _scaled_as_settings_say: (
                "MuJoCo scales all masses by the compiler settings of the file's element <mujoco>",
                "leave settotalmass out of <mujoco>",
                f"{_EXTENSIONS}, compiler: settotalmass",
            ),
            _gravity_of_settings: (
                "MuJoCo takes gravity from the option settings of the file's element <mujoco>",
                "leave gravity out of <mujoco>, or set it in every engine",
                f"{_EXTENSIONS}, option: gravity",
            ),
            _damped_in_each_velocity: (
                "MuJoCo applies the damping of a floating or planar joint to each of its velocities",
                "leave damping out of floating and planar joints",
                f"{_URDF_READER}, mjXURDF::Joint; wiki.ros.org/urdf/XML/joint: damping is for revolute and prismatic joints",
            ),
            _left_out.springs: (
                "MuJoCo's reader of URDF passes over Gazebo's springs of joints",
                "set stiffness and springref of the joint in an MjSpec",
                _ONE_EXTENSION,
            ),
            _left_out.point_springs: (
                "MuJoCo's reader of URDF passes over Drake's springs between points",
                "add each as a tendon in an MjSpec",
                _ONE_EXTENSION,
            ),
            _left_out.rotors: (
                "MuJoCo's reader of URDF passes over Drake's rotor inertias",
                "set armature of the joint in an MjSpec",
                _ONE_EXTENSION,
            ),
            _left_out.ball_joints: (
                "MuJoCo's reader of URDF passes over Drake's ball joint, and fixes the root link to the world",
                "add a ball joint to the root link in an MjSpec",
                _ONE_EXTENSION,
            ),
            _left_out.mimics: (
                "MuJoCo holds a mimic joint by a soft constraint",
                "keep that constraint on, and make its solref stiffer where it gives",
                f"{_EXTENSIONS}, equality/joint",
            ),
        },
    },
)
_NEAR = (
    "MuJoCo replaces the inertial frame of a body by the body's own, or its rotation by that, if they differ by less than 1e-6",
    "write the pose of the inertial as 0, or farther from it than 1e-6",
    "MuJoCo 4.0, user/user_model.cc, CopyTree: body_sameframe, and kFrameEps of IsNullPose",
)
OF_PROGRAM = readings_of(
    "mujoco",
    {
        _MJCF: {
            near_those_of_bodies: _NEAR,
            _along_branches: (
                "MuJoCo leaves the inertia of a tendon out of the entries of M between joints on different branches",
                "keep a tendon with armature on one branch",
                "MuJoCo 4.0, engine/engine_core_smooth.c, mj_tendonArmature: to those entries of M that the tree makes nonzero",
            ),
        },
        _URDF: {near_those_of_links: _NEAR},
    },
    is_misread=True,
    is_of_program=True,
)
MJX = readings_of(
    "mjx",
    {
        _MJCF: {
            _without_passive_forces: (
                "MJX leaves out springs and dampers alike where the file switches off the one or the other",
                "set stiffness or damping to 0 instead of the flag",
                "mujoco/mjx/_src/passive.py, passive; https://github.com/google-deepmind/mujoco/pull/3440",
            ),
            _left_out.rotors_of_actuators: (
                "MJX leaves out the armature and the damping of actuators",
                _left_out.ADD_TO_TARGET,
                "MJX 3.17, mujoco/mjx/_src/smooth.py, crb, and passive.py: of joints and tendons alone",
            ),
        },
    },
    is_misread=True,
)
