"""Elements that Newton's importers of MJCF, URDF and USD leave out, correct or take otherwise, and forces that SolverFeatherstone lacks."""

import contextlib
from dataclasses import replace
from fractions import Fraction

import numpy as np
from lxml import etree

from harness.arrays import Array
from harness.errors import InvalidModel
from harness.explain.changes.readings import (
    _left_out,
    _stages,
    computed,
    element_at,
    law,
    matrix_of,
    readings_of,
    with_bodies,
    with_inertias,
    with_joints,
)
from harness.files.document.source import read_any
from harness.files.given import Given, Placement, Vector, vector
from harness.files.joint_kinds import JointKind
from harness.files.reading import EXPECTED
from harness.files.tree import WORLD, Body, Inertia, Joint, Tree
from harness.trees.robot import Robot, robot_in

_MJCF, _URDF, _USD, _ALL = ("mjcf",), ("urdf",), ("usd",), ("mjcf", "urdf", "usd")
_IMPORTER, _URDF_IMPORTER = "Newton 1.8, newton/_src/utils/import_mjcf.py", "Newton 1.8, newton/_src/utils/import_urdf.py"
_USD_IMPORTER = "Newton 1.8, newton/_src/utils/import_usd.py"
_BUILDER = "Newton documentation, ModelBuilder"
_SOLVER = "Newton 1.8, newton/_src/solvers/featherstone/kernels.py, jcalc_tau"
_NOTHING = Fraction(0)
# ModelBuilder.inertia_relative_tolerance, inertia_absolute_tolerance and inertia_correction, and the rounding of a float32.
_RELATIVE, _LEAST, _MORE, _EPSILON = 1e-6, 1e-10, 1e-6, 2.0**-23
_DOWN = (0.0, 0.0, -9.81)
# By which MJCF calls the global defaults that have no other name.
_MAIN, _OF_THE_NAME = "main", "(main)"


@law("gravity", "files", supplied=True)
def _downwards(robot: Robot) -> Tree:
    """9.81 m/s^2 along -z, but where a flag switches gravity off."""
    tree, place = robot.tree, robot.tree.place
    root = element_at(place)
    flags = [] if root is None else [flag.get("gravity") for flag in root.iterfind("option/flag") if flag.get("gravity")]
    if place is None or flags[-1:] == ["disable"] or tuple(map(float, tree.gravity)) == _DOWN:
        return tree
    return replace(tree, gravity=vector([Given(one, place, "gravity of Newton", index) for index, one in enumerate(_DOWN)]))


@law("global defaults", "elements", first=True)
def _named_alone(robot: Robot) -> Tree:
    """Elements without a class have the global defaults only if these have no name, and no element has them by the name "main"."""
    document = read_any(robot.path, EXPECTED)
    root = document.root
    named, called = list(root.iterfind("default[@class]")), [*root.iterfind(f".//*[@class='{_MAIN}']")]
    called += root.iterfind(f".//*[@childclass='{_MAIN}']")
    is_named = any(default.get("class") == _MAIN for default in named)
    for element, attribute in ((element, "class" if element.get("class") == _MAIN else "childclass") for element in called):
        if is_named:
            # The class that an importer of MJCF takes for the global one has another name.
            element.set(attribute, _OF_THE_NAME)
        else:
            del element.attrib[attribute]
    for default in named:
        outer = etree.Element("default")
        root.replace(default, outer)
        outer.append(default)
    if not named and not called:
        return robot.tree
    # Without compiled meshes the rest may be no robot.
    with contextlib.suppress(InvalidModel):
        return replace(robot_in(document).tree, actuators=robot.tree.actuators, force_limits=robot.tree.force_limits)
    return robot.tree


@law("joints in frames", "joints", each=with_bodies)
def _outside_frames(body: Body) -> Body:
    """The joints that stand in the body itself."""
    elements = [(joint, element_at(joint.place)) for joint in body.joints]
    holders = [(joint, None if element is None else element.getparent()) for joint, element in elements]
    return replace(body, joints=tuple(joint for joint, holder in holders if holder is None or holder.tag != "frame"))


@law("several joints of a body", "bodies", after=("frames", "joints in frames"), each=with_bodies)
def _slides_first(body: Body) -> Body:
    """One joint of all, whose slides go before its hinges, in the position of the first."""
    if len(body.joints) < 2:
        return body
    joints = sorted(body.joints, key=lambda joint: joint.kind != JointKind.SLIDE)
    return replace(body, joints=tuple(replace(joint, anchor=body.joints[0].anchor) for joint in joints))


