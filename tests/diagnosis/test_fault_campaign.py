"""The fault campaign: mistakes are caught and named, and a check or a diagnosis that cannot see is told by its bars."""

from __future__ import annotations

import functools
import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from catalogue import BUILT_IN, is_tied
from support import harness, make_library

from harness.diagnosis.faults import bench as fault_bench
from harness.diagnosis.faults import campaign as fault_campaign
from harness.diagnosis.faults import reader
from harness.diagnosis.faults.bench import Answer, FaultBench
from harness.diagnosis.faults.campaign import CampaignSettings, number_faults, run_campaign, spread_evenly
from harness.diagnosis.faults.study import select_models
from harness.diagnosis.faults.summary import Fault, broken_bars, by_kind, shares
from harness.explain.changes.mistakes import find_mistakes, mended_mistakes
from harness.explain.columns import STATES, watch
from harness.explain.model_side import Diagnosis, diagnose
from harness.explain.pattern import Inference
from harness.files.model_file import ModelFile, read_model
from harness.files.text.scan import Element, Number, TextPlace, find_elements, find_numbers
from harness.truth.compare import compare
from harness.truth.reference import Reference
from harness.verdict import Verdict

KINDS = ("number", "damping", "friction", "parallel_axis", "units")
REFUSING = """
from harness.engines import Engine


class Refusing(Engine):
    requires = ("mujoco", "mujoco")
    formats = ("mjcf",)

    def load(self, source, joints, gravity):
        raise ValueError("mass and inertia are too small")


ENGINE = Refusing()
"""
SMALL = CampaignSettings(states=64, diagnosed=1, sizes=(1e-12, 1e-9, 1e-3), kinds=KINDS)
STRUCTURAL = ("axis", "damping", "parallel_axis")


def campaign(name: str, model_format: str, settings: CampaignSettings) -> list[Fault]:
    return run_campaign(BUILT_IN, name, model_format, settings, lambda text: None)


@functools.cache
def small(name: str, model_format: str) -> list[Fault]:
    return campaign(name, model_format, SMALL)


@pytest.mark.ci
@pytest.mark.parametrize(
    ("name", "model_format"),
    [
        # What another test asks of them is there already.
        ("bar_pendulum", "mjcf"),
        ("spring_damper", "urdf"),
        pytest.param("bar_pendulum", "urdf", marks=pytest.mark.nightly),
        pytest.param("spring_damper", "mjcf", marks=pytest.mark.nightly),
    ],
)
def test_every_fault_is_caught_and_nearly_every_one_named(name: str, model_format: str) -> None:
    faults = small(name, model_format)
    assert broken_bars(faults) == []
    live = [fault for fault in faults if fault.live]
    assert {"number", "damping", "friction", "units"} <= {fault.kind for fault in live}
    # What theory promises is what is measured, for a number that is felt by its first order.
    ratios = [fault.smallest / fault.theory for fault in live if fault.smallest and fault.theory and fault.order == 1]
    assert ratios
    assert all(0.1 < ratio < 10 for ratio in ratios)
    assert all(fault.named for fault in live if fault.kind == "friction")


@pytest.mark.ci
def test_what_moves_no_acceleration_is_no_fault() -> None:
    faults = small("bar_pendulum", "mjcf")
    text = read_model(BUILT_IN.model_path("bar_pendulum", "mjcf"), "mjcf").text
    numbers = [(element.tag, number.attribute, number.index) for element in find_elements(text, "mjcf") for number in _in_order(element)]
    alone = [fault for fault in faults if fault.kind == "number" and not fault.statement]
    assert len(alone) == len(numbers)
    dead = {number for number, fault in zip(numbers, alone, strict=True) if not fault.live}
    # The bar hangs along z and turns about y. Gravity along the axis does no work, a centre of mass moved along the axis keeps its
    # distance, and nothing turns about z. An axis turned towards x turns the plane of the swing about the bar, which is the same all
    # around; one that is tilted towards z is felt, but by the cosine of its tilt.
    assert dead == {("option", "gravity", 1), ("joint", "axis", 0), ("inertial", "pos", 1), ("inertial", "diaginertia", 2)}
    assert {number for number, fault in zip(numbers, alone, strict=True) if fault.order == 2} == {("joint", "axis", 2)}
    assert all(fault.live and fault.caught for fault in faults if fault.kind != "number")
    kinds = {kind.kind: kind for kind in by_kind(faults)}
    assert kinds["number"].planted - kinds["number"].live == len(dead)
    assert broken_bars([fault for fault in faults if not fault.live]) == []


