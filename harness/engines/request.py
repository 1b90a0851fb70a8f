"""One file for an engine to load, as plain data that goes to another process: its joints, and what the harness supplies of it.

A ``Request`` is loaded once; a ``EngineQuestion`` adds states. A state names positions and velocities of every joint of the file, those
that mimic another among them: an engine that passes over ``<mimic>`` has them as joints of their own.
Conventions are those of ``harness.engines.Model``: a rotation stands in q as (w, x, y, z), its velocity in v in the body's frame, both
behind the position of a free joint, whose linear velocity is in the frame of its parent. A planar joint has x, y and its turn, and its
linear velocity in the frame of its parent too.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from harness.arrays import Array
from harness.files.facts import JointSpring, PointSpring
from harness.files.joint_kinds import JointKind

if TYPE_CHECKING:
    from harness.files.contacts import FoundContact

# Of engines that no URDF tells theirs.
GRAVITY = (0.0, 0.0, -9.81)


@dataclass(frozen=True)
class AskedJoint:
    """A joint of a question.

    Attributes:
        positions, velocities: its columns in q and in v.
        turn, shift: orientation (4,), a unit quaternion (w, x, y, z), and origin (3,) [m], in the world, of the frame in which a free
            joint of a URDF is measured; of all others none that matters.
        follows: name of the joint that it mimics, "" for one that moves by itself: its position is ``multiplier`` times that of the
            other, and ``offset`` [m or rad].
        line: of the file, 0 for one that is none of its own. carrier: name of the joint before it in the tree, "" for none.
        body: name of the body that has it. tag: of its element; of a prim, its path.
    """

    name: str
    kind: JointKind
    positions: tuple[int, ...]
    velocities: tuple[int, ...]
    turn: tuple[float, ...] = (1.0, 0.0, 0.0, 0.0)
    shift: tuple[float, ...] = (0.0, 0.0, 0.0)
    follows: str = ""
    multiplier: float = 1.0
    offset: float = 0.0
    line: int = 0
    carrier: str = ""
    body: str = ""
    tag: str = ""

    @property
    def is_unnamed(self) -> bool:
        """True where the file gives it no name, so that its reader has made one of its place."""
        return self.name.startswith("(")

    @property
    def is_measured_in_the_world(self) -> bool:
        return (self.turn, self.shift) == (AskedJoint.turn, AskedJoint.shift)


def in_columns(joints: Sequence[AskedJoint]) -> tuple[AskedJoint, ...]:
    """The joints with their columns one after the other in this order."""
    found, q, v = [], 0, 0
    for joint in joints:
        nq, nv = joint.kind.sizes
        found.append(replace(joint, positions=tuple(range(q, q + nq)), velocities=tuple(range(v, v + nv))))
        q, v = q + nq, v + nv
    return tuple(found)


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
        damping: (nv,) [N s/m or N m s]. springs: each with the columns of its joint in q and in v.
    """

    damping: Array
    springs: tuple[tuple[JointSpring, int, int], ...]

    def of_dampers(self, v: Array) -> Array:
        """(n, nv) at velocities (n, nv)."""
        return -self.damping * v

    def of_springs(self, q: Array) -> Array:
        """(n, nv) at positions (n, nq)."""
        found = np.zeros((len(q), len(self.damping)))
        for spring, position, velocity in self.springs:
            found[:, velocity] = -spring.stiffness * (q[:, position] - spring.reference)
        return found


@dataclass(frozen=True)
class Aid:
    """Parts of a file that engines may leave out; an adapter takes those that its engine does.

    Attributes:
        gravity: (3,) [m/s^2]. forces: of the joints' dampers and springs. springs: between points of bodies.
        armature: (nv,) inertia that rotors add. inertias: by body.
    """

    gravity: Array
    forces: JointForces
    armature: Array
    inertias: Mapping[str, BodyInertia] = field(default_factory=dict)
    springs: tuple[PointSpring, ...] = ()


