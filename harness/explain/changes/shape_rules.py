"""Rules of engines for shapes, found in their source alone: poses that are not the file's, and more points than are documented.

Contacts are held against the file; those that are where such a rule has them are told as that.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from harness.arrays import Array
from harness.files.given import ORIGIN, Pose
from harness.files.shapes import BOX, Shape
from harness.files.tree import WORLD, Tree
from harness.trees.bodies.spatial import FileBuilder, placed

# kFrameEps of MuJoCo's compiler, of each component of a position and of a unit quaternion.
ALIKE = 1e-6
_BITS = 128


@dataclass(frozen=True, kw_only=True)
class ShapeRule:
    """A rule for shapes that is not the documented one.

    Attributes:
        engine: of whom. sentence, remedy, source: as of ``harness.explain.changes.departures.Departure``.
        placed: the pose of a shape of a tree as the engine has it; an equal one where that is the file's.
        every_corner: whether boxes touch planes with all of their corners, those above their centres too.
    """

    engine: str
    sentence: str
    remedy: str
    source: str
    placed: Callable[[Tree, Shape], Pose] = lambda _tree, shape: shape.pose
    every_corner: bool = False

    def of(self, tree: Tree, shape: Shape) -> Shape:
        """The shape where the engine has it."""
        return shape if shape.ends else replace(shape, pose=self.placed(tree, shape))

    def bears_on(self, tree: Tree, shape: Shape) -> bool:
        """True for a shape that has other contacts by this rule."""
        return (self.every_corner and shape.kind == BOX) or self.of(tree, shape) != shape


def shape_rules_of(engine: str, reader: str) -> list[ShapeRule]:
    """Those of an engine, and of the engine whose reader it has."""
    return [one for one in _RULES if one.engine in (engine, reader)]


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


_RULES = (
    ShapeRule(
        engine="mujoco_warp",
        sentence="MuJoCo Warp has a box touch a plane with all eight corners, those above its centre too",
        remedy="expect other contact forces than MuJoCo's where a box is in a plane with more than half of it",
        source="docs/issues/mujoco-warp-corners-above-the-centre.md",
        every_corner=True,
    ),
    ShapeRule(
        engine="mujoco",
        sentence="MuJoCo puts a geom into the frame of its body, or of the body's inertia, where their poses differ by less than 1e-6",
        remedy="write the pose of the geom as that of the inertial, or farther from it than 1e-6",
        source="MuJoCo, src/user/user_model.cc, CopyTree: geom_sameframe, and kFrameEps of IsSamePose",
        placed=_in_a_frame_of_the_body,
    ),
)
