"""Elements of a stage that PhysX leaves out of its articulations, or takes otherwise."""

from dataclasses import replace
from fractions import Fraction
from pathlib import Path

from harness.explain.changes.readings import (
    _left_out,
    _stages,
    computed,
    element_at,
    law,
    moving,
    readings_of,
    with_bodies,
    with_inertias,
)
from harness.files.document.stage import UsdDocument
from harness.files.given import Given, vector
from harness.files.joint_kinds import JointKind
from harness.files.kept_document import kept_document
from harness.files.tree import WORLD, Body, Inertia, Joint, Tree
from harness.files.usd import ROOTS
from harness.files.usd.reading import meaning_of_stage
from harness.trees.robot import Robot

_USD = ("usd",)
_NOTHING = Fraction(0)
_FLAG, _NEWTON = "mjc:flag:gravity", "NewtonSceneAPI"
# Of a stage that says none [m]; and what PhysX takes where it finds none.
_UNIT, _DOWN = 0.01, (0.0, 0.0, -9.81)
# Of a sphere of 1 kg with a radius of 0.1 [kg m^2].
_MOMENT = 0.004
_TENDONS = "ovphysx documentation, Articulations: tendons"
_ARTICULATIONS = "ovphysx documentation, Articulations: articulation root"
_BASE_OF_ITS_OWN = "put a base with mass on the world by a PhysicsFixedJoint with PhysicsArticulationRootAPI"


def _hangs(body: Body) -> bool:
    """True for a body that a joint holds on the world."""
    return body.parent == WORLD and not any(joint.kind == JointKind.FREE for joint in body.joints)


def _is_root(body: Body) -> bool:
    element = element_at(body.place)
    return element is not None and not ROOTS.isdisjoint(element.get("schemas", "").split())


@law("joints to the world", "joints", supplied=True)
def _anchored(robot: Robot) -> Tree:
    """The joint by which a tree hangs on the world fixes its base, if that is not made the root itself."""
    return with_bodies(robot.tree, lambda body: replace(body, joints=()) if _hangs(body) and not _is_root(body) else body)


@law("roots on bodies", "bodies", supplied=True)
def _floating(robot: Robot) -> Tree:
    """A body with the root on it floats, whatever joint holds it."""

    def read(body: Body) -> Body:
        base = Joint(f"(base of {body.name})", JointKind.FREE, place=body.place)
        return replace(body, pose=(), joints=(base,)) if _hangs(body) and _is_root(body) else body

    return with_bodies(robot.tree, read)


@law("links without mass", "links", supplied=True)
def _massless(robot: Robot) -> Tree:
    moved = moving(robot.tree)

    def read(body: Body) -> Inertia | None:
        if body.inertia is not None or body.solids or body.name not in moved:
            return body.inertia
        return Inertia((), Fraction(1), (*[computed(_MOMENT, body, "moment of PhysX")] * 3, *[_NOTHING] * 3), body.place)

    return with_inertias(robot.tree, read)


@law("gravity that a flag switches off", "files", supplied=True)
def _heavy(robot: Robot) -> Tree:
    """The gravity of the file without the flag of MuJoCo."""
    if any(robot.tree.gravity):
        return robot.tree
    document = _stage(robot.path)
    prims = [replace(prim, values={name: value for name, value in prim.values.items() if name != _FLAG}) for prim in document.prims]
    return replace(robot.tree, gravity=meaning_of_stage(replace(document, prims=tuple(prims))).tree.gravity)


@law("gravity of scenes of Newton", "files", supplied=True, after=(_heavy.name,))
def _defaulted(robot: Robot) -> Tree:
    """9.81 units of length of the stage [1/s^2] along -z where NewtonSceneAPI is applied to the scene."""
    document = _stage(robot.path)
    scene = next((prim for prim in document.prims if _NEWTON in prim.schemas), None)
    if scene is None:
        return robot.tree
    unit = document.layer["metersPerUnit"].numbers[0] if "metersPerUnit" in document.layer else _UNIT
    place = scene.at("physics:gravityMagnitude")
    gravity = [Given(one * unit, place, "gravity of PhysX", index) for index, one in enumerate(_DOWN)]
    return robot.tree if [*map(float, robot.tree.gravity)] == [*map(float, gravity)] else replace(robot.tree, gravity=vector(gravity))


def _stage(path: Path) -> UsdDocument:
    document = kept_document(path).document
    assert isinstance(document, UsdDocument)
    return document


READINGS = readings_of(
    "physx",
    {
        _USD: {
            _anchored: (
                "PhysX takes the joint between an articulation and the world as the anchor of a fixed base, so the joint does not move",
                _BASE_OF_ITS_OWN,
                f"{_ARTICULATIONS}; Population, PhysicsArticulationRootAPI",
            ),
            _floating: (
                "PhysX lets a body with PhysicsArticulationRootAPI float, and leaves its joint to the world out of the articulation",
                _BASE_OF_ITS_OWN,
                f"{_ARTICULATIONS}; Population, PhysicsArticulationRootAPI",
            ),
            _stages.attributes_of_joints: (
                "PhysX does not read springs, dampers and rotor inertias of joints from attributes in the namespace mjc",
                "write newton:armature and newton:damping; make a spring a drive to its reference",
                "ovphysx documentation, Population, PhysxJointAxisAPI",
            ),
            _left_out.point_springs: ("PhysX reads no tendon of the namespace mjc", _left_out.ADD_POINT_SPRINGS, _TENDONS),
            _left_out.tendon_inertias: ("PhysX reads no tendon of the namespace mjc", _left_out.ADD_TENDON_INERTIAS, _TENDONS),
            _left_out.linear_tendons: ("PhysX reads no tendon of the namespace mjc", _left_out.ADD_TENDONS, _TENDONS),
            _left_out.actuators: (
                "PhysX makes drives of DriveAPI only, whose targets the user sets; they are off here",
                _left_out.DRIVE,
                "ovphysx documentation, Population, PhysicsDriveAPI",
            ),
            _heavy: (
                "PhysX reads no mjc:flag:gravity",
                "set physics:gravityMagnitude = 0",
                "ovphysx documentation, Population, PhysicsScene",
            ),
            _left_out.total_mass: (
                "PhysX reads no mjc:compiler:setTotalMass",
                "write the masses that it gives",
                "ovphysx documentation, Population, PhysicsMassAPI",
            ),
            _massless: (
                "PhysX gives a link without mass and colliders 1 kg and 0.004 kg m^2",
                "write physics:mass and physics:diagonalInertia, as small as the robot bears",
                "ovphysx documentation, Population, PhysicsRigidBodyAPI; PhysX, setMassAndUpdateInertia of a sphere",
            ),
            _stages.gravity_compensation: (
                "PhysX reads no mjc:gravcomp",
                _left_out.CARRY_WEIGHTS,
                "ovphysx documentation, Population, PhysxRigidBodyAPI",
            ),
            _stages.references: (
                "PhysX counts joint positions from where the joint frames coincide, and reads no mjc:ref",
                "add the reference to its positions",
                "ovphysx documentation, Joints",
            ),
        },
    },
) + readings_of(
    "physx",
    {
        _USD: {
            _defaulted: (
                "PhysX takes 9.81 along -z as the gravity of a scene with NewtonSceneAPI if Newton's schemas are registered",
                "leave NewtonSceneAPI out; newton:gravityEnabled works without",
                "ovphysx documentation, Population, PhysicsScene, which says that the authored gravity is taken",
            ),
        },
    },
    is_misread=True,
)
