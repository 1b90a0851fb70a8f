"""What an engine is asked about a robot's file, and what it answers: plain data that goes to a worker process and back.

A state of a question names positions and velocities of every joint of the file, those that mimic another among them: an engine
that passes over ``<mimic>`` has them as joints of their own. Conventions are those of ``harness.engines.Model``: a rotation stands in
q as (w, x, y, z), its velocity in v in the body's frame, both behind the position of a free joint, whose linear velocity is in the
frame of its parent. A planar joint has x, y and its turn in q, and their rates in v.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

import numpy as np

from harness.arrays import Array

# Positions and velocities of a joint of each kind.
SIZES: Mapping[str, tuple[int, int]] = {"hinge": (1, 1), "slide": (1, 1), "planar": (3, 3), "ball": (4, 3), "free": (7, 6)}


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


@dataclass(frozen=True)
class BodyInertia:
    """Mass [kg], centre of mass [m] and inertia matrix (3, 3) about it [kg m^2] of a body, both in the body's frame."""

    mass: float
    centre: Array
    matrix: Array


@dataclass(frozen=True)
class Aid:
    """What a file holds that engines may leave out; a caller takes what its engine does.

    Attributes:
        gravity: (3,) [m/s^2]. forces: {"damping": (n, nv), "stiffness": (n, nv)} of the joints' dampers and springs at the states.
        armature: (nv,) inertia that rotors add. inertias: by body.
        couplings: (nv, velocities of the joints that move by themselves) matrix by which these give all velocities; None where no
            joint mimics another. leaders: the joints that move by themselves, in the order of its columns.
    """

    gravity: Array
    forces: Mapping[str, Array]
    armature: Array
    inertias: Mapping[str, BodyInertia]
    couplings: Array | None
    leaders: tuple[Asked, ...]


@dataclass(frozen=True)
class Question:
    """One file and its states.

    Attributes:
        format: "urdf" or "mjcf". joints: of the file, in its order.
        q, v, tau: (n, nq), (n, nv), (n, nv) over ``joints``. floating_base: name of the free joint to be put under a URDF's root,
            "" for none.
        aid: what is supplied; None for the engine as its user calls it.
    """

    path: Path
    format: str
    joints: tuple[Asked, ...]
    q: Array
    v: Array
    tau: Array
    floating_base: str = ""
    aid: Aid | None = None


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


class Caller(Protocol):
    """The ``CALLER`` of a module of ``harness.comparison.callers``: an engine as its user calls it.

    Attributes:
        engine: its name. formats: which it reads.
        call: the user's code for each format, on one line.
        takes_inertias_about_tree: whether it forms inertias about the centre of a whole tree, see ``harness.comparison.far_links``.
    """

    engine: str
    formats: tuple[str, ...]
    call: Mapping[str, str]
    takes_inertias_about_tree: bool

    def ask(self, question: Question) -> Answers:
        """Load the file and return accelerations at all states; a refusal of the file is an answer, no exception."""


def projected(mass: Array, force: Array, couplings: Array) -> Array:
    """Accelerations of what moves by itself: G' M G a = G' f with velocities G v and no velocity terms of G, which is constant."""
    return np.asarray(np.linalg.solve(couplings.T @ mass @ couplings, couplings.T @ force))


def by_joint(joints: Sequence[Asked], accelerations: Array) -> dict[str, Array]:
    """{joint: columns} of accelerations over the velocities of ``joints`` in their order."""
    ends = np.cumsum([len(joint.velocities) for joint in joints])
    return dict(zip((joint.name for joint in joints), np.split(accelerations, ends[:-1], axis=1), strict=True)) if joints else {}
