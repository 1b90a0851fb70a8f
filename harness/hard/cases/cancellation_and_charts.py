"""Accelerations that are small differences of large terms, points at which coordinates break down though the mechanism does not, and
quaternions that are no rotations.
"""

from __future__ import annotations

import math

import numpy as np

from harness.hard.cases import STATES, HardCase, Theory, decades, inertia_numbers, posed, shares, together, turned, varied
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.states import States

_HIGHAM = "Higham, Accuracy and Stability of Numerical Algorithms, 2nd ed., section 1.7 (cancellation)"
_DATA = _HIGHAM + ": a backward stable algorithm loses what the data lose, and no more"


def _near_rest(mechanism: Mechanism, value: float, seed: int) -> States:
    """At rest, every coordinate ``value`` times a number between -1 and 1 from zero, which is an equilibrium."""
    return States.at(value * shares(STATES, mechanism.nq), np.zeros((STATES, mechanism.nv)), np.zeros((STATES, mechanism.nv)))


_GIMBALS = ("I_o", "I_x", "I_y", "I_z")
# Of both gimbals: a millionth of a millionth of what the rotor has.
_LIGHT = 1e-14

CASES = (
    HardCase(
        name="near_equilibrium",
        title="double pendulum upright on a cart, close to its equilibrium",
        system="cart_double_pendulum",
        knob=("distance from equilibrium", "m or rad"),
        values=decades(-20, 0),
        states=_near_rest,
        source=_DATA,
        remedy="judge by absolute error near an equilibrium; linearise where a controller needs relative digits",
    ),
    HardCase(
        name="fast_turns",
        title="three-link arm whose velocity terms dwarf its weight",
        system="arm_3r",
        knob=("largest rate", "rad/s"),
        values=decades(0, 8),
        states=varied(lambda states, rate: {"v": rate * shares(*states.v.shape)}),
        source=_DATA + "; velocity terms reach 1e16 times the weight",
        remedy="nothing helps a state that no machine reaches; look for a controller that has diverged",
    ),
    HardCase(
        name="balanced_springs",
        title="two masses between three stretched springs that almost balance",
        system="coupled_oscillators",
        knob=("displacement from balance", "m"),
        values=decades(-18, -0.7),
        # Three springs of 10 N each pull the masses; the displacements undo a small part of the balance.
        states=_near_rest,
        source=_DATA,
        remedy="measure displacements from the equilibrium and leave the preload out, as small oscillations do",
    ),
    HardCase(
        name="gimbal_lock",
        title="gyroscope in gimbals of hardly any inertia, near gimbal lock",
        system="gyroscope_gimbals",
        knob=("angle between the axle and the vertical", "rad"),
        values=decades(-9, 0),
        parameters=lambda angle: dict.fromkeys(_GIMBALS, _LIGHT),
        changes=together(
            [
                inertia_numbers("outer", "outer", {"y": "I_o", "z": "I_o"}),
                inertia_numbers("inner", "inner", {"x": "I_x", "y": "I_z", "z": "I_y"}),
            ]
        ),
        states=posed(lambda angle: {1: angle - math.pi / 2}),
        source="Diebel, Representing attitude, 2006, section 5.6 (singularities); kappa_s grows as 1/angle^2",
        remedy="use a ball joint with a quaternion where the gimbals' inertia does not matter, or give them the inertia they have",
        # As sqrt(kappa_s); see harness.hard.cases.sizes.
        theory=dict.fromkeys(("lagrange", "mujoco/mjcf"), Theory("unstable", growth=-1.0)),
    ),
    HardCase(
        name="spherical_pole",
        title="spherical pendulum in azimuth and swing, near the vertical",
        system="spherical_pendulum",
        knob=("angle from the downward vertical", "rad"),
        values=decades(-7, 0.4),
        states=posed(lambda angle: {0: angle}),
        source="Landau, Lifshitz, Mechanics, section 14, problem 1: M is diagonal with m L^2 sin^2(theta), kappa_s is 1",
        remedy="hang the mass on a ball joint, or on two horizontal hinges whose chart is singular where it never swings",
    ),
    HardCase(
        name="free_body_at_the_pole",
        title="free body, held as a quaternion, where its Euler angles zxz are singular",
        system="free_body",
        knob=("angle from the singular attitude", "rad"),
        values=decades(-15, 0.4),
        states=posed(lambda angle: dict(zip(range(3, 7), turned((1.0, 0.0, 0.0), angle), strict=True))),
        source="Diebel, Representing attitude, 2006, section 6: a unit quaternion has no singular attitude",
        remedy="nothing: a quaternion is the cure",
    ),
    HardCase(
        name="unnormalised_quaternion",
        title="heavy top whose quaternion is longer than one",
        system="heavy_top",
        knob=("length of the quaternion beyond one", "1"),
        values=decades(-16, 0),
        states=varied(lambda states, excess: {"q": states.q * (1 + excess)}),
        source="Diebel, Representing attitude, 2006, section 6.1: a quaternion of another length is the same rotation when divided by it",
        remedy="normalise quaternions before every call; an integrator that does not project lets them drift",
        theory={"pinocchio/urdf": Theory("disagrees", growth=1.0, digits_growth=1.0)},
    ),
)
