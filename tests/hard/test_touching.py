"""Distances of engines from rigid contact: small where a law gives little, and wrong files, laws and starts are far."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import pytest
from rigid_motions import distances, of_setting

from harness.engines.moving import MotionsRequest, Moved
from harness.hard.cases.rigid import BALL, BLOCK, CRADLE, ROD, ROD_AT_REST, SPHERE, STACK
from harness.hard.touching import rigid_cases

FAR = ("Painleve", "bouncing", "Newton", "block that barely", "grazing", "bounce")


@pytest.mark.ci
@pytest.mark.parametrize("name", [one for one in rigid_cases() if not one.startswith(FAR)])
def test_mujoco_comes_near_rigid_motions(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    found = distances(rigid_cases()[name], monkeypatch)
    assert {one.value for one in found} == set(rigid_cases()[name].values)
    assert all(one.distance is not None and one.rigid and not one.reason for one in found)
    best = {
        value: min(one.distance for one in found if one.value == value and one.distance is not None) for value in rigid_cases()[name].values
    }
    assert max(best.values()) < 0.04


@pytest.mark.ci
def test_a_block_creeps_as_its_file_stands_and_not_with_what_holds_it(monkeypatch: pytest.MonkeyPatch) -> None:
    found = distances(BLOCK, monkeypatch, values=(1.2,))
    assert of_setting(found, "as the file stands")[1.2] > 100 * of_setting(found, "all of these")[1.2]  # type: ignore[operator]


@pytest.mark.ci
def test_a_stack_sinks_the_deeper_the_heavier_its_last_box(monkeypatch: pytest.MonkeyPatch) -> None:
    sinks = [*of_setting(distances(STACK, monkeypatch), "as the file stands").values()]
    assert sinks == sorted(sinks, key=lambda one: one or 0.0) and sinks[-1] > 50 * sinks[0]  # type: ignore[operator]


def test_a_ball_bounces_as_its_oscillator_the_finer_the_step(monkeypatch: pytest.MonkeyPatch) -> None:
    found = distances(BALL, monkeypatch)
    coarse, fine = (of_setting(found, name) for name in ("as the file stands", "steps of 0.2 ms"))
    assert all(fine[value] < coarse[value] for value in (0.5, 0.8, 0.95))  # type: ignore[operator]


def test_a_cradle_is_right_anywhere_on_its_arc(monkeypatch: pytest.MonkeyPatch) -> None:
    found = distances(CRADLE, monkeypatch, values=(1e4,))
    assert {one.distance for one in found} == {0.0} and {one.answers for one in found} == {"0.666667 to 1"}


@pytest.mark.ci
def test_all_accelerations_of_painleves_rod_are_told(monkeypatch: pytest.MonkeyPatch) -> None:
    turning = {one.value: len(one.rigid) for one in distances(ROD, monkeypatch)}
    at_rest = distances(ROD_AT_REST, monkeypatch)
    assert turning == {0.8: 1, 1.2: 1, 1.6: 2, 2.4: 2}
    assert {one.value: len(one.rigid) for one in at_rest} == {0.8: 1, 1.2: 1, 1.6: 0, 2.4: 0}
    assert {one.distance for one in at_rest if not one.rigid} == {None}
    assert {one.answers for one in at_rest if not one.rigid} == {"none is consistent"}


WRONG: Mapping[str, dict[str, object]] = {
    "friction": {"edits": lambda mu: {"worldbody//geom": {"friction": f"{1.05 * mu!r}"}}},
    "normal turned over": {"edits": lambda mu: {"worldbody/geom": {"zaxis": "-0.6 0 -0.8"}, "worldbody//geom": {"friction": f"{mu!r}"}}},
    "contact dropped": {"edits": lambda mu: {"worldbody/geom": {"contype": "0", "conaffinity": "0"}}},
    "no friction": {"edits": lambda mu: {"worldbody//geom": {"condim": "1"}}},
}


@pytest.mark.ci
@pytest.mark.parametrize("fault", WRONG)
def test_a_wrong_file_is_far(fault: str, monkeypatch: pytest.MonkeyPatch) -> None:
    right = of_setting(distances(SPHERE, monkeypatch, values=(0.1,)), "all of these")[0.1]
    wrong = of_setting(distances(SPHERE, monkeypatch, values=(0.1,), **WRONG[fault]), "all of these")[0.1]
    assert right is not None and wrong is not None and wrong > 10 * right


def test_a_motion_that_breaks_down_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    from harness.engines.adapters.mujoco import MujocoEngine

    def broken(self: object, request: MotionsRequest) -> Moved:
        found = real(self, request)
        return replace(found, q=found.q * float("nan"), v=found.v * float("nan"))

    real = MujocoEngine.moved
    monkeypatch.setattr(MujocoEngine, "moved", broken)
    found = distances(SPHERE, monkeypatch, values=(0.1,))
    assert {(one.found, one.distance, one.reason) for one in found} == {(None, None, "its motion breaks down")}
