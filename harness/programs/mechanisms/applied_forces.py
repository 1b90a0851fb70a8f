"""The applied forces that states of a mechanism are sampled with: how far they reach, and what holds the mechanism."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import Any

from harness.programs.kernels import BallKernel
from harness.programs.program import StraightLineProgram, right_hand_side, upper_triangle
from harness.programs.states import DEFAULT_ACCELERATION, DEFAULT_RATES

# (w, x, y, z) at which no chart is singular.
ANY_ROTATION = (0.8, 0.4, 0.4, 0.2)
# States over which the largest force that holds the mechanism is taken.
LOADED_STATES = 4
GOLDEN_RATIO = (math.sqrt(5.0) - 1) / 2


def forces_of(
    program: StraightLineProgram,
    parameters: Sequence[float],
    position_ranges: Sequence[tuple[float, float] | None],
    rate_ranges: Sequence[tuple[float, float]],
    attitudes: Sequence[int],
) -> dict[str, Any]:
    """``force_ranges``, ``static_loads`` and ``moving_loads`` of a ``Mechanism``, per coordinate [N or N m].

    They are the forces that would give each coordinate alone a brisk acceleration in the middle of its range, and those that hold it.

    At the first joint of a chain the former are some hundred times what gravity asks for. ``attitudes`` are the places of the first
    angles of ball and free joints.
    """
    n = len(position_ranges)
    evaluate = BallKernel(program, len(parameters)).bind(parameters)
    positions = [_between(bounds, (-math.pi, math.pi)) for bounds in position_ranges]
    rates = [_between(bounds, DEFAULT_RATES) for bounds in rate_ranges]

    def outputs(places: Sequence[float], v: Sequence[float]) -> dict[str, list[float]]:
        q = [low + place * (high - low) for place, (low, high) in zip(places, positions, strict=True)]
        for place in reversed(attitudes):
            q[place : place + 3] = ANY_ROTATION
        results = map(float, evaluate(*q, *v, *[0.0] * (n + 1)))
        return {name: list(itertools.islice(results, len(indices))) for name, indices in program.outputs.items()}

    mass = outputs([0.5] * n, [0.0] * n)["mass"]
    inertias = [abs(mass[position]) for position, (i, j) in enumerate(upper_triangle(n)) if i == j]
    forces = [DEFAULT_ACCELERATION * inertia if 0 < inertia < math.inf else DEFAULT_ACCELERATION for inertia in inertias]
    static, moving = [0.0] * n, [0.0] * n
    for state in range(LOADED_STATES):
        # Multiples of the golden ratio fill an interval evenly, and are the same float64 on every machine.
        places = [(state + 1) * (place + 1) * GOLDEN_RATIO % 1.0 for place in range(2 * n)]
        v = [low + place * (high - low) for place, (low, high) in zip(places[n:], rates, strict=True)]
        static = _largest(static, right_hand_side(outputs(places[:n], [0.0] * n)))
        moving = _largest(moving, right_hand_side(outputs(places[:n], v)))
    ranges = tuple((-force, force) for force in forces)
    return {"force_ranges": ranges, "static_loads": tuple(static), "moving_loads": tuple(moving)}


def _between(bounds: tuple[float, float] | None, otherwise: tuple[float, float]) -> tuple[float, float]:
    low, high = bounds or otherwise
    return float(low), float(high)


def _largest(loads: Sequence[float], forces: Sequence[float]) -> list[float]:
    """The larger magnitude of each; what is not finite, where the equations are singular, is left out."""
    return [max(load, abs(force) if math.isfinite(force) else 0.0) for load, force in zip(loads, forces, strict=True)]
