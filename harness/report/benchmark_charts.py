"""Plots of a benchmark: what an answer costs against how wrong it is, for accelerations and for motion, and growth with size."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING

from harness.report.benchmarks import BenchmarkSummary, acceleration_front, motion_front
from harness.report.figures import GREY, RED, Columns, Style, drawable, hover, inside, line_across, log_figure, log_range, scatter, styles
from harness.results.benchmark import AccelerationCost, Growth, MotionCost, QuantityCost
from harness.results.pareto import cost_of, way_of
from harness.results.table import error_text, seconds_text
from harness.verdict import AGREEMENT

if TYPE_CHECKING:
    from bokeh import plotting

# What lies beyond sits on the edge of the plot: no rounding error is felt below the first, nothing is right above the last.
_BACKWARD_ERRORS = 1e-3, 1e18
_STATE_ERRORS = 1e-17, 10.0
_AXES = {"seconds": "wall time per second of motion [s]", "evaluations": "evaluations of the accelerations per second of motion"}


def plots(summary: BenchmarkSummary) -> dict[str, plotting.figure | None]:
    """The plots over all systems by name, "growth cost" and "growth error"; None without data."""
    return {
        "growth cost": _growth(summary, "time per state [s]", [growth.seconds_per_state for growth in summary.benchmark.growth]),
        "growth error": _growth(summary, "worst backward error", [growth.backward_errors for growth in summary.benchmark.growth]),
    }


def plots_of(summary: BenchmarkSummary, system: str) -> dict[str, plotting.figure | None]:
    """The plots of one system by name, as "accelerations", "derivative errors" and "motion seconds"; None without data."""
    derived = {"derivative errors": _derivative_errors(summary, system), "derivative costs": _derivative_costs(summary, system)}
    further = {f"quantity {name}": _quantity(summary, costs) for name, costs in summary.quantities(system).items()}
    return (
        {"accelerations": _accelerations(summary, system)}
        | further
        | derived
        | {f"motion {by}": _motion(summary, system, by) for by in _AXES}
    )


def method_styles(summary: BenchmarkSummary) -> dict[str, Style]:
    """The style of each method, the same in all plots."""
    growing = {growth.method for growth in summary.benchmark.growth}
    return styles(sorted({*summary.methods, *growing}))


def quantity_styles(summary: BenchmarkSummary) -> dict[str, Style]:
    """The style of each subject that was asked for quantities beyond accelerations, the same in all plots."""
    return styles(sorted({cost.method for cost in summary.benchmark.quantities}))


def derivative_styles(summary: BenchmarkSummary) -> dict[str, Style]:
    """The style of each way of computing derivatives, the same in all plots."""
    return styles(sorted({cost.method for cost in summary.benchmark.derivatives}))


def _derivative_errors(summary: BenchmarkSummary, system: str) -> plotting.figure | None:
    """Errors over the steps of finite differences, with those of derivatives without one as level lines."""
    costs = summary.derivatives(system)
    steps = [step for cost in costs for step in cost.steps if drawable(step) and step > 0]
    if not steps:
        return None
    y_range = low, high = log_range([error for cost in costs for error in cost.errors], _STATE_ERRORS)
    plot = log_figure(380, "step", "relative error", log_range(steps), y_range)
    for cost in costs:
        own = zip(cost.steps, cost.errors, strict=False) if cost.steps else [(step, error) for error in cost.errors[:1] for step in steps]
        points = sorted((step, error) for step, error in own if drawable(step) and step > 0 and drawable(error))
        words = {
            "method": [cost.method] * len(points),
            "step": [f"{step:g}" if cost.steps else "none" for step, _ in points],
            "error": [error_text(error) for _, error in points],
        }
        style, y = derivative_styles(summary)[cost.method], [inside(error, low, high) for _, error in points]
        _draw_line(plot, style, [step for step, _ in points], y, words)
    hover(plot)
    return plot


def _derivative_costs(summary: BenchmarkSummary, system: str) -> plotting.figure | None:
    """The error at the best step over what a state costs, by how many states are asked for at once."""
    costs = [cost for cost in summary.derivatives(system) if drawable(cost.error)]
    seconds = [one for cost in costs for one in cost.seconds_per_state if drawable(one) and one > 0]
    if not seconds:
        return None
    y_range = low, high = log_range([cost.error for cost in costs], _STATE_ERRORS)
    plot = log_figure(380, "time per state [s]", "relative error", log_range(seconds), y_range)
    for cost in costs:
        points = [(count, one) for count, one in zip(cost.states, cost.seconds_per_state, strict=False) if drawable(one) and one > 0]
        words = {
            "method": [cost.method] * len(points),
            "states at once": [f"{count:,}" for count, _ in points],
            "time per state": [seconds_text(one) for _, one in points],
            "error": [error_text(cost.error)] * len(points),
        }
        y = [inside(cost.error, low, high)] * len(points)
        _draw_line(plot, derivative_styles(summary)[cost.method], [one for _, one in points], y, words)
    hover(plot)
    return plot


def _draw_line(plot: plotting.figure, style: Style, x: Sequence[float], y: Sequence[float], words: Columns) -> None:
    """Points, and a line through them."""
    plot.line(x, y, line_color=style[0], line_width=1.2, line_alpha=0.7)
    scatter(plot, style, x, y, words)


def _accelerations(summary: BenchmarkSummary, system: str) -> plotting.figure | None:
    known = method_styles(summary)
    return _answers(summary.accelerations(system), lambda cost: known[way_of(cost)])


def _quantity(summary: BenchmarkSummary, costs: Sequence[QuantityCost]) -> plotting.figure | None:
    """A mark for each subject and number of states at once."""
    known = quantity_styles(summary)
    return _answers(costs, lambda cost: known[cost.method])


def _answers(measured: Sequence[AccelerationCost], style_of: Callable[[AccelerationCost], Style]) -> plotting.figure | None:
    """Cost against worst and median backward error, with the front."""
    costs = [cost for cost in measured if cost.seconds_per_state and drawable(cost.backward_error)]
    if not costs:
        return None
    low, high = log_range(
        [1.0, AGREEMENT, *(e for cost in costs for e in (cost.backward_error, cost.median_backward_error))], _BACKWARD_ERRORS
    )
    x_range = log_range([cost.seconds_per_state for cost in costs])
    plot = log_figure(380, "time per state [s]", "backward error", x_range, (low, high))
    _draw_front(
        plot, [(c.seconds_per_state or 0.0, inside(c.backward_error, low, high)) for c in acceleration_front(costs)], x_range[1], high
    )
    chosen = [cost for cost in costs if drawable(cost.median_backward_error)]
    x, medians = [cost.seconds_per_state or 0.0 for cost in chosen], [inside(cost.median_backward_error, low, high) for cost in chosen]
    worst = [inside(cost.backward_error, low, high) for cost in chosen]
    plot.segment(x, medians, x, worst, line_color=[style_of(cost)[0] for cost in chosen], line_width=1, line_alpha=0.6)
    for shown, error, alpha in ((chosen, "median_backward_error", 0.0), (costs, "backward_error", 0.75)):
        words = {
            "method": [way_of(cost) for cost in shown],
            "time per state": [seconds_text(cost.seconds_per_state) for cost in shown],
            "fastest to slowest": [f"{seconds_text(cost.fastest)} to {seconds_text(cost.slowest)}" for cost in shown],
            "worst error": [error_text(cost.backward_error) for cost in shown],
            "median error": [error_text(cost.median_backward_error) for cost in shown],
        }
        x, y = [cost.seconds_per_state or 0.0 for cost in shown], [inside(getattr(cost, error), low, high) for cost in shown]
        scatter(plot, [style_of(cost) for cost in shown], x, y, words, fill_alpha=alpha)
    hover(plot)
    line_across(plot, "width", AGREEMENT, RED)
    return plot


def _motion(summary: BenchmarkSummary, system: str, by: str) -> plotting.figure | None:
    costs = [cost for cost in summary.motion(system) if cost.duration and drawable(cost.state_error) and _spent(cost, by) > 0]
    if not costs:
        return None
    y_range = low, high = log_range([cost.state_error for cost in costs], _STATE_ERRORS)
    x_range = log_range([_spent(cost, by) for cost in costs])
    plot = log_figure(380, _AXES[by], "relative error of the end state", x_range, y_range)
    _draw_front(plot, [(_spent(cost, by), inside(cost.state_error, low, high)) for cost in motion_front(costs, by)], x_range[1], high)
    known = styles(summary.integrators)
    lines = {name: [cost for cost in costs if cost.integrator == name] for name in sorted({cost.integrator for cost in costs})}
    plot.multi_line(
        [[_spent(cost, by) for cost in own] for own in lines.values()],
        [[inside(cost.state_error, low, high) for cost in own] for own in lines.values()],
        line_color=[known[name][0] for name in lines],
        line_width=1.2,
        line_alpha=0.7,
    )
    x, y = [_spent(cost, by) for cost in costs], [inside(cost.state_error, low, high) for cost in costs]
    words = {
        "way": [way_of(cost) for cost in costs],
        "time per second of motion": [seconds_text(cost_of(cost)) for cost in costs],
        "evaluations": [f"{cost.evaluations:,}" for cost in costs],
        "error of the end state": [error_text(cost.state_error) for cost in costs],
        "energy": [error_text(cost.energy_error) for cost in costs],
    }
    scatter(plot, [known[cost.integrator] for cost in costs], x, y, words)
    hover(plot)
    return plot


def _growth(summary: BenchmarkSummary, label: str, values: Sequence[Sequence[float | None]]) -> plotting.figure | None:
    lines = [(growth, _known(growth, own)) for growth, own in zip(summary.benchmark.growth, values, strict=True)]
    lines = [(growth, known) for growth, known in lines if known]
    if not lines:
        return None
    y_range = low, high = log_range([value for _, known in lines for _, value in known])
    sizes = [size for _, known in lines for size, _ in known]
    plot = log_figure(320, "number of bodies", label, (min(sizes) / 1.3, max(sizes) * 1.3), y_range)
    for growth, known in lines:
        style = method_styles(summary)[growth.method]
        x, y = [size for size, _ in known], [inside(value, low, high) for _, value in known]
        shown = [seconds_text(value) if label.startswith("time") else error_text(value) for _, value in known]
        words = {"method": [growth.method] * len(x), "bodies": [str(size) for size in x], label.removesuffix(" [s]"): shown}
        _draw_line(plot, style, x, y, words)
    hover(plot)
    return plot


def _draw_front(plot: plotting.figure, corners: Sequence[tuple[float, float]], right: float, top: float) -> None:
    """A staircase from the top of the plot to its right: below and left of it there is nothing."""
    if not corners:
        return
    x, y = [corners[0][0]], [top]
    for (cost, error), (following, _) in zip(corners, [*corners[1:], (right, 0.0)], strict=True):
        x += [cost, following]
        y += [error, error]
    plot.line(x, y, line_color=GREY, line_width=4, line_alpha=0.35)


def _known(growth: Growth, values: Iterable[float | None]) -> list[tuple[int, float]]:
    return [(size, value) for size, value in zip(growth.sizes, values, strict=False) if value is not None and drawable(value) and size > 0]


def _spent(cost: MotionCost, by: str) -> float:
    """Cost per second of motion; 0 where it has no duration."""
    return float(getattr(cost, by)) / cost.duration if cost.duration else 0.0
