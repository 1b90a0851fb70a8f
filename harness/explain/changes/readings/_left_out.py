"""Laws that several engines have: elements that an engine leaves out, and what it takes where nothing stands in a file."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction

from lxml import etree

from harness.explain.changes.readings import Law, element_at, freed, law, moving, with_bodies, with_inertias, with_joints, without_bodies
from harness.files.given import Given, Placement, Turn, vector
from harness.files.joint_kinds import JointKind
from harness.files.tree import Body, Inertia, Joint, Solid, Tree
from harness.trees.robot import Robot

# Remedies of several engines.
ADD_DAMPING, ADD_SPRINGS, ADD_POINT_SPRINGS = "add -d v to tau", "add -k (q - q0) to tau", "add J' f of each spring to tau"
ADD_TURNING_SPRINGS = "add -k times the position, and the rotation vector, from where they are relaxed to tau"
ADD_TENDON_INERTIAS = "add armature J'J of the tendon's length to M, and armature J' (dJ/dt v) to the bias"
ADD_TENDONS = "add coef times the force of the tendon to tau of each of its joints"
ADD_ROTORS = "add the rotor inertias to the diagonal of M, and solve with that"
ADD_TO_TARGET = "give gear^2 times both to the joint or tendon that the actuator drives"
DRIVE = "add J' f of each actuator to tau, f its force at the control"
CARRY_WEIGHTS = "add J' f to tau for each of these bodies, f its share of the weight, upwards in its centre"
LEAD = "reduce M and the bias h to the joints that are mimicked, G' M G and G' h, and solve these"
WRITE_INERTIA, POSSIBLE = "write an <inertial> into each of them", "write inertias that a body can have"
WRITE_OUT_FRAMES = "write out what they hold, each element with its own pose"

_ONE, _NOTHING = Fraction(1), Fraction(0)
# Of geometry by default: that of water [kg/m^3].
_DENSITY = Fraction(1000)
# Shape to the attributes that give its size, each halved or not, in the order of ``Solid``.
_SHAPES = {"sphere": (("radius", 1),), "cylinder": (("radius", 1), ("length", 2)), "box": (("size", 2),)}
_AXES = (vector((1, 0, 0)), vector((0, 1, 0)), vector((0, 0, 1)))


dampers = law("joint damping", "joints", supplied=True, each=with_joints)(lambda joint: replace(joint, damping=_NOTHING))
springs = law("springs", "joints", supplied=True, each=with_joints)(
    lambda joint: replace(joint, stiffness=_NOTHING) if joint.kind.has_axis else joint
)
springs_without_axis = law("springs of joints without axis", "joints", each=with_joints)(
    lambda joint: joint if joint.kind.has_axis else replace(joint, stiffness=_NOTHING)
)
rotors = law("rotor inertias", "joints", supplied=True, each=with_joints)(lambda joint: replace(joint, armature=_NOTHING))
mimics = law("mimic joints", "joints", supplied=True, each=with_joints)(freed)
point_springs = law("tendons", "tendons", supplied=True)(
    lambda robot: replace(robot.tree, springs=tuple(one for one in robot.tree.springs if not one.is_plain))
)
slack_springs = law("slack tendons", "tendons")(
    lambda robot: replace(robot.tree, springs=tuple(one for one in robot.tree.springs if one.slack_to is None))
)
tendon_inertias = law("tendons with armature", "tendons")(
    lambda robot: replace(robot.tree, springs=tuple(one for one in robot.tree.springs if not one.armature))
)
gravity_compensation = law("gravity compensation", "bodies", each=with_bodies)(lambda body: replace(body, gravity_compensation=_NOTHING))
actuators = law("actuators", "actuators")(lambda robot: replace(robot.tree, actuators=(), force_limits=()))

total_mass = law("settotalmass", "files")(lambda robot: replace(robot.tree, total_mass=None))


@law("tendons on joints", "tendons")
def linear_tendons(robot: Robot) -> Tree:
    return replace(robot.tree, couplings=tuple(one for one in robot.tree.couplings if one.of_actuator))


@law("armature and damping of actuators", "actuators")
def rotors_of_actuators(robot: Robot) -> Tree:
    return replace(robot.tree, couplings=tuple(one for one in robot.tree.couplings if not one.of_actuator))


@law("ball joint", "joints", supplied=True, each=with_bodies)
def ball_joints(body: Body) -> Body:
    return replace(body, joints=tuple(joint for joint in body.joints if joint.kind != JointKind.BALL))


def _is_framed(part: Body | Joint | Solid) -> bool:
    """True for what stands in frames or replicas, whose placements come before an element's own, which a joint does not have.

    The first of several replicas has none, and a body with a free joint no pose.
    """
    element = element_at(part.place)
    holder = None if element is None else element.getparent()
    return len(part.pose) > (not isinstance(part, Joint)) or (holder is not None and holder.tag in ("frame", "replicate"))


@law("frames", "elements")
def frames(robot: Robot) -> Tree:
    def read(body: Body) -> Body:
        joints = tuple(joint for joint in body.joints if not _is_framed(joint))
        return replace(body, joints=joints, solids=tuple(solid for solid in body.solids if not _is_framed(solid)))

    return with_bodies(without_bodies(robot.tree, [body.name for body in robot.tree.bodies if _is_framed(body)]), read)


@law("links without inertia", "links", supplied=True)
def unit_inertias(robot: Robot) -> Tree:
    """1 kg and moments of 1 kg m^2 about the origin of each moving body to which the file gives no inertia."""
    moved = moving(robot.tree)

    def read(body: Body) -> Inertia | None:
        if body.inertia is not None or body.name not in moved:
            return body.inertia
        return Inertia((), _ONE, (_ONE,) * 3 + (_NOTHING,) * 3, body.place)

    return with_inertias(robot.tree, read)


def gravity_along_z(value: float, whose: str) -> Law:
    """An engine takes this gravity [m/s^2] along z, whatever the file says; a decimal that it rounds, as the file's own is."""

    @law("gravity", "files", supplied=True)
    def tree(robot: Robot) -> Tree:
        place = robot.tree.place
        return replace(robot.tree, gravity=vector((0, 0, Fraction(value) if place is None else Given(value, place, f"gravity of {whose}"))))

    return tree


@law("mass of collision geometry", "links", supplied=True, each=with_bodies)
def collision_masses(body: Body) -> Body:
    """A link without inertia weighs what its collision geometry does, as if of water."""
    link = element_at(body.place) if body.inertia is None else None
    solids = () if link is None else tuple(solid for one in link.iterfind("collision") for solid in _solids(one, body))
    return replace(body, solids=solids) if solids else body


def _solids(collision: etree._Element, body: Body) -> Iterator[Solid]:
    origin = collision.find("origin")
    position, angles = (_numbers(origin, name) for name in ("xyz", "rpy"))
    # Roll, pitch and yaw are about axes that stay.
    turns = tuple(Turn(axis, angle) for axis, angle in reversed(list(zip(_AXES, angles, strict=True))) if angle)
    for shape in collision.iterfind("geometry/*"):
        if shape.tag in _SHAPES:
            size = [value / share for name, share in _SHAPES[shape.tag] for value in _numbers(shape, name)]
            yield Solid(shape.tag, tuple(size), (Placement(vector(position), turns),), None, _DENSITY, place=body.place)


def _numbers(element: etree._Element | None, name: str) -> list[Fraction]:
    text = "0 0 0" if element is None else element.get(name, "0 0 0")
    return [Fraction(float(word)) for word in text.split()]
