"""The protocols of an engine file, and the plain data it returns."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

from harness.arrays import Array
from harness.models.model_file import ModelFile

if TYPE_CHECKING:
    from harness.equations.mechanism import Mechanism

EQUATIONS = "equations"


class Unsupported(Exception):
    """The engine cannot express the mechanism; the message is the reason. Verdict ``unsupported``."""


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
class Terms:
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
        kind: "hinge", "slide", "ball", "free" or "planar".
        parent: name of the joint whose body carries it; "" for the world.
        anchor: a point of the axis, or the centre of a ball [m], (3,), on the parent's side of the joint; moved: the same point on
            the other side, which a slide or a free joint takes away. axis: unit vector, (3,); zero for ball, free and planar joints.
        armature: reflected inertia [kg or kg m^2]. damping: [N s/m or N m s]. stiffness: [N/m or N m];
            spring_reference: position at which the spring is relaxed [m or rad]. All of them as the engine, with what
            the harness adds for it, applies them.
        frame: rotation to the world of the axes in which a ball, free or planar joint has its velocity, (3, 3); the identity
            for hinges and slides.
    """

    kind: str
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


class Model(Protocol):
    """A mechanism loaded into an engine.

    An engine may also offer ``terms(q, v, tau) -> Terms``, arguments and columns as in ``forward_dynamics``, and
    ``held(positions, steps) -> HeldModel``; what it does not offer is not judged. Both arguments of ``held`` are by joint
    and may be left out. Every joint is at zero, or at ``positions`` [m or rad] for one of one position; then it is moved by
    ``steps`` along its velocities.
    """

    def loaded(self) -> LoadedModel | None:
        """The quantities the audit compares; None where there is no model file to audit."""

    def forward_dynamics(self, q: Array, v: Array, tau: Array) -> Array:
        """qdd, (n, nv), at q of shape (n, nq) and v, tau (n, nv); columns follow the joints given to ``load``.

        A rotation stands in q as (w, x, y, z), its velocity in v in the body's frame, both behind the
        position of a free joint.
        """


class Engine(Protocol):
    """The ``ENGINE`` of an engine file.

    Attributes:
        requires: importable module and distribution name of the program behind it.
        formats: model formats it reads, "mjcf" or "urdf"; "equations" where it takes the ``Mechanism``. The first is its
            native one. What a reader of another passes over, the engine file supplies from the same file or refuses.

    An engine that gives the linear velocity of a free joint in the body's own frame says so by an
    attribute ``linear_velocity_in_body = True``; without it the joint's frame is meant.
    """

    requires: tuple[str, str]
    formats: tuple[str, ...]

    def load(self, source: ModelFile | Mechanism, joints: Sequence[str], gravity: float) -> Model:
        """Load once; ``joints`` names the joint of each velocity; ``gravity`` [m/s^2, along -z] is for formats that hold none.

        Raises:
            Unsupported: the engine cannot express the mechanism, or a reader that is not its native one refuses the model.
            ValueError: the engine refuses the model; the message is the engine's.
        """


@dataclass(frozen=True, order=True)
class Subject:
    """An engine with a model format; prints as ``engine/format``, or ``engine`` for equations."""

    engine: str
    format: str

    def __str__(self) -> str:
        return self.engine if self.format == EQUATIONS else f"{self.engine}/{self.format}"
