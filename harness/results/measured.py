"""Numbers of a model that would explain a measured log, each alone, as plain data."""

from __future__ import annotations

import math
from dataclasses import dataclass

from harness.results.detail import Detail, telling
from harness.results.table import Column, Table, first_of, number_text

# What explains less of the gap is not proposed; so many numbers are named that the log does not tell apart.
PROPOSED, _MOST_ALIKE = 0.05, 3


@dataclass(frozen=True, kw_only=True)
class MeasuredNumber:
    """A number of the file.

    Attributes:
        cause: a ``DriftCause``. owner: as "joint elbow". what: as files call it. place: as "line 12"; "" where the file does not say it.
        value: that of the file. fitted: that with which the motion is nearest to the log.
        explained: the part of the mean square of the gap that is gone with it, of a motion that was computed.
        alike: numbers whose change moves the model alike, so that the log does not tell which of them it is.
    """

    cause: str
    owner: str
    what: str
    place: str
    value: float
    fitted: float
    explained: float
    alike: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        return " of ".join(filter(None, (self.what, self.owner)))


@dataclass(frozen=True, kw_only=True)
class MeasuredRecord:
    """A log held against a model that moves from its first row.

    Attributes:
        path, log: the files. mover: engine, integrator and step. joints: of the log. seconds: how long both are held against each other.
        gap: root mean square of the gap in the kinetic-energy norm of the model, over that of the way of the log.
        numbers: those that explain most, each alone. motions: how many were computed.
    """

    path: str
    log: str
    mover: str
    joints: list[str]
    seconds: float
    gap: float
    numbers: tuple[MeasuredNumber, ...]
    motions: int

    @property
    def sentence(self) -> str:
        """The number that would explain most of the gap."""
        size = f"{self.log} is {number_text(float(f'{self.gap:.2g}'))} of its way from the motion of {self.path} over {self.seconds:g} s"
        if math.isinf(self.gap):
            size = f"{self.log} stands still over {self.seconds:g} s, and the motion of {self.path} does not"
        best = self.numbers[0] if self.numbers else None
        if best is None or best.explained < PROPOSED:
            return f"{size}. No number of the file explains {PROPOSED:.0%} of that alone.".replace("%", " %")
        place = f" ({best.place})" if best.place else ""
        change = f"{best.name} {_short(best.fitted)} in place of {_short(best.value)}{place}"
        alike = f" The log does not tell it from {first_of(best.alike, _MOST_ALIKE)}." if best.alike else ""
        return f"{size}. {change[0].upper()}{change[1:]} explains {100 * best.explained:.0f} % of the gap.{alike}"

    def table(self, detail: Detail = Detail.BRIEF) -> tuple[Table, str]:
        """A row for each number, and words that count others."""
        kept, others = telling(self.numbers, lambda one: one.explained, detail)
        rows = [
            [one.name, _short(one.value), _short(one.fitted), f"{100 * one.explained:.1f} %", first_of(one.alike, _MOST_ALIKE)]
            for one in kept
        ]
        columns = ("in the file", "nearest to the log", "explains")
        return Table(["number", *(Column(title, "plain") for title in columns), "moves alike"], rows), others


def _short(value: float) -> str:
    return number_text(float(f"{value:.4g}"))
