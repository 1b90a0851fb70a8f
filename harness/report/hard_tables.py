"""The tables of an atlas; each medium shows all of their columns or some."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

from harness.report.hard_cases import Family, HardSummary, PartingSummary, StepSummary, growth_text
from harness.results.atlas import HardRow, Parting
from harness.results.table import Cell, Column, Table, error_text, seconds_text


def rows_of(hard: HardSummary) -> Table:
    """One row per family and subject."""
    return Table.of(
        [row for family in hard.families for row in family.rows.values()],
        {
            "family": "case",
            "subject": "subject",
            "verdict": lambda row: Cell(row.verdict, tone=f"{row.verdict} {'expected' if row.as_expected else 'surprise'}"),
            Column("largest backward error", "error"): "worst",
            Column("digits lost", "error"): lambda row: _largest(row, "digits_lost"),
            Column("kappa_s", "error"): lambda row: _largest(row, "condition"),
            Column("slope", "rounded"): "growth",
            Column("slope of digits", "rounded"): "digits_growth",
            "theory": _theory,
            "points": _counts,
            Column("time", "seconds"): "seconds",
        },
    )


def verdicts(hard: HardSummary) -> Table:
    """Family by subject: how many points have which verdict."""
    rows = [[family.name, *(_counts(family.rows.get(subject)) for subject in hard.subjects)] for family in hard.families]
    return Table(["family", *hard.subjects], rows)


def matrix(hard: HardSummary, anchors: Mapping[str, str]) -> Table:
    """Family by subject: gravest verdict, largest backward error and slope; ``anchors`` of the families on the page."""
    caption = (
        "Gravest verdict along each family, the largest backward error, and, where the error grows, its slope: "
        "p of error = constant · knob^p, beside the one theory gives"
    )
    rows = [_matrix_row(family, hard, anchors[family.name]) for family in hard.families]
    return Table(["family", *hard.subjects, "what you can do"], rows, caption, "matrix")


def partings(hard: HardSummary) -> Table:
    """One row per family of motions and integrator."""
    return Table.of(
        hard.partings(),
        {
            "motion": "motion",
            "integrator": "integrator",
            "parted": lambda entry: f"{entry.parted} of {entry.starts}",
            "rate over the expected one": "rates",
            "soonest": "soonest",
            Column("largest distance", "error"): "largest",
            "verdict": _verdict,
        },
    )


def starts(integrators: list[str], rows: list[tuple[float, list[Parting | None]]]) -> Table:
    """One row per start of a motion, with rate and time of each integrator."""
    columns = [Column("knob", "given"), Column("expected rate", "error"), Column("may part from", "plain")]
    columns += [Column(f"{name}: {what}", kind) for name in integrators for what, kind in (("rate", "error"), ("parts after", "plain"))]
    cells: list[list[object]] = []
    for knob, found in rows:
        known = next(parting for parting in found if parting is not None)
        cells.append([knob, known.expected_rate, _time(known.earliest)])
        for one in found:
            tone = "disagrees" if one and one.verdict != "agrees" else ""
            cells[-1] += ["", ""] if one is None else [one.rate, Cell(_time(one.parted), tone=tone)]
    return Table(columns, cells)


def stable_steps(hard: HardSummary) -> Table:
    """One row per integrator: the largest stable step times the frequency of an undamped spring."""
    return Table.of(
        hard.stable_steps(),
        {
            "integrator": "integrator",
            Column("theory", "plain"): lambda entry: "no limit" if entry.expected > 1e300 else f"{entry.expected:.4g}",
            Column("measured", "plain"): "measured",
            Column("frequencies", "plain"): lambda entry: f"{entry.softest:.3g} to {entry.stiffest:.3g} rad/s",
            "verdict": _verdict,
        },
    )


def _verdict(entry: PartingSummary | StepSummary) -> Cell:
    return Cell(entry.verdict, tone=entry.verdict)


def _largest(row: HardRow, number: str) -> float | None:
    return max((value for point in row.points if (value := getattr(point, number)) is not None), default=None)


def _theory(row: HardRow) -> str:
    slopes = [(row.theory_growth, "slope"), (row.theory_digits_growth, "of digits")]
    return ", ".join([row.theory_verdict, *(f"{what} {slope:g}" for slope, what in slopes if slope is not None)])


def _counts(row: HardRow | None) -> str:
    if row is None:
        return "not run"
    counts = ", ".join(f"{verdict} {count}" for verdict, count in sorted(row.verdicts.items()))
    return counts if row.as_expected else f"{counts} (not as expected)"


def _matrix_row(family: Family, hard: HardSummary, anchor: str) -> list[Cell]:
    linked = partial(Cell, fills=True, link=f"#{anchor}")
    cells = [Cell(family.name, link=f"#{anchor}")]
    for subject in hard.subjects:
        row = family.rows.get(subject)
        if row is None:
            cells.append(Cell("not run", tone="empty", fills=True))
            continue
        digits = growth_text(row.digits_growth, row.theory_digits_growth) if row.theory_digits_growth is not None else ""
        notes = [error_text(row.worst), "as expected" if row.as_expected and row.verdict != "agrees" else ""]
        notes += [growth_text(row.growth, row.theory_growth), digits and f"relative error: {digits}"]
        mark, tone = ("", row.verdict) if row.as_expected else ("✗ ", f"{row.verdict} surprise")
        cells.append(linked(f"{mark}{row.verdict}", list(filter(None, notes)), tone))
    return [*cells, Cell("; ".join(family.remedies) or "nothing is needed", tone="remedy", fills=True)]


def _time(value: float | None) -> str:
    return "never" if value is None else seconds_text(value)