# Models of loops whose base is a body without a joint, as MJCF writes it; one is asked by day.
ON_A_BASE = [path.stem for path in sorted((BUILT_IN.models / "mjcf").glob("*.xml")) if '<body name="ground">' in path.read_text()]


@pytest.mark.parametrize("name", [pytest.param(name, marks=() if name == "four_bar" else pytest.mark.nightly) for name in ON_A_BASE])
def test_a_base_turned_about_gravity_is_no_fault_and_one_turned_against_it_is(name: str) -> None:
    """The turn moves no acceleration, and what rounding leaves of the closed loops is in the axes of the world."""
    bench = FaultBench(BUILT_IN, name, "mjcf", 16, 0)
    [rotation] = [one for one in mended_mistakes() if one.name == "frame_rotation"]
    answers = {one.statement: bench.ask(one.text(1.0)) for one in rotation.plant(bench.model) if "frame of ground" in one.statement}
    tilted, turned = (answers[f"the frame of ground turned about its {axis}"] for axis in "yz")
    assert tilted.is_live == (tilted.caught_by == "check") == bool(bench.mechanism.gravity)
    assert not turned.is_live and turned.caught_by == ""


@pytest.mark.ci
def test_a_loop_that_opens_is_a_fault_where_accelerations_are_right() -> None:
    """The ground's point of a loop stands in no Jacobian; a micrometre shows in what the loop leaves."""
    bench = FaultBench(BUILT_IN, "slider_crank", "urdf", 16, 0)
    healthy = bench.readers[0].watch.healthy
    opened = healthy.copy()
    opened[:, bench.mechanism.nv :] += 1e-6
    assert bench.readers[0].movement(opened) == pytest.approx(1e-6)
    assert bench.readers[0].verdict(opened) == Verdict.DISAGREES.value


def _in_order(element: Element) -> list[Number]:
    return [number for attribute in element.attributes for number in attribute.numbers]


def test_a_number_is_planted_in_proportion_only_where_it_cannot_change_alone() -> None:
    free = read_model(BUILT_IN.model_path("free_body", "urdf"), "urdf")
    assert [planted for planted in number_faults(free) if planted.statement] == []
    # A thin bar: the two moments across it hold each other.
    bar = read_model(BUILT_IN.model_path("bar_pendulum", "urdf"), "urdf")
    assert [planted for planted in number_faults(bar) if planted.statement] != []


@pytest.mark.parametrize(("name", "model_format"), [("four_bar", "urdf"), ("four_bar", "mjcf"), ("collar", "urdf")])
def test_every_number_that_a_fault_changes_is_a_place_of_it(name: str, model_format: str) -> None:
    """Moments of inertia in proportion and components of an axis change together: a diagnosis that names one of them is right."""
    model = read_model(BUILT_IN.model_path(name, model_format), model_format)
    numbers = find_numbers(model.text, model_format)
    together = 0
    for planted in number_faults(model):
        changed = find_numbers(planted.text(-1e-3), model_format)
        moved = {_standing(before) for before, after in zip(numbers, changed, strict=True) if before.value != after.value}
        places = {(place.key, place.index) for place in planted.places}
        assert moved <= places
        together += len(moved) > 1
        found = {_standing(number): number.value for number in numbers}
        assert all(float(place.found) == found[place.key, place.index] for place in planted.places)
    assert together


def _standing(number: Number) -> tuple[tuple[int, str, str], int]:
    return (number.line, number.element, number.attribute), number.index


@pytest.mark.ci
def test_a_blunt_check_is_told_by_what_is_not_caught(monkeypatch: pytest.MonkeyPatch) -> None:
    """The check accepts a million times what the data roundoff allows."""

    def blunt(reference: Reference, accelerations: np.ndarray, factorises: bool = False) -> Any:
        middle = reference.high + reference.low
        return compare(reference, middle + (accelerations - middle) / 1e8)

    monkeypatch.setattr(reader, "compare", blunt)
    faults = campaign("spring_damper", "urdf", replace(SMALL, kinds=["number"], diagnosed=0))
    assert any("were not caught" in sentence for sentence in broken_bars(faults))
    assert any("times what theory promises" in sentence for sentence in broken_bars(faults))


