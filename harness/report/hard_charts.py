"""A plot per family of hard points: backward error against the knob, with the bounds between the verdicts."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from harness.report.figures import GREY, RED, Columns, Style, drawable, hover, inside, line_across, log_range, new_figure, scatter, styles
from harness.report.hard_cases import SILENT, Family, HardSummary
from harness.results.atlas import HardPoint, HardRow
from harness.results.table import error_text
from harness.verdict import AGREEMENT

if TYPE_CHECKING:
    from bokeh import plotting

_ERRORS = 1e-4, 1e19
# JavaScript draws no logarithmic axis among subnormal numbers.
_SMALLEST_ON_A_LOG_AXIS = 1e-290
# A knob over less than this ratio is drawn on a linear axis.
_LEAST_RATIO = 10.0
SILENT_MARKER = ("x", "✕")


def plots(summary: HardSummary) -> dict[str, plotting.figure | None]:
    """The plot of each family by its name, "hard NAME"; None without a point that has a place."""
    return {f"hard {family.name}": _plot(family, styles(summary.subjects)) for family in summary.families}


def _plot(family: Family, known: dict[str, Style]) -> plotting.figure | None:
    placed = [(row, point) for row in family.rows.values() for point in row.points if math.isfinite(point.knob)]
    if not placed:
        return None
    place, axis, label = _axis(family, [point.knob for _, point in placed])
    low, high = log_range([1.0, 10 * AGREEMENT, *(point.backward_error for _, point in placed)], _ERRORS, margin=10.0)
    x_range = _ends([place(point.knob) for _, point in placed], axis)
    plot = new_figure(280, label, "backward error", x_axis_type=axis, y_axis_type="log", x_range=x_range, y_range=(low, high))
    _draw_bounds(plot, placed, place, high)
    looks, x, y = [], [], []
    for row, point in placed:
        colour, marker, _ = known[row.subject]
        silent = point.verdict in SILENT
        looks.append((colour, SILENT_MARKER[0] if silent else marker, ""))
        x.append(place(point.knob))
        y.append(_height(row, point, family, low, high))
    scatter(plot, looks, x, y, _words(placed), fill_alpha=0.6)
    hover(plot)
    line_across(plot, "width", AGREEMENT, RED)
    return plot


def _draw_bounds(plot: plotting.figure, placed: Sequence[tuple[HardRow, HardPoint]], place: Callable[[float], float], high: float) -> None:
    """The end of "unstable": from the lowest to the highest of the subjects' own bounds at each value of the knob."""
    bounds: dict[float, list[float]] = {}
    for _, point in placed:
        if point.unstable_bound is not None and drawable(point.unstable_bound):
            # Below the limit of agreement nothing is unstable.
            bounds.setdefault(place(point.knob), []).append(min(max(point.unstable_bound, AGREEMENT), high**2))
    x = sorted(bounds)
    lowest, highest = [min(bounds[value]) for value in x], [max(bounds[value]) for value in x]
    if len(x) > 1:
        plot.varea(x, lowest, highest, fill_color=GREY, fill_alpha=0.18)
        for edge in (lowest, highest):
            plot.line(x, edge, line_color=GREY, line_width=1, line_dash="dotted")


def _axis(family: Family, knobs: Sequence[float]) -> tuple[Callable[[float], float], str, str]:
    """From a knob's value to its place, the type of the axis, and its label."""
    low, high = min(knobs), max(knobs)
    if low <= 0 or high / low < _LEAST_RATIO:
        return lambda value: value, "linear", family.label
    if low < _SMALLEST_ON_A_LOG_AXIS:
        return math.log10, "linear", f"log10 of {family.label}"
    return lambda value: value, "log", family.label


def _ends(values: Sequence[float], axis: str) -> tuple[float, float]:
    low, high = min(values), max(values)
    if axis == "log":
        margin = max((high / low) ** 0.03, 1.05)
        return low / margin, high * margin
    margin = 0.03 * (high - low) or 1.0
    return low - margin, high + margin


def _height(row: HardRow, point: HardPoint, family: Family, low: float, high: float) -> float:
    """Height of a point on the plot; those without an error stand in lines below the upper edge, one for each subject."""
    error = point.backward_error
    if error is not None and drawable(error) and math.isfinite(error):
        return inside(error, low, high)
    lines = 1 + list(family.rows).index(row.subject)
    return float(high / (high / low) ** (0.06 * lines))


def _words(placed: Sequence[tuple[HardRow, HardPoint]]) -> Columns:
    points = [point for _, point in placed]
    return {
        "subject": [row.subject for row, _ in placed],
        placed[0][0].knob: [f"{point.knob:.4g}" for point in points],
        "system": [point.system for point in points],
        "verdict": [point.verdict for point in points],
        "backward error": [error_text(point.backward_error) for point in points],
        "digits lost": ["-" if point.digits_lost is None else f"{point.digits_lost:.1f}" for point in points],
        "unstable up to": [error_text(point.unstable_bound) for point in points],
        "kappa_s": [error_text(point.condition) for point in points],
        "why": [point.reason or "-" for point in points],
    }
