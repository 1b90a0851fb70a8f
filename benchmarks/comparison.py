"""Verdicts on a run beside an earlier one: name, before, after, ratio, verdict."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import StrEnum

from benchmarks.history import Measured, Run

# A change is one where the ratio is another by this factor and the rounds of both runs differ at this level (Mann and Whitney).
FACTOR, LEVEL = 1.1, 0.01
# With fewer rounds no test reaches the level, and the factor decides.
FEWEST_ROUNDS = 5
SCALES = (1.0, "s"), (1e3, "ms"), (1e6, "us"), (1e9, "ns")


class Verdict(StrEnum):
    """What became of a benchmark."""

    SAME = "same"
    FASTER = "faster"
    SLOWER = "SLOWER"
    LESS = "less"
    MORE = "MORE"
    NEW = "new"
    NOT_RUN = "not run"
    ABOVE_ITS_BAR = "ABOVE ITS BAR"
    FAILED = "FAILED"

    @property
    def is_bad(self) -> bool:
        """Whether somebody has to look at it."""
        return self.isupper()


@dataclass(frozen=True)
class Row:
    """One benchmark in two runs; ``ratio`` is that of both runs' ratios."""

    name: str
    before: Measured | None
    after: Measured | None
    ratio: float | None
    verdict: Verdict

    @property
    def reason(self) -> str:
        """Why somebody has to look at it; empty where nobody has."""
        if self.after is None or not self.verdict.is_bad:
            return ""
        if self.verdict == Verdict.FAILED:
            return self.after.failure
        beside = f" times {self.after.beside}" if self.after.beside else f" {self.after.unit}"
        if self.verdict == Verdict.ABOVE_ITS_BAR:
            return f"{self.after.ratio:.3g}{beside}, of which {self.after.most:.3g} are allowed"
        assert self.before is not None
        return f"{self.before.ratio:.3g}{beside} before, {self.after.ratio:.3g} now"


def row(name: str, before: Measured | None, after: Measured | None) -> Row:
    """The verdict on one benchmark."""
    if after is None:
        return Row(name, before, None, None, Verdict.NOT_RUN)
    if after.failure:
        return Row(name, before, after, None, Verdict.FAILED)
    known = before is not None and not before.failure and (before.beside, before.unit) == (after.beside, after.unit)
    ratio = after.ratio / before.ratio if known and before is not None else None
    if after.most is not None and after.ratio > after.most:
        return Row(name, before, after, ratio, Verdict.ABOVE_ITS_BAR)
    if ratio is None or before is None:
        return Row(name, before, after, None, Verdict.NEW)
    timed = after.unit == "s"
    if not 1 / FACTOR < ratio < FACTOR and _differ(before.ratios, after.ratios):
        better, worse = (Verdict.FASTER, Verdict.SLOWER) if timed else (Verdict.LESS, Verdict.MORE)
        return Row(name, before, after, ratio, worse if ratio > 1 else better)
    return Row(name, before, after, ratio, Verdict.SAME)


def _differ(before: Sequence[float], after: Sequence[float]) -> bool:
    if min(len(before), len(after)) < FEWEST_ROUNDS:
        return True
    # Its import takes 0.4 s of every process that lists benchmarks or collects the tests of them.
    from scipy.stats import mannwhitneyu

    return bool(mannwhitneyu(before, after).pvalue < LEVEL)


def rows(before: Iterable[Measured], after: Iterable[Measured]) -> list[Row]:
    """A row for each benchmark of ``after``, in its order, and then for those that only ``before`` has."""
    known, measured = {one.name: one for one in before}, {one.name: one for one in after}
    return [row(name, known.get(name), measured.get(name)) for name in {**measured, **known}]


def last_measured(runs: Iterable[Run]) -> list[Measured]:
    """The last measurement of each benchmark that succeeded, of runs with the oldest first."""
    return list({one.name: one for run in runs for one in run.measured if not one.failure}.values())


def first_line(found: Sequence[Row], before: str, after: str) -> str:
    """What somebody wants to know of a comparison, in one sentence."""
    if not found:
        return "No benchmark was measured."
    counts = Counter(row.verdict for row in found)
    bad = [f"{counts[verdict]} {verdict.value.lower()}" for verdict in Verdict if verdict.is_bad and counts[verdict]]
    better = [f"{counts[verdict]} {verdict.value}" for verdict in (Verdict.FASTER, Verdict.LESS) if counts[verdict]]
    compared = sum(row.ratio is not None for row in found)
    what = f"{len(found)} benchmark{'s' * (len(found) > 1)} at {after}" + (f", {compared} of them beside {before}" if compared else "")
    if bad or better:
        return f"{what}: {', '.join([*bad, *better])}."
    return f"{what}: " + ("none is slower" if compared else "nothing to compare with") + ", and each is below its bar."


def lines(found: Sequence[Row]) -> list[str]:
    """The table, and a line for each row that somebody has to look at."""
    cells = [["benchmark", "before", "after", "ratio", "verdict"]]
    for one in found:
        ratio = "" if one.ratio is None else f"{one.ratio:.2f}"
        cells.append([one.name, shown(one.before), shown(one.after), ratio, one.verdict.value])
    widths = [max(len(line[column]) for line in cells) for column in range(4)]
    table = [f"{a:<{widths[0]}}  {b:>{widths[1]}}  {c:>{widths[2]}}  {d:>{widths[3]}}  {e}".rstrip() for a, b, c, d, e in cells]
    return [*table, *(f"{one.name}: {one.reason}" for one in found if one.reason)]


def shown(measured: Measured | None) -> str:
    """The least value with its unit; empty where nothing was measured."""
    if measured is None or measured.failure:
        return ""
    value = min(measured.values)
    if measured.unit != "s":
        return f"{value:.3g} {measured.unit}".rstrip()
    factor, unit = next((scale for scale in SCALES if value * scale[0] >= 1), SCALES[-1])
    return f"{value * factor:.3g} {unit}"
