"""Numbers of actuators that each state has of its own: their inputs, and on which side of its range each of their forces lies."""

from __future__ import annotations

import hashlib
from collections.abc import Hashable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from harness.arrays import Array
from harness.programs.states import States

if TYPE_CHECKING:
    from harness.programs.mechanisms.clamps import Clamp
    from harness.programs.mechanisms.zones import Zones

# Of inputs without a range, and how much further than a range others reach: a third of them lies beyond.
_REACH, _BEYOND = (-1.0, 1.0), 0.25


@dataclass(frozen=True, kw_only=True)
class Actuation:
    """The numbers of actuators that each state has of its own.

    Attributes:
        inputs: (parameter, actuator, whether its activation is the input). controls: number of actuators that have one.
        control_ranges, activation_ranges: (actuator, bounds), None without.
        clamped_controls: ranges that hold controls, by actuator. zones: of the forces that ranges hold; None without any.
    """

    inputs: tuple[tuple[int, int, bool], ...]
    controls: int
    control_ranges: tuple[tuple[int, tuple[float, float] | None], ...]
    activation_ranges: tuple[tuple[int, tuple[float, float] | None], ...]
    clamped_controls: tuple[tuple[int, Clamp], ...]
    zones: Zones | None

    @property
    def key(self) -> Hashable:
        """Equal for what gives equal parameters to equal states."""
        return self.inputs, self.control_ranges, self.clamped_controls, self.zones and self.zones.key

    @property
    def own(self) -> frozenset[int]:
        """The parameters that each state has of its own, which are no numbers of the file."""
        clamps = (*(self.zones.clamps if self.zones else ()), *(clamp for _, clamp in self.clamped_controls))
        return frozenset([*(column for column, _, _ in self.inputs), *(column for clamp in clamps for column in clamp.own)])

    def parameters_at(self, own: Array, states: States) -> Array:
        """Parameters ``own``, (n, number of parameters), with those of the states, whose controls count as 0 where they have none."""
        found, ranges = np.array(own), dict(self.clamped_controls)
        for column, actuator, is_activation in self.inputs:
            given = states.activation if is_activation else states.control
            found[:, column] = values = given[:, actuator] if actuator < given.shape[1] else np.zeros(len(states))
            if (clamp := ranges.get(actuator)) is not None:
                low, high = clamp.least(found), clamp.most(found)
                clamp.put(found, np.where(values < low, -1.0, np.where(values > high, 1.0, 0.0)), low, high)
        if self.zones is not None:
            self.zones.settle(states.known, found)
        return found

    def controlled(self, states: States) -> States:
        """The states with controls and activations that their own bits choose, within their ranges and, a third of them, beyond."""
        control, activation = np.zeros((2, len(states), self.controls))
        for state in range(len(states)):
            bits = b"".join(part[state].tobytes() for part in (states.q, states.v, states.tau))
            random = np.random.default_rng(int.from_bytes(hashlib.blake2b(bits, digest_size=8).digest()))
            for given, ranges in ((control, self.control_ranges), (activation, self.activation_ranges)):
                for actuator, bounds in ranges:
                    low, high = bounds or _REACH
                    further = _BEYOND * (high - low)
                    given[state, actuator] = random.uniform(low - further, high + further)
        return States(states.q, states.v, states.tau, states.time, control, activation)
