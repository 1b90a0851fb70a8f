"""An atlas arranged for a reader, before it is HTML or Markdown: families, growth, motions that part, stable steps."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import groupby
from operator import attrgetter

from harness.results.atlas import Atlas, HardReason, HardRow
from harness.results.records import Run
from harness.results.table import counted
from harness.verdict import SEVERITY, Verdict, gravest

# Points at which the engine was not asked, or gave nothing that could be judged.
SILENT = (Verdict.UNDECIDED, Verdict.UNSUPPORTED, Verdict.ERROR)


@dataclass(frozen=True)
class Family:
    """One hard case with what was measured along it.

    Attributes:
        name: of the case, and of the quantity where it is not accelerations. rows: subject to its row, at least one.
    """

    name: str
    rows: Mapping[str, HardRow]

    @property
    def case(self) -> HardRow:
        """A row, of which title, knob, unit, source and remedy are those of the case."""
        return next(iter(self.rows.values()))

    @property
    def systems(self) -> list[str]:
        """Their names, in the order of the knob."""
        return list(dict.fromkeys(point.system for row in self.rows.values() for point in row.points))

    @property
    def label(self) -> str:
        """The knob with its unit."""
        return self.case.knob if self.case.unit == "1" else f"{self.case.knob} [{self.case.unit}]"

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
        return list(dict.fromkeys(reason.remedy for _, reason in self.reasons)) or [self.case.remedy]

    @property
    def silences(self) -> list[str]:
        """A sentence on the points that are undecided, refused or failed, for each subject, verdict and reason."""
        found: dict[tuple[str, str, str], list[float]] = {}
        for subject, row in self.rows.items():
            for point in row.points:
                if point.verdict in SILENT:
                    found.setdefault((subject, point.verdict, point.reason), []).append(point.knob)
        sentences = []
        for (subject, verdict, reason), knobs in found.items():
            low, high = min(knobs), max(knobs)
            where = f", {low:.3g}" if low == high else f" between {low:.3g} and {high:.3g}"
            sentences.append(f"{subject} {verdict} at {counted(len(knobs), 'point')}{where}: {reason or 'no reason is given'}.")
        return sentences


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
        rows = sorted(atlas.rows, key=attrgetter("family", "subject"))
        self.families = [Family(name, {row.subject: row for row in own}) for name, own in groupby(rows, key=attrgetter("family"))]
        # An engine that cannot be loaded is one problem, however many parts of the atlas it was asked for in.
        self.unexpected, self.problems = atlas.unexpected, list(dict.fromkeys(atlas.problems))

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
        counts = f"{families}, {counted(len(self.subjects), 'subject')}, {counted(points, 'point')}"
        if wrong:
            return f"{counts}: {len(rows) - wrong} of {len(rows)} pairs of family and subject are as expected, {wrong} not."
        return f"{counts}: every verdict is as expected." if rows else "No family was measured."

    def sizes(self, subject: str) -> dict[str, int]:
        """Verdict to number of families whose gravest verdict of ``subject`` it is, from agreement to error."""
        verdicts = [family.rows[subject].verdict for family in self.families if subject in family.rows]
        return {verdict: verdicts.count(verdict) for verdict in SEVERITY if verdict in verdicts}


def growth_text(growth: float | None, theory: float | None) -> str:
    """ "slope -0.94, theory -1"; "" where neither is known."""
    if growth is None and theory is None:
        return ""
    measured = "no slope" if growth is None else f"slope {growth:.2f}"
    return measured if theory is None else f"{measured}, theory {theory:g}"
