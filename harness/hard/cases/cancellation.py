"""Accelerations that are small differences of large terms."""

from __future__ import annotations

import numpy as np

from harness.hard.cases import STATES, HardCase, decades, shares, varied
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.states import States

_HIGHAM = "Higham, Accuracy and Stability of Numerical Algorithms, 2nd ed., section 1.7 (cancellation)"
_DATA = _HIGHAM + ": a backward stable algorithm loses what the data lose, and no more"


def _near_rest(mechanism: Mechanism, value: float, seed: int) -> States:
    """At rest, every coordinate ``value`` times a number between -1 and 1 from zero, which is an equilibrium."""
    return States.at(value * shares(STATES, mechanism.nq), np.zeros((STATES, mechanism.nv)), np.zeros((STATES, mechanism.nv)))


NEAR_EQUILIBRIUM = HardCase(
    name="near_equilibrium",
    title="double pendulum upright on a cart, close to its equilibrium",
    system="cart_double_pendulum",
    knob=("distance from equilibrium", "m or rad"),
    values=decades(-20, 0),
    states=_near_rest,
    source=_DATA,
    remedy="judge by absolute error near an equilibrium; linearise where a controller needs relative digits",
)


FAST_TURNS = HardCase(
    name="fast_turns",
    title="three-link arm whose velocity terms dwarf its weight",
    system="arm_3r",
    knob=("largest rate", "rad/s"),
    values=decades(0, 8),
    states=varied(lambda states, rate: {"v": rate * shares(*states.v.shape)}),
    source=_DATA + "; velocity terms reach 1e16 times the weight",
    remedy="nothing helps a state that no machine reaches; look for a controller that has diverged",
)


BALANCED_SPRINGS = HardCase(
    name="balanced_springs",
    title="two masses between three stretched springs that almost balance",
    system="coupled_oscillators",
    knob=("displacement from balance", "m"),
    values=decades(-18, -0.7),
    # Three springs of 10 N each pull the masses; the displacements undo a small part of the balance.
    states=_near_rest,
    source=_DATA,
    remedy="measure displacements from the equilibrium and leave the preload out, as small oscillations do",
)
