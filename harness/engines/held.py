"""Plain data that an engine gives of a model beside its accelerations: for the load audit, the static audit, and term by term."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from harness.arrays import Array, Rows
from harness.files.joint_kinds import JointKind


@dataclass(frozen=True)
class LoadedModel:
    """Joint sizes, gravity and mass that an engine holds after loading, for the audit.

    Attributes:
        joints: name of each moving joint to its (number of positions, number of velocities).
        gravity: acceleration of gravity [m/s^2], (x, y, z).
        total_mass: sum of the masses of all moving bodies [kg].
    """

    joints: Mapping[str, tuple[int, int]]
    gravity: tuple[float, float, float]
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