@pytest.mark.ci
def test_a_diagnosis_that_always_names_the_first_attribute_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    def first_attribute(*arguments: Any, **options: Any) -> Diagnosis:
        found = diagnose(*arguments, **options)
        place = TextPlace(1, "mujoco", "model", None, "")
        return replace(found, tried=tuple(replace(explanation, place=place) for explanation in found.tried))

    monkeypatch.setattr(fault_campaign, "diagnose", first_attribute)
    faults = campaign("spring_damper", "mjcf", replace(SMALL, kinds=STRUCTURAL, diagnosed=2))
    assert any(fault.diagnosed is not None for fault in faults)
    assert not any(fault.named for fault in faults if fault.diagnosed is not None)
    assert any("named first or in their class" in sentence for sentence in broken_bars(faults))


@pytest.mark.ci
def test_what_takes_one_evaluation_is_tried_before_fits_of_a_large_error_take_them_all() -> None:
    """As in a file with so many numbers that their columns and fits take what a diagnosis may."""
    few = CampaignSettings(kinds=["axis", "joint_order"], states=16, diagnosed=1, evaluations=300)
    faults = [fault for fault in campaign("slider_crank", "mjcf", few) if fault.diagnosed is not None]
    assert len(faults) == 2 and all(fault.named and fault.stopped for fault in faults)


def test_an_inference_that_blames_an_engine_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fault_bench, "infer", lambda verdicts: Inference("engine mujoco", "mujoco is at fault"))
    faults = campaign("spring_damper", "mjcf", replace(SMALL, kinds=["damping"], diagnosed=0, evaluations=1))
    assert any("blamed" in sentence for sentence in broken_bars(faults))


def test_subjects_of_the_other_format_stay_green() -> None:
    bench = FaultBench(BUILT_IN, "spring_damper", "mjcf", 64, 0)
    assert {one.subject.format for one in bench.readers} == {"mjcf"}
    assert len(bench.others) >= 2
    assert set(bench.others.values()) == {Verdict.AGREES.value}
    assert bench.ask(bench.model.text).caught_by == ""


@pytest.mark.ci
def test_a_reader_that_loses_digits_as_expected_is_asked_only_where_it_does_not() -> None:
    bench = FaultBench(BUILT_IN, "chain_6", "mjcf", 1000, 0)
    sound = {str(one.subject): int(one.sound.sum()) for one in bench.readers}
    assert 900 < sound["mujoco/mjcf"] < 1000 == sound["pinocchio/mjcf"]
    healthy = bench.ask(bench.model.text)
    assert healthy.caught_by == "" and set(healthy.verdicts.values()) == {Verdict.AGREES.value}
    assert bench.others["mujoco/urdf"] == Verdict.UNSTABLE.value
    mass = next(planted for planted in number_faults(bench.model) if planted.places[0].attribute == "mass")
    smallest, theory, order = bench.smallest(mass)
    assert order == 1 and 1e-17 < smallest <= 10 * theory < 1e-10
    assert bench.ask(mass.text(1e-9)).caught_by == "check"
    # Neither may a diagnosis: no change of the file would explain a state at which the sound file loses digits.
    asked_at_all = {}
    for one in bench.readers:
        states, reference = bench.diagnostic(one)
        answers = watch(one.engine, bench.mechanism, bench.model, states).healthy
        assert set(compare(reference, answers).verdicts) == {Verdict.AGREES.value}
        asked_at_all[str(one.subject)] = len(states) == STATES
    assert asked_at_all == {"mujoco/mjcf": False, "pinocchio/mjcf": True}


