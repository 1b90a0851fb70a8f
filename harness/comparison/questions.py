"""What an engine is asked about a robot's file, and what it answers: plain data that goes to a worker process and back.

A ``Request`` is about a file, and a caller loads it once; a ``Question`` adds states. A state names positions and velocities of every
joint of the file, those that mimic another among them: an engine that passes over ``<mimic>`` has them as joints of their own.
Conventions are those of ``harness.engines.Model``: a rotation stands in q as (w, x, y, z), its velocity in v in the body's frame, both
behind the position of a free joint, whose linear velocity is in the frame of its parent. A planar joint has x, y and its turn, and its
linear velocity in the frame of its parent too.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from harness.arrays import Array
from harness.files.constraints import ModelConstraint
from harness.files.facts import PointSpring
from harness.models.constraint_law import ConstraintLaw


@dataclass(frozen=True)
class Asked:
    """A joint of a question.

    Attributes:
        kind: "hinge", "slide", "planar", "ball" or "free". positions, velocities: its columns in q and in v.
        turn, shift: orientation (4,), a unit quaternion (w, x, y, z), and origin (3,) [m], in the world, of the frame in which a free
            joint of a URDF is measured; of all others none that matters.
    """

    name: str
    kind: str
    positions: tuple[int, ...]
    velocities: tuple[int, ...]
    turn: tuple[float, ...] = (1.0, 0.0, 0.0, 0.0)
    shift: tuple[float, ...] = (0.0, 0.0, 0.0)

    @property
    def is_measured_in_the_world(self) -> bool:
        return (self.turn, self.shift) == (Asked.turn, Asked.shift)


@dataclass(frozen=True)
class BodyInertia:
    """Mass [kg], centre of mass [m] and inertia matrix (3, 3) about it [kg m^2] of a body, both in the body's frame."""

    mass: float
    centre: Array
    matrix: Array


@dataclass(frozen=True)
class JointForces:
    """Dampers and springs of joints.

    Attributes:
        damping: (nv,) [N s/m or N m s]. springs: of each, its columns in q and in v, stiffness [N/m or N m], and the position at which
            it is relaxed [m or rad].
    """

    damping: Array
    springs: tuple[tuple[int, int, float, float], ...]

    def of_dampers(self, v: Array) -> Array:
        """(n, nv) at velocities (n, nv)."""
        return -self.damping * v

    def of_springs(self, q: Array) -> Array:
        """(n, nv) at positions (n, nq)."""
        found = np.zeros((len(q), len(self.damping)))
        for position, velocity, stiffness, relaxed in self.springs:
            found[:, velocity] = -stiffness * (q[:, position] - relaxed)
        return found


@dataclass(frozen=True)
class Aid:
    """What a file holds that engines may leave out; a caller takes what its engine does.

    Attributes:
        gravity: (3,) [m/s^2]. forces: of the joints' dampers and springs. springs: between points of bodies.
        armature: (nv,) inertia that rotors add. inertias: by body.
        couplings: (nv, velocities of the joints that move by themselves) matrix by which these give all velocities; None where no
            joint mimics another. leaders: the joints that move by themselves, in the order of its columns.
    """

    gravity: Array
    forces: JointForces
    armature: Array
    inertias: Mapping[str, BodyInertia]
    couplings: Array | None
    leaders: tuple[Asked, ...]
    springs: tuple[PointSpring, ...] = ()


@dataclass(frozen=True)
class Held:
    """Equalities of a file that an engine is to hold.

    Attributes:
        kinds: the tags of all of them, in the order of the file. switched_on: numbers of those that act; no other does.
    """

    kinds: tuple[str, ...]
    switched_on: tuple[int, ...]


@dataclass(frozen=True, kw_only=True)
class Request:
    """One file for an engine to load.

    Attributes:
        format: "urdf" or "mjcf". joints: of the file, in its order.
        floating_base: name of the free joint to be put under a URDF's root, "" for none.
        aid: what is supplied; None for the engine as its user calls it.
        held: equalities that act; None where all constraints are off.
    """

    path: Path
    format: str
    joints: tuple[Asked, ...]
    floating_base: str = ""
    aid: Aid | None = None
    held: Held | None = None

    @property
    def supplied_ball_joint(self) -> str:
        """Name of the ball joint that hangs a URDF's root link on the world, to be supplied; "" without one, and for a plain engine."""
        balls = (joint.name for joint in self.joints if joint.kind == "ball")
        return next(balls, "") if self.aid is not None and self.format == "urdf" else ""

    @property
    def couplings(self) -> Array | None:
        """Those of the aid; None for a plain engine."""
        return None if self.aid is None else self.aid.couplings


@dataclass(frozen=True, kw_only=True)
class Question(Request):
    """A request with the states at which the engine answers.

    Attributes:
        q, v, tau: (n, nq), (n, nv), (n, nv) over ``joints``.
    """

    q: Array
    v: Array
    tau: Array


