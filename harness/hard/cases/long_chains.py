"""Chains of 2 to 64 equal bars, straight, folded and at random angles, and masses that grow or shrink along a chain.

Where the knob is the number of bars, the system changes with it, and each size is asked at three seeds. Masses change by up to twelve
orders of magnitude.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from harness.hard.cases import (
    Changes,
    HardCase,
    Rule,
    Theory,
    Values,
    at_each_seed,
    decades,
    inertia_numbers,
    of_sizes,
    together,
    with_columns,
)
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.states import States

SIZES = (2, 3, 4, 6, 8, 12, 16, 24, 40, 64)
# What MuJoCo accepts [kg m^2].
LEAST_INERTIA = 1e-15

_FEATHERSTONE = "Featherstone, An empirical study of the joint space inertia matrix, IJRR 23 (2004)"


def _bent(angle: float) -> Callable[[Mechanism, float, int], States]:
    """Random rates and forces; the first joint anywhere and the others at ``angle``."""

    def states(mechanism: Mechanism, value: float, seed: int) -> States:
        spread = at_each_seed(mechanism, value, seed)
        return States.at(with_columns(spread.q, dict.fromkeys(range(1, mechanism.nq), angle)), spread.v, spread.tau)

    return states


def bar_inertias(mass: str, length: str) -> tuple[Rule, Rule]:
    """The moments of a bar across and along it: m L^2 / 12, and what MuJoCo accepts for one that no motion feels.

    Never more than the two others together, which no body in space has.
    """

    def across(values: Values) -> float:
        return values[mass] * values[length] ** 2 / 12

    return across, lambda values: min(LEAST_INERTIA, across(values))


def bar_numbers(n: int) -> dict[str, Changes]:
    """The numbers of both models of a chain of ``n`` bars that masses m1.. and lengths L1.. decide."""

    def minus(name: str, share: float) -> Rule:
        return lambda values: -share * values[name]

    parts: list[dict[str, dict[str, Rule]]] = []
    for i in range(1, n + 1):
        across, along = bar_inertias(f"m{i}", f"L{i}")
        body, link, half = f"body bar_{i}", f"link link_{i}", minus(f"L{i}", 0.5)
        parts.append(inertia_numbers(f"bar_{i}", f"link_{i}", {"x": across, "y": across}, f"m{i}"))
        mjcf = {f"{body}/inertial@pos[2]": half, f"{body}/inertial@diaginertia[2]": along}
        parts.append({"mjcf": mjcf, "urdf": {f"{link}/inertial/origin@xyz[2]": half}})
        if i > 1:
            above = minus(f"L{i - 1}", 1.0)
            parts.append({"mjcf": {f"{body}@pos[2]": above}, "urdf": {f"joint joint_{i}/origin@xyz[2]": above}})
    return together(parts)


def _progression(n: int) -> Callable[[float], Values]:
    return lambda ratio: {f"m{i + 1}": ratio ** (i / (n - 1)) for i in range(n)}


CASES = (
    *(
        HardCase(
            name=f"long_chain_{name}",
            title=f"chain of n equal bars{title}",
            system=lambda value: f"chain_{value:.0f}",
            knob=("number of bars", "1"),
            values=of_sizes(SIZES),
            states=states,
            source=f"{_FEATHERSTONE}: in joint angles the condition number of M grows as the fourth power of the number of links",
            remedy="solve by the articulated-body algorithm, or split the chain by loop constraints; a smaller step does not help",
            theory=dict.fromkeys(("lagrange", "mujoco/mjcf"), factorised),
        )
        for name, title, states, factorised in (
            ("straight", " in one line", _bent(0.0), Theory("unstable", digits_growth=4.0)),
            ("folded", ", each folded back on the one before", _bent(math.pi), Theory()),
            ("random", " at random angles", at_each_seed, Theory("unstable")),
        )
    ),
    *(
        HardCase(
            name=f"mass_ratio_{n}",
            title=f"chain of {n} bars whose masses form a geometric progression",
            system=f"bar_chain_{n}",
            knob=("mass of the last bar over the first's", "1"),
            values=decades(-12, 12),
            parameters=_progression(n),
            changes=bar_numbers(n),
            source=f"{_FEATHERSTONE}, section 5; "
            "Ascher, Pai, Cloutier, Forward dynamics, elimination methods, and formulation stiffness, IJRR 16 (1997)",
            remedy="solve by the articulated-body algorithm, or root the tree at the heavy end; a reduced model without the light "
            "links loses less than they weigh",
            theory={"lagrange": Theory("unstable"), "mujoco/mjcf": Theory("unstable")} if n == 10 else {},
        )
        for n in (2, 3, 10)
    ),
)
