"""Placements: where an engine's compiler puts shapes elsewhere than their file does, found in its source alone.

Contacts are held against the file; those that are where such a shape touches are told as that.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from harness.arrays import Array
from harness.files.given import ORIGIN, Pose
from harness.files.shapes import Shape
from harness.files.tree import WORLD, Tree
from harness.trees.bodies.spatial import FileBuilder, placed

# kFrameEps of MuJoCo's compiler, of each component of a position and of a unit quaternion.
ALIKE = 1e-6
_BITS = 128


@dataclass(frozen=True, kw_only=True)
class ShapePlacement:
    """A placement of shapes that is not the file's.

    Attributes:
        engine: of whom. sentence, remedy, source: as of ``harness.explain.changes.departures.Departure``.
        placed: the pose of a shape of a tree as the engine has it; an equal one where that is the file's.
    """

    engine: str
    sentence: str
    remedy: str
    source: str
    placed: Callable[[Tree, Shape], Pose]


def placement_of(engine: str, reader: str) -> ShapePlacement | None:
    """That of an engine, or of the engine whose reader it has; None without one."""
    return next((one for one in _PLACEMENTS if one.engine in (engine, reader)), None)


def as_placed(placement: ShapePlacement, tree: Tree, shape: Shape) -> Shape:
    """The shape where the engine has it."""
    return shape if shape.ends else replace(shape, pose=placement.placed(tree, shape))


def _in_a_frame_of_the_body(tree: Tree, shape: Shape) -> Pose:
    """The pose, of which position and orientation, or the latter alone, are those of a frame of the body that is nearly the same.

    The body's own frame comes first, with an orientation alone too, then that of its inertia.
    """
    body = next((one for one in tree.bodies if one.name == shape.body), None)
    if shape.body == WORLD or body is None:
        return shape.pose
    own, frames = frame_of(shape.pose), list[Pose]([()])
    if body.inertia is not None and not any(body.inertia.moments[3:]):
        frames.append(body.inertia.pose)
    for frame in frames:
        position, orientation = frame_of(frame)
        if min(np.abs(own[1] - orientation).max(), np.abs(own[1] + orientation).max()) < ALIKE:
            if np.abs(own[0] - position).max() < ALIKE:
                return frame
            if len(shape.pose) == 1 and len(frame) <= 1:
                return (*(replace(one, rotation=()) for one in shape.pose), *(replace(one, position=ORIGIN) for one in frame))
    return shape.pose


def frame_of(pose: Pose) -> tuple[Array, Array]:
    """Position (3,) and unit quaternion (4,) of a pose."""
    builder = FileBuilder(())
    frame = placed(builder, pose)
    numbers = builder.evaluated({"frame": [*frame.shift, *frame.turn.ravel()]}, _BITS)["frame"]
    values = np.array([float(one.mid()) for one in numbers])
    return values[:3], _quaternion(values[3:].reshape(3, 3))


def _quaternion(turn: Array) -> Array:
    # Imported late: no other file of changes needs it.
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_matrix(turn).as_quat(scalar_first=True))


_PLACEMENTS = (
    ShapePlacement(
        engine="mujoco",
        sentence="MuJoCo puts a geom into the frame of its body, or of the body's inertia, where their poses differ by less than 1e-6",
        remedy="write the pose of the geom as that of the inertial, or farther from it than 1e-6",
        source="MuJoCo, src/user/user_model.cc, CopyTree: geom_sameframe, and kFrameEps of IsSamePose",
        placed=_in_a_frame_of_the_body,
    ),
)
