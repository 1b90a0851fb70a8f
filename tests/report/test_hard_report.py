"""The report on hard cases and worst cases: complete, offline, and built from nothing but what was measured."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from typing import Any

import pytest
from support import Page, missing, site_of

from harness.report import build
from harness.report.charts import hard_plots
from harness.report.hard_cases import HardSummary
from harness.report.markdown import VOLATILE
from harness.results.atlas import Atlas, HardPoint, HardReason, HardRow, Parting, StableStep
from harness.results.cross_check import CrossCheckResult
from harness.results.hard_states import RankedCase
from harness.results.records import Record
from harness.results.run import Run
from harness.verdict import SEVERITY

RUN = Run(
    started="2026-01-31T02:00:00+00:00", versions={"harness": "0.1.0"}, machine={"cpus": "4"}, seed=0, profile="atlas", states=8,
    library="built-in", command="harness atlas --motion",
)  # fmt: skip
REASON = HardReason(verdict="unstable", reason="pivots are small differences", remedy="use a ball joint", link="https://example.org/a")
STATE = {"q": [0.1], "v": [0.0], "tau": [1.0]}
RECORD = Record(
    system="collar", subject="mujoco/mjcf", states=1000, verdict="agrees", expected="agrees", backward_error=3.0, relative_error=1e-16,
    worst_state=STATE, seconds_per_state=1e-8, message="",
)  # fmt: skip
CASE = RankedCase(
    system="collar", subject="mujoco/mjcf", verdict="unstable", backward_error=4.5e3, state=STATE, statement="M is ill-conditioned here",
    replay="harness check collar --subject mujoco/mjcf", reproducer="import mujoco\nprint('the answer')",
)  # fmt: skip


def found(*worst: RankedCase) -> CrossCheckResult:
    return CrossCheckResult(records=[RECORD], worst_cases=list(worst))


def points(slope: float, decades: int = 9) -> list[HardPoint]:
    """A power of the knob, as far as "unstable" reaches at 1e6."""
    found = []
    for place in range(decades):
        knob = 10.0 ** (place - decades)
        error = knob**slope
        verdict = "agrees" if error <= 64 else "unstable" if error <= 1e6 else "disagrees"
        found.append(
            HardPoint(knob=knob, system="gyroscope", verdict=verdict, backward_error=error, digits_lost=1.0, condition=1e5,
                      unstable_bound=1e6, certified=8, states=8, bits=128, state=STATE)
        )  # fmt: skip
    return found


def row(case: str, subject: str, own: list[HardPoint], **more: Any) -> HardRow:
    verdict = max((point.verdict for point in own), key=SEVERITY.__getitem__)
    about = {"title": "gyroscope near the pole", "knob": "angle", "unit": "rad", "source": "a book", "remedy": "turn it round"}
    return HardRow(case=case, subject=subject, points=own, verdict=verdict, **(about | more))


def sample() -> Atlas:
    refused = HardPoint(knob=1e-9, system="gyroscope", verdict="unsupported", reason="mujoco refuses the model: mass too small")
    undecided = HardPoint(knob=1e-8, system="gyroscope", verdict="undecided", backward_error=0.5, reason="M is singular")
    return Atlas(
        rows=[
            row("gimbal", "lagrange", points(-0.75), growth=-0.75, theory_growth=-1.0, reasons=[REASON]),
            row("gimbal", "mujoco/mjcf", [refused, refused, undecided, *points(0.0)[2:]], problems=["undecided, which no entry expects"]),
            row("easy", "lagrange", points(0.0)),
        ],
        partings=[
            Parting(motion="chaos", system="double_pendulum", integrator=name, knob=knob, rate=1.5 if knob > 2 else None,
                    expected_rate=1.2 if knob > 2 else None, parted=25.0 if knob > 2 else None, earliest=24.0 if knob > 2 else None,
                    largest=1.1 if knob > 2 else 1e-13, verdict="agrees")
            for name in ("equations RK4", "mujoco RK4") for knob in (0.5, 2.5)
        ],
        stable_steps=[
            StableStep(case="stiff_mode", system="spring_damper", integrator="mujoco Euler", knob=1.0, frequency=1.0, measured=2.001,
                       expected=2.0, verdict="agrees"),
            StableStep(case="stiff_mode", system="spring_damper", integrator="variational", knob=1.0, frequency=1.0, measured=math.inf,
                       expected=math.inf, verdict="agrees"),
        ],
        problems=["middle_axis: exceeded its time limit of 600 s"],
    )  # fmt: skip


@pytest.fixture(scope="module")
def files() -> dict[str, str]:
    return build(atlas=(RUN, sample()))


@pytest.fixture(scope="module")
def page(files: dict[str, str]) -> Page:
    return site_of(files)


def test_everything_is_told(page: Page, files: dict[str, str]) -> None:
    for words in (
        "2 families, 2 subjects, 28 points: 2 of 3 pairs of family and subject are as expected, 1 not.",
        "gimbal, mujoco/mjcf: undecided, which no entry expects", "middle_axis: exceeded its time limit of 600 s",
        "slope -0.75, theory -1", "pivots are small differences", "Use a ball joint.",
        "mujoco/mjcf unsupported at 2 points, 1e-09: mujoco refuses the model: mass too small",
        "mujoco/mjcf undecided at 1 point, 1e-08: M is singular", "1 of 2", "median 1.25", "2.001", "no limit",
    ):  # fmt: skip
        assert words in page.words, words
    document = json.loads(files["report.json"], parse_constant=pytest.fail)["atlas"]
    assert document["run"]["command"] == RUN.command
    assert {part: len(items) for part, items in document.items() if part != "run"} == {
        part: len(items) for part, items in vars(sample()).items()
    }


def test_a_chart_holds_every_point_both_bounds_and_what_hovers_beside_it() -> None:
    plot = hard_plots(HardSummary(RUN, sample()))["hard gimbal"]
    assert plot is not None
    [drawn] = [renderer for renderer in plot.renderers if renderer.name == "point"]
    data: Any = drawn.data_source.data
    assert len(data["x"]) == 19 and data["x"][0] == 1e-9
    # Refused points have no error: they are crosses below the upper edge, and say why.
    places = [index for index, verdict in enumerate(data["verdict"]) if verdict == "unsupported"]
    assert {data["marker"][index] for index in places} == {"x"} and {data["backward error"][index] for index in places} == {"-"}
    assert all(plot.y_range.end / 100 < data["y"][index] < plot.y_range.end for index in places)
    assert all("mass too small" in data["why"][index] for index in places)
    assert data["marker"][data["verdict"].index("undecided")] == "x" and data["y"][data["verdict"].index("undecided")] == 0.5
    [across] = [shown for shown in plot.center if type(shown).__name__ == "Span"]
    assert across.location == 64.0
    bound = next(renderer for renderer in plot.renderers if type(renderer.glyph).__name__ == "VArea")
    assert set(bound.data_source.data["y1"]) == {1e6}
    told = {name for tool in plot.tools for name, _ in tool.tooltips}
    assert told >= {"angle", "backward error", "digits lost", "verdict", "kappa_s", "unstable up to", "why"}


def test_a_bound_below_the_limit_of_agreement_is_drawn_at_that_limit() -> None:
    low = [replace(point, unstable_bound=5.0) for point in points(0.0)]
    plot = hard_plots(HardSummary(RUN, Atlas(rows=[row("easy", "lagrange", low)])))["hard easy"]
    assert plot is not None
    bound = next(renderer for renderer in plot.renderers if type(renderer.glyph).__name__ == "VArea")
    assert set(bound.data_source.data["y2"]) == {64.0}


@pytest.mark.parametrize(
    ("knobs", "axis", "places"),
    [
        ((1e-9, 1e3), "LogScale", [1e-9, 1e3]),
        ((5e-324, 1e-290), "LinearScale", [math.log10(5e-324), -290.0]),
        ((0.0, 3.0), "LinearScale", [0.0, 3.0]),
        ((-1.0, 1.0), "LinearScale", [-1.0, 1.0]),
    ],
)
def test_axes_of_knobs(knobs: tuple[float, float], axis: str, places: list[float]) -> None:
    own = [replace(points(0.0)[0], knob=knob) for knob in knobs]
    plot = hard_plots(HardSummary(RUN, Atlas(rows=[row("easy", "lagrange", own)])))["hard easy"]
    assert plot is not None and type(plot.x_scale).__name__ == axis
    [drawn] = [renderer for renderer in plot.renderers if renderer.name == "point"]
    assert drawn.data_source.data["x"] == pytest.approx(places)


@pytest.mark.ci
def test_a_report_holds_hard_and_worst_cases_beside_its_verdicts() -> None:
    built = build(RUN, found(CASE, replace(CASE, subject="lagrange", reproducer="")), atlas=(RUN, sample()))
    page = site_of(built)
    assert not missing(built)
    for words in ("Hard cases", "Not all of them are as expected.", "Worst cases", "M is ill-conditioned here", CASE.replay, "the answer"):
        assert words in page.words, words
    assert "4.50e+03 data roundoffs" in page.words and "q = [0.1]" in page.words
    assert [case["subject"] for case in json.loads(built["report.json"])["worst_cases"]] == ["mujoco/mjcf", "lagrange"]
    without = build(RUN, found())
    assert "Hard cases" not in site_of(without).words and "atlas" not in json.loads(without["report.json"])


@pytest.mark.usefixtures("without_charts")
def test_markdown_stays_the_same_while_verdicts_do() -> None:
    slower = sample()
    slower.rows = [replace(row, seconds=5.0, growth=(row.growth or 0) + 0.01) for row in slower.rows]
    slower.partings = [replace(parting, parted=parting.parted and parting.parted + 0.1) for parting in slower.partings]
    first = build(atlas=(RUN, sample()))["report.md"]
    second = build(atlas=(replace(RUN, started="2026-02-01T02:00:00+00:00"), slower))["report.md"]
    assert first != second
    assert first.partition(VOLATILE)[0] == second.partition(VOLATILE)[0]
    assert "**not as expected**: gimbal" in first
