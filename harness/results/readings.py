"""What engines' readers make of a file, each reading with its lines and its effect, as plain data."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from harness.results.table import error_text

# The least relative change of accelerations that is one: less is rounding.
FELT = 1e-12
# Of a reading or of a part that is left out; the JSON has all lines.
MOST_LINES = 8


@dataclass(frozen=True, kw_only=True)
class Effect:
    """A reading that applies to a file.

    Attributes:
        lines: of the elements concerned. alone: largest change of qdd over the states when the engine reads nothing else otherwise,
            relative in the energy norm; infinite where that takes a joint away, None where the tree that it gives has no certified truth.
        beside: the same beside all other readings, where it moves nothing alone; None where it does, or where there is no other.
        remedy: what the engine's user can do about it, an imperative.
    """

    name: str
    sentence: str
    concerns: str
    lines: tuple[int, ...]
    alone: float | None
    source: str
    beside: float | None = None
    remedy: str = ""

    @property
    def statement(self) -> str:
        """Sentence, number and lines of the elements concerned, and effect."""
        number, nouns = len(self.lines), self.concerns
        one = f"{nouns[:-3]}y" if nouns.endswith("ies") else nouns.removesuffix("s")
        return f"{self.sentence}: {number} {one if number == 1 else nouns}, {lines_text(self.lines)}; {self.moves}"

    @property
    def moves(self) -> str:
        """The effect in words."""
        if self.alone is None:
            return "with it alone the accelerations are not certain"
        if self.alone == math.inf:
            return "alone it takes joints out of the robot"
        if self.alone > FELT:
            return f"alone it moves qdd by {effect_size(self.alone)}"
        if self.beside is None or self.beside <= FELT:
            return "alone it moves no acceleration"
        felt = "takes joints out of the robot" if self.beside == math.inf else f"moves qdd by {effect_size(self.beside)}"
        return f"alone it moves no acceleration, and beside the others it {felt}"


def effect_size(change: float) -> str:
    """A relative change of accelerations in words."""
    return f"{error_text(change)} times" if change >= 1 else f"{change:.2g} of its size"


def by_effect(readings: Iterable[Effect]) -> list[Effect]:
    """Readings, the one that moves the accelerations most first."""
    return sorted(readings, key=lambda one: -(one.alone or 0.0))


def reading_lines(readings: Iterable[Effect]) -> list[str]:
    """A line on each reading, and one on what its user can do, the one that moves the accelerations most first."""
    return [line for one in by_effect(readings) for line in (one.statement, f"  {one.remedy}") if line.strip()]


def lines_text(lines: Sequence[int]) -> str:
    """ "line 3", "lines 3, 5 and 10 more"."""
    shown = sorted(dict.fromkeys(lines))
    if not shown:
        return "no line of the file"
    if len(shown) <= MOST_LINES:
        return f"line{'s' if len(shown) > 1 else ''} {', '.join(map(str, shown))}"
    return f"lines {', '.join(map(str, shown[:MOST_LINES]))} and {len(shown) - MOST_LINES} more"
