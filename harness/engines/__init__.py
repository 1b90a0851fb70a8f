"""Engines: programs that return accelerations, each one a file here or in a library's ``engines/``.

An engine file defines ``ENGINE``, an object with the attributes of ``Engine``, and imports the program
it wraps only inside its methods, so that finding engines costs nothing.

Knows no equation. May use ``models`` and what is below it.

Start with ``Engine`` and ``Model``, the protocol, then with ``pinocchio``, which follows it.
"""

from __future__ import annotations

import importlib.metadata
import importlib.util
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

from harness.arrays import Array, Rows
from harness.errors import InvalidInput, InvalidModel, InvalidRequest
from harness.library import Library, nearest, run_file
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


def engine_names(library: Library) -> list[str]:
    """Names of all engine files, sorted: those of the harness and those of the library."""
    folders = Library.built_in().engines, library.engines
    return sorted({path.stem for folder in folders for path in folder.glob("*.py") if not path.stem.startswith("_")})


def load_engine(library: Library, name: str) -> Engine:
    """The engine called ``name``; a library's own engine wins over the harness's.

    Raises:
        InvalidInput: the engine file raises or defines no ``ENGINE``.
        InvalidRequest: there is no such engine.
    """
    own = library.engines / f"{name}.py"
    built_in = Library.built_in().engines / f"{name}.py"
    if library.engines != built_in.parent and own.is_file():
        module = run_file(own, f"_harness_engine_{name}")
    elif built_in.is_file():
        module = importlib.import_module(f"harness.engines.{name}")
    else:
        raise InvalidRequest(f"no engine is called {name!r}; {nearest(name, engine_names(library))}")
    engine: Engine | None = getattr(module, "ENGINE", None)
    if engine is None:
        raise InvalidInput(own if own.is_file() else built_in, None, "defines no ENGINE; see CONTRIBUTING, add an engine")
    return engine


def load_model(library: Library, subject: Subject, mechanism: Mechanism, model: ModelFile | None) -> Model:
    """The mechanism as the subject's engine loads it, from ``model`` or, for equations, as it is.

    Raises:
        InvalidModel: the engine refuses the model.
        Unsupported: the engine cannot express the mechanism.
    """
    source = mechanism if model is None else model
    try:
        return load_engine(library, subject.engine).load(source, mechanism.joints, mechanism.gravity)
    except ValueError as error:
        if model is None:
            raise
        raise InvalidModel(model.path, None, f"{subject.engine} refuses it: {error}") from error


def linear_velocity_in_body(engine: Engine) -> bool:
    """True where the engine gives the linear velocity of a free joint in the body's own frame."""
    return bool(getattr(engine, "linear_velocity_in_body", False))


def installed_version(engine: Engine) -> str | None:
    """Version of the program behind an engine, without importing it; None where it is not installed."""
    module, distribution = engine.requires
    if importlib.util.find_spec(module) is None:
        return None
    try:
        return importlib.metadata.version(distribution)
    except importlib.metadata.PackageNotFoundError:
        return None


def subjects(library: Library) -> list[Subject]:
    """Every subject of every engine, sorted by name."""
    return sorted(Subject(name, model_format) for name in engine_names(library) for model_format in load_engine(library, name).formats)


def is_native(library: Library, subject: Subject) -> bool:
    """True where the format is the engine's own; a question about engines, and not about readers, goes to such subjects."""
    return load_engine(library, subject.engine).formats[0] == subject.format


def select_subjects(library: Library, names: Sequence[str], native_only: bool = False) -> list[Subject]:
    """The subjects called ``names``; for none all of them, or those that are native.

    Raises:
        InvalidRequest: a name no subject has; the message gives the nearest one.
    """
    known = {str(subject): subject for subject in subjects(library)}
    for name in names:
        if name not in known:
            raise InvalidRequest(f"no subject is called {name!r}; {nearest(name, known)}")
    chosen = [known[name] for name in dict.fromkeys(names)]
    return chosen or [subject for subject in known.values() if not native_only or is_native(library, subject)]


def require_model(source: Any, engine: str) -> ModelFile:
    """``source`` as a model file; the error of an engine that was handed equations."""
    if not isinstance(source, ModelFile):
        raise TypeError(f"{engine} reads model files, not {type(source).__name__}")
    return source
