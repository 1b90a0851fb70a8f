"""Rotations of ball and free joints, and angular vectors between the frames in which engines have them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from harness.arrays import Array

BALL, FREE = (4, 3), (7, 6)


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
    """Where the harness has the joints in q and v: by name the first column of each; ``sizes`` are (nq, nv) of each."""

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
