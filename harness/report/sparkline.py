"""The trend of one pair over the runs, as a line of the size of a word."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from typing import TYPE_CHECKING

from harness.results.table import counted, error_text

if TYPE_CHECKING:
    from harness.results.trend import Trend

_WIDTH, _HEIGHT, _MARGIN = 80.0, 20.0, 3.0
# Changes within this factor look as flat as they are.
_LEAST_RATIO = 10.0


class Sparkline:
    """Positive numbers, oldest first, on a logarithmic scale: ``<svg>`` on a page, their extremes in words elsewhere.

    A number that such a scale cannot show sits at its end. ``changes`` are the places of those that are marked as change points.
    """

    def __init__(self, values: Sequence[float | None], changes: Collection[int] = ()) -> None:
        shown = [(value, place in changes) for place, value in enumerate(values) if value is not None and not math.isnan(value)]
        self.values = [value for value, _ in shown]
        self.changes = [place for place, (_, is_change) in enumerate(shown) if is_change]

    @classmethod
    def of(cls, trend: Trend) -> Sparkline:
        """A trend with its change points."""
        return cls(trend.values, [change.place for change in trend.changes])

    def __str__(self) -> str:
        if not self.values:
            return "no number yet"
        low, high = error_text(min(self.values)), error_text(max(self.values))
        changed = f", changed in run {', '.join(str(place + 1) for place in self.changes)}" if self.changes else ""
        return f"{low if low == high else f'{low} to {high}'} in {counted(len(self.values), 'run')}{changed}"

    def __html__(self) -> str:
        drawn = f'<svg class="trend" viewBox="0 0 {_WIDTH:g} {_HEIGHT:g}" role="img" aria-label="{self}">{self._line()}</svg>'
        return f"{drawn}<small> {self}</small>"

    def _line(self) -> str:
        shown = [math.log10(value) for value in self.values if 0 < value < math.inf] or [0.0]
        middle, span = (min(shown) + max(shown)) / 2, max(max(shown) - min(shown), math.log10(_LEAST_RATIO))
        low, high = middle - span / 2, middle + span / 2
        step = (_WIDTH - 2 * _MARGIN) / max(1, len(self.values) - 1)
        places = []
        for number, value in enumerate(self.values):
            height = low if value <= 0 else high if math.isinf(value) else math.log10(value)
            places.append((_MARGIN + number * step, _HEIGHT - _MARGIN - (height - low) / span * (_HEIGHT - 2 * _MARGIN)))
        line = " ".join(f"{x:.1f},{y:.1f}" for x, y in places)
        last = "".join(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="2"/>' for x, y in places[-1:])
        return f'<polyline points="{line}"/>{last}{"".join(_mark(*places[place]) for place in self.changes)}'


NO_TREND = Sparkline([])


def _mark(x: float, y: float) -> str:
    """A change point: a line through the whole height and a hollow diamond on the number."""
    diamond = f"M{x:.1f} {y - _MARGIN:.1f}l{_MARGIN} {_MARGIN}l{-_MARGIN} {_MARGIN}l{-_MARGIN} {-_MARGIN}z"
    return f'<path class="change" d="M{x:.1f} 0V{_HEIGHT:g}{diamond}"/>'
