"""A robot as its file states it: bodies in a tree, joints between them, springs and actuators, with the numbers of the file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from fractions import Fraction

from harness.files.equalities import BY_DEFAULT, BoundTendon, SolverParameters
from harness.files.given import ORIGIN, Given, Place, Placed, Pose, Vector
from harness.files.joint_kinds import JointKind

WORLD = "world"


@dataclass(frozen=True)
class Joint(Placed):
    """One joint of a body.

    Attributes:
        axis, anchor: in the frame ``pose`` of the body; the axis has any length but 0. A free joint has neither, a ball joint no axis.
            That of a planar joint is square to its plane.
        reference: position [m, rad, or degrees] at which the body stands where its pose says.
        armature: inertia [kg m^2 or kg] that a rotor adds to the joint's own.
        rotors_in_body: of a free joint, whether the inertia that it adds to its linear velocity is of the components along the body's axes,
            which turn, and not of those along its parent's.
        compensated_by_actuators: whether what compensates gravity on this joint is a force of actuators, which act or do not.
        follows: name of the joint that it mimics, "" for one that moves by itself; its position is ``multiplier`` times that of
            the other, and ``offset`` [m or rad].
        damping [N s/m or N m s/rad], stiffness [N/m or N m/rad]: force -damping v - stiffness (q - spring_reference) of the joint.
        spring_reference: [m, rad, or degrees].
        friction_loss: dry friction [N or N m], which the equations of motion leave out. friction_softness: how MuJoCo makes it soft.
        limits: (lowest, highest) position [m, rad, or degrees], which they leave out too; None without. limit_softness: as of friction.
        margin: distance [m or rad] from a limit at which its force sets in.
        in_degrees: whether reference, spring_reference and limits are in degrees.
    """

    name: str
    kind: JointKind
    axis: Vector = ORIGIN
    anchor: Vector = ORIGIN
    pose: Pose = ()
    reference: Fraction = Fraction(0)
    in_degrees: bool = False
    armature: Fraction = Fraction(0)
    rotors_in_body: bool = False
    compensated_by_actuators: bool = False
    follows: str = ""
    multiplier: Fraction = Fraction(1)
    offset: Fraction = Fraction(0)
    damping: Fraction = Fraction(0)
    stiffness: Fraction = Fraction(0)
    spring_reference: Fraction = Fraction(0)
    friction_loss: Fraction = Fraction(0)
    limits: tuple[Fraction, Fraction] | None = None
    margin: Fraction = Fraction(0)
    friction_softness: SolverParameters = BY_DEFAULT
    limit_softness: SolverParameters = BY_DEFAULT
    place: Place | None = None


@dataclass(frozen=True)
class Inertia(Placed):
    """Mass [kg] and moments xx, yy, zz, xy, xz, yz [kg m^2] about the centre of mass, in the frame ``pose`` of a body."""

    pose: Pose
    mass: Fraction
    moments: tuple[Fraction, ...]
    place: Place | None = None


@dataclass(frozen=True)
class Solid(Placed):
    """A geometric body of even density, or an even surface where ``shell``, in the frame ``pose`` of a body, whose origin is its centre.

    Attributes:
        kind: "sphere", "capsule", "cylinder", "ellipsoid" or "box"; "mesh" for what an engine compiled.
        size: radius; radius and half length along z without the half spheres; or half the extents along x, y and z [m].
        mass: [kg]; None where ``density`` [kg/m^3, or kg/m^2] gives it.
        ends: the two points between which it reaches, instead of all sizes but the first; None without.
        moments: principal moments of inertia [kg m^2] of a mesh, which has no size here.
    """

    kind: str
    size: tuple[Fraction, ...]
    pose: Pose
    mass: Fraction | None
    density: Fraction
    shell: bool = False
    ends: tuple[Vector, Vector] | None = None
    place: Place | None = None
    moments: tuple[Fraction, ...] = ()

    @property
    def is_massless(self) -> bool:
        return not (self.density if self.mass is None else self.mass)


@dataclass(frozen=True)
class Body(Placed):
    """A body in the frame of its parent; with several joints, the first is the nearest to the parent.

    Its mass is that of ``inertia`` and of all ``solids``.

    Attributes:
        gravity_compensation: share of its weight that a force in its centre of mass carries.
        start: of a body with a free joint, where an MJCF has it stand at first; no position is measured from there.
    """

    name: str
    parent: str
    pose: Pose
    joints: tuple[Joint, ...]
    inertia: Inertia | None
    place: Place | None = None
    solids: tuple[Solid, ...] = ()
    gravity_compensation: Fraction = Fraction(0)
    start: Pose = ()

    @property
    def is_unnamed(self) -> bool:
        """True where the file gives it no name, so that its reader has made one of its place."""
        return self.name.startswith("(")

    @property
    def is_massless(self) -> bool:
        return all(solid.is_massless for solid in self.solids) and not (self.inertia and self.inertia.mass)


@dataclass(frozen=True)
class Bounds:
    """Treatment of bodies that weigh too little, or that no body can be; see ``harness.trees.bodies.inertias``.

    Attributes:
        mass, moment: least mass [kg] of each body, and least principal moment of inertia [kg m^2].
        balances: whether principal moments of which one is more than the sum of the others all become their mean.
    """

    mass: Fraction = Fraction(0)
    moment: Fraction = Fraction(0)
    balances: bool = False


@dataclass(frozen=True)
class Coupling(Placed):
    """A spring, damper and inertia on a sum of multiples of joint positions; the generalised force of each joint is its multiple of theirs.

    Attributes:
        joints: (name, multiple) of hinges and slides.
        rest: the sum [m or rad] at which the spring is relaxed; None for that of the joints' ``spring_reference``. slack_to: it is, up to
            that sum; None for a spring that is never slack.
        armature: inertia [kg m^2 or kg]. gear: damper and inertia turn so many times as fast as the sum, and count gear^2 times.
        of_actuator: whether an actuator brings them. in_joint: whether that to a joint, and not to a tendon.
        along_branches: whether the inertia couples no velocities of joints on different branches.
    """

    joints: tuple[tuple[str, Fraction], ...]
    stiffness: Fraction
    damping: Fraction
    rest: Fraction | None
    place: Place | None = None
    armature: Fraction = Fraction(0)
    gear: Fraction = Fraction(1)
    slack_to: Fraction | None = None
    of_actuator: bool = False
    in_joint: bool = False
    along_branches: bool = False


@dataclass(frozen=True)
class Spring(Placed):
    """A spring, damper and inertia between two points, each a body's name and a frame in that body, whose origin the point is.

    ``stiffness`` [N/m] acts on the length beyond ``free_length`` [m], ``damping`` [N s/m] on its rate. A spring is slack from there up to
    the length ``slack_to`` [m], if any, from which on it acts on the length beyond that. ``armature`` [kg] is an inertia of that rate,
    ``along_branches`` as of a ``Coupling``.
    """

    ends: tuple[tuple[str, Pose], tuple[str, Pose]]
    free_length: Fraction
    stiffness: Fraction
    damping: Fraction
    place: Place | None = None
    slack_to: Fraction | None = None
    armature: Fraction = Fraction(0)
    along_branches: bool = False

    @property
    def is_plain(self) -> bool:
        """True for a spring and damper alone, which are never slack."""
        return self.slack_to is None and not self.armature


@dataclass(frozen=True)
class SpringDampers:
    """Joints that give a time constant [s] and a damping ratio, from which stiffness and damping follow by their inertia.

    Attributes:
        given: joint to both. springs, dampers: whether these are switched on.
    """

    given: Mapping[str, tuple[Given, Given]] = field(default_factory=dict)
    springs: bool = True
    dampers: bool = True


# Ranges of forces by the names of joints.
ForceLimits = tuple[tuple[str, tuple[Fraction, Fraction]], ...]
# A number of a file, and whether it counts with its own sign (1) or the other one (-1).
Signed = tuple[int, Fraction]


@dataclass(frozen=True)
class Actuator(Placed):
    """A force that a control drives, along a length, which is that of a joint, a fixed tendon, or the axes of a site.

    Its force is gain * input + bias, in ``force_range``; gain and bias are c0 + c1 length + c2 velocity each. The input is the control, in
    ``control_range``, and the activation of one with ``dynamics``.

    Attributes:
        kind: the tag. name: "" for none. number: among the actuators of the file, from 0.
        joints: (name, multiple) whose sum of multiples of positions is the length but for the gear. site: body and frame, None for none.
        gear: (6,), of which a single joint and a tendon take the first, a ball joint three, and a free joint and a site all.
        in_parent: whether the gear of a ball or free joint is along the axes of its parent.
        damping_ratio: from which the damping follows by the inertia of what is driven; 0 where the file gives the damping.
        why_not: why its force is not read; "" where it is.
    """

    kind: str
    name: str
    line: int
    number: int
    joints: tuple[tuple[str, Fraction], ...] = ()
    site: tuple[str, Pose] | None = None
    gear: tuple[Fraction, ...] = ()
    in_parent: bool = False
    gain: tuple[Signed, ...] = ()
    bias: tuple[Signed, ...] = ()
    dynamics: str = "none"
    control_range: tuple[Fraction, Fraction] | None = None
    activation_range: tuple[Fraction, Fraction] | None = None
    force_range: tuple[Fraction, Fraction] | None = None
    damping_ratio: Fraction = Fraction(0)
    why_not: str = ""
    place: Place | None = None

    @property
    def has_activation(self) -> bool:
        return self.dynamics != "none"


class SensorKind(StrEnum):
    """The measure of a sensor, by its tag; a vector (3,), of which a single number is the first component and the others are 0.

    In the axes of its site: the acceleration of the site less gravity, its velocity, its angular velocity, and force and moment about it
    that the body of the site gets from the body that it hangs on. Along the world's axes: the acceleration of the site less gravity, and
    the angular acceleration. Of actuators: the force of one in its range, and what all do together on a joint in the range of that.
    Of hinges and slides: position and velocity.
    """

    ACCELEROMETER = "accelerometer"
    VELOCIMETER = "velocimeter"
    GYRO = "gyro"
    FORCE = "force"
    TORQUE = "torque"
    LINEAR_ACCELERATION = "framelinacc"
    ANGULAR_ACCELERATION = "frameangacc"
    ACTUATOR_FORCE = "actuatorfrc"
    JOINT_ACTUATOR_FORCE = "jointactuatorfrc"
    JOINT_POSITION = "jointpos"
    JOINT_VELOCITY = "jointvel"

    @property
    def is_transmitted(self) -> bool:
        """True for what a body gets from another."""
        return self in (SensorKind.FORCE, SensorKind.TORQUE)

    @property
    def is_in_world(self) -> bool:
        """True for one along the world's axes."""
        return self in (SensorKind.LINEAR_ACCELERATION, SensorKind.ANGULAR_ACCELERATION)

    @property
    def is_of_actuators(self) -> bool:
        """True for what actuators do."""
        return self in (SensorKind.ACTUATOR_FORCE, SensorKind.JOINT_ACTUATOR_FORCE)

    @property
    def is_of_joints(self) -> bool:
        """True for the position of a joint, or its velocity."""
        return self in (SensorKind.JOINT_POSITION, SensorKind.JOINT_VELOCITY)


