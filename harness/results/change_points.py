"""Change points of a number that is measured anew every night.

Proofs and sources: docs/inside/numerics.md, "Change points".
"""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from statistics import NormalDist
from typing import TypeVar

# Of all cells together whose noise is known, expected in a night in which nothing changes: half of them jumps, half drifts.
FALSE_ALARMS = 1e-3
# Earlier nights whose scores a jump of a pool need not exceed, and the factor by which it exceeds those of the others.
NIGHTS_PASSED_OVER, WELL_BEYOND = 1, 1.25
# Of CUSUM: half of the shift, in standard deviations, that it finds soonest.
ALLOWANCE = 0.5
# Nights whose scatter tells the noise where nothing else does.
FEWEST_UNKNOWN = 8
# Probability at which Student's distribution says by how much an estimated noise widens a tail that is not normal.
WIDENED_AT = 1e-4
# Beyond this multiple of the known noise the scatter of the nights is another noise.
MUCH_LARGER, FEWEST_SCATTERED = 2.0, 3
JUMP, DRIFT = "jump", "drift"
_NORMAL = NormalDist()
_Cell = TypeVar("_Cell")
_EULER = 0.5772156649015329
_GUMBEL = math.pi / math.sqrt(6)
# Overshoot of a CUSUM of normal scores, see Siegmund.
_OVERSHOOT = 1.166
# Scores beyond it are all alike.
_FURTHEST = 37.0


@dataclass(frozen=True)
class NightValue:
    """The value of one night.

    Attributes:
        value: a logarithm. noise: its standard deviation, as far as it is known beforehand, which is the least that is assumed.
        pool: the numbers that are scored together with it, as their noise is not known beforehand and has a long upper tail; "" where
            ``noise`` is all of it.
        run: how many nights in a row must show a change.
        measured: the number itself, for a reader; None where it is not known.
    """

    value: float
    noise: float
    pool: str = ""
    run: int = 1
    measured: float | None = None


@dataclass(frozen=True)
class ChangePoint:
    """A change: the place of the night it was found in, the mean before and the value now, how many nights were before, and how."""

    place: int
    before: float
    now: float
    nights: int
    found_by: str


@dataclass(frozen=True)
class Chart:
    """The limits for so many cells."""

    cells: int
    false_alarms: float = FALSE_ALARMS

    def limit(self, run: int = 1) -> float:
        """A score beyond it is a jump; of a run of nights, so many scores in a row beyond it on one side."""
        return -_NORMAL.inv_cdf((self.false_alarms / (4 * max(1, self.cells))) ** (1 / run))

    @cached_property
    def interval(self) -> float:
        """A sum beyond it is a drift: the two sides of all cells have half of the false alarms."""
        run_length = 4 * max(1, self.cells) / self.false_alarms
        low, high = 0.0, 100.0
        while high - low > 1e-9:
            middle = (low + high) / 2
            low, high = (low, middle) if _run_length(middle) > run_length else (middle, high)
        return high

    def changes(self, series: Mapping[_Cell, Sequence[tuple[int, NightValue]]]) -> dict[_Cell, list[ChangePoint]]:
        """The changes of each cell, oldest first; after each its series begins anew.

        Args:
            series: of each cell, its nights by their places in ascending order.
        """
        courses = {cell: _Course() for cell in series}
        nights: dict[int, list[tuple[_Cell, NightValue]]] = {}
        for cell, values in series.items():
            for place, value in values:
                nights.setdefault(place, []).append((cell, value))
        largest: dict[str, list[float]] = {}
        for place in sorted(nights):
            scores: dict[str, float] = {}
            for cell, value in nights[place]:
                earlier = sorted(largest.get(value.pool, ()))[:-NIGHTS_PASSED_OVER]
                score = courses[cell].take(place, value, self, WELL_BEYOND * earlier[-1] if earlier else 0.0)
                if value.pool:
                    scores[value.pool] = max(score, scores.get(value.pool, 0.0))
            for pool, score in scores.items():
                largest.setdefault(pool, []).append(score)
        return {cell: course.found for cell, course in courses.items()}


def _run_length(interval: float) -> float:
    """Nights until a one-sided CUSUM of normal scores is beyond ``interval`` on average, by Siegmund's approximation."""
    reach = 2 * ALLOWANCE * (interval + _OVERSHOOT)
    return (math.exp(reach) - 1 - reach) / (2 * ALLOWANCE**2)