@dataclass(frozen=True)
class Answers:
    """What an engine returned.

    Attributes:
        accelerations: {joint: (n, velocities of the joint)} of the joints of the question that it has; with couplings, of those that
            move by themselves.
        refusal: the engine's own words where it does not read the file; "" where it does. element: the body or joint that they name.
        notes: what had to be taken out of the file before the engine read it, a sentence each.
        further: joints that it has and that the file does not name.
    """

    accelerations: Mapping[str, Array] = field(default_factory=dict)
    refusal: str = ""
    element: str = ""
    notes: tuple[str, ...] = ()
    further: tuple[str, ...] = ()

    def of(self, joints: Sequence[str]) -> Array:
        """(n, nv) of these joints; raises KeyError for one that the engine does not have."""
        return np.hstack([self.accelerations[name] for name in joints])


class Refused(Exception):
    """An engine does not read a file; the message holds its own words. ``element``: the body or joint that they name, "" for none."""

    def __init__(self, words: str, element: str = "") -> None:
        super().__init__(words)
        self.element = element


class Run(Protocol):
    """States in an engine's own conventions, ready to be computed any number of times."""

    def compute(self) -> None:
        """Let the engine compute all states: nothing is converted.

        Raises:
            Refused: the engine has read the file, and refuses what it holds once it is asked for accelerations.
        """

    def accelerations(self) -> Array:
        """(n, velocities of the loaded joints): what the last ``compute`` found."""


class Loaded(Protocol):
    """A file in an engine.

    One that is asked for more than accelerations has ``quantities(names)``: an object with methods of ``harness.engines.interface``, whose
    q and v are of the joints of these names.

    Attributes:
        joints: that it answers for, in the order of its columns; with couplings, those that move by themselves.
        notes: what had to be taken out of the file before the engine read it, a sentence each.
        further: joints that it has and that the file does not name.
        model: the engine's own; raises ``Unsupported`` where none can be asked by itself.
        is_supplied_with_forces: whether forces that its reader leaves out are applied to it.
    """

    joints: tuple[Asked, ...]
    notes: tuple[str, ...]
    further: tuple[str, ...]

    @property
    def model(self) -> Any: ...

    @property
    def is_supplied_with_forces(self) -> bool: ...

    def addresses(self, names: Sequence[str]) -> tuple[list[int], list[int]]:
        """Positions and velocities of the joints called ``names`` in the engine's own q and v; quaternions as (w, x, y, z)."""

    def prepare(self, q: Array, v: Array, tau: Array) -> Run:
        """The run at states (n, nq), (n, nv), (n, nv) over the joints of the request, with what the harness supplies."""


class Caller(Protocol):
    """The ``CALLER`` of a module of ``harness.comparison.callers``: an engine as its user calls it. It derives from this class.

    Attributes:
        engine: its name. formats: which it reads. requires: importable module and distribution name of the program behind it.
        supplied: for each format, what an aided engine is given besides what its reader takes from the file, as a sentence.
        factorises_mass_matrix: whether it solves for accelerations by a factorisation of M.
        call: the user's code for each format, on one line.
        takes_inertias_about_tree: whether it forms inertias about the centre of a whole tree, see ``harness.comparison.far_links``.
        why_no_equalities: why the call holds no equality of a file; "" for an engine that can be asked with some that are ``Held``.
        optional: whether not everybody installs it, as of ``harness.engines.Engine``.
        reader: the engine whose reader of files it has, with all readings of that; "" for one of its own.

    One of an engine with integrators has ``step_rules(root, model_format) -> Sequence[StepRule]``, those of a file with this root
    element; what it loads has ``advanced(q, v, rule, steps)``, q and v after so many steps without applied forces, of the joints of
    the request, (nq,) and (nv,).
    """

    engine: str
    formats: tuple[str, ...]
    requires: tuple[str, str]
    supplied: Mapping[str, str]
    factorises_mass_matrix: bool
    call: Mapping[str, str]
    takes_inertias_about_tree: bool = False
    why_no_equalities: str
    optional: bool = False
    reader: str = ""

    def laws(self, root: Any, model_format: str, constraints: Sequence[ModelConstraint]) -> Mapping[str, ConstraintLaw]:
        """What the engine documents of constraints of the file with this root element, by their names; of none where it holds none."""
        return {}

    def fuses(self, root: Any, model_format: str) -> bool:
        """Whether its reader makes bodies that no joint moves one with their parents."""
        return False

    def load(self, request: Request) -> Loaded:
        """Load the file once.

        Raises:
            Refused: the engine does not read it.
        """


def ask(caller: Caller, question: Question) -> Answers:
    """Load the file and return accelerations at all states; a refusal of the file is an answer, no exception."""
    try:
        loaded = caller.load(question)
        run = loaded.prepare(question.q, question.v, question.tau)
        run.compute()
    except Refused as refusal:
        return Answers(refusal=str(refusal), element=refusal.element)
    return Answers(by_joint(loaded.joints, run.accelerations()), notes=loaded.notes, further=loaded.further)


def projected(mass: Array, force: Array, couplings: Array) -> Array:
    """Accelerations of what moves by itself: G' M G a = G' f with velocities G v and no velocity terms of G, which is constant."""
    return np.asarray(np.linalg.solve(couplings.T @ mass @ couplings, couplings.T @ force))


def by_joint(joints: Sequence[Asked], accelerations: Array) -> dict[str, Array]:
    """{joint: columns} of accelerations over the velocities of ``joints`` in their order."""
    ends = np.cumsum([len(joint.velocities) for joint in joints])
    return dict(zip((joint.name for joint in joints), np.split(accelerations, ends[:-1], axis=1), strict=True)) if joints else {}