@dataclass(frozen=True)
class Sensor(Placed):
    """A sensor at a site, of a joint, or of actuators.

    Attributes:
        name: "" for none. number: among the sensors of the file, from 0. body, pose: of the site.
        actuator: whose force it measures, by its number among the actuators of the file; -1 of all others. joint: on which it measures
            the force, or where that is, or how fast; "" of all others.
        why_not: why its value is not judged; "" where it is.
    """

    kind: SensorKind
    name: str
    line: int
    number: int
    body: str = WORLD
    pose: Pose = ()
    why_not: str = ""
    place: Place | None = None
    actuator: int = -1
    joint: str = ""


@dataclass(frozen=True)
class Tree(Placed):
    """Bodies, parents before their children, the gravity [m/s^2] they feel, springs between points, and couplings of joints.

    ``tendons`` are those with dry friction or limits, ``actuators`` those that act, and ``force_limits`` the ranges [N or N m] of what they
    do together on joints. ``sensors`` are those at sites and of actuators.

    With ``bounds`` each body weighs what these make of it. With ``total_mass`` [kg] all masses and inertias are then scaled by one
    factor, so that the masses of all bodies sum to it.
    """

    bodies: tuple[Body, ...]
    gravity: Vector
    springs: tuple[Spring, ...] = ()
    couplings: tuple[Coupling, ...] = ()
    total_mass: Fraction | None = None
    place: Place | None = None
    bounds: Bounds | None = None
    actuators: tuple[Actuator, ...] = ()
    force_limits: ForceLimits = ()
    tendons: tuple[BoundTendon, ...] = ()
    sensors: tuple[Sensor, ...] = ()

    @property
    def joints(self) -> tuple[Joint, ...]:
        """All joints, those of a body before those of its children."""
        return tuple(joint for body in self.bodies for joint in body.joints)

    @property
    def joints_before(self) -> dict[str, str]:
        """For each joint the one that carries it, "" for none; parents first."""
        last: dict[str, str] = {}
        found = {}
        for body in self.bodies:
            above = last.get(body.parent, "")
            for joint in body.joints:
                found[joint.name], above = above, joint.name
            last[body.name] = above
        return found