@pytest.mark.ci
def test_a_number_that_a_reader_rounds_away_is_felt_by_the_law_of_its_loop() -> None:
    """The last rod of Bricard's mechanism turns about the ground's hinge alone, so that no rigid loop feels its products of inertia.

    The law of MuJoCo's loop has inverse weights with them, which are felt off the manifold. MuJoCo itself takes the principal axes as they
    were up to a turn of 2e-6 rad, so that its answer is not by the law of the file from far below that on.
    """
    bench = FaultBench(BUILT_IN, "bricard", "urdf", 100, 0)
    *_, product = (planted for planted in number_faults(bench.model) if planted.places[0].attribute == "ixz")
    smallest, theory, order = bench.smallest(product)
    assert order == 1 and 1e-9 < smallest < 1e-7 and smallest == pytest.approx(theory, rel=1)
    assert bench.ask(product.text(smallest / 10)).caught_by == ""


@pytest.mark.ci
def test_the_order_of_a_fault_that_is_felt_little_is_measured() -> None:
    """The governor's stiff springs hide a change of 1e-5 of an arm's inertia along itself, which moves the shaft in proportion.

    The slider's axis tilts the slide, which is felt by the square of the tilt.
    """
    bench = FaultBench(BUILT_IN, "flyball_governor", "urdf", 32, 0)
    plants = list(number_faults(bench.model))
    along = next(one for one in plants if one.places[0].attribute == "izz" and one.places[0].line == _line_of(bench.model, "right_arm"))
    tilts = [one for one in plants if one.places[0].element == "axis" and not float(one.places[0].found)]
    smallest, theory, order = bench.smallest(along)
    assert order == 1 and theory > 1e-5 and 0.5 < smallest / theory < 2
    smallest, theory, order = bench.smallest(tilts[-1])
    assert order == 2 and 0.5 < smallest / theory < 2


def _line_of(model: ModelFile, link: str) -> int:
    """The line of a link's moments of inertia."""
    found = next(one for one in find_elements(model.text, "urdf") if one.tag == "link" and one.get("name") == link)
    return next(one.line for one in find_elements(model.text, "urdf") if one.tag == "inertia" and found.start < one.start < found.end)


def test_what_a_reader_cannot_express_is_left_to_the_others() -> None:
    assert [str(one.subject) for one in FaultBench(BUILT_IN, "coupled_oscillators", "mjcf", 16, 0).readers] == ["mujoco/mjcf"]


@pytest.mark.ci
def test_a_sound_model_that_an_engine_refuses_is_exit_status_2(tmp_path: Path) -> None:
    """Another reader of the same file does not make a campaign of it."""
    library = make_library(tmp_path / "refused", ["bar_pendulum"], {"mujoco": REFUSING})
    done = harness("faults", "--kind", "damping", "--states", "16", "--workers", "1", "--library", str(library))
    assert done.returncode == 2, done
    assert "bar_pendulum.xml: mujoco/mjcf refuses it before any fault is planted: mass and inertia are too small" in done.stderr
    # Of both campaigns it is told once.
    assert done.stderr.count("mujoco/mjcf refuses") == 1


def record(**further: Any) -> Fault:
    return Fault(**{"system": "s", "format": "urdf", "kind": "axis", "statement": "", "where": ((1, "axis", "xyz"),), **further})


@pytest.mark.parametrize(
    ("faults", "broken"),
    [
        ([record(caught_by="check", diagnosed=1.0, named=True)], 0),
        ([record(caught_by="check", diagnosed=1.0, in_class=True)], 0),
        ([record(caught_by="check", diagnosed=1.0)], 1),
        ([record(live=False)], 0),
        ([record()], 1),
        ([record(caught_by="check", missed=(1e-9,))], 1),
        ([record(caught_by="check", blamed="engine mujoco")], 1),
        ([record(caught_by="check", smallest=1e-10, theory=1e-12)], 1),
        # The bar of naming is of kinds that the diagnosis knows.
        ([record(kind="two_numbers", known=False, caught_by="check", diagnosed=1.0)], 0),
        ([record(kind="two_numbers", known=False)], 1),
    ],
)
def test_each_bar_breaks_by_itself(faults: Sequence[Fault], broken: int) -> None:
    assert len(broken_bars(faults)) == broken


def test_families_come_by_their_smallest_member_and_models_that_nobody_can_write_not_at_all() -> None:
    found, left_out = select_models(BUILT_IN, ())
    assert ("puma_560", "mjcf") in found and ("puma_560", "urdf") in found
    families = [(name, form) for name in ("chain_3", "four_bar_chain_2") for form in ("mjcf", "urdf")]
    assert [pair for pair in found if "chain" in pair[0]] == families
    assert not any(name == "rolling_disc" for name, _ in found)
    assert {model_format for name, model_format in left_out if name == "rolling_disc"} == {"mjcf", "urdf"}


