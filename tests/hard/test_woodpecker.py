"""The woodpecker that hangs: its threshold in closed form, and its sliding against an integration of the text's equations."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import pytest
from catalogue import BUILT_IN
from rigid_motions import distances, of_setting
from scipy.integrate import solve_ivp

from harness.arrays import Array
from harness.crosscheck.scene import with_parameters
from harness.hard.cases.woodpecker import WOODPECKER
from harness.hard.touching import rigid_contacts
from harness.lagrange.derivation import load_mechanism, load_system
from harness.truth.coulomb import Manner, RigidContacts

OWN = {name: value for name, value, _ in load_mechanism(BUILT_IN, "woodpecker").parameters}


def of(mu: float) -> RigidContacts:
    system, _ = load_system(BUILT_IN.system_path("woodpecker"))
    return rigid_contacts(system, with_parameters(load_mechanism(BUILT_IN, "woodpecker"), {"mu": mu}))


def levers() -> tuple[float, float, float]:
    """Angle of the sleeve, how far its edge is below the joint, and how far the pole is to the left of it."""
    _, bird, spring = WOODPECKER.start(OWN)[0]
    arm = OWN["l_M"] - OWN["r_M"] - OWN["r"]
    return bird + spring, OWN["h_M"] * math.cos(bird + spring) + arm * math.sin(bird + spring), OWN["l_M"] - OWN["r_0"]


def threshold() -> float:
    """Three forces that hold a body at rest meet in one point: weight, friction and what presses, of which the latter passes the edge."""
    sleeve, below, left = levers()
    moment = OWN["m_S"] * OWN["l_G"] * math.cos(WOODPECKER.start(OWN)[0][1]) - OWN["m_M"] * OWN["l_M"] * math.cos(sleeve)
    return below / (left + moment / (OWN["m_S"] + OWN["m_M"]))


@pytest.mark.parametrize(("share", "jams"), [(1 - 1e-9, False), (1 + 1e-9, True)])
def test_it_jams_from_its_threshold_on(share: float, jams: bool) -> None:
    q, v = WOODPECKER.start(OWN)
    assert f"{threshold():.4f}" in WOODPECKER.source
    [found] = of(threshold() * share).answers(q, v, ["lower edge"])
    assert found.manners == {"lower edge": Manner.STICKS if jams else Manner.SLIDES_BACK}
    assert np.abs(found.accelerations[0]) < 1e-12 if jams else found.accelerations[0] < -1e-9
    assert found.normal["lower edge"] * threshold() == pytest.approx((OWN["m_S"] + OWN["m_M"]) * OWN["g"])


def sliding(mu: float, own: Mapping[str, float]) -> float:
    """The measured speed by the two equations that are left, of height and bird, where the angle of the sleeve stays."""
    sleeve, below, left = levers()
    total, swing = own["m_S"] + own["m_M"], own["m_S"] * own["l_G"]

    def rate(_: float, state: Array) -> list[float]:
        _, phi, fall, turn = state
        torque, weighs = own["c_phi"] * (sleeve - phi), swing * math.cos(phi)
        carried, lever = own["m_M"] * own["l_M"] * math.cos(sleeve), below - mu * left
        # With f = a + g of the joint, the normal force n and alpha of the bird: moments of the sleeve about the joint are
        # lever n = torque - carried f; those of the bird, inertia alpha + weighs f = torque; and all that moves up and down,
        # total f + weighs alpha - swing sin(phi) turn^2 = mu n.
        matrix = [[total + mu / lever * carried, weighs], [weighs, own["J_S"] + swing * own["l_G"]]]
        felt, alpha = np.linalg.solve(matrix, [mu / lever * torque + swing * math.sin(phi) * turn**2, torque])
        return [fall, turn, felt - own["g"], alpha]

    found = solve_ivp(rate, (0.0, 0.02), [0.0, WOODPECKER.start(OWN)[0][1], 0.0, 0.0], method="DOP853", rtol=1e-12, atol=1e-14)
    return float(-found.y[2, -1] / (own["g"] * 0.02))


@pytest.mark.parametrize("mu", [0.1, 0.2])
def test_it_slides_as_the_equations_of_height_and_bird_say(mu: float) -> None:
    q, v = WOODPECKER.start(OWN)
    [(low, high)] = WOODPECKER.rigid(of(mu), q, v, OWN)
    assert low == high == pytest.approx(sliding(mu, OWN), rel=1e-6)
    assert abs(low / sliding(1.001 * mu, OWN) - 1) > 1e-4


@pytest.mark.ci
def test_it_creeps_as_its_file_stands_and_hangs_with_what_holds_it(monkeypatch: pytest.MonkeyPatch) -> None:
    found = distances(WOODPECKER, monkeypatch, values=(0.3,))
    assert {one.rigid[0] for one in found} == {(0.0, 0.0)}
    loose, held = (of_setting(found, name)[0.3] for name in ("as the file stands", "all of these"))
    assert loose is not None and held is not None and held < 1e-4 < 0.1 < loose


def test_what_engines_take_from_no_urdf_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    [found] = distances(WOODPECKER, monkeypatch, "pinocchio_admm", values=(0.3,))
    assert found.is_refused and found.found is None and found.reason == "its reader takes no spring of a joint from a URDF"


def test_without_its_spring_it_falls(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is left out would be taken for a distance."""
    [found, *_] = distances(WOODPECKER, monkeypatch, "pinocchio_admm", values=(0.3,), not_in_urdf="")
    assert found.found == pytest.approx(1.0, rel=1e-9)
