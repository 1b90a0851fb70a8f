"""The two configurations that a picture shows of a model."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from harness.engines import Model
from harness.engines._placement import Placement
from harness.equations.mechanism import Mechanism

ANGLE_SHOWN = 0.4
SLIDE_SHOWN = 0.25


def place(model: Model, mechanism: Mechanism) -> tuple[Placement, Placement] | None:
    """A loaded model at its zero configuration, and with every coordinate moved a little in its positive direction.

    A coordinate whose range does not hold 0 stands in the middle of it. None where the engine places nothing. Raises what the
    engine raises.
    """
    placer = getattr(model, "place", None)
    if placer is None:
        return None
    singles = {
        joint: bounds
        for joint, bounds in zip(mechanism.joints, mechanism.position_ranges, strict=True)
        if mechanism.joint_sizes[joint] == (1, 1)
    }
    middle = {
        joint: sum(bounds) / 2 if bounds is not None and not bounds[0] <= 0.0 <= bounds[1] else 0.0 for joint, bounds in singles.items()
    }
    resting = placer(middle, {})
    step = SLIDE_SHOWN * _extent(resting, singles)
    steps: dict[str, list[float]] = {}
    for joint in resting.joints:
        wanted = {"slide": [step], "hinge": [ANGLE_SHOWN], "ball": [ANGLE_SHOWN] * 3, "free": [step] * 3 + [ANGLE_SHOWN] * 3}[joint.kind]
        bounds = singles.get(joint.name)
        steps[joint.name] = wanted if bounds is None else [min(wanted[0], bounds[1] - middle[joint.name])]
    return resting, placer(middle, steps)


def _extent(placement: Placement, ranges: Mapping[str, tuple[float, float] | None]) -> float:
    span = float(np.linalg.norm(np.ptp(np.array(placement.points()), axis=0)))
    return span or max((abs(bound) for bounds in ranges.values() if bounds for bound in bounds), default=0.0) or 1.0
