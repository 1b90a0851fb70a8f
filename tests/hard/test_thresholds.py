"""Distances from rigid contact at thresholds: laws of growth, who breaks first, and files that are wrong by little."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import pytest
from rigid_motions import distances, of_setting

from harness.hard.cases.thresholds import GRAZING, SLIDES, STEPS, STICKS
from harness.hard.rigid_case import RigidCase
from harness.results.rigid import BROKEN, RigidDistance, first_broken, rigid_laws


def along(engine: str, found: Sequence[float | None], setting: str = "as the file stands") -> list[RigidDistance]:
    """Distances of an engine at 1, 0.1, 0.01 and so on."""
    return [
        RigidDistance(
            case="case",
            system="system",
            engine=engine,
            setting=setting,
            knob="knob",
            unit="m",
            value=10.0**-place,
            gentle_first=True,
            measured="number",
            measured_unit="1",
            rigid=[(0.0, 0.0)],
            found=one,
            distance=one,
        )
        for place, one in enumerate(found)
    ]


def test_a_law_is_the_slope_until_the_distance_grows_no_more() -> None:
    [law] = rigid_laws(along("engine", [1e-4, 1e-2, 1.0, 1.0, 1.0]))
    assert law.growth == pytest.approx(-2.0) and law.largest == 1.0
    assert (law.breaks, law.step) == (0.01, 2)


def test_too_few_distances_and_none_at_all_have_no_law() -> None:
    assert [law.growth for law in rigid_laws(along("engine", [1e-4, 1e-2]) + along("exact", [0.0, 0.0, 0.0, 0.0]))] == [None, None]


def test_a_law_is_of_what_has_a_logarithm_at_several_values() -> None:
    found = along("engine", [1e-4, 1e-2, 1.0])
    at_zero, endless = replace(found[0], value=0.0), replace(found[0], value=10.0, distance=math.inf)
    assert [law.growth for law in rigid_laws([at_zero, endless, *found])] == [pytest.approx(-2.0)]
    assert [law.growth for law in rigid_laws([found[0]] * 3)] == [None]


def test_a_motion_without_a_number_is_broken() -> None:
    [law] = rigid_laws(along("engine", [1e-4, None, 1e-4]))
    assert law.breaks == 0.1


def test_what_an_engine_is_not_asked_for_breaks_nothing() -> None:
    first, *others = along("engine", [None, 1e-6, 1e-4, 1e-2])
    [law] = rigid_laws([replace(first, is_refused=True), *others])
    assert law.breaks is None and law.growth == pytest.approx(-2.0)


def test_cases_in_no_order_have_no_laws() -> None:
    assert not rigid_laws(replace(one, gentle_first=False) for one in along("engine", [1e-4, 1e-2, 1.0]))


def test_the_first_to_break_is_named_with_its_settings() -> None:
    found = along("early", [0.0, 1.0, 1.0]) + along("early", [0.0, 0.0, 0.0], "fine") + along("late", [0.0, 0.0, 1.0])
    assert first_broken(rigid_laws(found)) == "First to be 10 % from rigid contact: case: early (as the file stands) at knob 0.1 m."
    assert first_broken(rigid_laws(found[3:6])) == "First to be 10 % from rigid contact: case: none."
    assert first_broken([]) == ""


@pytest.mark.ci
@pytest.mark.parametrize("case", [SLIDES, STICKS], ids=lambda case: case.name)
def test_creeping_hides_a_threshold_the_wider_the_softer_friction_is(case: RigidCase, monkeypatch: pytest.MonkeyPatch) -> None:
    laws = {law.setting: law for law in rigid_laws(distances(case, monkeypatch))}
    soft, firm = laws["as the file stands"], laws["all of these"]
    # An acceleration that creeping gives whatever friction is: its share is that over the distance from the threshold.
    assert soft.growth == pytest.approx(-1.0, abs=0.4) and soft.breaks == 0.01
    assert firm.breaks is not None and firm.breaks <= 1e-3


@pytest.mark.parametrize(("case", "sign"), [(SLIDES, 1.1), (STICKS, 0.9)], ids=["sliding", "sticking"])
def test_friction_that_is_beyond_the_threshold_is_far(case: RigidCase, sign: float, monkeypatch: pytest.MonkeyPatch) -> None:
    def wrong(share: float) -> object:
        [(place, attributes)] = case.edits(share).items()
        return {place: {"friction": repr(sign * float(attributes["friction"]))}}

    found = distances(case, monkeypatch, values=(0.03,), edits=wrong)
    assert min(one.distance for one in found if one.distance is not None) > 0.5


def test_grazing_is_missed_by_a_contact_that_gives_deeper(monkeypatch: pytest.MonkeyPatch) -> None:
    found = of_setting(distances(GRAZING, monkeypatch), "as the file stands")
    deepest, *_, shallowest = found.values()
    assert deepest is not None and deepest < 0.1 and shallowest == pytest.approx(1.0, abs=1e-6)


def test_a_floor_that_is_elsewhere_is_missed_at_any_depth(monkeypatch: pytest.MonkeyPatch) -> None:
    def wrong(depth: float) -> object:
        return {**GRAZING.edits(depth), "worldbody/geom": {"pos": "0 0 -0.02"}}

    found = of_setting(distances(GRAZING, monkeypatch, values=(0.01,), edits=wrong), "timeconst of two steps")
    assert found[0.01] == pytest.approx(1.0, abs=1e-6)


def test_a_bounce_comes_to_its_closed_form_by_the_first_power_of_steps_and_breaks_before_two_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    found = distances(STEPS, monkeypatch)
    own = of_setting(found, "as the file stands")
    finest, finer = own[0.01], own[0.03]
    assert finest is not None and finer is not None and finest < 0.005 and finer / finest == pytest.approx(3.0, rel=0.15)
    first = next(value for value, one in own.items() if one is not None and one > BROKEN)
    assert first <= 0.5
    # Steps longer than half of timeconst lengthen it, unless that is switched off.
    assert own[2.0] == pytest.approx(own[0.5], rel=0.05) and of_setting(found, "without refsafe")[2.0] > 10 * own[2.0]  # type: ignore[operator]


def test_another_damping_is_another_bounce(monkeypatch: pytest.MonkeyPatch) -> None:
    def wrong(ratio: float) -> object:
        [(place, attributes)] = STEPS.edits(ratio).items()
        time, damping = attributes["solref"].split()
        return {place: {**attributes, "solref": f"{time} {1.2 * float(damping)!r}"}}

    found = of_setting(distances(STEPS, monkeypatch, values=(0.01,), edits=wrong), "as the file stands")[0.01]
    assert found is not None and found > 0.03
