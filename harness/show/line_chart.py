"""Lines over one axis as an SVG drawing, for which a page loads nothing."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from html import escape

import numpy as np

from harness.arrays import Array
from harness.report.figures import COLOURS
from harness.show.drawing import Drawing

_WIDTH, _LEAST_HEIGHT = 640.0, 220.0
_LEFT, _TOP, _BOTTOM = 64.0, 14.0, 40.0
# Of a name beside its line: height of a row, start behind the panel, and width of a letter.
_ROW, _KEY, _LETTER = 16.0, 34.0, 7.0
_LABELS = 5
# More points than this are not seen apart.
_MOST_POINTS = 1200
_RULES = """
svg.lines { width: 100%; max-width: 44rem; height: auto; background: var(--panel); border: 1px solid var(--rule); border-radius: .3rem; }
svg.lines text { fill: var(--ink); font: 12px system-ui, sans-serif; }
svg.lines .grid { stroke: var(--rule); }
svg.lines .key, svg.lines polyline { fill: none; stroke-width: 1.8px; stroke-linejoin: round; }
"""
Lines = Mapping[str, Array]


def draw_lines(x: Array, panels: Sequence[tuple[str, Lines]], x_label: str, title: str) -> Drawing:
    """Panels above one another, each with the label of its axis and its lines by name.

    ``x`` is (n,), increasing; each line is (n,).
    """
    right = _WIDTH - _KEY - _LETTER * max(len(name) for _, lines in panels for name in lines)
    parts, above = list[str](), 0.0
    for label, lines in panels:
        below = above + max(_LEAST_HEIGHT, _TOP + _ROW * len(lines) + _BOTTOM)
        parts += _panel(x, (label, lines), x_label, (_LEFT, right, above + _TOP, below - _BOTTOM))
        above = below
    box = f'viewBox="0 0 {_WIDTH:g} {above:g}"'
    drawn = f'<svg class="lines" {box} role="img" xmlns="http://www.w3.org/2000/svg"><title>{escape(title)}</title>{"".join(parts)}</svg>'
    return Drawing.styled(drawn, "lines", _RULES, title)


def _panel(x: Array, panel: tuple[str, Lines], x_label: str, place: tuple[float, float, float, float]) -> Iterator[str]:
    (label, lines), (left, right, top, bottom) = panel, place
    values = np.concatenate(list(lines.values()))
    low, high = float(values.min()), float(values.max())
    margin = 0.05 * ((high - low) or max(abs(high), 1.0))
    low, high = low - margin, high + margin

    def across(value: float) -> float:
        return left + (value - float(x[0])) / float(x[-1] - x[0]) * (right - left)

    def up(value: float) -> float:
        return bottom - (value - low) / (high - low) * (bottom - top)

    for value in round_numbers(low, high):
        yield f'<path class="grid" d="M{left:g} {up(value):.1f}H{right:g}"/>'
        yield f'<text text-anchor="end" x="{left - 6:g}" y="{up(value) + 4:.1f}">{value:g}</text>'
    for value in round_numbers(float(x[0]), float(x[-1])):
        yield f'<path class="grid" d="M{across(value):.1f} {top:g}V{bottom:g}"/>'
        yield f'<text text-anchor="middle" x="{across(value):.1f}" y="{bottom + 16:g}">{value:g}</text>'
    yield f'<text text-anchor="end" x="{right:g}" y="{bottom + 32:g}">{escape(x_label)}</text>'
    yield f'<text transform="translate(14 {(top + bottom) / 2:g}) rotate(-90)" text-anchor="middle">{escape(label)}</text>'
    shown = np.unique(np.linspace(0, len(x) - 1, min(len(x), _MOST_POINTS)).round().astype(int))
    for number, (name, line) in enumerate(lines.items()):
        colour, y = COLOURS[number % len(COLOURS)], top + 12 + _ROW * number
        points = " ".join(f"{across(float(x[place])):.1f},{up(float(line[place])):.1f}" for place in shown)
        yield f'<polyline points="{points}" style="stroke:{colour}"/>'
        yield f'<path class="key" d="M{right + 10:g} {y - 4:g}h18" style="stroke:{colour}"/>'
        yield f'<text x="{right + _KEY:g}" y="{y:g}">{escape(name)}</text>'


def round_numbers(low: float, high: float) -> list[float]:
    """Multiples of 1, 2 or 5 times a power of ten between two ends, at most about ``_LABELS``."""
    least = (high - low) / _LABELS
    power = 10.0 ** math.floor(math.log10(least))
    step = next(factor * power for factor in (1, 2, 5, 10) if factor * power >= least * (1 - 1e-9))
    return [step * number for number in range(math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9) + 1)]
