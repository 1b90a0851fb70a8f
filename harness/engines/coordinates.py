"""Positions, velocities and forces of joints in the coordinates of an engine, and accelerations back.

Where a free or planar joint has its linear velocity is a convention: in the frame of the parent, which stays, or in that of the body.
The rates of components in a frame that turns miss the turning of the frame.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.files.joint_kinds import JointKind

BALL, FREE = (4, 3), (7, 6)


def rotations(quaternions: Array) -> Array:
    """(n, 3, 3) of unit quaternions (w, x, y, z), (n, 4)."""
    w, x, y, z = quaternions.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)


def multiplied(first: Array, second: Array) -> Array:
    """Products of quaternions (w, x, y, z), (n, 4)."""
    w, vector = first[..., :1], first[..., 1:]
    other_w, other = second[..., :1], second[..., 1:]
    real = w * other_w - (vector * other).sum(axis=-1, keepdims=True)
    return np.concatenate([real, w * other + other_w * vector + np.cross(vector, other)], axis=-1)


def quaternion_of(turn: Array) -> Array:
    """(w, x, y, z) of a rotation (3, 3)."""
    x, y, z = np.diag(turn)
    # Of the four squares the largest is 1/4 at least.
    squares = np.array([1 + x + y + z, 1 + x - y - z, 1 - x + y - z, 1 - x - y + z])
    largest = int(squares.argmax())
    rows = np.array(
        [
            [squares[0], turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]],
            [turn[2, 1] - turn[1, 2], squares[1], turn[1, 0] + turn[0, 1], turn[0, 2] + turn[2, 0]],
            [turn[0, 2] - turn[2, 0], turn[1, 0] + turn[0, 1], squares[2], turn[2, 1] + turn[1, 2]],
            [turn[1, 0] - turn[0, 1], turn[0, 2] + turn[2, 0], turn[2, 1] + turn[1, 2], squares[3]],
        ]
    )
    return np.asarray(rows[largest] / (2 * np.sqrt(squares[largest])))


def of_linear(turn: Array, values: Any) -> Any:
    """Velocities or forces with their linear components turned; ``turn`` is (n, 2, 2) or (n, 3, 3), or one for all."""
    count = turn.shape[-1]
    return np.hstack([np.einsum("...ij,nj->ni" if turn.ndim == 2 else "nij,nj->ni", turn, values[:, :count]), values[:, count:]])


def body_turn(kind: JointKind, q: Array) -> Array:
    """Orientation of the body of a free or planar joint at positions q, (n, 3, 3) or (n, 2, 2)."""
    if kind == JointKind.FREE:
        return rotations(q[:, 3:])
    cosine, sine = np.cos(q[:, 2]), np.sin(q[:, 2])
    return np.moveaxis(np.array([[cosine, -sine], [sine, cosine]]), 2, 0)


def to_body(turn: Array, values: Array) -> Array:
    """Velocities or forces whose linear components are in the frame of the parent, in that of the body."""
    return np.asarray(of_linear(turn.transpose(0, 2, 1), values))


def accelerations_from_body(turn: Array, accelerations: Array, v: Array) -> Array:
    """Rates of components in the frame of the body, as rates of those in the frame of the parent; ``v`` is in the latter."""
    count = turn.shape[-1]
    linear, angular = to_body(turn, v)[:, :count], v[:, count:]
    turning = angular * np.column_stack([-linear[:, 1], linear[:, 0]]) if count == 2 else np.cross(angular, linear)
    return np.asarray(of_linear(turn, np.hstack([accelerations[:, :count] + turning, accelerations[:, count:]])))


def rotation(quaternion: Array) -> Array:
    """The rotation matrix (3, 3) from the body's frame to the parent's, of (w, x, y, z) of any length but 0."""
    w, x, y, z = quaternion / np.linalg.norm(quaternion)
    return np.array(
        [
            [w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z],
        ]
    )


def cross_matrix(vector: Array) -> Array:
    """The matrix (3, 3) that takes another vector to the product of ``vector`` with it."""
    x, y, z = vector
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


class Columns:
    """Columns of the joints in the harness's q and v: by name the first column of each; ``sizes`` are (nq, nv) of each."""

    def __init__(self, joints: Sequence[str], sizes: Mapping[str, tuple[int, int]]) -> None:
        self.sizes = {name: sizes[name] for name in dict.fromkeys(joints)}
        ends = np.cumsum([(0, 0), *self.sizes.values()], axis=0).tolist()
        self.first = dict(zip(self.sizes, map(tuple, ends), strict=False))
        self.nq, self.nv = ends[-1]

    def spans(self, name: str) -> tuple[slice, slice]:
        """The columns of a joint in q and in v."""
        (q, v), (nq, nv) = self.first[name], self.sizes[name]
        return slice(q, q + nq), slice(v, v + nv)

    def turn(self, q: Array, places: Mapping[str, int], width: int, rotation_first: bool) -> Array:
        """The matrix (nv, width) that takes velocities, accelerations and forces of an engine to those of the harness, at one q.

        Its transpose takes them back. The engine has angular velocities along the axes of the parent, and a joint from the column in
        ``places`` on; ``rotation_first``: of a free joint it has the angular velocity before the linear one. That the body's axes turn
        about the angular velocity itself changes no component of its rate.
        """
        found = np.zeros((self.nv, width))
        for name, (nq, nv) in self.sizes.items():
            rows, columns = self.spans(name)
            block = np.eye(nv)
            if nq > nv:
                block[-3:, -3:] = rotation(q[rows][-4:]).T
            if nv == FREE[1] and rotation_first:
                block = np.roll(block, 3, axis=1)
            found[columns, places[name] : places[name] + nv] = block
        return found
