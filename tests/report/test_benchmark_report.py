"""Benchmarks in reports: complete, offline, escaped, never failing; the Pareto front and the cheapest ways in it."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support import Page, charts_of, missing, pages_of, site_of

from harness.report import build
from harness.report.benchmarks import BenchmarkSummary
from harness.report.markdown import VOLATILE
from harness.results.benchmark import AccelerationCost, Benchmark, DerivativeCost, Growth, QuantityCost, Yardstick
from harness.results.cross_check import CrossCheckResult
from harness.results.motion_benchmark import Drift, Figure, MotionCost, MotionTruth, Order, Stationarity
from harness.results.pareto import acceleration_front, cheapest, front, motion_front
from harness.results.records import Record
from harness.results.run import Run

RUN = Run(
    started="2026-01-31T02:00:00+00:00", versions={"harness": "0.1.0", "mujoco": "4.0"}, machine={"cpus": "4"}, seed=7,
    profile="quick", states=1000, library="built-in", command="harness bench --motion",
)  # fmt: skip
SYSTEMS = ("arm_2r", "collar")
# Method: threads, seconds per state, worst backward error, worst relative error.
METHODS = {
    "heyoka float32": (1, 2e-9, 3e8, 4e-5),
    "heyoka float64": (1, 4e-9, 0.9, 2e-14),
    "pinocchio aba": (1, 9e-7, 1.4, 3e-14),
    "pinocchio abaInParallel": (2, 2e-7, 1.4, 3e-14),
    "mujoco batch": (1, 4e-7, 5.0, 8e-14),
    "certified balls": (1, 4e-5, 0.0, 1e-38),
}
# Of a quantity: seconds of a call, worst backward error.
SUBJECTS = {"mujoco/mjcf": (1e-4, 3.0), "pinocchio/urdf": (2e-5, 1.5)}
ORDERS = {"euler-cromer": 1.0, "pinocchio RK4": 4.0, "mujoco Euler": 1.0}
STEPS = (1e-1, 1e-2, 1e-3)
DURATION = 2.0


def acceleration(system: str, method: str) -> AccelerationCost:
    threads, seconds, backward, relative = METHODS[method]
    return AccelerationCost(
        system=system, method=method, threads=threads, states=1000, seconds_per_state=seconds, fastest=0.9 * seconds, slowest=1.3 * seconds,
        repetitions=12, backward_error=backward, median_backward_error=backward / 5, relative_error=relative,
    )  # fmt: skip


def answered(subject: str, states: int) -> QuantityCost:
    seconds, backward = SUBJECTS[subject]
    return QuantityCost(
        system="collar", quantity="bias", method=subject, states=states, seconds_per_state=seconds / states, fastest=0.9 * seconds / states,
        slowest=1.3 * seconds / states, repetitions=5, backward_error=backward, median_backward_error=backward / 5, relative_error=2e-16,
    )  # fmt: skip


def motion(system: str, integrator: str, step: float) -> MotionCost:
    order, steps = ORDERS[integrator], round(DURATION / step)
    error = step**order
    return MotionCost(
        system=system, integrator=integrator, step=step, tolerance=None, steps=steps, evaluations=round(order) * steps,
        seconds=steps * order * 1e-6, state_error=error, energy_error=error / 2, duration=DURATION,
    )  # fmt: skip


def sample() -> Benchmark:
    """Two systems with everything; some of it is not as expected, some could not be measured."""
    explained = "MuJoCo treats joint damping implicitly; without that its error is that of euler-cromer."
    return Benchmark(
        accelerations=[
            *(acceleration(system, method) for system in SYSTEMS for method in METHODS),
            AccelerationCost(system="collar", method="lambdify", threads=1, states=0, seconds_per_state=None, note="no time was left"),
        ],
        yardsticks=[Yardstick(system=system, seconds=3e-5) for system in SYSTEMS],
        quantities=[
            *(answered(subject, states) for subject in SUBJECTS for states in (1, 1000)),
            QuantityCost(system="collar", quantity="bias", method="pybullet/urdf", states=0, seconds_per_state=None, note="offers no bias"),
        ],
        derivatives=[
            DerivativeCost(
                system="collar", method="mujoco mjd_inverseFD", of="tau", steps=[1e-2, 1e-6, 1e-10], errors=[1e-2, 3e-7, 1e-5],
                worst_errors=[2e-2, 1e-6, 1e-4], best_step=1e-6, error=3e-7, states=[1, 100], seconds_per_state=[3e-5, 2e-5], loop="Python",
            ),
            DerivativeCost(
                system="collar", method="pinocchio computeRNEADerivatives", of="tau", errors=[2e-16], worst_errors=[4e-16], error=2e-16,
                states=[1, 100], seconds_per_state=[2e-5, 1e-5], loop="Python",
            ),
            DerivativeCost(system="collar", method="heyoka derivatives of qdd", of="qdd", note="no time was left for it"),
        ],
        growth=[
            Growth(
                family="chain", method="pinocchio aba", sizes=[1, 2, 4], seconds_per_state=[1e-6, 1.5e-6, 2.6e-6],
                backward_errors=[0.5, 1.0, None], exponent=0.8, expected="1",
            )
        ],
        truths=[
            MotionTruth(
                system="collar", start={"q": [0.1], "v": [0.0]}, horizon=20.0, trusted=20.0, error=3e-15, precision="float64, long double",
                seconds=0.02,
            )
        ],
        motion=[
            *(motion(system, integrator, step) for system in SYSTEMS for integrator in ORDERS for step in STEPS),
            MotionCost(
                system="collar", integrator="heyoka Taylor", step=None, tolerance=1e-15, steps=20, evaluations=400, seconds=1e-4,
                state_error=0.0, energy_error=1e-16, duration=DURATION,
            ),
            MotionCost(
                system="arm_2r", integrator="mujoco Euler", step=1.0, tolerance=None, steps=2, evaluations=2, seconds=1e-5,
                state_error=math.inf, energy_error=math.nan, duration=DURATION, note="broke down",
            ),
        ],
        orders=[
            *(Order(system=system, integrator=name, measured=order + 0.01, expected=order, verdict="as expected")
              for system in SYSTEMS for name, order in ORDERS.items() if name != "mujoco Euler"),
            Order(system="arm_2r", integrator="mujoco Euler", measured=1.4, expected=1.0, verdict="differs", explanation=explained),
            Order(system="collar", integrator="mujoco Euler", measured=0.3, expected=1.0, verdict="differs"),
        ],
        drifts=[
            Drift(system="collar", integrator="euler-cromer", step=1e-3, steps=10**6, seconds=0.5, largest=1e-3, growth=0.02,
                  verdict="bounded", expected="bounded"),
            Drift(system="collar", integrator="pinocchio RK4", step=1e-3, steps=10**6, seconds=1.5, largest=1e-9, growth=None,
                  verdict="bounded", expected="secular"),
            Drift(system="arm_2r", integrator="euler-cromer", step=1e-3, steps=10**6, seconds=0.5, largest=0.1, growth=1.01,
                  verdict="secular", expected="bounded"),
        ],
        stationarity=[Stationarity(system="collar", path="mujoco RK4", step=1e-3, residual=1e-9, slope=2.0, first_variation=1e-10)],
        figures=[
            Figure(system="cart_pendulum", what="largest |x| after 18 s, c = 0.2", unit="cm", printed=0.01, computed=0.0048, truth=0.0048,
                   reproduced=False, remark="The program of the text gives 0.0048 cm as well."),
            Figure(system="cart_pendulum", what="largest |x| after 18 s, c = 0", unit="cm", printed=2.98, computed=2.979, truth=2.979,
                   reproduced=True),
        ],
        problems=["bar_pendulum, motion: exceeded its time limit of 600 s"],
    )  # fmt: skip


@pytest.fixture(scope="module")
def files() -> dict[str, str]:
    return build(benchmarks=[(RUN, sample())])


@pytest.fixture(scope="module")
def page(files: dict[str, str]) -> Page:
    return site_of(files)


@pytest.mark.ci
def test_every_measurement_has_its_place(page: Page, files: dict[str, str]) -> None:
    for method in METHODS:
        assert method in page.words
    for words in (
        "The program of the text gives 0.0048 cm as well.",
        "no time was left", "broke down", "exceeded its time limit of 600 s", "MuJoCo treats joint damping implicitly",
        "tolerance 1e-15", "float64, long double", "mujoco Euler on collar: order of convergence 0.30, expected 1.00",
        "euler-cromer on arm_2r: energy over a long run is secular, expected bounded",
    ):  # fmt: skip
        assert words in page.words, words
    document = json.loads(files["report.json"], parse_constant=pytest.fail)["benchmark"]
    assert document["run"]["command"] == RUN.command
    for part, expected in vars(sample()).items():
        assert len(document[part]) == len(expected) or part == "cheapest", part
    assert len(document["cheapest"]) == 2 * 2 * 3


def test_two_charts_per_system_and_their_fronts_are_named(files: dict[str, str]) -> None:
    source = "".join(pages_of(files).values())
    captions = re.findall(r"<figcaption>(.*?)</figcaption>", source, re.DOTALL)
    assert len([caption for caption in captions if caption.startswith("Accelerations:")]) == len(SYSTEMS)
    assert len([caption for caption in captions if caption.startswith("Motion:")]) == 2 * len(SYSTEMS)
    named = [re.findall(r"<strong>(.*?)</strong>", caption) for caption in captions if caption.startswith("Accelerations:")]
    assert named == [["heyoka float32", "heyoka float64", "certified balls"]] * 2
    by_time = next(caption for caption in captions if caption.startswith("Motion: wall time"))
    assert "pinocchio RK4, step 0.001 s" in by_time and "mujoco Euler, step" not in by_time
    for told in ("method", "time per state", "worst error", "way", "error of the end state", "energy"):
        assert f"@{{{told}}}" in charts_of(source)
    fronts = re.search(r"<caption>Pareto front of each system</caption>.*?</table>", files["benchmark.html"], re.DOTALL)
    assert fronts and fronts[0].count("heyoka float32; heyoka float64; certified balls") == len(SYSTEMS)


def test_a_quantity_has_a_mark_for_each_subject_and_number_of_states(files: dict[str, str]) -> None:
    source = files["mechanisms/collar.html"]
    page = Page(source)
    [caption] = [one for one in re.findall(r"<figcaption>(.*?)</figcaption>", source, re.DOTALL) if one.startswith("Quantity bias:")]
    assert re.findall(r"<strong>(.*?)</strong>", caption) == ["pinocchio/urdf, 1000 states at once"]
    marks = charts_of(source)
    for subject in SUBJECTS:
        assert f"{subject}, 1 state at once" in marks and f"{subject}, 1000 states at once" in marks
    assert "Quantity bias in numbers" in page.words and "offers no bias" in page.words
    assert "Quantity bias" not in Page(files["mechanisms/arm_2r.html"]).words


def test_finite_differences_have_a_chart_over_their_steps(files: dict[str, str]) -> None:
    """Beside derivatives without a step; what has no error is in the table alone."""
    page = Page(files["mechanisms/collar.html"])
    assert "relative error against the step of finite differences" in page.words and "Derivatives in numbers" in page.words
    assert "1e-06" in page.words and "no time was left for it" in page.words
    assert "@{step}" in charts_of(files["mechanisms/collar.html"]) and "@{states at once}" in charts_of(files["mechanisms/collar.html"])
    assert "Derivatives in numbers" not in Page(files["mechanisms/arm_2r.html"]).words


@pytest.mark.usefixtures("without_charts")
def test_a_report_holds_the_benchmark_beside_its_verdicts() -> None:
    record = Record(
        system="collar", subject="lagrange", states=1, verdict="agrees", expected="agrees", backward_error=1.0, relative_error=0.0,
        worst_state=None, seconds_per_state=1e-6, message="",
    )  # fmt: skip
    built = build(RUN, CrossCheckResult(records=[record]), benchmarks=[(RUN, sample())])
    page = site_of(built)
    assert "ollar: lagrange agrees." in page.words
    assert not missing(built)
    assert "mechanisms/collar.html#cost" in page.links and "benchmark.html" in page.links and "The cheapest way to an error" in page.words
    assert "benchmark" in json.loads(built["report.json"])
    without = build(RUN, CrossCheckResult(records=[record]))
    assert "Speed against error" not in site_of(without).words and "benchmark" not in json.loads(without["report.json"])


@pytest.mark.usefixtures("without_charts")
def test_markdown_stays_the_same_while_verdicts_do() -> None:
    slower = sample()
    slower.accelerations = [replace(cost, seconds_per_state=(cost.seconds_per_state or 0) * 3 or None) for cost in slower.accelerations]
    slower.motion = [replace(cost, seconds=5 * cost.seconds) for cost in slower.motion]
    slower.orders = [replace(order, measured=(order.measured or 0) + 0.001) for order in slower.orders]
    first = build(benchmarks=[(RUN, sample())])["report.md"]
    second = build(benchmarks=[(replace(RUN, started="2026-02-01T02:00:00+00:00"), slower)])["report.md"]
    assert first != second
    assert first.partition(VOLATILE)[0] == second.partition(VOLATILE)[0]
    assert "## Speed against error\n\n- **not as expected**: " in first


def itself(point: tuple[float | None, float]) -> tuple[float | None, float]:
    return point


def test_front_keeps_what_nothing_beats() -> None:
    points = [(1.0, 5.0), (2.0, 5.0), (2.0, 1.0), (0.5, 9.0), (3.0, 0.0), (4.0, 0.0), (math.nan, 0.0), (0.1, math.inf), (None, 0.0)]
    assert front(points, itself) == [(0.5, 9.0), (1.0, 5.0), (2.0, 1.0), (3.0, 0.0)]
    assert front(points, itself, below=5.0) == [(2.0, 1.0), (3.0, 0.0)]
    assert front([(1.0, 1.0), (1.0, 0.5)], itself) == [(1.0, 0.5)]


@settings(max_examples=100, deadline=None)
@given(st.lists(st.tuples(st.floats(0, 10), st.floats(0, 10)), max_size=12))
def test_front_is_the_set_of_undominated_points(points: list[tuple[float, float]]) -> None:
    undominated = {
        (cost, error) for cost, error in points if not any(c <= cost and e <= error and (c, e) != (cost, error) for c, e in points)
    }
    assert set(front(points, itself)) == undominated


def test_cheapest_is_the_fastest_that_is_exact_enough() -> None:
    ways = {(entry.system, entry.kind, entry.error): (entry.way, entry.cost) for entry in cheapest(sample())}
    assert ways["collar", "accelerations", 1e-3] == ("heyoka float32", 2e-9)
    assert ways["collar", "accelerations", 1e-6] == ("heyoka float64", 4e-9)
    # RK4 at 0.1 s has an error of 1e-4 for 4 evaluations, Euler needs 1000 for 1e-3; both times per second of motion.
    assert ways["arm_2r", "motion", 1e-3] == ("pinocchio RK4, step 0.1 s", pytest.approx(20 * 4e-6 / 2))
    assert ways["arm_2r", "motion", 1e-9] == ("pinocchio RK4, step 0.001 s", pytest.approx(2000 * 4e-6 / 2))
    assert ways["collar", "motion", 1e-9] == ("heyoka Taylor, tolerance 1e-15", 5e-5)
    coarse = Benchmark(motion=[motion("arm_2r", "mujoco Euler", 0.1)])
    assert [(entry.way, entry.cost) for entry in cheapest(coarse)] == [(None, None)] * 3


def test_fronts_of_a_system() -> None:
    summary = BenchmarkSummary(RUN, sample())
    assert [cost.method for cost in acceleration_front(summary.accelerations["collar"])] == [
        "heyoka float32", "heyoka float64", "certified balls"
    ]  # fmt: skip
    assert [(cost.integrator, cost.step) for cost in motion_front(summary.motion["arm_2r"], "evaluations")] == [
        ("euler-cromer", 0.1), ("pinocchio RK4", 0.1), ("pinocchio RK4", 0.01), ("pinocchio RK4", 0.001)
    ]  # fmt: skip


def test_what_misses_by_the_whole_motion_is_on_no_front() -> None:
    lost = [replace(motion("arm_2r", "mujoco Euler", step), state_error=1.5) for step in STEPS]
    assert motion_front(lost, "seconds") == []
    words = site_of(build(benchmarks=[(RUN, Benchmark(motion=lost))])).words
    assert "the Pareto front: empty." in words and "none reaches it" in words


def test_only_what_is_unexplained_is_unexpected() -> None:
    summary = BenchmarkSummary(RUN, sample())
    assert len(summary.unexpected) == 2
    spoilt = sample()
    spoilt.figures[0] = replace(spoilt.figures[0], remark="")
    assert len(BenchmarkSummary(RUN, spoilt).unexpected) == 3