@pytest.mark.ci
def test_the_command_prints_a_row_per_kind_and_writes_json(tmp_path: Path) -> None:
    path = tmp_path / "faults.json"
    options = ["--kind", "damping", "--kind", "number", "--size", "1e-6", "--states", "64", "--diagnoses", "1", "--workers", "1"]
    done = harness("faults", "spring_damper", *options, "--json", str(path), isolated=True)
    assert done.returncode == 0, done
    document = json.loads(path.read_text())
    rows = document["faults"]
    assert document["shares"]["known"]["share_named"] == document["shares"]["known"]["share_right"] == 1.0
    assert {row["kind"] for row in rows} == {"damping", "number"}
    assert {row["format"] for row in rows} == {"mjcf", "urdf"}
    assert "faults that change the dynamics" in done.stdout
    assert "0 searches stopped; 100.0% of those named first with the right number" in done.stdout
    assert any(line.startswith("damping ") and "100%" in line for line in done.stdout.splitlines())


def test_a_kind_that_can_be_made_nowhere_is_told() -> None:
    done = harness("faults", "spring_damper", "--kind", "products", "--states", "16", "--workers", "1")
    assert done.returncode == 1, done
    assert done.stdout.startswith("no faults were planted: nothing in the models can be wrong in this way")


def test_an_unknown_kind_is_told_with_the_nearest_and_the_command_that_lists_them() -> None:
    done = harness("faults", "--kind", "dampig")
    assert done.returncode == 2
    assert "did you mean 'damping'?" in done.stderr
    assert "harness list faults" in done.stderr


# A model has its turn once in so many nights, and then another fault of each kind is diagnosed: diagnoses are nearly all of the cost.
NIGHTS = 12


