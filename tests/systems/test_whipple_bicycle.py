"""The benchmark bicycle: published accelerations at a state far from upright, and the published linear equations about upright.

Sources: Basu-Mandal, Chatterjee, Papadopoulos, Hands-free circular motions of a benchmark bicycle, Proc. R. Soc. A 463 (2007),
table 1; Meijaard, Papadopoulos, Ruina, Schwab, Linearized dynamics equations for the balance and steer of a bicycle: a benchmark
and review, Proc. R. Soc. A 463 (2007), section 5 and table 2.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from harness.lagrange.derivation import load_mechanism
from harness.library import Library
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.states import States
from harness.truth.manifold import closed, closes
from harness.truth.reference import ReferenceKernel

# Other bodies that roll and other loops stand for it at the desk.
pytestmark = pytest.mark.ci
NAMES = ("x", "y", "yaw", "lean", "pitch", "rear", "steer", "front")
REAR_RADIUS = 0.3


@pytest.fixture(scope="module")
def bicycle() -> Mechanism:
    return load_mechanism(Library.built_in(), "whipple_bicycle")


@pytest.fixture(scope="module")
def kernel(bicycle: Mechanism) -> ReferenceKernel:
    return ReferenceKernel(bicycle)


def states_of(mechanism: Mechanism, *several: Mapping[str, float]) -> States:
    """States without applied forces that have the positions and rates given, closed together; what no constraint determines is 0 else."""
    q, v = ([[given.get(name + ending, 0.0) for name in NAMES] for given in several] for ending in ("", "_rate"))
    return closed(mechanism, States.at(q, v, np.zeros((len(several), len(NAMES)))))


def test_accelerations_are_those_of_the_table(bicycle: Mechanism, kernel: ReferenceKernel) -> None:
    """Their x and y point backward and to the right; lean is pi/2 - psi and pitch phi - pi, and the other angles are as here."""
    given = {"lean": math.pi / 2 - 0.9501292851472, "steer": 0.2311385135743}
    given |= {"lean_rate": -0.6068425835418, "steer_rate": 0.4859824687093, "rear_rate": 8.9129896614890}
    states = states_of(bicycle, given)
    assert closes(bicycle, states).all()
    determined = {"x": 2.8069345714545, "y": 0.1480982396001, "yaw": 0.7830033527065, "pitch": -0.0119185528069, "front": 8.0133620584155}
    np.testing.assert_allclose(states.q[0, NAMES.index("pitch")], 3.1257073014894 - math.pi, rtol=0, atol=1e-13)
    np.testing.assert_allclose([states.v[0, NAMES.index(name)] for name in determined], list(determined.values()), rtol=0, atol=5e-13)

    printed = {"x": 0.5041626315047, "y": 0.3449706619454, "yaw": 0.8353281706379, "lean": 7.8555281128244, "pitch": 0.1205543897884}
    printed |= {"rear": 1.8472554144217, "steer": -4.6198904039403, "front": 2.4548072904550}
    found = kernel.evaluate(states).high[0]
    # The state is printed to 13 decimals, of which the accelerations keep twelve.
    np.testing.assert_allclose(found, [printed[name] for name in NAMES], rtol=0, atol=1e-12)


def linearised(mechanism: Mechanism, kernel: ReferenceKernel, speed: float) -> Any:
    """The 2 x 2 derivatives of (lean'', steer'') by positions and rates of lean and steer, and by their applied moments."""
    small, places = 2.0**-40, [NAMES.index("lean"), NAMES.index("steer")]
    straight = {"rear_rate": speed / REAR_RADIUS}
    moved = [straight | {name + ending: small} for ending in ("", "_rate") for name in ("lean", "steer")]
    states = states_of(mechanism, *moved, straight, straight)
    states.tau[[-2, -1], places] = small
    slopes = kernel.evaluate(states).high[:, places].T / small
    return slopes[:, 0:2], slopes[:, 2:4], slopes[:, 4:6]


def test_linear_equations_are_those_of_the_benchmark(bicycle: Mechanism, kernel: ReferenceKernel) -> None:
    """M q'' + v C1 q' + (g K0 + v^2 K2) q = f for q = (lean, steer), whose moments are those of the joints."""
    mass = np.array([[80.81722, 2.31941332208709], [2.31941332208709, 0.29784188199686]])
    weight = np.array([[-80.95, -2.59951685249872], [-2.59951685249872, -0.80329488458618]])
    speedy = np.array([[0, 76.59734589573222], [0, 2.65431523794604]])
    damping = np.array([[0, 33.86641391492494], [-0.85035641456978, 1.68540397397560]])
    for speed in (0.0, 1.0, 5.0):
        by_position, by_rate, by_moment = linearised(bicycle, kernel, speed)
        # Lean and steer to the right are positive there, and steer to the left here.
        signs = np.diag([1.0, -1.0])
        found = np.linalg.inv(by_moment)
        np.testing.assert_allclose(signs @ found @ signs, mass, rtol=1e-12)
        np.testing.assert_allclose(-signs @ found @ by_rate @ signs, speed * damping, rtol=1e-12, atol=1e-11)
        np.testing.assert_allclose(-signs @ found @ by_position @ signs, 9.81 * weight + speed**2 * speedy, rtol=1e-12, atol=1e-11)


def roots(mechanism: Mechanism, kernel: ReferenceKernel, speed: float) -> np.ndarray:
    by_position, by_rate, _ = linearised(mechanism, kernel, speed)
    return np.sort_complex(np.linalg.eigvals(np.block([[np.zeros((2, 2)), np.eye(2)], [by_position, by_rate]])))


def test_eigenvalues_and_critical_speeds_are_those_of_the_benchmark(bicycle: Mechanism, kernel: ReferenceKernel) -> None:
    weave = -0.77534188219585 + 4.46486771378823j
    expected = np.sort_complex([-14.07838969279822, weave, weave.conjugate(), -0.32286642900409])
    np.testing.assert_allclose(roots(bicycle, kernel, 5.0), expected, rtol=1e-11)
    # The weave mode is neither damped nor excited at the weave speed, and the capsize mode at the capsize speed.
    at_weave, at_capsize = roots(bicycle, kernel, 4.29238253634111), roots(bicycle, kernel, 6.02426201538837)
    assert np.abs(at_weave.real[np.abs(at_weave.imag) > 1]).max() < 1e-11
    assert np.abs(at_capsize).min() < 1e-11
