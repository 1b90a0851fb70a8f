"""Plots of the verdicts: how large the backward errors are, what they cost, and how they went over the nights."""

from __future__ import annotations

from datetime import datetime
from typing import TYPE_CHECKING

from harness.report.figures import (
    GREY,
    RED,
    drawable,
    hover,
    line_across,
    log_figure,
    log_range,
    new_figure,
    scatter,
    styles,
    within,
)
from harness.report.summary import Summary
from harness.results.records import Record
from harness.results.table import counted, error_text, seconds_text
from harness.results.trend import ChangedCell, subject_of
from harness.results.trend_numbers import MEDIAN
from harness.verdict import AGREEMENT

if TYPE_CHECKING:
    from bokeh import plotting


# Half decade below which a distribution is not drawn: 1e-8.
LEAST_SHOWN = -16


def half_decades(record: Record) -> dict[int, int]:
    """Half-decade index to number of states, of those bins of a distribution that have a place on a log axis.

    Errors far below a rounding, which hypothesis finds where a state is all but zero, would squeeze all others into a corner.
    """
    bins = {}
    for key, count in record.distribution.items():
        if key.removeprefix("-").isdecimal() and LEAST_SHOWN <= int(key) <= 600 and count > 0:
            bins[int(key)] = count
    return bins


def plots(summary: Summary) -> dict[str, plotting.figure | None]:
    """The plots over all systems by name, "overview" and "trend"; None without data."""
    return {"overview": _overview(summary), "trend": _trend(summary)}


def plots_of(summary: Summary, system: str) -> dict[str, plotting.figure | None]:
    """The plots of one system by name, "medians", "distribution" and "cost"; None without data."""
    return {"medians": _medians(summary, system), "distribution": _distribution(summary, system), "cost": _cost(summary, system)}


def _overview(summary: Summary) -> plotting.figure | None:
    from bokeh.models import FixedTicker

    compared = [record for record in summary.records if drawable(record.backward_error)]
    if not compared:
        return None
    low, high = log_range([1.0, AGREEMENT, *(record.backward_error for record in compared)])
    rows, count = summary.systems, len(summary.subjects)
    height = 50 + len(rows) * max(28, 12 * count)
    plot = new_figure(height, "worst backward error", "", x_axis_type="log", x_range=(low, high), y_range=(len(rows) - 0.5, -0.5))
    plot.yaxis.ticker = FixedTicker(ticks=list(range(len(rows))))
    plot.yaxis.major_label_overrides = dict(enumerate(rows))
    plot.ygrid.ticker = FixedTicker(ticks=[row + 0.5 for row in range(len(rows))])
    for subject in summary.subjects:
        shown = [record for record in compared if record.subject == subject]
        offset = 0.7 * ((summary.subjects.index(subject) + 0.5) / count - 0.5)
        words = {
            "system": [record.system for record in shown],
            "subject": [subject] * len(shown),
            "verdict": [record.verdict for record in shown],
            "backward error": [error_text(record.backward_error) for record in shown],
        }
        x, y = [within(r.backward_error, low, high) for r in shown], [rows.index(record.system) + offset for record in shown]
        scatter(plot, styles(summary.subjects)[subject], x, y, words)
    hover(plot)
    line_across(plot, "height", AGREEMENT, RED)
    return plot


def _distribution(summary: Summary, system: str) -> plotting.figure | None:
    filled = [(record, bins) for record in summary.of_system(system) if (bins := half_decades(record))]
    if not filled:
        return None
    first = min(min(bins) for _, bins in filled)
    last = max(max(bins) for _, bins in filled)
    most = max(max(bins.values()) for _, bins in filled)
    low, high = min(_edge(first), 1.0) / 2, max(_edge(last + 1), AGREEMENT) * 2
    plot = log_figure(260, "backward error", "states", (low, high), (0.5, 2.0 * most))
    for record, bins in filled:
        style = styles(summary.subjects)[record.subject]
        indices = range(min(bins), max(bins) + 1)
        # Counts of zero sit on the floor of the log axis, half a state.
        tops = [0.5, *(bins.get(index, 0.5) for index in indices), 0.5]
        edges = [_edge(index) for index in (*indices, indices[-1] + 1)]
        plot.line([x for x in edges for _ in (0, 1)], [y for y in tops for _ in (0, 1)][1:-1], line_color=style[0], line_width=1.5)
        held = sorted(bins)
        words = {
            "subject": [record.subject] * len(held),
            "states": [str(bins[index]) for index in held],
            "backward error": [f"{error_text(_edge(index))} to {error_text(_edge(index + 1))}" for index in held],
        }
        scatter(plot, style, [_edge(index + 0.5) for index in held], [bins[index] for index in held], words)
    hover(plot)
    line_across(plot, "height", AGREEMENT, RED)
    return plot


