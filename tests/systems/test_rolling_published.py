"""Rolling and ropes: what texts print of them, held against the certified accelerations, and both ways to these."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import mpmath
import numpy as np
import pytest

from harness.certify.manifold import closes
from harness.certify.reference import Reference, ReferenceKernel, energy_norm
from harness.certify.sampling import sample
from harness.equations.constraint_forces import by_reduction, constrained_program
from harness.equations.derivation import load_mechanism
from harness.equations.mechanism import Mechanism
from harness.library import Library

BUILT_IN = Library.built_in()
SEED = 23
DIGITS = 50
# Of the numbers that ``sample`` draws; by night of the bead, which the project began with.
COUNT, MANY = 1000, 100_000

Named = Mapping[str, Any]


def mechanism_named(name: str) -> Mechanism:
    return load_mechanism(BUILT_IN, name)


def open_between(one: Reference, other: Reference) -> np.ndarray:
    """(n,) what the radii of two enclosures leave open between them, with the rounding of the low parts [sqrt(J)/s]."""
    return np.asarray(one.radius + other.radius + 2.0**-104 * one.size)


@pytest.mark.parametrize(
    ("name", "count"),
    [
        ("rolling_disc_on_incline", COUNT),
        ("atwood", COUNT),
        ("cycloid_bead", 2 * COUNT),
        pytest.param("cycloid_bead", MANY, marks=pytest.mark.nightly),
    ],
)
def test_multipliers_and_reduction_enclose_the_same_accelerations(name: str, count: int) -> None:
    mechanism = mechanism_named(name)
    assert mechanism.constraints is not None
    states = sample(mechanism, count, SEED)
    assert closes(mechanism, states).all()
    reduced = replace(mechanism, program=constrained_program(mechanism.constraints, by_reduction))
    one, other = (ReferenceKernel(way).evaluate(states) for way in (mechanism, reduced))
    assert one.certified.all() and other.certified.all()
    apart = energy_norm(one.norm_factor, (one.high - other.high) + (one.low - other.low))
    assert (apart <= open_between(one, other)).all()


def disc_on_incline(q: Any, v: Any, tau: Any, p: Named) -> list[Any]:
    """Goldstein, section 2.4, for a disc: two thirds of what it would have without rolling; tau are forces along the joints."""
    pull = p["g"] * mpmath.sin(p["alpha"]) + tau[0] / p["m"] + tau[1] / (p["m"] * p["R"])
    return [2 * pull / 3, 2 * pull / (3 * p["R"])]


def atwood(q: Any, v: Any, tau: Any, p: Named) -> list[Any]:
    """Taylor, problem 7.8, with a pulley that turns: a = (m_right - m_left) g / (m_left + m_right + I/R^2)."""
    pull = (p["m_right"] - p["m_left"]) * p["g"] + tau[0] / p["R"] + tau[1] - tau[2]
    rise = pull / (p["m_left"] + p["m_right"] + p["I"] / p["R"] ** 2)
    return [rise / p["R"], rise, -rise]


def cycloid(q: Any, v: Any, tau: Any, p: Named) -> list[Any]:
    """Taylor, problem 6.25: 2 m R^2 (1 - cos phi) phi'' + m R^2 sin phi phi'^2 - m g R sin phi = tau."""
    phi, rate = q[1], v[1]
    pull = p["m"] * p["R"] * mpmath.sin(phi) * (p["g"] - p["R"] * rate**2) + tau[1] + p["R"] * tau[0]
    turn = pull / (2 * p["m"] * p["R"] ** 2 * (1 - mpmath.cos(phi)))
    return [p["R"] * turn, turn]


@pytest.mark.parametrize(
    ("name", "closed_form"), [("rolling_disc_on_incline", disc_on_incline), ("atwood", atwood), ("cycloid_bead", cycloid)]
)
@mpmath.workdps(DIGITS)
def test_accelerations_are_those_of_the_closed_form(name: str, closed_form: Callable[..., list[Any]]) -> None:
    """Nothing is rounded on the way: the closed form has the very numbers of the states and the parameters."""
    mechanism = mechanism_named(name)
    states = sample(mechanism, COUNT, SEED)
    reference = ReferenceKernel(mechanism).evaluate(states)
    parameters = {name: mpmath.mpf(value) for name, value, _ in mechanism.parameters}
    apart = np.empty_like(reference.high)
    for index in range(len(states)):
        state = ([mpmath.mpf(value) for value in part[index].tolist()] for part in (states.q, states.v, states.tau))
        pairs = zip(reference.high[index].tolist(), reference.low[index].tolist(), strict=True)
        found = [mpmath.mpf(high) + mpmath.mpf(low) for high, low in pairs]
        apart[index] = [float(a - b) for a, b in zip(found, closed_form(*state, parameters), strict=True)]
    assert (energy_norm(reference.norm_factor, apart) <= open_between(reference, reference)).all()