@law("sequence of joints of a body", "bodies")
def _by_name(robot: Robot) -> Tree:
    """One joint of all that a body has: slides first, in the position of the first, by the paths of their prims.

    Those of a body by itself, which is in no articulation for the importer, are in the order of the file.
    """
    carrying = {body.parent for body in robot.tree.bodies}

    def read(body: Body) -> Body:
        if len(body.joints) < 2:
            return body
        is_alone = body.parent == WORLD and body.name not in carrying
        joints = body.joints if is_alone else sorted(body.joints, key=lambda joint: joint.place.tag.split("/") if joint.place else [])
        # The frame of a joint in its body is one placement.
        first = _position(joints[0])
        joints = [joint if _position(joint) == first else _moved(joint, first) for joint in joints]
        return replace(body, joints=tuple(sorted(joints, key=lambda joint: joint.kind != JointKind.SLIDE)))

    return with_bodies(robot.tree, read)


def _position(joint: Joint) -> Vector:
    return next(iter(joint.pose), Placement()).position


def _moved(joint: Joint, position: Vector) -> Joint:
    """A joint whose frame in its body has another origin."""
    return replace(joint, pose=(replace(next(iter(joint.pose), Placement()), position=position), *joint.pose[1:]))


def _raise(moments: Array) -> float:
    """Added to every principal moment of a body with a mass [kg m^2]."""
    first, second, third = np.sort(moments)
    added = 0.0
    if first < (least := max(_RELATIVE * third, _LEAST)):
        added = least - first + _MORE
    lacking = third - first - second - added
    return added + (lacking + _MORE if lacking > max(_EPSILON * (third + added), _LEAST) else 0.0)


@law("least inertias", "links", supplied=True, each=with_inertias)
def _raised(body: Body) -> Inertia | None:
    inertia = body.inertia
    if inertia is None or not inertia.mass > 0:
        return inertia
    added = _raise(np.asarray(np.linalg.eigvalsh(matrix_of(inertia)), dtype=float))
    if not added:
        return inertia
    more = computed(added, body, "moment that Newton adds")
    return replace(inertia, moments=(*(moment + more for moment in inertia.moments[:3]), *inertia.moments[3:]))


@law("inertia without mass", "links", supplied=True, each=with_inertias)
def _massless(body: Body) -> Inertia | None:
    inertia = body.inertia
    is_dropped = inertia is not None and not inertia.mass > 0 and (inertia.mass or any(inertia.moments))
    return replace(inertia, mass=_NOTHING, moments=(_NOTHING,) * 6) if inertia is not None and is_dropped else inertia


@law("dampers and rotors of free joints", "joints", each=with_joints)
def _bare_floats(joint: Joint) -> Joint:
    return replace(joint, damping=_NOTHING, armature=_NOTHING) if joint.kind == JointKind.FREE else joint


