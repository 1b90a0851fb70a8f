"""How much a benchmark measures, by the name of a profile."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Thoroughness:
    """The extent of a benchmark.

    Attributes:
        states: states per system of the accelerations; minimum_seconds: how long each method is timed at least.
        derivative_states: numbers of states of which derivatives are asked for at once.
        quantity_states: at which errors of other quantities than accelerations are measured.
        sizes: numbers of bodies of the growing chain; arms: of seven joints, of the growing robot.
        steps: steps of the integrators [s]; horizon: length of those motions [s].
        seconds: longest that an integrator may take with one step, else the step is left out.
        long_steps: steps of a long run, or as many as take an integrator ``long_seconds``.
        time_limit: seconds a task may take.
    """

    states: int
    minimum_seconds: float
    derivative_states: Sequence[int]
    quantity_states: int
    sizes: Sequence[int]
    arms: Sequence[int]
    steps: Sequence[float]
    horizon: float
    seconds: float
    long_steps: int
    long_seconds: float
    time_limit: float


THOROUGHNESS = {
    "quick": Thoroughness(
        states=1000, minimum_seconds=0.05, derivative_states=(1, 10, 100, 1000), quantity_states=128,
        sizes=(1, 2, 4, 8, 16), arms=(1, 2, 4, 8, 14),
        steps=(1e-1, 1e-2, 1e-3, 1e-4, 1e-5), horizon=2.0, seconds=0.5, long_steps=1_000_000, long_seconds=2.0, time_limit=300.0,
    ),
    "nightly": Thoroughness(
        states=10_000, minimum_seconds=0.5, derivative_states=(1, 10, 100, 1000, 10_000), quantity_states=1000, sizes=(1, 2, 4, 8, 16, 32),
        arms=(1, 2, 4, 8, 14), horizon=10.0, seconds=30.0,
        steps=(1e-1, 3e-2, 1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 3e-5, 1e-5), long_steps=1_000_000, long_seconds=120.0, time_limit=3600.0,
    ),
}  # fmt: skip
