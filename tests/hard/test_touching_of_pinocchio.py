"""Distances from rigid contact of Pinocchio's constraint solvers, as they are set by default."""

from __future__ import annotations

import pytest
from rigid_motions import distances, of_setting

from harness.engines.adapters.pinocchio import touching
from harness.hard.cases.rigid import BLOCK, DISC, ROLLING, SPHERE, STACK
from harness.hard.rigid_case import UrdfChanges

SOLVERS = ("pinocchio_admm", "pinocchio_pgs")


@pytest.mark.ci
@pytest.mark.parametrize("engine", SOLVERS)
def test_they_come_near_rigid_motions(engine: str, monkeypatch: pytest.MonkeyPatch) -> None:
    [found] = of_setting(distances(ROLLING, monkeypatch, engine, values=(0.9,)), "as the file stands").values()
    assert found is not None and found < 0.01


@pytest.mark.ci
@pytest.mark.parametrize("engine", SOLVERS)
@pytest.mark.parametrize("case", [BLOCK, SPHERE], ids=lambda case: case.name)
def test_they_slide_and_stick_as_rigid_bodies(case: object, engine: str, monkeypatch: pytest.MonkeyPatch) -> None:
    assert max(of_setting(distances(case, monkeypatch, engine), "as the file stands").values()) < 0.01  # type: ignore[arg-type,type-var]


@pytest.mark.ci
def test_a_step_is_finer_and_nearer_and_none_is_asked_for_more_than_it_has_time_for(monkeypatch: pytest.MonkeyPatch) -> None:
    found = distances(ROLLING, monkeypatch, "pinocchio_admm", values=(0.1, 0.9))
    coarse, fine = (of_setting(found, name) for name in ("as the file stands", "steps of 0.2 ms"))
    assert fine[0.9] < coarse[0.9] and fine[0.1] is None  # type: ignore[operator]
    assert ["2,000 steps at most" in one.reason for one in found if one.is_refused] == [True]


def test_no_friction_is_about_the_normal(monkeypatch: pytest.MonkeyPatch) -> None:
    found = distances(DISC, monkeypatch, "pinocchio_admm", values=(0.08,))
    assert of_setting(found, "as the file stands") == {0.08: pytest.approx(0.5, abs=1e-6)}


@pytest.mark.ci
def test_gauss_seidel_lets_a_stack_fall_through_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    """It takes itself to have converged after one sweep; an entry that is mended is noticed."""
    admm, pgs = (of_setting(distances(STACK, monkeypatch, engine, values=(1.0,)), "as the file stands")[1.0] for engine in SOLVERS)
    assert admm is not None and pgs is not None and admm < 1e-4 < 0.5 < pgs


@pytest.mark.parametrize("fault", ["friction", "no contact", "a normal's sign"])
def test_a_fault_is_far(fault: str, monkeypatch: pytest.MonkeyPatch) -> None:
    changed: dict[str, object] = {}
    if fault == "friction":
        changed = {"of_urdf": lambda mu: UrdfChanges({"lateral_friction": 1.1 * mu})}
    elif fault == "no contact":
        monkeypatch.setattr(touching.TouchingShapes, "at", lambda *_: iter(()))
    else:
        own = touching._axes
        monkeypatch.setattr(touching, "_axes", lambda normal: own([-one for one in normal]))
    wrong = of_setting(distances(SPHERE, monkeypatch, "pinocchio_admm", values=(0.1,), **changed), "as the file stands")[0.1]
    assert wrong is None or wrong > 0.005
