"""Change points: planted ones are found the night they happen, and quiet nights show none."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np
import pytest
from support_results import RECORD

from harness.results.benchmark import AccelerationCost, Benchmark, Yardstick
from harness.results.change_points import DRIFT, FALSE_ALARMS, JUMP, NIGHTS_PASSED_OVER, ChangePoint, Chart, NightValue, _run_length
from harness.results.quantiles import quantile_ranks
from harness.results.records import Record
from harness.results.trend import (
    COST,
    MEDIAN,
    WORST,
    Cell,
    changes,
    changes_of_the_last,
    readings_of_costs,
    readings_of_records,
)

NIGHTS = 20
# As many as a catalogue of 60 systems and 5 subjects has, with three numbers each.
CELLS = 900


def record(system: str, errors: np.ndarray, factor: float = 1.0) -> Record:
    """A record as a cross-check makes it of the errors of sampled states."""
    errors = np.sort(errors * factor)
    bounds = {}
    for name, share in (("median_bounds", 0.5), ("percentile_99_bounds", 0.99)):
        ranks = quantile_ranks(len(errors), share)
        bounds[name] = [] if ranks is None else [float(errors[rank]) for rank in ranks]
    return Record(
        system=system, subject="mujoco/mjcf", states=len(errors), verdict="agrees", expected="agrees", backward_error=float(errors[-1]),
        relative_error=None, worst_state=None, seconds_per_state=None, message="", median_backward_error=float(np.median(errors)),
        percentile_99_backward_error=float(np.percentile(errors, 99)), **bounds,
    )  # fmt: skip


def errors_of(name: str, subject: str, count: int, seed: int) -> np.ndarray:
    """Backward errors of an engine at sampled states, as a cross-check has them."""
    from catalogue import BUILT_IN

    from harness.crosscheck.assignment import Assignment
    from harness.explain.pattern import subject_named
    from harness.truth.sampling import random_sample

    assignment = Assignment.of(BUILT_IN, name, subject_named(subject))
    errors: np.ndarray = assignment.judge(random_sample(assignment.mechanism, count, seed)).known("backward_error")
    return errors


@pytest.fixture(scope="module")
def recorded() -> list[np.ndarray]:
    """Backward errors of two engines on three mechanisms."""
    names = ("double_pendulum", "cart_pendulum", "collar")
    return [errors_of(name, subject, 4000, 0) for name in names for subject in ("mujoco/mjcf", "pinocchio/urdf")]


def resampled(recorded: list[np.ndarray], states: int, nights: int, cells: int, seed: int = 0) -> Iterator[dict[str, np.ndarray]]:
    """Nights of ``cells`` systems, each with errors drawn from those that were recorded."""
    draw = np.random.default_rng(seed)
    for _ in range(nights):
        yield {f"system_{place}": draw.choice(recorded[place % len(recorded)], states) for place in range(cells)}


def readings(night: Mapping[str, np.ndarray], factors: Mapping[str, float] | None = None) -> dict[Cell, NightValue]:
    return readings_of_records(record(system, errors, (factors or {}).get(system, 1.0)) for system, errors in night.items())


def changes_of(chart: Chart, values: Sequence[NightValue]) -> list[ChangePoint]:
    """Changes of one cell that has a value in every night."""
    return chart.changes({"": list(enumerate(values))})[""]


@pytest.mark.parametrize("states", [1500, pytest.param(5000, marks=pytest.mark.ci)])
def test_quiet_nights_of_other_seeds_show_no_change(recorded: list[np.ndarray], states: int) -> None:
    nights = [readings(night) for night in resampled(recorded, states, NIGHTS, CELLS // 3)]
    assert len(nights[-1]) == CELLS
    assert changes(nights) == []


def test_quiet_nights_of_one_seed_show_no_change(recorded: list[np.ndarray]) -> None:
    [night] = resampled(recorded, 2000, 1, CELLS // 3)
    assert changes([readings(night)] * NIGHTS) == []


@pytest.mark.ci
def test_nights_that_were_really_sampled_show_no_change() -> None:
    names = ("double_pendulum", "collar")
    pairs = [(name, subject) for name in names for subject in ("mujoco/mjcf", "pinocchio/urdf")]
    nights = [readings({f"{name} {subject}": errors_of(name, subject, 1000, seed) for name, subject in pairs}) for seed in range(NIGHTS)]
    assert changes(nights) == []


# At the desk each factor comes once, after the first night, a few nights and more.
AT_THE_DESK = {(1, 2.0), (3, 2.5), (5, 0.5)}


@pytest.mark.parametrize(
    ("before", "factor"),
    [
        pytest.param(*case, marks=() if case in AT_THE_DESK else pytest.mark.ci)
        for case in itertools.product([1, 2, 3, 5, 19], [2.0, 2.5, 0.5])
    ],
)
def test_a_median_that_doubles_is_found_that_night_and_only_that_night(recorded: list[np.ndarray], before: int, factor: float) -> None:
    drawn = list(resampled(recorded, 2000, before + 3, 60, seed=before))
    nights = [readings(night, {"system_7": factor} if place >= before else {}) for place, night in enumerate(drawn)]
    found = changes_of_the_last(nights[: before + 1])
    assert [(one.system, one.number) for one in found if one.number == MEDIAN] == [("system_7", MEDIAN)]
    assert {one.system for one in found} == {"system_7"}
    [median] = [one for one in found if one.number == MEDIAN]
    assert median.found_by == JUMP and median.nights == before
    assert median.now / median.before == pytest.approx(factor, rel=0.15)
    assert {one.place for one in changes(nights)} == {before}


def test_the_rise_of_the_issue_is_found(recorded: list[np.ndarray]) -> None:
    pool = recorded[0] * (1.2 / np.median(recorded[0]))
    nights = [readings(night) for night in resampled([pool], 1000, 4, 10)]
    nights += [readings(night, {"system_3": 3.0 / 1.2}) for night in resampled([pool], 1000, 1, 10, seed=9)]
    [found] = [one for one in changes_of_the_last(nights) if one.number == MEDIAN]
    assert (found.system, found.nights) == ("system_3", 4)
    assert (found.before, found.now) == (pytest.approx(1.2, rel=0.1), pytest.approx(3.0, rel=0.1))


def test_a_slow_drift_is_found_by_the_sums() -> None:
    chart = Chart(CELLS)
    values = [0.0] * 10 + [0.15] * 30
    assert abs(0.15 / (0.05 * math.sqrt(1.1))) < chart.limit()
    [first, *_] = changes_of(chart, [NightValue(value, 0.05) for value in values])
    assert first.found_by == DRIFT
    assert 10 < first.place < 25


@pytest.mark.parametrize("nights", [3, 15, pytest.param(40, marks=pytest.mark.ci)])
def test_false_alarms_are_as_many_as_are_allowed(nights: int) -> None:
    draw, cells, allowed = np.random.default_rng(nights), 4000, 40.0
    chart = Chart(cells, allowed)
    found = [change for row in draw.normal(size=(cells, nights)) for change in changes_of(chart, [NightValue(value, 1.0) for value in row])]
    jumps = sum(change.found_by == JUMP for change in found)
    # Half of what is allowed, in every night but the first; each change leaves a night after it that cannot be judged the same way.
    expected = allowed / 2 * (nights - 1)
    assert 0.75 * expected - 3 * math.sqrt(expected) < jumps < expected + 3 * math.sqrt(expected)
    assert sum(change.found_by == DRIFT for change in found) < expected + 3 * math.sqrt(expected)


def test_the_run_length_is_that_of_simulated_sums() -> None:
    draw, interval, lengths = np.random.default_rng(1), 3.0, []
    for _ in range(400):
        total, count = 0.0, 0
        while total <= interval:
            total, count = max(0.0, total + draw.normal() - 0.5), count + 1
        lengths.append(count)
    assert _run_length(interval) == pytest.approx(np.mean(lengths), rel=0.15)


def test_a_cell_whose_nights_scatter_more_than_its_sample_is_judged_by_its_nights() -> None:
    draw = np.random.default_rng(3)
    nights = [{("one", "engine", MEDIAN): NightValue(float(value), 0.01)} for value in draw.normal(scale=0.3, size=40)]
    # The first nights cannot know better.
    assert [one for one in changes(nights, Chart(CELLS)) if one.place > 3] == []


def test_a_largest_value_that_rises_far_is_found_after_some_nights(recorded: list[np.ndarray]) -> None:
    nights = [readings(night) for night in resampled(recorded, 1000, 12, 6)]
    cell = ("system_2", "mujoco/mjcf", WORST)
    raised = nights[-1] | {cell: NightValue(nights[-1][cell].value + math.log(1e6), nights[-1][cell].noise, WORST)}
    assert [(one.system, one.number) for one in changes_of_the_last([*nights[:-1], raised])] == [("system_2", WORST)]


def test_no_change_of_less_than_a_tenth_of_a_rounding_is_one() -> None:
    nights = [readings({"one": np.full(1000, size)}) for size in (0.0, 0.0, 0.0, 0.01, 0.0)]
    assert changes(nights) == []


def test_a_sample_that_is_too_small_has_no_quantiles_in_the_trend() -> None:
    assert quantile_ranks(5, 0.5) is None
    assert {number for _, _, number in readings({"one": np.linspace(1, 2, 5)})} == {WORST}


def test_ranks_hold_the_quantile() -> None:
    draw = np.random.default_rng(0)
    for share in (0.5, 0.99):
        ranks = quantile_ranks(2000, share)
        assert ranks is not None
        held = 0
        for _ in range(400):
            sample = np.sort(draw.uniform(size=2000))
            held += sample[ranks[0]] <= share <= sample[ranks[1]]
        assert held >= 394


def benchmark(fastest: float, yardstick: float) -> Benchmark:
    cost = AccelerationCost(system="one", method="pinocchio aba", states=10, seconds_per_state=fastest * 1.3, fastest=fastest)
    return Benchmark(accelerations=[cost], yardsticks=[Yardstick(system="one", seconds=yardstick)])


# Costs of MuJoCo and Pinocchio on a machine that others used as well: fastest call in units of the reference computation, as logarithms.
BUSY = [
    [-4.90, -4.81, -3.51, -3.94, -4.30, -4.83, -4.82, -3.98, -4.81, -4.83, -3.37, -3.28, -4.84, -3.41],
    [-5.49, -5.43, -5.34, -3.25, -5.49, -5.49, -5.43, -5.39, -5.38, -5.55, -5.52, -5.45, -4.76, -5.23],
]


def test_a_cost_is_a_ratio_so_that_a_slower_machine_is_no_change() -> None:
    machine = [1.0, 1.1, 2.0, 0.9, 1.0, 3.0, 1.0, 1.1, 0.7, 1.0, 5.0]
    nights = [readings_of_costs(benchmark(1e-6 * speed, 1e-4 * speed)) for speed in machine]
    assert changes(nights) == []
    slower = readings_of_costs(benchmark(2.5e-6, 1e-4))
    assert changes([*nights, *[slower] * 4]) == []
    [found] = changes_of_the_last([*nights, *[slower] * 5])
    assert (found.number, found.now / found.before) == (COST, pytest.approx(2.5))
    assert readings_of_costs(Benchmark(accelerations=benchmark(1.0, 1.0).accelerations)) == {}


@pytest.mark.ci
def test_costs_on_a_busy_machine_show_no_change() -> None:
    draw = np.random.default_rng(0)
    values = [draw.choice(BUSY[place % 2], NIGHTS) for place in range(CELLS)]
    nights = [{(f"system_{place}", "aba", COST): cost(row[night]) for place, row in enumerate(values)} for night in range(NIGHTS)]
    assert changes(nights) == []


def cost(value: float) -> NightValue:
    return next(iter(readings_of_costs(benchmark(math.exp(value), 1.0)).values()))


def test_nights_of_a_run_that_ends_too_soon_are_noise() -> None:
    values = [0.0] * 10 + [2.0, 2.0, 0.0, 2.0, -2.0, 2.0, 0.0]
    assert changes_of(Chart(CELLS), [cost(value) for value in values]) == []


@pytest.mark.ci
@pytest.mark.parametrize("nights", [9, 15])
def test_largest_values_give_as_many_false_alarms_as_are_allowed(nights: int) -> None:
    draw, cells, allowed = np.random.default_rng(nights), 30_000, 12.0
    chart = Chart(cells, allowed)
    rows = draw.gumbel(size=(cells, nights))
    found = [one for row in rows for one in changes_of(chart, [NightValue(value, 0.0, WORST) for value in row])]
    expected = allowed / 2 * (nights - 8)
    assert sum(one.found_by == JUMP for one in found) < 2 * expected + 3 * math.sqrt(expected)


def resembling(cells: int, nights: int, seed: int, resemblance: float) -> np.ndarray:
    """Values of nights of which each resembles the one before."""
    draw = np.random.default_rng(seed)
    values = [draw.normal(scale=0.3, size=cells)]
    for _ in range(nights - 1):
        values.append(resemblance * values[-1] + math.sqrt(1 - resemblance**2) * draw.normal(scale=0.3, size=cells))
    return np.array(values)


def of_two_humps(cells: int, nights: int, seed: int, share: float) -> np.ndarray:
    """Values of which a share is far above the others."""
    draw = np.random.default_rng(seed)
    return 4.0 * (draw.uniform(size=(nights, cells)) < share) + draw.normal(scale=0.3, size=(nights, cells))


Law = Callable[[int, int, int, float], np.ndarray]
LAWS: list[tuple[str, Law, float]] = [(COST, resembling, 0.5), (COST, resembling, 0.9), (COST, resembling, 0.95)]
LAWS += [(WORST, of_two_humps, 0.02), (WORST, of_two_humps, 0.1), (WORST, resembling, 0.9)]


def night(number: str, values: Mapping[str, float]) -> dict[Cell, NightValue]:
    noise, run = (0.1, 5) if number == COST else (0.25, 1)
    return {(system, "engine", number): NightValue(value, noise, number, run) for system, value in values.items()}


@pytest.mark.ci
@pytest.mark.parametrize(("number", "law", "of_law"), LAWS)
def test_whatever_the_law_of_costs_and_worst_errors_few_nights_report_one(number: str, law: Law, of_law: float) -> None:
    reporting = 0
    for seed in range(4):
        rows = law(600, 60, seed, of_law)
        nights = [night(number, {f"system_{place}": value for place, value in enumerate(row)}) for row in rows]
        found = changes(nights)
        reporting += len({one.place for one in found if one.place > 12})
    assert reporting / 4 <= 2 * (1 + NIGHTS_PASSED_OVER)


@pytest.mark.parametrize(("number", "law", "of_law"), [LAWS[0], LAWS[-1]])
def test_a_change_beyond_what_all_cells_do_is_found_among_them(number: str, law: Law, of_law: float) -> None:
    rows = law(60, 30, 0, of_law)
    rows[25:, 7] += 12.0
    nights = [night(number, {f"system_{place}": value for place, value in enumerate(row)}) for row in rows]
    found = [one for one in changes(nights) if one.place >= 25]
    assert [(one.system, one.place) for one in found] == [("system_7", 29 if number == COST else 25)]


def test_a_number_that_is_not_finite_is_a_number() -> None:
    broken = [record("one", np.array([1.0] * 500)), RECORD]
    nights = [readings_of_records(broken) for _ in range(12)]
    assert changes(nights) == []
    assert all(math.isfinite(reading.value) for night in nights for reading in night.values())


def test_a_change_begins_a_series_of_its_own() -> None:
    values = [0.0] * 5 + [1.0] * 5 + [0.0] * 5
    found = changes_of(Chart(10), [NightValue(value, 0.05) for value in values])
    assert [(one.place, one.nights, one.found_by) for one in found] == [(5, 5, JUMP), (10, 5, JUMP)]


def test_limits_grow_with_the_number_of_cells() -> None:
    few, many = Chart(10), Chart(10_000)
    assert few.limit() < many.limit() and few.interval < many.interval
    assert 4.5 < Chart(CELLS).limit() < 5.5
    assert FALSE_ALARMS <= 1e-3
