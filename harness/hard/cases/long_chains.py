"""Chains of 2 to 64 equal bars: straight, folded and at random angles.

The knob is the number of bars, so the system changes with it; each size is asked at three seeds.
"""

from __future__ import annotations

import numpy as np

from harness.hard.cases import STATES, HardCase, Theory, with_columns
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.states import States
from harness.truth.sampling import generic_sample

SIZES = (2, 3, 4, 6, 8, 12, 16, 24, 40, 64)
SEEDS = 3

_SOURCE = (
    "Featherstone, An empirical study of the joint space inertia matrix, IJRR 23 (2004): in joint angles the condition "
    "number of M grows as the fourth power of the number of links"
)
_REMEDY = "solve by the articulated-body algorithm, or split the chain by loop constraints; a smaller step does not help"


def _at(angles: float | None, mechanism: Mechanism, seed: int) -> States:
    """Random rates and forces; the first joint anywhere and the others at ``angles``, or all anywhere for None."""
    # The Sobol sequence is spread by its scrambling, so that every seed gives other states.
    states = generic_sample(mechanism, STATES, seed)
    q = states.q if angles is None else with_columns(states.q, dict.fromkeys(range(1, mechanism.nq), angles))
    return States.at(q, states.v, states.tau)


def _case(name: str, title: str, angles: float | None, factorised: Theory) -> HardCase:
    return HardCase(
        name=f"long_chain_{name}",
        title=title,
        system=lambda value: f"chain_{value:.0f}",
        knob=("number of bars", "1"),
        values=tuple(float(size) for size in SIZES for _ in range(SEEDS)),
        states=lambda mechanism, value, seed: _at(angles, mechanism, seed),
        source=_SOURCE,
        remedy=_REMEDY,
        theory=dict.fromkeys(("lagrange", "mujoco/mjcf"), factorised),
    )


STRAIGHT = _case("straight", "chain of n equal bars in one line", 0.0, Theory("unstable", digits_growth=4.0))
FOLDED = _case("folded", "chain of n equal bars, each folded back on the one before", float(np.pi), Theory())
RANDOM = _case("random", "chain of n equal bars at random angles", None, Theory("unstable"))
