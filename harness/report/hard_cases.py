"""An atlas arranged for a reader, before it is HTML or Markdown: families, growth, motions that part, stable steps; and its tables."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from operator import attrgetter
from statistics import median

from harness.results.atlas import Atlas, HardReason, HardRow, Parting, StableStep
from harness.results.check_conclusion import MOST_ROWS
from harness.results.detail import Detail
from harness.results.rigid import RigidDistance, RigidLaw, first_broken, rigid_laws
from harness.results.run import Run
from harness.results.table import Cell, Column, Table, TableOf, counted, error_text, grouped, seconds_text
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
        found = grouped((reason, subject) for subject, row in self.rows.items() for reason in row.reasons)
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
        silent = [(subject, point) for subject, row in self.rows.items() for point in row.points if point.verdict in SILENT]
        sentences = []
        for (subject, verdict, reason), knobs in grouped(((who, one.verdict, one.reason), one.knob) for who, one in silent).items():
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
        families = grouped((row.family, row) for row in sorted(atlas.rows, key=attrgetter("family", "subject")))
        self.families = [Family(name, {row.subject: row for row in own}) for name, own in families.items()]
        # An engine that cannot be loaded is one problem, however many parts of the atlas it was asked for in.
        self.unexpected, self.problems = atlas.unexpected, list(dict.fromkeys(atlas.problems))

    @property
    def is_good(self) -> bool:
        """True where something was measured and everything is as expected."""
        measured = self.atlas.rows or self.atlas.partings or self.atlas.stable_steps or self.atlas.distances
        return bool(measured) and not self.unexpected and not self.problems

    @property
    def sentence(self) -> str:
        """The result in one sentence."""
        rows = self.atlas.rows
        points = sum(len(row.points) for row in rows)
        wrong = sum(not row.as_expected for row in rows)
        families = f"{len(self.families)} {'family' if len(self.families) == 1 else 'families'}"
        counts = f"{families}, {counted(len(self.subjects), 'subject')}, {counted(points, 'point')}"
        broken = first_broken(rigid_laws(self.atlas.distances))
        if wrong:
            sentence = f"{counts}: {len(rows) - wrong} of {len(rows)} pairs of family and subject are as expected, {wrong} not."
            return f"{sentence} {broken}".rstrip()
        if rows:
            return f"{counts}: every verdict is as expected. {broken}".rstrip()
        return "Nothing was measured: no subject that was asked offers this in these cases; name other subjects, quantities or cases."

    def shown(self, detail: Detail) -> HardSummary:
        """All families where they are few or all is asked for; else the pairs that are not plain agreement."""
        if len(self.atlas.rows) <= MOST_ROWS or detail >= Detail.ALL:
            return self
        rows = [row for row in self.atlas.rows if not (row.as_expected and row.verdict == Verdict.AGREES)]
        return HardSummary(self.run, replace(self.atlas, rows=rows))

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


_rows = TableOf(
    HardRow,
    "family subject marked_verdict worst digits_lost condition growth digits_growth theory counts balls seconds",
    "Each subject along each family",
)


def rows_of(hard: HardSummary) -> Table:
    """One row per family and subject."""
    return _rows(row for family in hard.families for row in family.rows.values())


def matrix(hard: HardSummary, anchors: Mapping[str, str]) -> Table:
    """Family by subject: gravest verdict, largest backward error and slope; ``anchors`` of the families on the page."""
    caption = (
        "Gravest verdict along each family, the largest backward error, and, where the error grows, its slope: "
        "p of error = constant · knob^p, beside the one theory gives"
    )
    rows = [
        [
            Cell(family.name, link=f"#{anchors[family.name]}"),
            *(_matrix_cell(family.rows.get(subject), f"#{anchors[family.name]}") for subject in hard.subjects),
            Cell("; ".join(family.remedies) or "nothing is needed", tone="remedy", fills=True),
        ]
        for family in hard.families
    ]
    return Table(["family", *hard.subjects, "what you can do"], rows, caption, "matrix")


def _matrix_cell(row: HardRow | None, link: str) -> Cell:
    if row is None:
        return Cell("not run", tone="empty", fills=True)
    digits = growth_text(row.digits_growth, row.theory_digits_growth) if row.theory_digits_growth is not None else ""
    notes = [error_text(row.worst), "as expected" if row.as_expected and row.verdict != "agrees" else ""]
    notes += [growth_text(row.growth, row.theory_growth), digits and f"relative error: {digits}"]
    mark, tone = ("", row.verdict) if row.as_expected else ("✗ ", f"{row.verdict} surprise")
    return Cell(f"{mark}{row.verdict}", list(filter(None, notes)), tone, fills=True, link=link)


def partings(hard: HardSummary) -> Table:
    """One row per family of motions and integrator."""
    ordered = sorted(hard.atlas.partings, key=attrgetter("motion", "integrator"))
    return Table.of(
        grouped(((one.motion, one.integrator), one) for one in ordered).values(),
        {
            "motion": lambda found: found[0].motion,
            "integrator": lambda found: found[0].integrator,
            "parted": lambda found: f"{len(_times(found))} of {len(found)}",
            "rate over the expected one": _rates,
            "soonest": lambda found: next((f"{time:.4g} s" for time in _times(found)), "-"),
            Column("largest distance", "error"): lambda found: max(one.largest for one in found),
            "verdict": _gravest,
        },
        "When integrators of one scheme part",
    )


_distances = TableOf(RigidDistance, "case at number answers engine setting found distance", "How far contacts are from rigid ones")


def distances(hard: HardSummary, detail: Detail = Detail.ALL) -> Table:
    """One row per case, value, engine and setting; with less detail the largest distance along each case."""
    found = sorted(hard.atlas.distances, key=attrgetter("case"))
    if detail < Detail.ALL:
        by_place = grouped(((one.case, one.engine, one.setting), one) for one in found)
        found = [max(own, key=lambda one: -1.0 if one.distance is None else one.distance) for own in by_place.values()]
    return _distances(found)


_laws = TableOf(RigidLaw, "case engine setting knob growth largest breaking", "How distances from rigid contact grow")


def laws(hard: HardSummary) -> Table:
    """One row per case whose values go from gentle to hard, engine and setting."""
    return _laws(sorted(rigid_laws(hard.atlas.distances), key=attrgetter("case")))


def _times(partings: Sequence[Parting]) -> list[float]:
    """The times at which they part, the soonest first."""
    return sorted(one.parted for one in partings if one.parted is not None)


def _rates(partings: Sequence[Parting]) -> str:
    ratios = [one.rate / one.expected_rate for one in partings if one.rate is not None and one.expected_rate]
    return f"median {median(ratios):.2f}, {min(ratios):.2f} to {max(ratios):.2f}" if ratios else "-"


def starts(partings: Sequence[Parting]) -> Table:
    """One row per start of one family of motions, with rate and time of each integrator."""
    integrators = list(dict.fromkeys(parting.integrator for parting in partings))
    by_place = {(parting.knob, parting.integrator): parting for parting in partings}
    columns = [Column("knob", "given"), Column("expected rate", "error"), Column("may part from", "plain")]
    columns += [Column(f"{name}: {what}", kind) for name in integrators for what, kind in (("rate", "error"), ("parts after", "plain"))]
    cells: list[list[object]] = []
    for knob, (first, *_) in grouped((one.knob, one) for one in sorted(partings, key=attrgetter("knob"))).items():
        cells.append([knob, first.expected_rate, _time(first.earliest)])
        for one in (by_place.get((knob, name)) for name in integrators):
            tone = "disagrees" if one and one.verdict != "agrees" else ""
            cells[-1] += ["", ""] if one is None else [one.rate, Cell(_time(one.parted), tone=tone)]
    return Table(columns, cells, "Each start: rates [1/s], and when it parts")


def stable_steps(hard: HardSummary) -> Table:
    """One row per integrator: the largest stable step times the frequency of an undamped spring."""
    ordered = sorted(hard.atlas.stable_steps, key=attrgetter("integrator"))
    return Table.of(
        grouped((one.integrator, one) for one in ordered).values(),
        {
            "integrator": lambda steps: steps[0].integrator,
            Column("theory", "plain"): lambda steps: "no limit" if steps[0].expected > 1e300 else f"{steps[0].expected:.4g}",
            Column("measured", "plain"): _limits,
            Column("frequencies", "plain"): lambda steps: (
                f"{min(step.frequency for step in steps):.3g} to {max(step.frequency for step in steps):.3g} rad/s"
            ),
            "verdict": _gravest,
        },
        "Largest stable step times the frequency",
    )


def _limits(steps: Sequence[StableStep]) -> str:
    low, high = min(step.measured for step in steps), max(step.measured for step in steps)
    return "no limit found" if math.isinf(low) else f"{low:.4g}" if low == high else f"{low:.4g} to {high:.4g}"


def _gravest(measured: Iterable[Parting | StableStep]) -> Cell:
    verdict = gravest(one.verdict for one in measured)
    return Cell(verdict, tone=verdict)


def _time(value: float | None) -> str:
    return "never" if value is None else seconds_text(value)
