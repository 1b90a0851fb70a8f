"""Quantities that a loaded model may be asked for beside accelerations, the plain data that it gives, and the audit of what it has loaded.

Each is a method of the model. q is (n, nq), v and qdd (n, nv), their columns as in ``forward_dynamics``; joints are those that ``load``
was given, each once.

- ``mass_matrix(q)``: M with reflected inertias, (n, nv, nv). ``gravity(q)``: what holds the model at rest against its weight, (n, nv).
  An engine that offers ``terms`` need not offer these two.
- ``bias(q, v)``: velocity terms and gravity, (n, nv), without springs and dampers.
- ``inverse_dynamics(q, v, qdd)``: the applied forces that give these accelerations beside springs and dampers, (n, nv).
- ``forward_dynamics_derivatives(q, v, tau)``: of the accelerations by q, v and tau, (n, 3, nv, nv), the accelerations by rows; and
  ``inverse_dynamics_derivatives(q, v, qdd)``: of the applied forces by q, v and qdd. Derivatives by q are along the engine's own
  velocities, whose components in v are kept: a ball joint turns about the axes of its body, and a free joint moves along these or along
  those of its parent, as ``linear_velocity_in_body`` says. Springs and dampers take part.
- ``regressor(q, v, qdd)``: of the applied forces without springs and dampers by the inertial parameters of bodies, (n, nv, joints, 10):
  of the body behind a joint m, its first moments mx, my, mz, and Ixx, Ixy, Iyy, Ixz, Iyz, Izz about the point of ``positions``, along the
  axes of the body's frame. Of several joints of a body only the last is looked at.
- ``energies(q, v)``: kinetic energy, and potential energy up to a constant, of gravity and springs, (n, 2) [J].
- ``momenta(q, v)``: of all that moves, (n, 9): momentum [N s], and moments of momentum about the world's origin and about the centre
  of mass [N m s].
- ``positions(q)``: of each joint, (n, joints, 12): the anchor of the last joint of its body, which moves with the body [m], and the
  orientation of a frame of the body in the world, by rows. Which frame it is does not matter.
- ``velocities(q, v)``: of each joint, (n, joints, 6): the velocity of the same point, and the angular velocity of the body.
- ``jacobians(q)``: by which each velocity changes these, (n, joints, 6, nv).
- ``sensors(q, v, qdd)``: of each sensor of the file that is of a ``harness.files.tree.SensorKind``, in the order of the file, what it
  measures where the joints have these accelerations and nothing else acts, (n, sensors, 3); a number stands first, with zeros behind it.
- ``driven_sensors(q, v, tau, control, activation)``: the same at applied forces and inputs of actuators, (n, actuators of the file) each,
  where all that the model holds acts.
- ``reactions(q, v, tau)``: what each joint transmits, (n, joints, 6): the force [N] and the moment [N m] that the parent exerts on the
  child; the moment is about the point of ``positions``. Springs between points pull from outside, and so do constraints that hold
  points or frames together; couplings of joints act through the joints. The row of a free joint is not looked at.
- ``step(q, v, tau, length, integrator)``: q and v after one step of that length [s] by an integrator that the engine declares a rule of,
  (n, nq + nv).
- ``by_default()``: the same model whose solver of constraints has the engine's default settings; in words, how the model itself is
  solved; and what its defaults are. None where nothing is left to a solver. Of an engine that the harness tells more than its user has to.
- ``to_the_end(tolerance)``: the same model whose solvers go on until nothing changes by more, which is 0 where it is not given, and what
  its user sets for that, as text of a file.

Vectors are along the world's axes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from harness.arrays import Array, Rows
from harness.errors import InvalidModel
from harness.files.equalities import Limit
from harness.files.joint_kinds import JointKind
from harness.files.model_file import ModelFile
from harness.library import nearest

if TYPE_CHECKING:
    from harness.programs.mechanisms.mechanism import Mechanism

METHODS = (
    "mass_matrix",
    "gravity",
    "bias",
    "inverse_dynamics",
    "energies",
    "momenta",
    "positions",
    "velocities",
    "jacobians",
    "reactions",
    "forward_dynamics_derivatives",
    "inverse_dynamics_derivatives",
    "regressor",
    "sensors",
    "driven_sensors",
)
# Coarser than what the comparison sees by far: the audit finds another mechanism, the comparison finds
# another digit.
AUDIT_TOLERANCE = 1e-6


@dataclass(frozen=True)
class LoadedModel:
    """Joint sizes, gravity and mass that an engine holds after loading, for the audit.

    Attributes:
        joints: name of each moving joint to its (number of positions, number of velocities).
        gravity: acceleration of gravity [m/s^2], (x, y, z).
        total_mass: sum of the masses of all moving bodies [kg].
    """

    joints: Mapping[str, tuple[int, int]]
    gravity: tuple[float, ...]
    total_mass: float


@dataclass(frozen=True)
class Terms(Rows):
    """The terms of M qdd + velocity + gravity = passive + applied at n states, as an engine computes them.

    Attributes:
        mass: M, (n, nv, nv), symmetric. velocity, gravity, passive, applied: (n, nv) [N or N m].
    """

    mass: Array
    velocity: Array
    gravity: Array
    passive: Array
    applied: Array


@dataclass(frozen=True)
class HeldJoint:
    """A joint as an engine holds it after loading, in the world's frame with every joint at zero.

    Attributes:
        parent: name of the joint whose body carries it; "" for the world.
        anchor: a point of the axis, or the centre of a ball [m], (3,), on the parent's side of the joint; moved: the same point on
            the other side, which a slide or a free joint takes away. axis: unit vector, (3,); zero for ball, free and planar joints.
        armature: reflected inertia [kg or kg m^2]. damping: [N s/m or N m s]. stiffness: [N/m or N m];
            spring_reference: position at which the spring is relaxed [m or rad]. All of them as the engine, with what
            the harness adds for it, applies them.
        frame: rotation to the world of the axes in which a ball, free or planar joint has its velocity, (3, 3); the identity
            for hinges and slides.
    """

    kind: JointKind
    parent: str
    anchor: Array
    moved: Array
    axis: Array
    armature: float
    damping: float
    stiffness: float
    spring_reference: float
    frame: Array


@dataclass(frozen=True)
class HeldBody:
    """Everything that moves rigidly with one joint and no further one, in the world's frame with every joint at zero.

    Attributes:
        mass: [kg]. centre: of mass [m], (3,). inertia: about it [kg m^2], (3, 3). name: the engine's, "" where it has none.
    """

    mass: float
    centre: Array
    inertia: Array
    name: str = ""


@dataclass(frozen=True)
class HeldSpring:
    """A spring and damper between points, with every joint at zero.

    Attributes:
        points: of its line in the world, from end to end [m], (n, 3).
        stiffness: [N/m]. damping: [N s/m]. free_length: [m].
    """

    points: Array
    stiffness: float
    damping: float
    free_length: float


@dataclass(frozen=True)
class HeldModel:
    """Everything that an engine holds after loading, for the static audit.

    Attributes:
        gravity: [m/s^2], (3,). joints: by name. bodies: by the name of the last joint that moves them; a body without
            mass and inertia between two joints may be absent, as formats differ in whether they need one.
        springs: between points, in document order; those in a joint stand in the joint.
    """

    gravity: Array
    joints: Mapping[str, HeldJoint]
    bodies: Mapping[str, HeldBody]
    springs: tuple[HeldSpring, ...] = ()


# Parts of a vector; of a quaternion, of which each sign is the same orientation; and of an inertia, with their places in the matrix.
AXES, QUATERNION = ("x", "y", "z"), ("w", "x", "y", "z")
_MOMENTS = {"xx": (0, 0), "yy": (1, 1), "zz": (2, 2), "xy": (0, 1), "xz": (0, 2), "yz": (1, 2)}


@dataclass(frozen=True)
class CompiledNumber:
    """Numbers of one name that an engine holds of one of its objects after loading a file.

    Attributes:
        quantity: the engine's own name, as "dof_damping". owner: name of the joint, body or other object; "" for the whole model.
        values: in the engine's units; a word for a value of an enumeration. parts: their names, of what is one vector, quaternion or
            inertia; none where values are counted, each a number by itself.
        felt: whether an acceleration without constraints and fluid, with the actuators that act, may feel it.
    """

    quantity: str
    owner: str
    values: tuple[float | str, ...]
    parts: tuple[str, ...] = ()
    felt: bool = True

    @classmethod
    def of_inertia(cls, quantity: str, owner: str, matrix: Array) -> CompiledNumber:
        """The moments of a matrix (3, 3) [kg m^2], by their names."""
        return cls(quantity, owner, tuple(float(matrix[place]) for place in _MOMENTS.values()), tuple(_MOMENTS))


class Unsupported(Exception):
    """The engine cannot express the mechanism; the message is the reason. Verdict ``unsupported``."""


class Misread(Unsupported):
    """The engine accepts the file, and its reader is known to make another mechanism of it, which cannot be asked about this one."""


class NotOffered(Unsupported):
    """The engine does not claim to compute what was asked for, or the mechanism has nothing of the kind."""


class InvalidAnswer(Exception):
    """An engine returned something else than was asked for; the message says what. Verdict ``error``."""


def audit(loaded: LoadedModel | None, model: ModelFile | None, mechanism: Mechanism) -> None:
    """Check constraints by name, joints by name and size, gravity and total mass; nothing where an engine reads no file.

    What the engine does not say is not checked.

    Raises:
        InvalidModel: with the line, the value found and the value expected.
    """
    if model is not None:
        require_constraints(model, mechanism)
    if loaded is None or model is None:
        return
    for joint in mechanism.joints:
        if joint not in loaded.joints:
            hint = nearest(joint, sorted(loaded.joints)) if loaded.joints else "the model has none at all"
            raise InvalidModel(model.path, model.root_line, f"has no moving joint {joint!r}, which the system needs; {hint}")
    for joint, (positions, velocities) in loaded.joints.items():
        line = model.joint_lines.get(joint, model.root_line)
        if joint not in mechanism.joints:
            raise InvalidModel(model.path, line, f"joint {joint!r} moves, but the system has joints {', '.join(mechanism.joints)} only")
        nq, nv = mechanism.joint_sizes[joint]
        if (positions, velocities) != (nq, nv):
            kind = {(4, 3): "a ball joint", (7, 6): "a free joint"}.get((nq, nv), "a joint of one degree of freedom")
            problem = f"joint {joint!r} has nq = {positions} and nv = {velocities}, expected {nq} and {nv}; use {kind}"
            raise InvalidModel(model.path, line, problem)
    expected = (0.0, 0.0, -mechanism.gravity)
    if any(abs(found - wanted) > AUDIT_TOLERANCE * mechanism.gravity for found, wanted in zip(loaded.gravity, expected, strict=True)):
        # Adding zero turns -0 into 0.
        found_text, expected_text = (" ".join(f"{component + 0.0:g}" for component in vector) for vector in (loaded.gravity, expected))
        raise InvalidModel(model.path, model.gravity_line, f"gravity is {found_text} m/s^2, expected {expected_text} as the system says")
    if abs(loaded.total_mass - mechanism.total_mass) > AUDIT_TOLERANCE * mechanism.total_mass:
        masses = f"{loaded.total_mass:.10g} kg in all, expected {mechanism.total_mass:.10g} kg as the system says"
        raise InvalidModel(model.path, model.root_line, f"the moving bodies have {masses}")


def require_constraints(model: ModelFile, mechanism: Mechanism) -> None:
    """Check that a file has the constraints of a mechanism, by name.

    Raises:
        InvalidModel: it lacks one, or has another.
    """
    wanted = () if mechanism.constraints is None else mechanism.constraints.names
    found = {constraint.name: constraint.line for constraint in model.constraints}
    for name in wanted:
        if name not in found:
            hint = nearest(name, sorted(found)) if found else "the model has none at all"
            raise InvalidModel(model.path, model.root_line, f"has no constraint {name!r}, which the system needs; {hint}")
    for name, line in found.items():
        if name not in wanted:
            expected = f"the system has {', '.join(map(repr, wanted))} only" if wanted else "the system has none"
            raise InvalidModel(model.path, line, f"constraint {name!r} ties joints, but {expected}")
    require_bounds(model, mechanism)


def require_bounds(model: ModelFile, mechanism: Mechanism) -> None:
    """Hold the dry friction, limits and actuators of a model against those that the mechanism has; a URDF can state no actuators.

    Raises:
        InvalidModel: one is missing, or is none of the mechanism's.
    """
    wanted = () if mechanism.bounded is None else mechanism.bounded.names
    found = {one.name: one for one in model.bounded}
    for name in wanted:
        if name not in found:
            hint = nearest(name, sorted(found)) if found else "the model has neither friction nor limits"
            raise InvalidModel(model.path, model.root_line, f"has no {name}, which the system needs; {hint}")
    for name, one in found.items():
        # Every joint of a URDF states limits, which no engine is asked to apply unless the system has them.
        if name not in (*wanted, *mechanism.left_out) and not (model.format == "urdf" and isinstance(one.says, Limit)):
            raise InvalidModel(model.path, one.line, f"{name} is none that the system has; remove it, or declare it there")
    driving, lines = () if mechanism.driving is None else mechanism.driving.names, dict(model.actuators)
    for name in driving if model.format == "mjcf" else ():
        if name not in lines:
            hint = nearest(name, sorted(lines)) if lines else "the model has none at all"
            raise InvalidModel(model.path, model.root_line, f"has no actuator {name!r}, which the system needs; {hint}")
    for name, line in lines.items():
        if name not in driving and f"actuator {name}" not in mechanism.left_out:
            raise InvalidModel(model.path, line, f"actuator {name!r} is none that the system has; remove it, or declare it there")


def acting_as(model: ModelFile, mechanism: Mechanism) -> ModelFile:
    """The model, of whose dry friction, limits and actuators those act that the mechanism has."""
    names = () if mechanism.bounded is None else mechanism.bounded.names
    driven = () if mechanism.driving is None else mechanism.driving.names
    # The audit tells which one a file does not have.
    driven = driven if {*driven} <= dict(model.actuators).keys() else ()
    return model if (model.acting, model.driven) == (names, driven) else replace(model, acting=names, driven=driven)
