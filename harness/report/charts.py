"""Plots of a report, drawn by Bokeh as one document.

Text and lines of the axes take their colours from CSS variables of the page (``--bk-...``), so that
they follow its light or dark scheme; the greys given here are readable on both where a Bokeh is too
old to read them.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

from harness.records import Record
from harness.report.summary import Summary, error_text, seconds_text
from harness.verdict import AGREEMENT

if TYPE_CHECKING:
    from bokeh import plotting
    from bokeh.model import Model
    from bokeh.models.renderers import DataRenderer

MARKERS = (
    ("circle", "●"), ("triangle", "▲"), ("square", "■"), ("diamond", "◆"), ("inverted_triangle", "▼"), ("star", "★"), ("hex", "⬢"),
)  # fmt: skip
COLOURS = ("#2f8fd0", "#e0731d", "#16a37b", "#c766a5", "#b8860b", "#8a70d6", "#7d8b3c", "#d9534f")
_GREY, _RED = "#808080", "#d9534f"
_LOWEST, _HIGHEST = 1e-300, 1e300
_Columns = dict[str, Sequence[Any]]
_Direction = Literal["width", "height"]


@dataclass(frozen=True)
class Charts:
    """What a page needs to show the plots.

    Attributes:
        resources: ``<script>`` elements with all of BokehJS; "" where there is no plot.
        script: the ``<script>`` element that fills the divs.
        divs: name of a plot to its ``<div>``; a plot without data is absent. Names are "overview",
            "trend", and per system "distribution NAME" and "cost NAME".
    """

    resources: str = ""
    script: str = ""
    divs: dict[str, str] = field(default_factory=dict)


def style_of(summary: Summary, subject: str) -> tuple[str, str, str]:
    """(colour, Bokeh marker, the marker as a character) of a subject, the same in all plots."""
    index = summary.subjects.index(subject)
    return COLOURS[index % len(COLOURS)], *MARKERS[index % len(MARKERS)]


def half_decades(record: Record) -> dict[int, int]:
    """Half-decade index to number of states, of those bins of a distribution that have a place on a log axis."""
    bins = {}
    for key, count in record.distribution.items():
        if key.removeprefix("-").isdecimal() and abs(int(key)) <= 600 and count > 0:
            bins[int(key)] = count
    return bins


def draw(summary: Summary) -> Charts:
    """Every plot of the report that has data."""
    from bokeh.document import Document
    from bokeh.embed import components
    from bokeh.resources import Resources

    plots = {"overview": _overview(summary), "trend": _trend(summary)}
    for system in summary.systems:
        plots[f"distribution {system}"] = _distribution(summary, system)
        plots[f"cost {system}"] = _cost(summary, system)
    drawn: dict[str, Model] = {name: plot for name, plot in plots.items() if plot is not None}
    if not drawn:
        return Charts()
    document = Document()
    # Without the freeze Bokeh visits all plots again after adding each.
    with document.models.freeze():
        for plot in drawn.values():
            document.add_root(plot)
    script, divs = components(drawn)
    return Charts(Resources(mode="inline", components=["bokeh"]).render_js(), script, divs)


def _overview(summary: Summary) -> plotting.figure | None:
    from bokeh.models import FixedTicker

    compared = [record for record in summary.records if _drawable(record.backward_error)]
    if not compared:
        return None
    low, high = _range(record.backward_error for record in compared)
    rows, count = summary.systems, len(summary.subjects)
    height = 50 + len(rows) * max(28, 12 * count)
    plot = _figure(height, "worst backward error", "", x_axis_type="log", x_range=(low, high), y_range=(len(rows) - 0.5, -0.5))
    plot.yaxis.ticker = FixedTicker(ticks=list(range(len(rows))))
    plot.yaxis.major_label_overrides = dict(enumerate(rows))
    plot.ygrid.ticker = FixedTicker(ticks=[row + 0.5 for row in range(len(rows))])
    for subject in summary.subjects:
        shown = [record for record in compared if record.subject == subject]
        offset = 0.7 * ((summary.subjects.index(subject) + 0.5) / count - 0.5)
        columns = _columns(shown, low, high)
        _scatter(plot, summary, subject, columns["size"], [rows.index(record.system) + offset for record in shown], columns)
    _hover(plot, system="@system", subject="@subject", verdict="@verdict", **{"backward error": "@error"})
    _limit(plot, "height")
    return plot


def _distribution(summary: Summary, system: str) -> plotting.figure | None:
    filled = [(record, bins) for record in summary.of_system(system) if (bins := half_decades(record))]
    if not filled:
        return None
    first = min(min(bins) for _, bins in filled)
    last = max(max(bins) for _, bins in filled)
    most = max(max(bins.values()) for _, bins in filled)
    low, high = min(_edge(first), 1.0) / 2, max(_edge(last + 1), AGREEMENT) * 2
    plot = _figure(260, "backward error", "states", x_axis_type="log", y_axis_type="log", x_range=(low, high), y_range=(0.5, 2.0 * most))
    for record, bins in filled:
        colour, _, _ = style_of(summary, record.subject)
        indices = range(min(bins), max(bins) + 1)
        # Counts of zero sit on the floor of the log axis, half a state.
        tops = [0.5, *(bins.get(index, 0.5) for index in indices), 0.5]
        edges = [_edge(index) for index in (*indices, indices[-1] + 1)]
        plot.line([x for x in edges for _ in (0, 1)], [y for y in tops for _ in (0, 1)][1:-1], line_color=colour, line_width=1.5)
        held = sorted(bins)
        columns: _Columns = {
            "subject": [record.subject] * len(held),
            "count": [str(bins[index]) for index in held],
            "between": [f"{error_text(_edge(index))} to {error_text(_edge(index + 1))}" for index in held],
        }
        _scatter(plot, summary, record.subject, [10 ** ((index + 0.5) / 2) for index in held], [bins[index] for index in held], columns)
    _hover(plot, subject="@subject", states="@count", **{"backward error": "@between"})
    _limit(plot, "height")
    return plot


def _cost(summary: Summary, system: str) -> plotting.figure | None:
    shown = [r for r in summary.of_system(system) if _drawable(r.backward_error) and _drawable(r.seconds_per_state) and r.seconds_per_state]
    if not shown:
        return None
    card = summary.cards.get(system)
    reference = card.reference_seconds_per_state if card else None
    times = [_clipped(seconds) for seconds in (*(r.seconds_per_state for r in shown), reference) if seconds and _drawable(seconds)]
    low, high = _range(record.backward_error for record in shown)
    x_range = (max(min(times) / 4, _LOWEST), min(max(times) * 4, _HIGHEST))
    axes = {"x_axis_type": "log", "y_axis_type": "log", "x_range": x_range, "y_range": (low, high)}
    plot = _figure(260, "time per state [s]", "worst backward error", **axes)
    for record in shown:
        columns = _columns([record], low, high)
        _scatter(plot, summary, record.subject, [_clipped(record.seconds_per_state)], columns["size"], columns)
    _hover(plot, subject="@subject", **{"time per state": "@seconds", "backward error": "@error"})
    _limit(plot, "width")
    if reference and _drawable(reference):
        _line(plot, "height", _clipped(reference), _GREY)
    return plot


def _trend(summary: Summary) -> plotting.figure | None:
    points = {subject: [p for p in values if _drawable(p[1])] for subject, values in summary.trend().items()} if summary.earlier else {}
    if not any(points.values()):
        return None
    low, high = _range(value for values in points.values() for _, value in values)
    plot = _figure(280, "run started (UTC)", "worst backward error", x_axis_type="datetime", y_axis_type="log", y_range=(low, high))
    for subject, values in points.items():
        x, y = [moment for moment, _ in values], [_within(value, low, high) for _, value in values]
        plot.line(x, y, line_color=style_of(summary, subject)[0], line_width=1.5)
        columns: _Columns = {
            "subject": [subject] * len(x),
            "started": [f"{moment:%Y-%m-%d %H:%M}" for moment in x],
            "error": [error_text(value) for _, value in values],
        }
        _scatter(plot, summary, subject, x, y, columns)
    _hover(plot, subject="@subject", started="@started", **{"backward error": "@error"})
    _limit(plot, "width")
    return plot


def _figure(height: int, x_label: str, y_label: str, **options: Any) -> plotting.figure:
    from bokeh.plotting import figure

    plot = figure(
        height=height, sizing_mode="stretch_width", tools="", toolbar_location=None, x_axis_label=x_label, y_axis_label=y_label,
        background_fill_color=None, border_fill_color=None, outline_line_color=_GREY, outline_line_alpha=0.4, **options,
    )  # fmt: skip
    for axis in plot.axis:
        axis.axis_label_text_font_style = "normal"
        axis.axis_label_text_color = axis.major_label_text_color = _GREY
        axis.axis_line_color = axis.major_tick_line_color = axis.minor_tick_line_color = _GREY
    plot.grid.grid_line_color = _GREY
    plot.grid.grid_line_alpha = 0.25
    return plot


def _columns(records: Sequence[Record], low: float, high: float) -> _Columns:
    return {
        "system": [record.system for record in records],
        "subject": [record.subject for record in records],
        "verdict": [record.verdict for record in records],
        "error": [error_text(record.backward_error) for record in records],
        "seconds": [seconds_text(record.seconds_per_state) for record in records],
        "size": [_within(record.backward_error, low, high) for record in records],
    }


def _scatter(plot: plotting.figure, summary: Summary, subject: str, x: Sequence[Any], y: Sequence[Any], columns: _Columns) -> None:
    from bokeh.models import ColumnDataSource

    colour, marker, _ = style_of(summary, subject)
    source = ColumnDataSource({**columns, "x": list(x), "y": list(y)})
    plot.scatter("x", "y", source=source, name="point", marker=marker, size=9, color=colour, fill_alpha=0.75)


def _hover(plot: plotting.figure, **tooltips: str) -> None:
    from bokeh.models import HoverTool
    from bokeh.models.renderers import GlyphRenderer

    points: list[DataRenderer] = [shown for shown in plot.renderers if isinstance(shown, GlyphRenderer) and shown.name == "point"]
    plot.add_tools(HoverTool(renderers=points, tooltips=list(tooltips.items())))


def _limit(plot: plotting.figure, dimension: _Direction) -> None:
    _line(plot, dimension, AGREEMENT, _RED)


def _line(plot: plotting.figure, dimension: _Direction, location: float, colour: str) -> None:
    from bokeh.models.annotations.geometry import Span

    plot.add_layout(Span(dimension=dimension, location=location, line_color=colour, line_dash="dashed", line_width=1.5))


def _edge(index: int) -> float:
    return float(10.0 ** (index / 2))


def _drawable(value: float | None) -> bool:
    return value is not None and not math.isnan(value) and value >= 0


def _clipped(value: float | None) -> float:
    return min(max(value or 0.0, _LOWEST), _HIGHEST)


def _within(value: float | None, low: float, high: float) -> float:
    """``value``, or the end of the axis nearest to it: a log axis has no place for 0 and inf."""
    return min(max(value or 0.0, low), high)


def _range(values: Iterable[float | None]) -> tuple[float, float]:
    """Ends of a log axis that shows 1, the limit and every value that has a place on it."""
    finite = [value for value in values if value and math.isfinite(value)]
    low, high = min([1.0, *finite]) / 4, max([AGREEMENT, *finite]) * 4
    return max(low, _LOWEST), min(high, _HIGHEST)