@dataclass(frozen=True)
class SolverSettings:
    """Method, tolerance and iterations of an engine's solver of constraints.

    Attributes:
        method: by the engine's own name. iterations: at most; None as the file says. tolerance: it ends where an iteration gains less, as
            the engine documents; None as the file says.
        jacobian: "dense" or "sparse", how rows are stored; "" as the file says. line_search: iterations of the search along a line, at
            most; None as the file says.
    """

    method: str
    iterations: int | None = None
    tolerance: float | None = None
    jacobian: str = ""
    line_search: int | None = None


@dataclass(frozen=True)
class Ending:
    """Settings with which an engine's solver of constraints ends at the optimum that it documents, where it does not as it is set.

    Attributes:
        remedy: what its user does for that, an imperative.
        fault: what is wrong with the solver otherwise, a clause; "" where it is only stopped too early.
    """

    solver: SolverSettings
    remedy: str
    fault: str = ""


@dataclass(frozen=True)
class StopRule:
    """The rule by which an engine documents that its solver of a step stops, if nobody can set that.

    With the metric A of the step, the velocities v' after it and the impulses x at them, momentum A (v' - v*) - J' x is left, of at most
    ``absolute`` [J^1/2] + ``relative`` max(|A v'|, |J' x|), in the norm |p|^2 = sum of p_i^2 / A_ii.

    Attributes:
        remedy: what its user does about it, an imperative.
    """

    absolute: float
    relative: float
    remedy: str


@dataclass(frozen=True)
class Held:
    """Equalities of a file that an engine is to hold, and actuators, dry friction and limits that are to act.

    Attributes:
        kinds: the tags of all of them, in the order of the file. switched_on: numbers of those that act; no other does.
        solver: how the engine's solver goes; None where it goes as the file says.
        actuators: numbers of those that act, among all of the file; no other does.
        rubbing, limited: "joint NAME" or "tendon NAME" whose dry friction acts, and of those whose limits do; no other's does. A tendon
            without a name is "(tendon 2)" by its place in the file.
        touches: whether bodies act where they touch.
    """

    kinds: tuple[str, ...]
    switched_on: tuple[int, ...]
    solver: SolverSettings | None = None
    actuators: tuple[int, ...] = ()
    rubbing: tuple[str, ...] = ()
    limited: tuple[str, ...] = ()
    touches: bool = False


@dataclass(frozen=True, kw_only=True)
class Request:
    """One file for an engine to load.

    Attributes:
        format: "urdf", "mjcf" or "usd". joints: of the file, in its order. moving: names of those that move by themselves, in the order of
            what is asked of an aided engine.
        text: what the file holds; None to read it where it lies, beside its meshes.
        floating_base: name of the free joint to be put under a URDF's root, "" for none.
        aid: what is supplied; None for the engine as its user calls it.
        held: what acts; None where all constraints are off.
    """

    path: Path
    format: str
    joints: tuple[AskedJoint, ...]
    moving: tuple[str, ...]
    text: str | None = None
    floating_base: str = ""
    aid: Aid | None = None
    held: Held | None = None

    @property
    def driven(self) -> tuple[int, ...]:
        """The numbers of the actuators that act."""
        return () if self.held is None else self.held.actuators

    @property
    def content(self) -> bytes:
        """The text that is read."""
        return self.path.read_bytes() if self.text is None else self.text.encode()

    @property
    def leaders(self) -> tuple[AskedJoint, ...]:
        """The joints that move by themselves, in columns of their own."""
        by_name = {joint.name: joint for joint in self.joints}
        return in_columns([by_name[name] for name in self.moving])

    @property
    def gravity(self) -> tuple[float, ...]:
        """(3,) [m/s^2] for an engine that must be told: the file's where that is supplied, else what its user would say for a URDF."""
        return GRAVITY if self.aid is None else tuple(self.aid.gravity.tolist())

    @property
    def couplings(self) -> Array | None:
        """(nv, velocities of the leaders) matrix by which these give all velocities; None for a plain engine, or where no joint mimics."""
        if self.aid is None or not any(joint.follows for joint in self.joints):
            return None
        own = {joint.name: joint for joint in self.leaders}
        found = np.zeros((sum(len(joint.velocities) for joint in self.joints), sum(len(joint.velocities) for joint in own.values())))
        for joint in self.joints:
            found[list(joint.velocities), list(own[joint.follows or joint.name].velocities)] = joint.multiplier
        return found

    @property
    def supplied_ball_joint(self) -> str:
        """Name of the ball joint that hangs a URDF's root link on the world, to be supplied; "" without one, and for a plain engine."""
        balls = (joint.name for joint in self.joints if joint.kind == JointKind.BALL)
        return next(balls, "") if self.aid is not None and self.format == "urdf" else ""

    def spread(self, q: Array, v: Array, tau: Array) -> tuple[Array, Array, Array]:
        """States of the leaders, (n, nq), (n, nv) and (n, nv), over all joints."""
        return spread(self.leaders, self.joints, (q, v, tau))


