"""The sleeve of the woodpecker, canted by the weight of the bird, jams on its pole or slides down.

Sliding has no closed form, for the bird swings up on its spring as it grows lighter: its accelerations, which are certified at each state,
are integrated. The edge of the sleeve presses on a body of 0.3 g, so that a contact which gives within 20 ms gives much.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from harness.arrays import Array
from harness.hard.cases.rigid import surfaces
from harness.hard.rigid_case import Edits, Interval, Numbers, RigidCase
from harness.truth.coulomb import RigidContacts

_EDGE = ("lower edge",)
# Length of the motion [s], in which the edge stays on the pole whatever it rubs by, and the steps of its integration: halving them changes
# the number that is measured by less than 1e-6.
_TIME, _STEPS = 0.02, 32
# Speeds below that part of free fall's are none.
_NOTHING = 1e-12


def _start(own: Numbers) -> tuple[Sequence[float], Sequence[float]]:
    """At rest, with the lower edge on the pole, and the bird where the spring carries its weight, which Newton's method finds."""
    arm = own["l_M"] - own["r_M"] - own["r"]
    canted = math.acos((own["l_M"] - own["r_0"] - own["r"]) / math.hypot(arm, own["h_M"])) - math.atan2(own["h_M"], arm)
    weight, hanging = own["m_S"] * own["g"] * own["l_G"], 0.0
    for _ in range(20):
        hanging += (own["c_phi"] * (canted - hanging) - weight * math.cos(hanging)) / (own["c_phi"] - weight * math.sin(hanging))
    return [0.0, hanging, canted - hanging], [0.0] * 3


def _edits(mu: float) -> Edits:
    """Friction, and what no motion feels: MJX switches springs off with dampers, and Newton adds 1e-6 kg m^2 to moments that are none."""
    bird, sleeve = "worldbody/body/inertial", "worldbody/body/body/inertial"
    round_bodies = {bird: {"diaginertia": "7e-7 7e-7 7e-7"}, sleeve: {"diaginertia": "5e-9 5e-9 5e-9"}}
    return {"worldbody//geom": {"friction": f"{mu!r}"}, "option/flag": {"damper": "enable"}, **round_bodies}


def _speed(contacts: RigidContacts, q: Sequence[float], v: Sequence[float], own: Numbers) -> list[Interval]:
    """The speed of the joint after rigid motion, by the classical method of Runge and Kutta."""

    def rate(state: Array) -> Array:
        (answer,) = contacts.answers(state[:3].tolist(), state[3:].tolist(), _EDGE)
        return np.concatenate([state[3:], answer.accelerations])

    state, step = np.array([*q, *v]), _TIME / _STEPS
    for _ in range(_STEPS):
        first = rate(state)
        second = rate(state + step / 2 * first)
        third = rate(state + step / 2 * second)
        fourth = rate(state + step * third)
        state = state + step / 6 * (first + 2 * second + 2 * third + fourth)
    found = float(-state[3] / (own["g"] * _TIME))
    return [(found, found)] if abs(found) > _NOTHING else [(0.0, 0.0)]


WOODPECKER = RigidCase(
    name="woodpecker that hangs",
    system="woodpecker",
    knob=("coefficient of friction", "1"),
    values=(0.1, 0.2, 0.25, 0.3, 0.6),
    changes=lambda mu: {"mu": mu},
    edits=_edits,
    of_usd=surfaces("woodpecker", "staticFriction", "dynamicFriction"),
    not_in_urdf="spring of a joint",
    start=_start,
    closed=_EDGE,
    time=lambda own: _TIME,
    measured=("speed down the pole, of that of free fall", "1"),
    measure=lambda motion, own: float(-motion.v[-1, 0] / (own["g"] * motion.times[-1])),
    rigid=_speed,
    source=(
        "Pfeiffer, Glocker, Multibody Dynamics with Unilateral Contacts, on the woodpecker toy: jams while mu >= 0.2435, which is how far "
        "the edge is below the joint over how far the centre of mass is from the pole"
    ),
)
