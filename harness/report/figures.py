"""The common parts of all plots: colours, axes, points with words beside them, and the embedding into a page.

Text and lines of the axes take their colours from CSS variables of the page (``--bk-...``), so that
they follow its light or dark scheme; the greys given here are readable on both where a Bokeh is too
old to read them.
"""

from __future__ import annotations

import base64
import functools
import gzip
import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Generic, Literal, TypeGuard, TypeVar

from markupsafe import Markup

from harness.errors import require
from harness.verdict import AGREEMENT

if TYPE_CHECKING:
    from bokeh import plotting
    from bokeh.model import Model
    from bokeh.models.renderers import DataRenderer

MARKERS = (
    ("circle", "●"), ("triangle", "▲"), ("square", "■"), ("diamond", "◆"), ("inverted_triangle", "▼"), ("star", "★"), ("hex", "⬢"),
)  # fmt: skip
COLOURS = ("#2f8fd0", "#e0731d", "#16a37b", "#c766a5", "#b8860b", "#8a70d6", "#7d8b3c", "#d9534f")
GREY, RED = "#808080", "#d9534f"
LOWEST, HIGHEST = 1e-300, 1e300
_LEAST_SPAN = 100.0
_NEEDED = "a report has charts"
Style = tuple[str, str, str]
_Item = TypeVar("_Item")


def embed(plots: Mapping[str, plotting.figure | None]) -> dict[str, Any]:
    """Everything a page needs beside ``library()`` to show every plot that has data, in one document.

    "charts" holds what fills the divs as JSON in gzip and base64, so that a page needs no script of its own; none where there is no
    plot. "plots" maps names to ``<div>`` elements.
    """
    drawn: dict[str, Model] = {name: plot for name, plot in plots.items() if plot is not None}
    if not drawn:
        return {"charts": [], "plots": {}}
    from bokeh.document import Document
    from bokeh.embed.util import standalone_docs_json_and_render_items

    document = Document()
    # Without the freeze Bokeh visits all plots again after adding each.
    with document.models.freeze():
        for plot in drawn.values():
            document.add_root(plot)
    documents, [item] = standalone_docs_json_and_render_items(list(drawn.values()))[:2]
    places = item.roots.to_json()
    text = json.dumps({"documents": documents, "items": [item.to_json()]})
    packed = base64.b64encode(gzip.compress(text.encode(), mtime=0)).decode()
    return {"charts": [packed], "plots": {name: _named(name, plot, places[plot.id]) for name, plot in drawn.items()}}


@functools.cache
def library() -> str:
    """All of BokehJS: the script that every page with plots loads."""
    require(_NEEDED, "bokeh")
    from bokeh.resources import Resources

    return "\n".join(Resources(mode="inline", components=["bokeh"]).js_raw) + "\n"


def _named(name: str, plot: Any, place: str) -> Markup:
    """The place of a plot, with what it shows for those who do not see it."""
    shown = f"Chart {name}: {plot.yaxis.axis_label or 'all systems'} against {plot.xaxis.axis_label}"
    return Markup('<div role="img" aria-label="{}"><div class="chart" id="{}" data-root-id="{}"></div></div>').format(shown, place, plot.id)


def styles(names: Sequence[str]) -> dict[str, Style]:
    """(colour, Bokeh marker, the marker as a character) of each name, by its place in ``names``."""
    return {name: (COLOURS[index % len(COLOURS)], *MARKERS[index % len(MARKERS)]) for index, name in enumerate(names)}


def new_figure(height: int, x_label: str, y_label: str, **options: Any) -> plotting.figure:
    """An empty plot as wide as its place."""
    require(_NEEDED, "bokeh")
    from bokeh.plotting import figure

    plot = figure(
        height=height, sizing_mode="stretch_width", tools="", toolbar_location=None, x_axis_label=x_label, y_axis_label=y_label,
        background_fill_color=None, border_fill_color=None, outline_line_color=GREY, outline_line_alpha=0.4, **options,
    )  # fmt: skip
    for axis in plot.axis:
        axis.axis_label_text_font_style = "normal"
        axis.axis_label_text_color = axis.major_label_text_color = GREY
        axis.axis_line_color = axis.major_tick_line_color = axis.minor_tick_line_color = GREY
    plot.grid.grid_line_color = GREY
    plot.grid.grid_line_alpha = 0.25
    return plot


