"""Plots of the verdicts: how large the backward errors are, what they cost, how they went over the nights; and a plot per family of hard
points, backward error against the knob, with the bounds between the verdicts.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from datetime import datetime
from typing import TYPE_CHECKING

from harness.report.figures import (
    GREY,
    RED,
    Points,
    Style,
    drawable,
    inside,
    line_across,
    log_figure,
    log_range,
    new_figure,
    styles,
    within,
)
from harness.report.hard_cases import SILENT, Family, HardSummary
from harness.report.summary import Summary
from harness.results.atlas import HardPoint, HardRow
from harness.results.records import Record
from harness.results.table import counted, error_text, grouped, seconds_text
from harness.results.trend import ChangedCell
from harness.results.trend_numbers import MEDIAN
from harness.verdict import AGREEMENT

if TYPE_CHECKING:
    from bokeh import plotting

# Half decade below which a distribution is not drawn: 1e-8.
LEAST_SHOWN = -16
_HARD_ERRORS = 1e-4, 1e19
# JavaScript draws no logarithmic axis among subnormal numbers.
_SMALLEST_ON_A_LOG_AXIS = 1e-290
# A knob over less than this ratio is drawn on a linear axis.
_LEAST_RATIO = 10.0
SILENT_MARKER = ("x", "✕")


def half_decades(record: Record) -> dict[int, int]:
    """Half-decade index to number of states, of those bins of a distribution that have a place on a log axis.

    Errors far below a rounding, which hypothesis finds where a state is all but zero, would squeeze all others into a corner.
    """
    known = {int(key): count for key, count in record.distribution.items() if key.removeprefix("-").isdecimal() and count > 0}
    return {index: count for index, count in known.items() if LEAST_SHOWN <= index <= 600}


def plots(summary: Summary) -> dict[str, plotting.figure | None]:
    """The plot over all systems, "overview"; None without data."""
    return {"overview": _overview(summary)}


def trend_plots(summary: Summary) -> dict[str, plotting.figure | None]:
    """The plot over all runs, "trend"; None without data."""
    return {"trend": _trend(summary)}


def plots_of(summary: Summary, system: str) -> dict[str, plotting.figure | None]:
    """The plots of one system by name, "medians", "distribution" and "cost"; None without data."""
    return {"medians": _medians(summary, system), "distribution": _distribution(summary, system), "cost": _cost(summary, system)}


def _overview(summary: Summary) -> plotting.figure | None:
    """The worst backward error of each pair, a row for each system."""
    compared = [record for record in summary.records if drawable(record.backward_error)]
    if not compared:
        return None
    low, high = log_range([1.0, AGREEMENT, *(record.backward_error for record in compared)])
    rows, count = summary.systems, len(summary.subjects)
    height = 50 + len(rows) * max(28, 12 * count)
    plot = new_figure(height, "worst backward error", "", x_axis_type="log", x_range=(low, high), y_range=(len(rows) - 0.5, -0.5))
    from bokeh.models import FixedTicker

    plot.yaxis.ticker = FixedTicker(ticks=list(range(len(rows))))
    plot.yaxis.major_label_overrides = dict(enumerate(rows))
    plot.ygrid.ticker = FixedTicker(ticks=[row + 0.5 for row in range(len(rows))])
    offsets = {subject: 0.7 * ((place + 0.5) / count - 0.5) for place, subject in enumerate(summary.subjects)}
    points = Points[Record](
        plot,
        lambda record: (within(record.backward_error, low, high), rows.index(record.system) + offsets[record.subject]),
        {
            "system": lambda record: record.system,
            "subject": lambda record: record.subject,
            "verdict": lambda record: record.verdict,
            "backward error": lambda record: error_text(record.backward_error),
        },
    )
    for subject, style in styles(summary.subjects).items():
        points.draw([record for record in compared if record.subject == subject], style)
    return points.shown("height")


def _distribution(summary: Summary, system: str) -> plotting.figure | None:
    filled = [(record.subject, bins) for record in summary.of_system(system) if (bins := half_decades(record))]
    if not filled:
        return None
    first = min(min(bins) for _, bins in filled)
    last = max(max(bins) for _, bins in filled)
    most = max(max(bins.values()) for _, bins in filled)
    low, high = min(_edge(first), 1.0) / 2, max(_edge(last + 1), AGREEMENT) * 2
    points = Points[tuple[str, int, int]](
        log_figure(260, "backward error", "states", (low, high), (0.5, 2.0 * most)),
        lambda one: (_edge(one[1] + 0.5), one[2]),
        {
            "subject": lambda one: one[0],
            "states": lambda one: one[2],
            "backward error": lambda one: f"{error_text(_edge(one[1]))} to {error_text(_edge(one[1] + 1))}",
        },
    )
    for subject, bins in filled:
        style = styles(summary.subjects)[subject]
        indices = range(min(bins), max(bins) + 1)
        # Counts of zero sit on the floor of the log axis, half a state.
        tops = [0.5, *(bins.get(index, 0.5) for index in indices), 0.5]
        edges = [_edge(index) for index in (*indices, indices[-1] + 1)]
        points.plot.line([x for x in edges for _ in (0, 1)], [y for y in tops for _ in (0, 1)][1:-1], line_color=style[0], line_width=1.5)
        points.draw([(subject, index, bins[index]) for index in sorted(bins)], style)
    return points.shown("height")


def _cost(summary: Summary, system: str) -> plotting.figure | None:
    shown = [r for r in summary.of_system(system) if drawable(r.backward_error) and drawable(r.seconds_per_state) and r.seconds_per_state]
    if not shown:
        return None
    card = summary.cards.get(system)
    reference = card.reference_seconds_per_state if card else None
    times = [within(seconds) for seconds in (*(r.seconds_per_state for r in shown), reference) if seconds and drawable(seconds)]
    low, high = log_range([1.0, AGREEMENT, *(record.backward_error for record in shown)])
    points = Points[Record](
        log_figure(260, "time per state [s]", "worst backward error", log_range(times), (low, high)),
        lambda record: (within(record.seconds_per_state), within(record.backward_error, low, high)),
        {
            "subject": lambda record: record.subject,
            "time per state": lambda record: seconds_text(record.seconds_per_state),
            "backward error": lambda record: error_text(record.backward_error),
        },
    )
    known = styles(summary.subjects)
    points.draw(shown, lambda record: known[record.subject])
    plot = points.shown("width")
    if reference and drawable(reference):
        line_across(plot, "height", within(reference), GREY)
    return plot


def _trend(summary: Summary) -> plotting.figure | None:
    """The worst backward error of each subject over the runs."""
    values = {subject: [p for p in values if drawable(p[1])] for subject, values in summary.trend().items()} if summary.earlier else {}
    if not any(values.values()):
        return None
    low, high = log_range([1.0, AGREEMENT, *(value for own in values.values() for _, value in own)])
    points = Points[tuple[str, datetime, float]](
        new_figure(280, "run started (UTC)", "worst backward error", x_axis_type="datetime", y_axis_type="log", y_range=(low, high)),
        lambda one: (one[1], within(one[2], low, high)),
        {
            "subject": lambda one: one[0],
            "started": lambda one: f"{one[1]:%Y-%m-%d %H:%M}",
            "backward error": lambda one: error_text(one[2]),
        },
    )
    for subject, style in styles(list(values)).items():
        points.draw([(subject, *one) for one in values[subject]], style, line_width=1.5)
    return points.shown("width")


def _medians(summary: Summary, system: str) -> plotting.figure | None:
    """The trend of the median of each subject, with its change points."""
    subjects = {record.series for record in summary.of_system(system)} if len(summary.nights) > 1 else set()
    shown = [trend for trend in summary.trends if (trend.system, trend.number) == (system, MEDIAN) and trend.subject in subjects]
    moments = [datetime.fromisoformat(run.started).replace(tzinfo=None) for run, _ in summary.nights]
    values = [value for trend in shown for value in trend.values if drawable(value)]
    if not values:
        return None
    low, high = log_range(values)
    points = Points[tuple[str, datetime, float, ChangedCell | None]](
        new_figure(260, "run started (UTC)", "median backward error", x_axis_type="datetime", y_axis_type="log", y_range=(low, high)),
        lambda one: (one[1], within(one[2], low, high)),
        {
            "subject": lambda one: one[0],
            "started": lambda one: f"{one[1]:%Y-%m-%d %H:%M}",
            "median": lambda one: error_text(one[2]),
            "change": lambda one: _change_text(one[3]),
        },
    )
    for trend in shown:
        changed = {change.place: change for change in trend.changes}
        nights = enumerate(zip(moments, trend.values, strict=True))
        own = [(trend.subject, moment, value, changed.get(place)) for place, (moment, value) in nights if drawable(value)]
        points.draw(own, styles(summary.subjects)[trend.subject.partition(" ")[0]], line_width=1.5)
        x, y = points.places(one for one in own if one[3] is not None)
        points.plot.scatter(x, y, marker="diamond", size=20, fill_color=None, line_color=RED, line_width=2)
    return points.shown()


def _change_text(change: ChangedCell | None) -> str:
    if change is None:
        return "none"
    return f"{change.found_by} from {error_text(change.before)} to {error_text(change.now)} after {counted(change.nights, 'run')}"


def _edge(index: float) -> float:
    return float(10.0 ** (index / 2))


def hard_plots(summary: HardSummary) -> dict[str, plotting.figure | None]:
    """The plot of each family by its name, "hard NAME"; None without a point that has a place."""
    return {f"hard {family.name}": _family(family, styles(summary.subjects)) for family in summary.families}


def _family(family: Family, known: dict[str, Style]) -> plotting.figure | None:
    placed = [(row, point) for row in family.rows.values() for point in row.points if math.isfinite(point.knob)]
    if not placed:
        return None
    place, axis, label = _axis(family, [point.knob for _, point in placed])
    low, high = log_range([1.0, 10 * AGREEMENT, *(point.backward_error for _, point in placed)], _HARD_ERRORS, margin=10.0)
    x_range = _ends([place(point.knob) for _, point in placed], axis)
    lines = {subject: 0.06 * number for number, subject in enumerate(family.rows, start=1)}

    def height(row: HardRow, point: HardPoint) -> float:
        """Points without an error stand in lines below the upper edge, one for each subject."""
        error = point.backward_error
        is_known = error is not None and drawable(error) and math.isfinite(error)
        return inside(error, low, high) if is_known else float(high / (high / low) ** lines[row.subject])

    points = Points[tuple[HardRow, HardPoint]](
        new_figure(280, label, "backward error", x_axis_type=axis, y_axis_type="log", x_range=x_range, y_range=(low, high)),
        lambda one: (place(one[1].knob), height(*one)),
        {
            "subject": lambda one: one[0].subject,
            placed[0][0].knob: lambda one: f"{one[1].knob:.4g}",
            "system": lambda one: one[1].system,
            "verdict": lambda one: one[1].verdict,
            "backward error": lambda one: error_text(one[1].backward_error),
            "digits lost": lambda one: "-" if one[1].digits_lost is None else f"{one[1].digits_lost:.1f}",
            "unstable up to": lambda one: error_text(one[1].unstable_bound),
            "kappa_s": lambda one: error_text(one[1].condition),
            "why": lambda one: one[1].reason or "-",
        },
    )
    _draw_bounds(points.plot, placed, place, high)

    def style(one: tuple[HardRow, HardPoint]) -> Style:
        own = known[one[0].subject]
        return (own[0], *SILENT_MARKER) if one[1].verdict in SILENT else own

    points.draw(placed, style, fill_alpha=0.6)
    return points.shown("width")


def _draw_bounds(plot: plotting.figure, placed: Sequence[tuple[HardRow, HardPoint]], place: Callable[[float], float], high: float) -> None:
    """The end of "unstable": from the lowest to the highest of the subjects' own bounds at each value of the knob."""
    known = [(place(point.knob), point.unstable_bound) for _, point in placed if drawable(point.unstable_bound)]
    # Below the limit of agreement nothing is unstable.
    bounds = grouped((x, min(max(bound, AGREEMENT), high**2)) for x, bound in known)
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