@pytest.mark.nightly(nights=NIGHTS)
@pytest.mark.parametrize(("name", "model_format"), select_models(BUILT_IN, ())[0])
def test_the_whole_catalogue(name: str, model_format: str, request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    turn = request.config.getoption("--night") // NIGHTS

    def in_turn(count: int, most: int) -> set[int]:
        return {(place + turn) % count for place in spread_evenly(count, most)}

    monkeypatch.setattr(fault_campaign, "spread_evenly", in_turn)
    faults = campaign(name, model_format, CampaignSettings(diagnosed=1))
    live = [fault for fault in faults if fault.live]
    assert [fault for fault in live if not fault.caught or fault.blamed] == []
    # Of the kinds that a hypothesis undoes. Five in a hundred of the whole catalogue; of a single model a little more.
    judged = [fault for fault in live if fault.judged and fault.known]
    assert sum(fault.named or fault.in_class for fault in judged) >= 0.9 * len(judged)


# Models of mechanisms with constraints, and the elements of which a test by day plants faults: points that a loop holds together, axes
# whose tilt opens it by so little that only zero explains it, a body without mass, and a centre of mass that MuJoCo takes for the origin.
BY_DAY = [
    ("slider_crank", "urdf", "drake:ball_constraint_p_BQ"),
    ("slider_crank", "mjcf", "site"),
    ("four_bar", "urdf", "axis"),
    ("cycloid_bead", "urdf", "mass"),
    ("rolling_disc_on_incline", "mjcf", "inertial"),
    ("atwood", "urdf", "mimic"),
]
TIED = [(name, model_format) for name, model_format in select_models(BUILT_IN, ())[0] if is_tied(name)]


@pytest.mark.ci
@pytest.mark.parametrize(
    ("name", "model_format", "element"),
    [
        *BY_DAY,
        *(pytest.param(*model, "", marks=pytest.mark.nightly(nights=4)) for model in TIED),
    ],
)
def test_a_fault_of_1e_10_in_a_loop_is_caught_and_named(
    name: str, model_format: str, element: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def of_element(model: Any) -> list[Any]:
        return [planted for planted in number_faults(model) if element in ("", planted.places[0].element)]

    monkeypatch.setattr(fault_campaign, "number_faults", of_element)
    faults = campaign(name, model_format, CampaignSettings(kinds=["number"], sizes=(1e-10,), states=100))
    assert broken_bars(faults) == []
    diagnosed = [fault for fault in faults if fault.diagnosed is not None]
    assert diagnosed and {fault.diagnosed for fault in diagnosed} <= {1e-10, -1e-10}
    # First, and not among others: five in a hundred of all loops; of a single model a little more.
    judged = [fault for fault in faults if fault.judged]
    assert sum(fault.named for fault in judged) >= 0.9 * len(judged)


HYPOTHESES = {hypothesis.name for hypothesis in mended_mistakes()}
UNKNOWN = tuple(kind.name for kind in find_mistakes() if kind.changes is None)


@pytest.mark.ci
def test_mistakes_outside_the_vocabulary_of_the_diagnosis_are_planted_and_caught() -> None:
    faults = campaign("double_pendulum", "mjcf", CampaignSettings(kinds=UNKNOWN, states=16, diagnosed=0, sizes=(1e-3,)))
    # Its two inertias are too small to be felt, so that no density can be wrong.
    assert {fault.kind for fault in faults if fault.live} == set(UNKNOWN) - {"density"} and not set(UNKNOWN) & HYPOTHESES
    assert [fault for fault in faults if fault.known or (fault.live and not fault.caught)] == []
    arm = read_model(BUILT_IN.model_path("arm_2r", "urdf"), "urdf")
    [density] = [one for kind in find_mistakes() if kind.name == "density" for one in kind.plant(arm)]
    moments = [number for number in find_numbers(arm.text, "urdf") if number.attribute == "iyy"]
    scaled = [number.value for number in find_numbers(density.text(0.5), "urdf") if number.attribute == "iyy"]
    assert scaled == [1.5 * number.value for number in moments] and len(scaled) == 2


def test_an_error_above_a_speed_is_no_change_of_the_file() -> None:
    [fault] = campaign("bar_pendulum", "urdf", CampaignSettings(kinds=["above_speed"], states=64, diagnosed=1))
    assert fault.caught_by == "check" and fault.diagnosed is not None and not fault.stopped
    assert not fault.named and not fault.explained


def test_shares_are_told_with_and_without_refusals_and_with_the_right_number() -> None:
    red: dict[str, Any] = {"caught_by": "check", "diagnosed": 1e-3, "explained": True}
    faults = [
        record(caught_by="validator", named=True, in_class=True),
        record(**red, named=True, in_class=True, right_value=True),
        record(**red, named=True, in_class=True, right_value=False),
        record(**red, in_class=True, stopped=True),
        record(**red),
        record(**red, live=False),
        record(**red, kind="density", known=False),
    ]
    known, other = shares(by_kind(faults))["known"], shares(by_kind(faults))["unknown"]
    assert (known["share_named"], known["share_in_class"]) == (3 / 5, 4 / 5)
    assert (known["share_found"], known["share_found_in_class"]) == (2 / 4, 3 / 4)
    assert (known["share_right"], known["misled"], known["stopped"]) == (1 / 2, 1, 1)
    assert (other["diagnosed"], other["misled"]) == (1, 1) and "share_right" not in other


def test_lost_digits_are_not_counted_as_caught() -> None:
    assert Answer(verdicts={"mujoco/mjcf": "unstable"}).caught_by == ""
    assert Answer(verdicts={"mujoco/mjcf": "unstable", "pinocchio/mjcf": "disagrees"}).caught_by == "check"


@pytest.mark.ci
def test_a_diagnosis_that_mends_with_another_number_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """The place is right, and the number off by 1e-5."""

    def off(*arguments: Any, **options: Any) -> Diagnosis:
        found = diagnose(*arguments, **options)
        shifted = (replace(one, value=one.value and one.value * (1 + 1e-5), residual=10.0) for one in found.tried)
        return replace(found, tried=tuple(shifted))

    settings = replace(SMALL, kinds=["number"], sizes=(1e-3,))
    right = [fault for fault in campaign("spring_damper", "urdf", settings) if fault.diagnosed]
    monkeypatch.setattr(fault_campaign, "diagnose", off)
    wrong = [fault for fault in campaign("spring_damper", "urdf", settings) if fault.diagnosed]
    assert [fault.right_value for fault in right] == [True] and [fault.right_value for fault in wrong] == [False]
