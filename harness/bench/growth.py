"""Cost and error of each way of computing accelerations over the sizes of a family, and how fast a cost grows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from harness.bench.acceleration_cost import acceleration_costs
from harness.bench.measuring import Effort
from harness.bench.methods import Method
from harness.crosscheck.scene import Scene
from harness.crosscheck.tasks import Note
from harness.library import Library
from harness.results.benchmark import Growth

FAMILY = "chain"
# Where a state costs this many times what the cheapest costs, at most half is the call's own.
HIDDEN_BELOW = 2.0
FEWEST_SIZES = 2
FEWEST_STATES = 64


def growth(library: Library, methods: Sequence[Method], sizes: Sequence[int], effort: Effort, note: Note) -> list[Growth]:
    """Cost and error of each method over ``sizes`` of ``FAMILY``, in one process; ``effort`` is for size 1, larger members take less."""
    measured = []
    for size in sizes:
        note(f"{FAMILY}_{size}: derivation")
        scene = Scene.of(library, f"{FAMILY}_{size}")
        count = max(FEWEST_STATES, effort.most // size)
        measured.append(acceleration_costs(scene, methods, replace(effort, counts=(count,), judged=count), note)[0])
        if failed := next((cost for cost in measured[-1] if cost.failed), None):
            raise RuntimeError(f"{failed.method}: {failed.note}")
    return [
        Growth(
            family=FAMILY,
            method=method.name,
            sizes=list(sizes),
            seconds_per_state=[cost.seconds_per_state for cost in costs],
            backward_errors=[cost.backward_error for cost in costs],
            # The noise of a machine only adds, and at a few sizes one outlier would decide.
            exponent=exponent(sizes, [cost.fastest for cost in costs]),
            expected=method.growth,
        )
        for method, costs in zip(methods, zip(*measured, strict=True), strict=True)
    ]


def exponent(sizes: Sequence[int], seconds: Sequence[float | None]) -> float | None:
    """Slope of log seconds over log size by least squares, where the cost of a call no longer hides it.

    Those are the largest sizes at each of which a state costs at least ``HIDDEN_BELOW`` times what it costs
    at the cheapest; None where there are fewer than two.
    """
    known = [(size, cost) for size, cost in zip(sizes, seconds, strict=True) if cost]
    if not known:
        return None
    least = HIDDEN_BELOW * min(cost for _, cost in known)
    hidden = [place for place, (_, cost) in enumerate(known) if cost < least]
    upper = known[hidden[-1] + 1 :] if hidden else known
    if len(upper) < FEWEST_SIZES:
        return None
    logarithms = np.log(np.array(upper))
    return float(np.polyfit(logarithms[:, 0], logarithms[:, 1], 1)[0])
