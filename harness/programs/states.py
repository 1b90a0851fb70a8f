"""States of a mechanism, many at a time, and the ranges of what a system file leaves open."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from harness.arrays import Array, Rows, no_columns

DEFAULT_RATES = (-10.0, 10.0)
# Applied forces reach what would give a coordinate alone this acceleration [1/s^2, or m/s^2].
DEFAULT_ACCELERATION = 100.0
# mjMAXVAL, beyond which MuJoCo takes a state for unstable: a motion that leads there has broken down, whoever moves.
LARGEST_STATE = 1e10


@dataclass(frozen=True)
class States(Rows):
    """n states of a mechanism: q of shape (n, nq), v and tau (n, nv), and time (n,) [s].

    With actuators, ``control`` and ``activation`` (n, actuators of the file); 0 for those that have none.
    """

    q: Array
    v: Array
    tau: Array
    time: Array
    control: Array = field(default_factory=no_columns)
    activation: Array = field(default_factory=no_columns)

    @classmethod
    def at(cls, q: Any, v: Any, tau: Any, time: Any = None, control: Any = None, activation: Any = None) -> States:
        """States from anything array-like; one state may be given by flat sequences."""
        q, v, tau = (np.ascontiguousarray(np.atleast_2d(np.asarray(part, dtype=np.float64))) for part in (q, v, tau))
        driving = (np.empty((len(q), 0)) if part is None else np.atleast_2d(np.asarray(part, float)) for part in (control, activation))
        return cls(q, v, tau, np.zeros(len(q)) if time is None else np.atleast_1d(np.asarray(time, dtype=np.float64)), *driving)

    @classmethod
    def concatenate(cls, parts: Sequence[States]) -> States:
        """The states of all parts, in order; what some of them do not drive has control and activation 0 there."""
        widths = {name: max(getattr(part, name).shape[1] for part in parts) for name in ("control", "activation")}
        return super().concatenate([replace(part, **{name: part.driving(name, width) for name, width in widths.items()}) for part in parts])

    def driving(self, name: str, width: int) -> Array:
        """(n, width) control or activation."""
        given = getattr(self, name)[:, :width]
        return np.hstack([given, np.zeros((len(self), width - given.shape[1]))])

    @property
    def known(self) -> Array:
        """The inputs of a mechanism's programs but for its parameters, (n, nq + 2 nv + 1), one row a state."""
        return np.hstack([self.q, self.v, self.tau, self.time[:, None]])

    def as_json(self, index: int) -> dict[str, list[float]]:
        """One state as ``{"q", "v", "tau"}`` lists, which print exactly, with time, control and activation where these are not 0."""
        return {name: getattr(self[[index]], name).ravel().tolist() for name in self.named}

    @property
    def named(self) -> tuple[str, ...]:
        """The parts that say which states these are: a mechanism that does not feel time has all of them at time 0."""
        driving = tuple(name for name in ("control", "activation") if getattr(self, name).any())
        return ("q", "v", "tau", *(("time",) if self.time.any() else ()), *driving)