READINGS = readings_of(
    "newton",
    {
        _MJCF: {
            _bare_floats: (
                "Newton's importer of MJCF gives a free joint neither damping nor armature",
                _left_out.ADD_DAMPING,
                f"{_IMPORTER}, parse_body: add_joint_free takes neither",
            ),
        },
        _URDF: {
            _left_out.springs: ("Newton's importer of URDF reads no springs", _left_out.ADD_SPRINGS, _URDF_IMPORTER),
            _left_out.rotors: (
                "Newton's importer of URDF reads no rotor inertias",
                "set model.joint_armature to the rotor inertias",
                f"{_URDF_IMPORTER}, which reads no <transmission>",
            ),
            _left_out.point_springs: (
                "Newton's importer of URDF reads no springs between points",
                _left_out.ADD_POINT_SPRINGS,
                _URDF_IMPORTER,
            ),
            _left_out.collision_masses: (
                "Newton's importer of URDF gives a link without <inertial> the mass of its collision geometry at 1000 kg/m^3",
                _left_out.WRITE_INERTIA,
                f"{_URDF_IMPORTER}, parse_shapes: density=default_shape_density",
            ),
        },
        _USD: {
            _stages.attributes_of_joints: (
                "Newton's importer of USD does not read springs, dampers and rotor inertias of joints from attributes in the namespace mjc",
                "write newton:armature and newton:damping, or pass SchemaResolverMjc to add_usd",
                f"{_USD_IMPORTER}: schema_resolvers",
            ),
            _stages.gravity_compensation: (
                "SolverFeatherstone carries no weights: mjc:gravcomp is an attribute of SolverMuJoCo",
                _left_out.CARRY_WEIGHTS,
                "Newton documentation, custom attributes: mujoco:gravcomp",
            ),
            _left_out.point_springs: ("SolverFeatherstone has no tendons", _left_out.ADD_POINT_SPRINGS, _SOLVER),
            _left_out.linear_tendons: ("SolverFeatherstone has no tendons", _left_out.ADD_TENDONS, _SOLVER),
            _left_out.actuators: (
                "Newton makes drives of DriveAPI, whose targets the user sets; they are off here",
                _left_out.DRIVE,
                _USD_IMPORTER,
            ),
            _left_out.total_mass: (
                "Newton's importer of USD reads no mjc:compiler:setTotalMass",
                "write the masses that it gives",
                _USD_IMPORTER,
            ),
            _stages.references: (
                "Newton counts joint positions from where the joint frames coincide, and reads no mjc:ref",
                "add the reference to its positions",
                _USD_IMPORTER,
            ),
        },
        _ALL: {
            _massless: (
                "Newton drops the inertia of a body whose mass is 0 or less; it warns of it",
                "call finalize(skip_validation_inertia=True) on the ModelBuilder",
                "Newton 1.8, newton/_src/geometry/inertia.py, validate_and_correct_inertia_kernel: for zero mass, inertia should be zero",
            ),
            _raised: (
                (
                    "Newton raises the principal moments of a body by more than 1e-6 kg m^2 where one is below 1e-6 of the largest or "
                    "1e-10 kg m^2, or where they violate the triangle inequality; it warns of it"
                ),
                "call finalize(skip_validation_inertia=True) on the ModelBuilder",
                f"{_BUILDER}: inertia_relative_tolerance, inertia_absolute_tolerance, inertia_correction and balance_inertia",
            ),
        },
    },
) + readings_of(
    "newton",
    {
        _USD: {
            _by_name: (
                "Newton merges the joints of a body in the order of their names, slides first, and not in traversal order as "
                "newton:jointsAddMobility says",
                "give the joints of a body names in their order, or bodies of their own",
                "newton-usd-schemas 0.6, NewtonArticulationRootAPI; Newton 1.8, newton/_src/usd/_joints.py, parse_merged_joints",
            ),
        },
        _MJCF: {
            _downwards: (
                "Newton's importer of MJCF takes 9.81 m/s^2 along -z for gravity, whatever <option gravity> says",
                "set ModelBuilder.gravity to the gravity of the file",
                f"{_IMPORTER}, parse_mjcf: of <option> it reads the flag gravity alone",
            ),
            _named_alone: (
                "Newton's importer of MJCF gives global defaults that have a name to no element without a class, and knows none as main",
                "leave the outer <default> without a class, and elements of its class without one",
                f"{_IMPORTER}, parse_default and resolve_class_defaults: __all__; docs/issues/newton-mjcf-global-defaults.md",
            ),
            _outside_frames: (
                "Newton's importer of MJCF passes over joints in a <frame>, and fixes their body to its parent",
                "write the joint into the body itself, with the rotation of the frame in its axis",
                f"{_IMPORTER}, process_frames: bodies, geoms, sites and frames",
            ),
            _slides_first: (
                "Newton's importer of MJCF merges several joints of a body into one: slides before hinges, at the position of the first",
                "give each of these joints a body of its own",
                f"{_IMPORTER}, parse_body: linear_axes, angular_axes and joint_pos[0]",
            ),
            _left_out.total_mass: (
                "Newton's importer of MJCF ignores <compiler settotalmass>",
                "write the scaled masses and inertias into each <inertial>",
                f"{_IMPORTER}, parse_mjcf, which does not read it",
            ),
        },
    },
    is_misread=True,
)

OF_THE_SOLVER = readings_of(
    "newton",
    {
        _MJCF: {
            _left_out.actuators: (
                "Newton makes drives only of position and velocity actuators of joints, whose targets the user sets; they are off here",
                _left_out.DRIVE,
                f"{_IMPORTER}, parse_actuators: JOINT_TARGET; all others are of SolverMuJoCo alone",
            ),
            _left_out.rotors_of_actuators: (
                "Newton's importer of MJCF gives joints neither the armature nor the damping of actuators",
                _left_out.ADD_TO_TARGET,
                f"{_IMPORTER}, parse_actuators, whose custom attributes SolverMuJoCo alone has",
            ),
            _left_out.gravity_compensation: (
                "SolverFeatherstone carries no weights: gravcomp is an attribute of SolverMuJoCo",
                _left_out.CARRY_WEIGHTS,
                "Newton documentation, custom attributes: mujoco:gravcomp",
            ),
            _left_out.point_springs: (
                "SolverFeatherstone has no spatial tendons; SolverMuJoCo has",
                _left_out.ADD_POINT_SPRINGS,
                f"{_IMPORTER}, parse_tendons; {_SOLVER}, which has no such force",
            ),
            _left_out.slack_springs: (
                "SolverFeatherstone has no spatial tendons; SolverMuJoCo has",
                _left_out.ADD_POINT_SPRINGS,
                f"{_IMPORTER}, parse_tendons; {_SOLVER}, which has no such force",
            ),
            _left_out.tendon_inertias: (
                "SolverFeatherstone has no spatial tendons, nor their inertia; SolverMuJoCo has",
                _left_out.ADD_TENDON_INERTIAS,
                f"{_IMPORTER}, parse_tendons; {_SOLVER}, which has no such inertia",
            ),
            _left_out.linear_tendons: (
                "SolverFeatherstone has no tendons on joints; SolverMuJoCo has",
                _left_out.ADD_TENDONS,
                f"{_IMPORTER}, parse_tendons; {_SOLVER}, which has no such force",
            ),
        },
    },
    is_of_program=True,
)