def log_figure(height: int, x_label: str, y_label: str, x_range: tuple[float, float], y_range: tuple[float, float]) -> plotting.figure:
    """An empty plot between two logarithmic axes."""
    return new_figure(height, x_label, y_label, x_axis_type="log", y_axis_type="log", x_range=x_range, y_range=y_range)


@dataclass(frozen=True)
class Points(Generic[_Item]):
    """Items as marks on a plot.

    Attributes:
        place: x and y of an item. words: what is shown beside an item, by title.
    """

    plot: plotting.figure
    place: Callable[[_Item], tuple[Any, float]]
    words: Mapping[str, Callable[[_Item], object]]

    def places(self, items: Iterable[_Item]) -> tuple[list[Any], list[float]]:
        """All x and all y."""
        found = [self.place(item) for item in items]
        return [x for x, _ in found], [y for _, y in found]

    def draw(self, items: Iterable[_Item], style: Style | Callable[[_Item], Style], fill_alpha: float = 0.75, **line: Any) -> None:
        """A mark for each item, in a style of all of them or of its own; ``line`` is the width and more of a line through them."""
        from bokeh.models import ColumnDataSource

        items = list(items)
        x, y = self.places(items)
        if line:
            self.plot.line(x, y, line_color=style[0] if isinstance(style, tuple) else GREY, **line)
        columns: dict[str, list[Any]] = {title: [str(word(item)) for item in items] for title, word in self.words.items()}
        colour, marker = style[:2] if isinstance(style, tuple) else ("colour", "marker")
        if not isinstance(style, tuple):
            looks = [style(item) for item in items]
            columns |= {"colour": [own[0] for own in looks], "marker": [own[1] for own in looks]}
        source = ColumnDataSource({**columns, "x": x, "y": y})
        shown = self.plot.scatter("x", "y", source=source, name="point", marker=marker, size=9, color=colour, fill_alpha=fill_alpha)
        shown.tags = list(self.words)

    def shown(self, limit: Literal["width", "height"] | None = None) -> plotting.figure:
        """The plot when all items are drawn: the words of a mark are shown beside it, and a line across says how much agrees."""
        from bokeh.models import HoverTool
        from bokeh.models.renderers import GlyphRenderer

        marks: list[DataRenderer] = [one for one in self.plot.renderers if isinstance(one, GlyphRenderer) and one.name == "point"]
        titles = dict.fromkeys(title for one in marks for title in one.tags)
        self.plot.add_tools(HoverTool(renderers=marks, tooltips=[(str(title), f"@{{{title}}}") for title in titles]))
        if limit is not None:
            line_across(self.plot, limit, AGREEMENT, RED)
        return self.plot


def line_across(plot: plotting.figure, dimension: Literal["width", "height"], location: float, colour: str) -> None:
    """A dashed line through all of the plot."""
    from bokeh.models.annotations.geometry import Span

    plot.add_layout(Span(dimension=dimension, location=location, line_color=colour, line_dash="dashed", line_width=1.5))


def drawable(value: float | None) -> TypeGuard[float]:
    """True where a logarithmic axis has a place for ``value``, if only its end."""
    return value is not None and not math.isnan(value) and value >= 0


def log_range(values: Iterable[float | None], limits: tuple[float, float] = (LOWEST, HIGHEST), margin: float = 3.0) -> tuple[float, float]:
    """Ends of a log axis for those of ``values`` that have a place on it; what lies beyond ``limits`` sits on its edge."""
    finite = [value for value in values if value and math.isfinite(value) and value > 0] or [1.0]
    low = min(max(min(finite) / margin, limits[0]), limits[1] / _LEAST_SPAN)
    high = min(max(finite) * margin, limits[1])
    # Within one decade a logarithmic axis has no round numbers to show.
    widening = max(1.0, math.sqrt(_LEAST_SPAN * low / high))
    return low / widening, high * widening


def inside(value: float | None, low: float, high: float) -> float:
    """``value``, or just inside the nearer end of the axis, so that the whole marker is seen."""
    return within(value, low * 1.5, high / 1.5)


def within(value: float | None, low: float = LOWEST, high: float = HIGHEST) -> float:
    """``value``, or the end of the axis nearest to it: a log axis has no place for 0 and inf."""
    return min(max(value or 0.0, low), high)
