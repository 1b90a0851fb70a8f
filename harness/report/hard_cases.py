"""An atlas arranged for a reader, before it is HTML or Markdown: families, growth, motions that part, stable steps."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import groupby
from operator import attrgetter
from statistics import median

from harness.report.summary import ChangedValue, changed_versions
from harness.results.atlas import Atlas, HardPoint, HardReason, HardRow, Parting
from harness.results.records import Run
from harness.results.table import counted
from harness.verdict import SEVERITY, Verdict, gravest

# Points at which the engine was not asked, or gave nothing that could be judged.
SILENT = (Verdict.UNDECIDED, Verdict.UNSUPPORTED, Verdict.ERROR)


@dataclass(frozen=True)
class Silence:
    """Points of one subject with one verdict other than a comparison, and why."""

    subject: str
    verdict: str
    count: int
    lowest: float
    highest: float
    reason: str


@dataclass(frozen=True)
class Family:
    """One hard case with what was measured along it.

    Attributes:
        name, title, knob, unit, source, remedy: of the case; systems: names, in the order of the knob.
        rows: subject to its row.
    """

    name: str
    title: str
    knob: str
    unit: str
    source: str
    remedy: str
    systems: list[str]
    rows: Mapping[str, HardRow]

    @property
    def label(self) -> str:
        """The knob with its unit."""
        return self.knob if self.unit == "1" else f"{self.knob} [{self.unit}]"

    @property
    def verdict(self) -> str:
        """The gravest of the subjects."""
        return gravest(row.verdict for row in self.rows.values())

    @property
    def reasons(self) -> list[tuple[list[str], HardReason]]:
        """Subjects and why a verdict is expected of them, each reason once."""
        found: dict[HardReason, list[str]] = {}
        for subject, row in self.rows.items():
            for reason in row.reasons:
                found.setdefault(reason, []).append(subject)
        return [(subjects, reason) for reason, subjects in found.items()]

    @property
    def remedies(self) -> list[str]:
        """Remedies for a user, each once; none where every subject agrees."""
        if self.verdict == Verdict.AGREES:
            return []
        return list(dict.fromkeys(reason.remedy for _, reason in self.reasons)) or [self.remedy]

    @property
    def silences(self) -> list[Silence]:
        """Points that are undecided, refused or failed, by subject, verdict and reason."""
        found: dict[tuple[str, str, str], list[HardPoint]] = {}
        for subject, row in self.rows.items():
            for point in row.points:
                if point.verdict in SILENT:
                    found.setdefault((subject, point.verdict, point.reason), []).append(point)
        return [
            Silence(subject, verdict, len(points), min(p.knob for p in points), max(p.knob for p in points), reason)
            for (subject, verdict, reason), points in found.items()
        ]


@dataclass(frozen=True)
class PartingSummary:
    """One integrator over the starts of one family of motions; times in seconds, rates over those of theory or of a nudged start."""

    motion: str
    integrator: str
    starts: int
    parted: int
    rates: str
    soonest: str
    largest: float
    verdict: str


@dataclass(frozen=True)
class StepSummary:
    """One integrator over the stiffnesses of a spring: largest stable step times the frequency [rad/s]."""

    integrator: str
    expected: float
    measured: str
    softest: float
    stiffest: float
    verdict: str


class HardSummary:
    """An atlas arranged for a reader.

    Attributes:
        run: versions, machine and settings of the atlas; atlas: what it measured.
        subjects: sorted names.
        families: by name.
        unexpected: sentences on what is not as expected; problems: on what could not be measured.
    """

    def __init__(self, run: Run, atlas: Atlas) -> None:
        self.run, self.atlas = run, atlas
        self.subjects = sorted({row.subject for row in atlas.rows})
        rows = sorted(atlas.rows, key=attrgetter("case", "subject"))
        self.families = [_family(list(own)) for _, own in groupby(rows, key=attrgetter("case"))]
        self.unexpected, self.problems = atlas.unexpected, atlas.problems

    @property
    def is_good(self) -> bool:
        """True where something was measured and everything is as expected."""
        measured = self.atlas.rows or self.atlas.partings or self.atlas.stable_steps
        return bool(measured) and not self.unexpected and not self.problems

    @property
    def sentence(self) -> str:
        """The result in one sentence."""
        rows = self.atlas.rows
        points = sum(len(row.points) for row in rows)
        wrong = sum(not row.as_expected for row in rows)
        families = f"{len(self.families)} {'family' if len(self.families) == 1 else 'families'}"
        told = f"{families}, {counted(len(self.subjects), 'subject')}, {counted(points, 'point')}"
        if wrong:
            return f"{told}: {len(rows) - wrong} of {len(rows)} pairs of family and subject are as expected, {wrong} not."
        return f"{told}: every verdict is as expected." if rows else "No family was measured."

    def sizes(self, subject: str) -> dict[str, int]:
        """Verdict to number of families whose gravest verdict of ``subject`` it is, from agreement to error."""
        verdicts = [family.rows[subject].verdict for family in self.families if subject in family.rows]
        return {verdict: verdicts.count(verdict) for verdict in SEVERITY if verdict in verdicts}

    def changed_versions(self, run: Run) -> list[ChangedValue]:
        """Versions that the atlas had and ``run`` has not."""
        return changed_versions(self.run.versions, run.versions)

    @cached_property
    def motions(self) -> list[tuple[str, str, list[str], list[tuple[float, list[Parting | None]]]]]:
        """(motion, system, integrators, rows) of each family of motions; a row is a knob and one parting per integrator."""
        found = []
        ordered = sorted(self.atlas.partings, key=attrgetter("motion"))
        for motion, own in groupby(ordered, key=attrgetter("motion")):
            partings = list(own)
            integrators = list(dict.fromkeys(parting.integrator for parting in partings))
            cells = {(parting.knob, parting.integrator): parting for parting in partings}
            knobs = sorted({parting.knob for parting in partings})
            rows = [(knob, [cells.get((knob, name)) for name in integrators]) for knob in knobs]
            found.append((motion, partings[0].system, integrators, rows))
        return found

    def partings(self) -> list[PartingSummary]:
        """One line per family of motions and integrator."""
        groups: dict[tuple[str, str], list[Parting]] = {}
        for parting in self.atlas.partings:
            groups.setdefault((parting.motion, parting.integrator), []).append(parting)
        return [_parting_summary(*key, partings) for key, partings in sorted(groups.items())]

    def stable_steps(self) -> list[StepSummary]:
        """One line per integrator."""
        found = []
        for name, own in groupby(sorted(self.atlas.stable_steps, key=attrgetter("integrator")), key=attrgetter("integrator")):
            steps = list(own)
            low, high = min(step.measured for step in steps), max(step.measured for step in steps)
            measured = "no limit found" if math.isinf(low) else f"{low:.4g}" if low == high else f"{low:.4g} to {high:.4g}"
            frequencies = [step.frequency for step in steps]
            verdict = gravest(step.verdict for step in steps)
            found.append(StepSummary(name, steps[0].expected, measured, min(frequencies), max(frequencies), verdict))
        return found


def growth_text(growth: float | None, theory: float | None) -> str:
    """ "slope -0.94, theory -1"; "" where neither is known."""
    if growth is None and theory is None:
        return ""
    measured = "no slope" if growth is None else f"slope {growth:.2f}"
    return measured if theory is None else f"{measured}, theory {theory:g}"


def _family(rows: Sequence[HardRow]) -> Family:
    first = rows[0]
    systems = list(dict.fromkeys(point.system for row in rows for point in row.points))
    return Family(first.case, first.title, first.knob, first.unit, first.source, first.remedy, systems, {row.subject: row for row in rows})


def _parting_summary(motion: str, integrator: str, partings: Sequence[Parting]) -> PartingSummary:
    times = [parting.parted for parting in partings if parting.parted is not None]
    ratios = [p.rate / p.expected_rate for p in partings if p.rate is not None and p.expected_rate]
    rates = f"median {median(ratios):.2f}, {min(ratios):.2f} to {max(ratios):.2f}" if ratios else "-"
    soonest = f"{min(times):.4g} s" if times else "-"
    largest = max(parting.largest for parting in partings)
    verdict = gravest(parting.verdict for parting in partings)
    return PartingSummary(motion, integrator, len(partings), len(times), rates, soonest, largest, verdict)
