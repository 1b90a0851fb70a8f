"""Contents of a picture of a model: two configurations, as an engine's own kinematics places it in the world [m], and from where.

A planar mechanism is seen along its hinges, a spatial one from a corner.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from harness.arrays import Array
from harness.engines import HeldBody, HeldJoint, HeldModel, Model
from harness.files.joint_kinds import JointKind
from harness.programs.mechanisms.mechanism import Mechanism

ANGLE_SHOWN = 0.4
SLIDE_SHOWN = 0.25
WORLD = -1
Point = tuple[float, float]
_FLAT = 1e-6


@dataclass(frozen=True)
class Pose:
    """A mechanism at one configuration; the joints of a body stand in their order from its parent.

    Attributes:
        joints: by name. bodies: those that move. springs: their lines, from end to end.
        body_of: joint to the place in ``bodies`` of the one it moves.
        parents: for each body the place of the one that carries it, or ``WORLD``.
    """

    joints: dict[str, HeldJoint]
    bodies: list[HeldBody]
    springs: list[Array]
    body_of: dict[str, int]
    parents: list[int]

    @classmethod
    def of(cls, held: HeldModel) -> Pose:
        """A model whose every body is held; of the joints of a body, each carries the next."""
        names = list(held.bodies)
        carried = {joint.parent: name for name, joint in held.joints.items()}
        body_of = {}
        parents = [WORLD] * len(names)
        for name in held.joints:
            last = name
            while last not in names:
                last = carried[last]
            body_of[name] = names.index(last)
        for name, joint in held.joints.items():
            parent = body_of.get(joint.parent, WORLD)
            if parent != body_of[name]:
                parents[body_of[name]] = parent
        return cls(dict(held.joints), list(held.bodies.values()), [spring.points for spring in held.springs], body_of, parents)

    def points(self) -> list[Array]:
        """Everything that a picture must hold."""
        ends = [point for joint in self.joints.values() for point in (joint.anchor, joint.moved)]
        return ends + [body.centre for body in self.bodies if body.mass > 0] + [point for line in self.springs for point in line]


def place(model: Model, mechanism: Mechanism) -> tuple[Pose, Pose] | None:
    """A loaded model at its zero configuration, and with every coordinate moved a little in its positive direction.

    A coordinate whose range does not hold 0 stands in the middle of it. None where the engine places nothing. Raises what the
    engine raises.
    """
    held = getattr(model, "held", None)
    if held is None:
        return None
    ranges = dict(zip(mechanism.joints, mechanism.position_ranges, strict=True))
    singles = {joint: ranges[joint] for joint, size in mechanism.joint_sizes.items() if size == (1, 1)}
    middle = {joint: sum(bounds) / 2 if bounds and not bounds[0] <= 0.0 <= bounds[1] else 0.0 for joint, bounds in singles.items()}
    resting = Pose.of(held(middle, {}))
    extent = extent_of(resting) or max((abs(bound) for bounds in singles.values() if bounds for bound in bounds), default=0.0) or 1.0
    kinds = {name: JointKind(joint.kind) for name, joint in resting.joints.items()}
    steps = {name: [ANGLE_SHOWN if turns else SLIDE_SHOWN * extent for turns in kind.turning] for name, kind in kinds.items()}
    steps |= {name: [min(steps[name][0], bounds[1] - middle[name])] for name, bounds in singles.items() if bounds}
    return resting, Pose.of(held(middle, steps))


def extent_of(pose: Pose) -> float:
    """The diagonal of the box that holds all of a pose [m]."""
    return float(np.linalg.norm(np.ptp(np.array(pose.points()), axis=0)))


@dataclass(frozen=True)
class View:
    """A direction to look along: unit vectors to the right, up, and towards the viewer; a name for the caption."""

    name: str
    right: Array
    up: Array

    @property
    def towards(self) -> Array:
        return np.cross(self.right, self.up)

    def flat(self, vector: Array) -> Point:
        """A vector's components to the right and up."""
        return float(np.dot(vector, self.right)), float(np.dot(vector, self.up))


def _view(name: str, right: Sequence[float], up: Sequence[float]) -> View:
    return View(name, np.array(right) / np.linalg.norm(right), np.array(up) / np.linalg.norm(up))


PLANES = (_view("x-z plane", (1, 0, 0), (0, 0, 1)), _view("x-y plane", (1, 0, 0), (0, 1, 0)), _view("y-z plane", (0, 1, 0), (0, 0, 1)))
CORNER = _view("seen from a corner: x to the right and front, y to the right and back", (0.8, 0.6, 0), (-0.27, 0.36, 0.893))


def choose_view(placements: Iterable[Pose]) -> View:
    """The plane the mechanism moves in, where it extends most if there are several; a corner for spatial ones."""
    placements = list(placements)
    points = np.array([point for placement in placements for point in placement.points()])

    def in_plane(view: View) -> bool:
        joints = placements[0].joints.values()
        if not all(JointKind(joint.kind).is_single for joint in joints):
            return False
        along = [(joint.kind, abs(float(np.dot(joint.axis, view.towards)))) for joint in joints]
        return all(amount > 1 - _FLAT if kind == JointKind.HINGE else amount < _FLAT for kind, amount in along)

    def extent(view: View) -> float:
        return float(sum(np.ptp(points @ direction) for direction in (view.right, view.up)))

    return max((view for view in PLANES if in_plane(view)), key=extent, default=CORNER)
