"""The gap between two motions over time, stacked by cause, as an SVG drawing."""

from __future__ import annotations

from collections.abc import Iterator
from html import escape

import numpy as np

from harness.arrays import Array
from harness.report.figures import COLOURS, GREY
from harness.results.drift import NAMED, DriftRecord
from harness.show.drawing import Drawing
from harness.show.line_chart import round_numbers

_WIDTH, _HEIGHT = 720.0, 320.0
_LEFT, _TOP, _BOTTOM, _KEYS = 70.0, 20.0, 44.0, 190.0
_ROW = 18.0
# Causes with a colour of their own; the others are one.
_MOST = len(COLOURS) - 1
_RULES = """
svg.drift { width: 100%; max-width: 46rem; height: auto; background: var(--panel); border: 1px solid var(--rule); border-radius: .3rem; }
svg.drift text { fill: var(--ink); font: 12px system-ui, sans-serif; }
svg.drift .grid { stroke: var(--rule); }
svg.drift .gap { fill: none; stroke: var(--ink); stroke-width: 1.6px; }
"""


def draw_drift(drift: DriftRecord) -> Drawing:
    """The parts of the gap in positions by cause, those that take from it below zero; its size as a line; grey where none is claimed."""
    end = float(drift.times[-1]) if drift.times else 1.0
    times, gap = np.array([0.0, *drift.times]), np.array([0.0, *drift.of_positions])
    stacked = list(_stacked(drift, gap))
    values = np.concatenate([gap, *(band for _, low, high, _ in stacked for band in (low, high))])
    low, high = min(float(values.min()), 0.0), float(values.max()) or 1.0
    right, bottom = _WIDTH - _KEYS, _HEIGHT - _BOTTOM

    def across(time: float) -> float:
        return _LEFT + time / end * (right - _LEFT)

    def up(value: float) -> float:
        return bottom - (value - low) / (high - low) * (bottom - _TOP)

    def path(x: Array, y: Array) -> str:
        return " ".join(f"{across(float(one)):.1f},{up(float(other)):.1f}" for one, other in zip(x, y, strict=True))

    parts = []
    for value in round_numbers(low, high):
        parts.append(f'<path class="grid" d="M{_LEFT:g} {up(value):.1f}H{right:g}"/>')
        parts.append(f'<text text-anchor="end" x="{_LEFT - 6:g}" y="{up(value) + 4:.1f}">{value:.3g}</text>')
    for value in round_numbers(0.0, end):
        parts.append(f'<text text-anchor="middle" x="{across(value):.1f}" y="{bottom + 16:g}">{value:g}</text>')
    for place, (name, lower, upper, colour) in enumerate(stacked):
        known = times[: len(lower)]
        outline = path(np.concatenate([known, known[::-1]]), np.concatenate([upper, lower[::-1]]))
        parts.append(f'<polygon points="{outline}" style="fill:{colour};fill-opacity:.75"><title>{escape(name)}</title></polygon>')
        parts.append(f'<path d="M{right + 12:g} {_TOP + 8 + _ROW * place:g}h16" style="stroke:{colour};stroke-width:10px"/>')
        parts.append(f'<text x="{right + 36:g}" y="{_TOP + 12 + _ROW * place:g}">{escape(name)}</text>')
    if drift.horizon is not None:
        at, top = across(drift.horizon), _TOP
        parts.append(
            f'<rect x="{at:.1f}" y="{top:g}" width="{right - at:.1f}" height="{bottom - top:g}" style="fill:{GREY};fill-opacity:.25"/>'
        )
        parts.append(f'<text x="{right + 12:g}" y="{bottom:g}">grey: rounding alone</text>')
    parts.append(f'<polyline class="gap" points="{path(times, gap)}"/>')
    parts.append(f'<text text-anchor="end" x="{right:g}" y="{bottom + 34:g}">time [s]</text>')
    middle = (_TOP + bottom) / 2
    parts.append(f'<text transform="translate(14 {middle:g}) rotate(-90)" text-anchor="middle">gap in positions [kg^1/2 m]</text>')
    box = f'viewBox="0 0 {_WIDTH:g} {_HEIGHT:g}"'
    title = f"gap between {drift.first.label} and {drift.second.label} by cause"
    drawn = f'<svg class="drift" {box} role="img" xmlns="http://www.w3.org/2000/svg"><title>{escape(title)}</title>{"".join(parts)}</svg>'
    return Drawing.styled(drawn, "drift", _RULES, title)


def _stacked(drift: DriftRecord, gap: Array) -> Iterator[tuple[str, Array, Array, str]]:
    """Name, lower and upper edge over time, and colour, of each cause with enough of the gap, and of all others together."""
    rows = [(share.name, np.array([0.0, *(part or 0.0 for part in share.positions)])) for share in drift.ranked]
    clear = 1 + sum(1 for time in drift.times if drift.horizon is None or time < drift.horizon)
    own = [row for row, share in zip(rows, drift.ranked, strict=True) if abs(share.whole or 0.0) >= NAMED][:_MOST]
    rest = [parts for name, parts in rows if all(name != kept for kept, _ in own)]
    if rest and np.abs(others := np.sum(rest, axis=0)).max() >= NAMED / 10:
        own.append(("all others", others))
    above, below = np.zeros(clear), np.zeros(clear)
    for place, (name, parts) in enumerate(own):
        height = (parts * gap)[:clear]
        grown, sunk = np.maximum(height, 0.0), np.minimum(height, 0.0)
        lower, upper = np.where(height >= 0, above, below + sunk), np.where(height >= 0, above + grown, below)
        above, below = above + grown, below + sunk
        yield name, lower, upper, COLOURS[place] if name != "all others" else GREY
