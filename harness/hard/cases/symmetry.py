"""States in a symmetric set, or next to it, from which exact dynamics does not depart by itself."""

from __future__ import annotations

import numpy as np

from harness.arrays import Array
from harness.hard.cases import STATES, HardCase, decades, shares, turned, varied, with_columns
from harness.programs.states import States

_INVARIANT = "Marsden, Ratiu, Introduction to Mechanics and Symmetry, 2nd ed., chapter 8: the fixed points of a symmetry stay fixed points"


def _almost_principal(states: States, value: float) -> dict[str, Array]:
    """Turning about the middle principal axis, which is unstable; ``value`` is the rate about the others."""
    x, z = shares(2, STATES)
    rates = {**dict.fromkeys(range(3), 0.0), 3: value * x, 4: 5.0, 5: value * z}
    rotation = dict(zip(range(3, 7), turned((0.6, 0.0, 0.8), 1.0), strict=True))
    return {"q": with_columns(states.q, rotation), "v": with_columns(states.v, rates), "tau": np.zeros_like(states.tau)}


CASES = (
    HardCase(
        name="planar_swing",
        title="spherical pendulum that almost swings in a plane",
        system="spherical_pendulum",
        knob=("rate of the azimuth", "rad/s"),
        values=decades(-20, 0),
        # The azimuth alone turns at this rate, and nothing drives it.
        states=varied(
            lambda states, rate: {"v": with_columns(states.v, {1: rate * shares(STATES)}), "tau": with_columns(states.tau, {1: 0.0})}
        ),
        source=_INVARIANT,
        remedy="nothing: what leaves the plane is within what the data decide",
    ),
    HardCase(
        name="middle_axis",
        title="free body that almost turns about its middle principal axis",
        system="free_body",
        knob=("rate about the other axes", "rad/s"),
        values=decades(-20, 0),
        states=varied(_almost_principal),
        source=_INVARIANT + "; Goldstein, Poole, Safko, Classical Mechanics, 3rd ed., section 5.6 (instability of the middle axis)",
        remedy="nothing: an error that leaves the axis grows in motion as the theory says",
    ),
)
