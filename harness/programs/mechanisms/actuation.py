"""Numbers of actuators that each state has of its own: their inputs, and on which side of its range each of their forces lies.

A force in its range is ``share`` times what it would be, and a constant: 1 and 0 inside, 0 and the bound beyond. On which side a state
lies is proved by bounds of the force. Where half an ulp of what the force is made of leads across, it counts as inside, where data
roundoff is larger, and the constant is what leads to the bound.
"""

from __future__ import annotations

import hashlib
from collections.abc import Hashable
from dataclasses import dataclass

import numpy as np

from harness.arrays import Array
from harness.programs.evaluation import values_and_spread
from harness.programs.kernels import BallKernel
from harness.programs.program import StraightLineProgram
from harness.programs.states import States
from harness.storage import Kept

_BITS = 192
_HALF_ULP = 2.0**-53
# Of inputs without a range, and how much further than a range others reach: a third of them lies beyond.
_REACH, _BEYOND = (-1.0, 1.0), 0.25
_KERNELS: Kept[BallKernel] = Kept(32)


@dataclass(frozen=True)
class Clamp:
    """A range of a force: the parameters ``share`` and ``constant`` by their numbers, and the bounds [N or N m]."""

    share: int
    constant: int
    low: float
    high: float


@dataclass(frozen=True, kw_only=True)
class Actuation:
    """The numbers of actuators that each state has of its own.

    Attributes:
        inputs: (parameter, actuator, whether its activation is the input). controls: number of actuators that have one.
        control_ranges, activation_ranges: (actuator, bounds), None without.
        clamps: in the order in which they act. program: its output is what each of them holds; inputs are the mechanism's.
    """

    inputs: tuple[tuple[int, int, bool], ...]
    controls: int
    control_ranges: tuple[tuple[int, tuple[float, float] | None], ...]
    activation_ranges: tuple[tuple[int, tuple[float, float] | None], ...]
    clamps: tuple[Clamp, ...]
    program: StraightLineProgram

    @property
    def key(self) -> Hashable:
        """Equal for what gives equal parameters to equal states."""
        return self.inputs, self.control_ranges, self.clamps, self.program.key

    def parameters_at(self, own: Array, states: States) -> Array:
        """Parameters ``own``, (n, number of parameters), with those of the states, whose controls count as 0 where they have none."""
        found, ranges = np.array(own), dict(self.control_ranges)
        for column, actuator, is_activation in self.inputs:
            given = states.activation if is_activation else states.control
            values = given[:, actuator] if actuator < given.shape[1] else np.zeros(len(states))
            bounds = None if is_activation else ranges[actuator]
            found[:, column] = values if bounds is None else np.clip(values, *bounds)
        known = np.hstack([states.q, states.v, states.tau, states.time[:, None]])
        for number, clamp in enumerate(self.clamps):
            self._hold(number, clamp, known, found)
        return found

    def _hold(self, number: int, clamp: Clamp, known: Array, found: Array) -> None:
        """Set share and constant of one range in the parameters of each state; those before it are set."""
        import flint

        count = self.program.inputs[known.shape[1] :]
        inputs = np.hstack([known, found[:, : len(count)]])
        _, spread = values_and_spread(self.program, np.ascontiguousarray(inputs.T), np.abs(inputs.T))
        (reach,) = (_HALF_ULP * rows[number] for rows in spread.values())
        kernel = _KERNELS.get(self.program.key, lambda: BallKernel(self.program, 0))
        with flint.ctx.workprec(_BITS):
            evaluate = kernel.bind([])
            for state, row in enumerate(inputs.tolist()):
                raw = evaluate(*row)[number]
                bound = clamp.low if raw < clamp.low else clamp.high if raw > clamp.high else None
                is_near = bound is not None and abs(float((raw - bound).mid())) <= reach[state]
                share, constant = (1.0, 0.0) if bound is None else (1.0, float((bound - raw).mid())) if is_near else (0.0, bound)
                found[state, clamp.share], found[state, clamp.constant] = share, constant

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