def _cost(summary: Summary, system: str) -> plotting.figure | None:
    shown = [r for r in summary.of_system(system) if drawable(r.backward_error) and drawable(r.seconds_per_state) and r.seconds_per_state]
    if not shown:
        return None
    card = summary.cards.get(system)
    reference = card.reference_seconds_per_state if card else None
    times = [within(seconds) for seconds in (*(r.seconds_per_state for r in shown), reference) if seconds and drawable(seconds)]
    low, high = log_range([1.0, AGREEMENT, *(record.backward_error for record in shown)])
    plot = log_figure(260, "time per state [s]", "worst backward error", log_range(times), (low, high))
    words = {
        "subject": [record.subject for record in shown],
        "time per state": [seconds_text(record.seconds_per_state) for record in shown],
        "backward error": [error_text(record.backward_error) for record in shown],
    }
    looks = [styles(summary.subjects)[record.subject] for record in shown]
    x, y = [within(record.seconds_per_state) for record in shown], [within(record.backward_error, low, high) for record in shown]
    scatter(plot, looks, x, y, words)
    hover(plot)
    line_across(plot, "width", AGREEMENT, RED)
    if reference and drawable(reference):
        line_across(plot, "height", within(reference), GREY)
    return plot


def _trend(summary: Summary) -> plotting.figure | None:
    points = {subject: [p for p in values if drawable(p[1])] for subject, values in summary.trend().items()} if summary.earlier else {}
    if not any(points.values()):
        return None
    low, high = log_range([1.0, AGREEMENT, *(value for values in points.values() for _, value in values)])
    plot = new_figure(280, "run started (UTC)", "worst backward error", x_axis_type="datetime", y_axis_type="log", y_range=(low, high))
    for subject, values in points.items():
        x, y = [moment for moment, _ in values], [within(value, low, high) for _, value in values]
        plot.line(x, y, line_color=styles(summary.subjects)[subject][0], line_width=1.5)
        words = {
            "subject": [subject] * len(x),
            "started": [f"{moment:%Y-%m-%d %H:%M}" for moment in x],
            "backward error": [error_text(value) for _, value in values],
        }
        scatter(plot, styles(summary.subjects)[subject], x, y, words)
    hover(plot)
    line_across(plot, "width", AGREEMENT, RED)
    return plot


def _medians(summary: Summary, system: str) -> plotting.figure | None:
    """The trend of the median of each subject, with its change points."""
    if len(summary.nights) < 2:
        return None
    subjects = dict.fromkeys(subject_of(record) for record in summary.of_system(system))
    shown = [trend for trend in summary.trends if (trend.system, trend.number) == (system, MEDIAN) and trend.subject in subjects]
    moments = [datetime.fromisoformat(run.started).replace(tzinfo=None) for run, _ in summary.nights]
    values = [value for trend in shown for value in trend.values if drawable(value)]
    if not values:
        return None
    low, high = log_range(values)
    plot = new_figure(260, "run started (UTC)", "median backward error", x_axis_type="datetime", y_axis_type="log", y_range=(low, high))
    for trend in shown:
        style = styles(summary.subjects)[trend.subject.partition(" ")[0]]
        changed = {change.place: change for change in trend.changes}
        places = [place for place, value in enumerate(trend.values) if drawable(value)]
        x, y = [moments[place] for place in places], [within(trend.values[place], low, high) for place in places]
        plot.line(x, y, line_color=style[0], line_width=1.5)
        marked = [(moment, value) for place, moment, value in zip(places, x, y, strict=True) if place in changed]
        plot.scatter(
            [moment for moment, _ in marked], [value for _, value in marked], marker="diamond", size=20, fill_color=None, line_color=RED,
            line_width=2,
        )  # fmt: skip
        words = {
            "subject": [trend.subject] * len(places),
            "started": [f"{moment:%Y-%m-%d %H:%M}" for moment in x],
            "median": [error_text(trend.values[place]) for place in places],
            "change": [_change_text(changed.get(place)) for place in places],
        }
        scatter(plot, style, x, y, words)
    hover(plot)
    return plot


def _change_text(change: ChangedCell | None) -> str:
    if change is None:
        return "none"
    return f"{change.found_by} from {error_text(change.before)} to {error_text(change.now)} after {counted(change.nights, 'run')}"


def _edge(index: float) -> float:
    return float(10.0 ** (index / 2))