def spread(leaders: Sequence[AskedJoint], joints: Sequence[AskedJoint], states: tuple[Array, Array, Array]) -> tuple[Array, Array, Array]:
    """States of some joints, over ``joints``: one that mimics another moves as the other lets it, unloaded.

    Raises:
        KeyError: a joint follows one that follows another.
    """
    own = {joint.name: joint for joint in leaders}
    found: list[list[Array]] = [[], [], []]
    for joint in joints:
        leader = joint.follows or joint.name
        if leader not in own:
            raise KeyError(f"joint {joint.name!r} follows {leader!r}, which follows another")
        columns = list(own[leader].positions), list(own[leader].velocities), list(own[leader].velocities)
        q, v, tau = (values[:, places] for values, places in zip(states, columns, strict=True))
        if joint.follows:
            q, v, tau = joint.multiplier * q + joint.offset, joint.multiplier * v, np.zeros_like(tau)
        for part, values in zip(found, (q, v, tau), strict=True):
            part.append(values)
    own_q, own_v, own_tau = (np.hstack([np.empty((len(states[0]), 0)), *part]) for part in found)
    return own_q, own_v, own_tau


@dataclass(frozen=True)
class EngineQuestion:
    """A request with the states at which the engine answers: (n, nq), (n, nv), (n, nv) over the joints of the request.

    ``driving`` holds the controls and the activations, (n, actuators of the file) each, where actuators act; () where none do.
    ``steps``, a number for each state, ask for states instead: those after so many of the engine's own steps from where the file puts all
    bodies, at the velocities ``v``, without applied forces.
    """

    request: Request
    q: Array
    v: Array
    tau: Array
    driving: tuple[Array, ...] = ()
    steps: tuple[int, ...] = ()


@dataclass(frozen=True)
class EngineAnswers:
    """The answers of an engine to one question.

    Attributes:
        accelerations: {joint: (n, velocities of the joint)} of the joints of the question that it has; with couplings, of those that
            move by themselves.
        refusal: the engine's own words where it does not read the file; "" where it does.
        notes: what had to be taken out of the file before the engine read it, a sentence each.
        contacts: those of each state, where bodies act where they touch. states: q and v of a question with ``steps``.
        shapes: as of ``LoadedFile``. seconds: that its own call took for each state [s]; none
            where nobody has timed it.
    """

    accelerations: Mapping[str, Array] = field(default_factory=dict)
    refusal: str = ""
    notes: tuple[str, ...] = ()
    contacts: tuple[tuple[FoundContact, ...], ...] = ()
    states: tuple[Array, ...] = ()
    shapes: tuple[str, ...] = ()
    seconds: tuple[float, ...] = ()

    def of(self, joints: Sequence[str]) -> Array:
        """(n, nv) of these joints; raises KeyError for one that the engine does not have."""
        return np.hstack([self.accelerations[name] for name in joints])


class Refused(Exception):
    """An engine does not read a file; the message holds its own words."""


def projected(mass: Array, force: Array, couplings: Array) -> Array:
    """Accelerations of what moves by itself: G' M G a = G' f with velocities G v and no velocity terms of G, which is constant."""
    return np.asarray(np.linalg.solve(couplings.T @ mass @ couplings, couplings.T @ force))


def by_joint(joints: Sequence[AskedJoint], accelerations: Array) -> dict[str, Array]:
    """{joint: columns} of accelerations over the velocities of ``joints`` in their order."""
    ends = np.cumsum([len(joint.velocities) for joint in joints])
    return dict(zip((joint.name for joint in joints), np.split(accelerations, ends[:-1], axis=1), strict=True)) if joints else {}
