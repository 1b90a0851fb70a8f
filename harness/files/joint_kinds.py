"""Kinds of joints, and what is the same of each for model files, equations and engines."""

from __future__ import annotations

from enum import StrEnum
from typing import Self


class JointKind(StrEnum):
    """A kind of joint.

    Attributes:
        coordinates: names of its velocities, of which there is one of a joint with a single coordinate, called "".
        linear: number of its linear velocities, which stand before the angular ones.
        has_axis: a direction belongs to it; that of a planar joint is square to its plane.
        has_attitude: its last four positions are a quaternion (w, x, y, z), which its last three velocities turn.
    """

    HINGE = "hinge", ("",), 0
    SLIDE = "slide", ("",), 1
    PLANAR = "planar", ("x", "y", "turn"), 2
    BALL = "ball", ("x", "y", "z"), 0
    FREE = "free", ("x", "y", "z", "about x", "about y", "about z"), 3

    coordinates: tuple[str, ...]
    linear: int

    def __new__(cls, word: str, coordinates: tuple[str, ...] = (), linear: int = 0) -> Self:
        self = str.__new__(cls, word)
        self._value_ = word
        self.coordinates, self.linear = coordinates, linear
        return self

    @property
    def velocities(self) -> int:
        return len(self.coordinates)

    @property
    def positions(self) -> int:
        return self.velocities + self.has_attitude

    @property
    def sizes(self) -> tuple[int, int]:
        """Number of positions and of velocities."""
        return self.positions, self.velocities

    @property
    def turning(self) -> tuple[bool, ...]:
        """For each velocity, True for the rate of a rotation."""
        return tuple(number >= self.linear for number in range(self.velocities))

    @property
    def is_single(self) -> bool:
        """True for a joint with one coordinate along or about its axis: a hinge or a slide."""
        return self.velocities == 1

    @property
    def has_axis(self) -> bool:
        return not self.has_attitude

    @property
    def has_attitude(self) -> bool:
        return self.velocities - self.linear == 3