@dataclass
class _Course:
    """A cell from night to night: the nights since its last change, those of a run under way with their scores, and the changes."""

    segment: _Segment = field(default_factory=lambda: _Segment())
    run: list[tuple[int, NightValue, float]] = field(default_factory=list)
    found: list[ChangePoint] = field(default_factory=list)

    def take(self, place: int, value: NightValue, chart: Chart, least: float) -> float:
        """Score of the run that a night completes, 0 where it completes none; it is a change if the score is beyond ``least``."""
        found_by, score = self.segment.judge(value, chart)
        if self.run and (not found_by or (self.run[-1][2] > 0) != (score > 0)):
            self._settle()
        if not found_by:
            self.segment.add(value)
            return 0.0
        self.run.append((place, value, score))
        if len(self.run) < value.run:
            return 0.0
        # The mildest night of the run says what is there to stay.
        of_run = min(abs(one) for _, _, one in self.run)
        if of_run > least:
            mean = self.segment.mean
            now = min((one.value for _, one, _ in self.run), key=lambda value: abs(value - mean))
            self.found.append(ChangePoint(place, mean, now, self.segment.count, found_by))
            self.segment = _Segment()
        self._settle()
        return of_run

    def _settle(self) -> None:
        """Count the nights of the run to the segment."""
        for _, value, _ in self.run:
            self.segment.add(value)
        self.run = []


@dataclass
class _Segment:
    """The nights since the last change: their number, mean, sum of squares about it, and the two sums."""

    count: int = 0
    mean: float = 0.0
    squares: float = 0.0
    known: float = 0.0
    up: float = 0.0
    down: float = 0.0

    def add(self, reading: NightValue) -> None:
        """Welford's update."""
        self.count += 1
        step = reading.value - self.mean
        self.mean += step / self.count
        self.squares += step * (reading.value - self.mean)
        self.known += (reading.noise**2 - self.known) / self.count

    def judge(self, reading: NightValue, chart: Chart) -> tuple[str, float]:
        """Way in which a reading shows a change, "" where it shows none, and its score."""
        if self.count < (FEWEST_UNKNOWN if reading.pool else 1):
            return "", 0.0
        score = self._score(reading)
        if abs(score) > chart.limit(reading.run):
            return JUMP, score
        if reading.pool:
            return "", score
        self.up, self.down = max(0.0, self.up + score - ALLOWANCE), max(0.0, self.down - score - ALLOWANCE)
        return DRIFT if max(self.up, self.down) > chart.interval else "", score

    def _score(self, reading: NightValue) -> float:
        scatter = math.sqrt(self.squares / (self.count - 1)) if self.count > 1 else 0.0
        by_noise = math.sqrt(reading.noise**2 + self.known / self.count)
        of_scatter = scatter * math.sqrt(1 + 1 / self.count)
        ratio = (reading.value - self.mean) / max(by_noise, of_scatter)
        if reading.pool:
            ratio = max(-_FURTHEST, min(_FURTHEST, ratio / _widening(self.count - 1)))
            return _normal_of_gumbel(ratio) if ratio > 0 else ratio
        is_scattered = self.count >= FEWEST_SCATTERED and of_scatter > MUCH_LARGER * by_noise
        if is_scattered:
            ratio = _normal_of_student(ratio, self.count - 1)
        return max(-_FURTHEST, min(_FURTHEST, ratio))


@functools.cache
def _widening(degrees: int) -> float:
    """By how much a limit at ``WIDENED_AT`` grows where the noise is estimated with so many degrees of freedom."""
    from scipy.special import stdtrit

    return float(stdtrit(degrees, 1 - WIDENED_AT)) / _NORMAL.inv_cdf(1 - WIDENED_AT)


def _normal_of_student(ratio: float, degrees: int) -> float:
    """The normal score that is as unlikely as a ratio by Student's distribution."""
    # Imported late: it takes longer than all the rest.
    from scipy.special import stdtr

    tail = max(float(stdtr(degrees, -abs(ratio))), 1e-300)
    return math.copysign(-_NORMAL.inv_cdf(tail), ratio)


def _normal_of_gumbel(ratio: float) -> float:
    """The normal score that is as unlikely as a ratio upwards by Gumbel's distribution of largest values; never larger than it."""
    tail = -math.expm1(-math.exp(-(_GUMBEL * ratio + _EULER)))
    return min(ratio, -_NORMAL.inv_cdf(max(tail, 1e-300)))
