"""Numbers of a model that would explain a measured log, each alone and several at once, as plain data."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from harness.results.detail import Detail, telling
from harness.results.table import Column, Table, counted, first_of, joined, number_text, plural

# What explains less of the gap is not proposed; so many numbers are named that the log does not tell apart.
PROPOSED, _MOST_ALIKE = 0.05, 3


@dataclass(frozen=True, kw_only=True)
class MeasuredNumber:
    """A number of the file.

    Attributes:
        cause: a ``DriftCause``. owner: as "joint elbow". what: as files call it. place: as "line 12"; "" where the file does not say it.
        value: that of the file. fitted: that with which the motion is nearest to the log.
        explained: the part of the mean square of the gap that is gone with it, of a motion that was computed; of several numbers at
            once, with it and those before it.
        alike: numbers whose change moves the model alike, so that the log does not tell which of them it is.
        error: standard error of ``fitted`` by the noise of the log. groups: numbers whose changes together move the model alike.
        remedy: what is set in the file for it, as 'damping="0.3"', "" where no attribute alone says it. remedy_place: the line.
    """

    cause: str
    owner: str
    what: str
    place: str
    value: float
    fitted: float
    explained: float
    alike: tuple[str, ...] = ()
    error: float = 0.0
    groups: tuple[tuple[str, ...], ...] = ()
    remedy: str = ""
    remedy_place: str = ""

    @property
    def name(self) -> str:
        return " of ".join(filter(None, (self.what, self.owner)))

    @property
    def change(self) -> str:
        place = f" ({self.place})" if self.place else ""
        return f"{self.name} {_short(self.fitted)} in place of {_short(self.value)}{place}"

    def untold(self, name: str) -> Iterator[str]:
        """Sentences on what the log does not tell from this number, which is called ``name``."""
        if self.alike:
            yield f"The log does not tell {name} from {first_of(self.alike, _MOST_ALIKE)}."
        for group in self.groups[:1]:
            more = f" (and {counted(len(self.groups) - 1, 'other group')})" if len(self.groups) > 1 else ""
            yield f"Not identifiable together: {joined([self.name, *group])}{more}."


@dataclass(frozen=True, kw_only=True)
class MeasuredRecord:
    """A log held against a model that moves from its first row.

    Attributes:
        path, log: the files. mover: engine, integrator and step. joints: of the log. seconds: how long both are held against each other.
        gap: root mean square of the gap in the kinetic-energy norm of the model, over that of the way of the log.
        numbers: those that explain most, each alone. motions: how many were computed.
        together: those that explain most at once, each beyond what the noise of the log may make; the one that explains most comes first.
    """

    path: str
    log: str
    mover: str
    joints: list[str]
    seconds: float
    gap: float
    numbers: tuple[MeasuredNumber, ...]
    motions: int
    together: tuple[MeasuredNumber, ...] = ()

    @property
    def sentence(self) -> str:
        """The numbers that would explain most of the gap."""
        size = f"{self.log} is {number_text(float(f'{self.gap:.2g}'))} of its way from the motion of {self.path} over {self.seconds:g} s"
        if math.isinf(self.gap):
            size = f"{self.log} stands still over {self.seconds:g} s, and the motion of {self.path} does not"
        if max((one.explained for one in (*self.numbers, *self.together)), default=0.0) < PROPOSED:
            return f"{size}. No number of the file explains {PROPOSED:.0%} of that alone.".replace("%", " %")
        if not self.together:
            return f"{size}. No number of the file explains more of that than the noise of the log may make."
        changes = joined([one.change for one in self.together])
        *before, whole = (f"{100 * one.explained:.0f} %" for one in self.together)
        parts = [f"{'the first alone' if not count else f'the first {count + 1}'} {part}" for count, part in enumerate(before)]
        how = f" together; {joined(parts)}" if parts else ""
        verb = plural(len(self.together), "explains", "explain")
        told = f"{changes[0].upper()}{changes[1:]} {verb} {whole} of the gap{how}."
        untold = (sentence for one in self.together for sentence in one.untold(one.name if parts else "it"))
        return " ".join([f"{size}.", told, *untold])

    def table(self, detail: Detail = Detail.BRIEF) -> tuple[Table, str]:
        """A row for each number, and words that count others."""
        kept, others = telling(self.numbers, lambda one: one.explained, detail)
        rows = [
            [one.name, _short(one.value), _short(one.fitted), f"{100 * one.explained:.1f} %", first_of(one.alike, _MOST_ALIKE)]
            for one in kept
        ]
        columns = ("in the file", "nearest to the log", "explains")
        return Table(["number", *(Column(title, "plain") for title in columns), "moves alike"], rows), others

    @property
    def joint_table(self) -> Table:
        """A row for each of the numbers that explain the log at once, with all that it does not tell from it."""
        rows = [
            [
                one.name,
                _short(one.value),
                f"{_short(one.fitted)} +- {number_text(float(f'{one.error:.1g}'))}",
                f"{100 * one.explained:.1f} %",
                "; ".join([*one.alike, *(joined(group) for group in one.groups)]),
            ]
            for one in self.together
        ]
        columns = ("in the file", "nearest to the log", "explains, with those above")
        return Table(["numbers at once", *(Column(title, "plain") for title in columns), "not identifiable together with"], rows)


def _short(value: float) -> str:
    return number_text(float(f"{value:.4g}"))
