"""Plots of a benchmark: what an answer costs against how wrong it is, for accelerations and for motion, and growth with size."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, TypeVar

from harness.report.benchmarks import BenchmarkSummary
from harness.report.figures import GREY, Points, Style, drawable, inside, log_figure, log_range, styles
from harness.results.benchmark import AccelerationCost, DerivativeCost
from harness.results.motion_benchmark import MotionCost
from harness.results.pareto import acceleration_front, cost_of, motion_front, way_of
from harness.results.table import error_text, seconds_text
from harness.verdict import AGREEMENT

if TYPE_CHECKING:
    from bokeh import plotting

# What lies beyond sits on the edge of the plot: no rounding error is felt below the first, nothing is right above the last.
_BACKWARD_ERRORS = 1e-3, 1e18
_STATE_ERRORS = 1e-17, 10.0
_AXES = {"seconds": "wall time per second of motion [s]", "evaluations": "evaluations of the accelerations per second of motion"}
_Cost = TypeVar("_Cost", AccelerationCost, MotionCost)
_LINE: dict[str, Any] = {"line_width": 1.2, "line_alpha": 0.7}


def plots(summary: BenchmarkSummary) -> dict[str, plotting.figure | None]:
    """The plots over all systems by name, "growth cost" and "growth error"; None without data."""
    return {
        "growth cost": _growth(summary, "time per state", " [s]", seconds_text, "seconds_per_state"),
        "growth error": _growth(summary, "worst backward error", "", error_text, "backward_errors"),
    }


def plots_of(summary: BenchmarkSummary, system: str) -> dict[str, plotting.figure | None]:
    """The plots of one system by name, as "accelerations", "derivative errors" and "motion seconds"; None without data."""
    known = styles_of(summary)
    found = {"accelerations": _answers(summary.accelerations[system], lambda cost: known["method_styles"][way_of(cost)])}
    for name, costs in summary.quantities(system).items():
        # A mark for each subject and number of states at once.
        found[f"quantity {name}"] = _answers(costs, lambda cost: known["quantity_styles"][cost.method])
    for name, drawn in (("errors", _derivative_errors), ("costs", _derivative_costs)):
        found[f"derivative {name}"] = drawn(summary.derivatives[system], known["derivative_styles"])
    return found | {f"motion {by}": _motion(summary.motion[system], known["integrator_styles"], by) for by in _AXES}


def styles_of(summary: BenchmarkSummary) -> dict[str, dict[str, Style]]:
    """The style of each method, subject, way of computing derivatives, and integrator: the same in all plots."""
    measured = summary.benchmark
    return {
        "method_styles": styles(sorted({*summary.methods, *(growth.method for growth in measured.growth)})),
        "quantity_styles": styles(sorted({cost.method for cost in measured.quantities})),
        "derivative_styles": styles(sorted({cost.method for cost in measured.derivatives})),
        "integrator_styles": styles(summary.integrators),
    }


def _derivative_errors(costs: Sequence[DerivativeCost], known: dict[str, Style]) -> plotting.figure | None:
    """Errors over the steps of finite differences, with those of derivatives without one as level lines."""
    steps = [step for cost in costs for step in cost.steps if drawable(step) and step > 0]
    if not steps:
        return None
    y_range = low, high = log_range([error for cost in costs for error in cost.errors], _STATE_ERRORS)
    points = Points[tuple[float, float, DerivativeCost]](
        log_figure(380, "step", "relative error", log_range(steps), y_range),
        lambda one: (one[0], inside(one[1], low, high)),
        {
            "method": lambda one: one[2].method,
            "step": lambda one: f"{one[0]:g}" if one[2].steps else "none",
            "error": lambda one: error_text(one[1]),
        },
    )
    for cost in costs:
        own = zip(cost.steps, cost.errors, strict=False) if cost.steps else [(step, error) for error in cost.errors[:1] for step in steps]
        shown = sorted((step, error) for step, error in own if drawable(step) and step > 0 and drawable(error))
        points.draw([(*one, cost) for one in shown], known[cost.method], **_LINE)
    return points.shown()


def _derivative_costs(measured: Sequence[DerivativeCost], known: dict[str, Style]) -> plotting.figure | None:
    """The error at the best step over what a state costs, by how many states are asked for at once."""
    costs = [cost for cost in measured if drawable(cost.error)]
    lines = [
        [(cost, *one) for one in zip(cost.states, cost.seconds_per_state, strict=False) if drawable(one[1]) and one[1] > 0]
        for cost in costs
    ]
    seconds = [one[2] for line in lines for one in line]
    if not seconds:
        return None
    y_range = low, high = log_range([cost.error for cost in costs], _STATE_ERRORS)
    points = Points[tuple[DerivativeCost, int, float]](
        log_figure(380, "time per state [s]", "relative error", log_range(seconds), y_range),
        lambda one: (one[2], inside(one[0].error, low, high)),
        {
            "method": lambda one: one[0].method,
            "states at once": lambda one: f"{one[1]:,}",
            "time per state": lambda one: seconds_text(one[2]),
            "error": lambda one: error_text(one[0].error),
        },
    )
    for cost, line in zip(costs, lines, strict=True):
        points.draw(line, known[cost.method], **_LINE)
    return points.shown()


def _answers(measured: Sequence[AccelerationCost], style_of: Callable[[AccelerationCost], Style]) -> plotting.figure | None:
    """Cost against worst and median backward error, with the front."""
    costs = [cost for cost in measured if cost.seconds_per_state and drawable(cost.backward_error)]
    if not costs:
        return None
    errors = [error for cost in costs for error in (cost.backward_error, cost.median_backward_error)]
    y_range = low, high = log_range([1.0, AGREEMENT, *errors], _BACKWARD_ERRORS)
    x_range = log_range([cost.seconds_per_state for cost in costs])
    worst = Points[AccelerationCost](
        log_figure(380, "time per state [s]", "backward error", x_range, y_range),
        lambda cost: (cost.seconds_per_state or 0.0, inside(cost.backward_error, low, high)),
        {
            "method": way_of,
            "time per state": lambda cost: seconds_text(cost.seconds_per_state),
            "fastest to slowest": lambda cost: f"{seconds_text(cost.fastest)} to {seconds_text(cost.slowest)}",
            "worst error": lambda cost: error_text(cost.backward_error),
            "median error": lambda cost: error_text(cost.median_backward_error),
        },
    )
    _draw_front(worst, acceleration_front(costs), x_range[1], high)
    medians = replace(worst, place=lambda cost: (cost.seconds_per_state or 0.0, inside(cost.median_backward_error, low, high)))
    chosen = [cost for cost in costs if drawable(cost.median_backward_error)]
    x, bottoms = medians.places(chosen)
    colours = [style_of(cost)[0] for cost in chosen]
    worst.plot.segment(x, bottoms, x, worst.places(chosen)[1], line_color=colours, line_width=1, line_alpha=0.6)
    medians.draw(chosen, style_of, fill_alpha=0.0)
    worst.draw(costs, style_of)
    return worst.shown("width")


def _motion(measured: Sequence[MotionCost], known: dict[str, Style], by: str) -> plotting.figure | None:
    costs = [cost for cost in measured if cost.duration and drawable(cost.state_error) and _spent(cost, by) > 0]
    if not costs:
        return None
    y_range = low, high = log_range([cost.state_error for cost in costs], _STATE_ERRORS)
    x_range = log_range([_spent(cost, by) for cost in costs])
    points = Points[MotionCost](
        log_figure(380, _AXES[by], "relative error of the end state", x_range, y_range),
        lambda cost: (_spent(cost, by), inside(cost.state_error, low, high)),
        {
            "way": way_of,
            "time per second of motion": lambda cost: seconds_text(cost_of(cost)),
            "evaluations": lambda cost: f"{cost.evaluations:,}",
            "error of the end state": lambda cost: error_text(cost.state_error),
            "energy": lambda cost: error_text(cost.energy_error),
        },
    )
    _draw_front(points, motion_front(costs, by), x_range[1], high)
    names = sorted({cost.integrator for cost in costs})
    lines = [points.places([cost for cost in costs if cost.integrator == name]) for name in names]
    points.plot.multi_line([x for x, _ in lines], [y for _, y in lines], line_color=[known[name][0] for name in names], **_LINE)
    points.draw(costs, lambda cost: known[cost.integrator])
    return points.shown()


def _growth(summary: BenchmarkSummary, what: str, unit: str, text: Callable[[float], str], part: str) -> plotting.figure | None:
    """``part`` of each growth over the numbers of bodies; ``what`` that is, with its unit, and its text."""
    lines: list[list[tuple[str, int, float]]] = []
    for growth in summary.benchmark.growth:
        values = zip(growth.sizes, getattr(growth, part), strict=False)
        lines.append([(growth.method, size, value) for size, value in values if drawable(value) and size > 0])
    shown = [one for line in lines for one in line]
    if not shown:
        return None
    y_range = low, high = log_range([value for _, _, value in shown])
    sizes = [size for _, size, _ in shown]
    points = Points[tuple[str, int, float]](
        log_figure(320, "number of bodies", what + unit, (min(sizes) / 1.3, max(sizes) * 1.3), y_range),
        lambda one: (one[1], inside(one[2], low, high)),
        {"method": lambda one: one[0], "bodies": lambda one: str(one[1]), what: lambda one: text(one[2])},
    )
    for line in filter(None, lines):
        points.draw(line, styles_of(summary)["method_styles"][line[0][0]], **_LINE)
    return points.shown()


def _draw_front(points: Points[_Cost], front: Sequence[_Cost], right: float, top: float) -> None:
    """A staircase from the top of the plot to its right: below and left of it there is nothing."""
    if not front:
        return
    corners: list[tuple[float, float]] = [points.place(cost) for cost in front]
    x, y = [corners[0][0]], [top]
    for (cost, error), (following, _) in zip(corners, [*corners[1:], (right, 0.0)], strict=True):
        x += [cost, following]
        y += [error, error]
    points.plot.line(x, y, line_color=GREY, line_width=4, line_alpha=0.35)


def _spent(cost: MotionCost, by: str) -> float:
    """Cost per second of motion; 0 where it has no duration."""
    return float(getattr(cost, by)) / cost.duration if cost.duration else 0.0
