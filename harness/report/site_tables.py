"""The site from its data: addresses, counts of each engine and feature with their badges, and the tables of the index and the engines."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from statistics import median
from typing import TYPE_CHECKING

from harness.results.site import (
    FeatureLine,
    Number,
    ShownCell,
    ShownColumn,
    ShownTable,
    Site,
    SiteCell,
    SiteColumn,
    SiteCount,
    plain_number,
)
from harness.results.table import Cell, Column, Table, error_text, grouped
from harness.results.trend_numbers import change_of
from harness.verdict import SEVERITY, Verdict, gravest

if TYPE_CHECKING:
    from harness.results.records import Record

INDEX, BENCHMARK, HARD, ROBOTS = "index.html", "benchmark.html", "hard.html", "robots.html"


def slugs(names: Iterable[str]) -> dict[str, str]:
    """A word for each name that a file, an address and an ``id`` may hold, no two alike, whatever a file system makes of case."""
    found: dict[str, str] = {}
    taken: set[str] = set()
    for name in names:
        plain = re.sub(r"[^A-Za-z0-9_.@]+", "-", name).strip(".") or "-"
        number, word = 2, plain
        while word.casefold() in taken:
            number, word = number + 1, f"{plain}-{number}"
        taken.add(word.casefold())
        found[name] = word
    return found


def pages_in(folder: str, names: Iterable[str]) -> dict[str, str]:
    """The page of each name in a folder."""
    return {name: f"{folder}/{word}.html" for name, word in slugs(names).items()}


# Features by which constraints give, and a distance from rigid ones that is no rounding.
_TIES, _SOFT = ("loops", "coupled joints", "coupled tendons", "mimic joints", "rolling"), 1e-12


def engine_counts(columns: Sequence[SiteColumn], cells: Sequence[SiteCell]) -> Iterator[SiteCount]:
    """Counts of each engine and version, over its formats."""
    versions = {(column.engine, column.version): "-".join(filter(None, (column.engine, column.version))) for column in columns}
    badges = slugs(versions[one] for one in sorted(versions))
    for (engine, version), name in sorted(versions.items()):
        own = {column.name for column in columns if (column.engine, column.version) == (engine, version)}
        verdicts = [cell for cell in cells if cell.column in own]
        unsupported = sum(cell.verdict == Verdict.UNSUPPORTED for cell in verdicts)
        yield SiteCount(
            engine=engine,
            version=version,
            agrees=sum(cell.agrees for cell in verdicts),
            asked=len(verdicts) - unsupported,
            unsupported=unsupported,
            badge=f"badges/{badges[name]}.svg",
        )


def feature_lines(columns: Sequence[SiteColumn], cells: Sequence[SiteCell]) -> Iterator[FeatureLine]:
    """By feature, then by column."""
    for feature in sorted({name for cell in cells for name in asked_of(cell)}):
        for column in columns:
            own = [cell for cell in cells if cell.column == column.name and feature in asked_of(cell)]
            if own:
                yield _feature_line(feature, column.name, own)


def asked_of(cell: SiteCell) -> list[str]:
    """The features of a cell; of another quantity than accelerations that quantity alone."""
    return cell.features if cell.quantity == "accelerations" else [cell.quantity]


def _feature_line(feature: str, column: str, cells: Sequence[SiteCell]) -> FeatureLine:
    agrees = sum(cell.agrees for cell in cells)
    unsupported = sum(cell.verdict == Verdict.UNSUPPORTED for cell in cells)
    distances = [float(cell.from_rigid) for cell in cells if cell.from_rigid is not None and feature in _TIES]
    worst, soft = largest(cell.backward_error for cell in cells), median(distances) if distances else None
    others = {verdict: sum(cell.verdict == verdict for cell in cells) for verdict in SEVERITY if verdict != Verdict.AGREES}
    parts = [f"soft, {soft:.1e} from rigid at the file's settings"] if soft is not None and soft > _SOFT else []
    if agrees:
        what = "agrees with what its engine documents" if parts else "agrees"
        parts.append(f"{what} on {agrees} of {len(cells)}, worst {error_text(worst)}")
    parts += [f"{verdict} on {count} of {len(cells)}" for verdict, count in others.items() if count]
    reasons = list(dict.fromkeys(cell.reason for cell in cells if not cell.agrees and cell.reason))
    line = "; ".join(parts) + (f": {reasons[0]}" if len(reasons) == 1 else "")
    return FeatureLine(
        feature=feature, column=column, asked=len(cells), agrees=agrees, unsupported=unsupported, worst=plain_number(worst),
        from_rigid=plain_number(soft), line=line,
    )  # fmt: skip


def largest(errors: Iterable[Number]) -> float | None:
    """The largest that there is, NaN counting as infinite; None of none."""
    known = [float(error) for error in errors if error is not None]
    return max((math.inf if math.isnan(error) else error for error in known), default=None)


# Of a mechanism every subject is asked; of a variant and of a robot's file, those that read it.
_NOT_RUN, _NOT_ASKED = "not run", "not asked"
# Rows of a table: a new version of an engine may change every cell. The data have all of them.
MOST_SHOWN = 200


def value_of(number: Number) -> float | None:
    """The number that the data hold as text where it is not finite."""
    return None if number is None else float(number)


def error_of(number: Number) -> str:
    """Three digits; "nan" and "inf" as they are."""
    return number if isinstance(number, str) else error_text(number)


def head_of(column: SiteColumn) -> str:
    """ "mujoco/mjcf (4.0.0)"; the subject alone where its name says the version, or nobody does."""
    return column.name if "@" in column.name or not column.version else f"{column.name} ({column.version})"


def matrix(site: Site) -> Table:
    """A row for each mechanism and robot, a column for each subject; a cell leads to the place where it is told."""
    held = grouped(((cell.row, cell.column), cell) for cell in site.cells)
    rows, columns = slugs(row.name for row in site.rows), slugs(column.name for column in site.columns)
    places = {(row, column): f"cell-{rows[row]}--{columns[column]}" for row in rows for column in columns}
    drawn: list[list[object]] = []
    for row in site.rows:
        about = {"data-kind": row.kind, "data-features": ", ".join(row.features)}
        line: list[object] = [Cell(row.name, tone="", fills=True, link=row.page, attributes={"data-row": row.name, **about})]
        for column in site.columns:
            pair = row.name, column.name
            absent = _NOT_RUN if row.kind == "mechanism" else _NOT_ASKED
            line.append(_matrix_cell(held.get(pair, []), absent, {"id": places[pair], "data-column": column.name}))
        drawn.append(line)
    caption = "Verdict and worst backward error [data roundoffs]; of a robot, whether the engine's reading of its file explains its answer"
    return Table(["mechanism or robot", *map(head_of, site.columns)], drawn, caption, "matrix verdicts")


def quantities(site: Site, row: str) -> Table:
    """A row for each quantity beside accelerations that was asked of a mechanism, a column for each subject; none where none was."""
    held = {(cell.quantity, cell.column): [cell] for cell in site.quantities if cell.row == row}
    columns = [column for column in site.columns if any(column.name == name for _, name in held)]
    names = sorted({quantity for quantity, _ in held})
    drawn = [[name, *(_matrix_cell(held.get((name, column.name), []), _NOT_ASKED, {}) for column in columns)] for name in names]
    return Table(["quantity", *map(head_of, columns)], drawn, f"Other quantities on {row}: verdict and worst backward error", "matrix")


def _matrix_cell(cells: Sequence[SiteCell], absent: str, attributes: Mapping[str, str]) -> Cell:
    """The cells of one pair, nearly always one."""
    if not cells:
        return Cell(absent, tone="empty", fills=True, attributes={**attributes, "data-verdict": absent})
    is_surprise = not all(cell.as_expected for cell in cells)
    errors = [[] if cell.backward_error is None else [error_of(cell.backward_error)] for cell in cells]
    notes = [note for cell, error in zip(cells, errors, strict=True) for note in (*error, *expectation(cell))]
    looks = "agrees" if all(cell.agrees for cell in cells) else gravest(cell.verdict for cell in cells)
    first, outcomes = cells[0], "; ".join(cell.outcome for cell in cells)
    numbers = {"error": first.backward_error, "median": first.median_backward_error, "seconds": first.seconds_per_state}
    data = {f"data-{name}": str(number) for name, number in numbers.items() if number is not None}
    data |= {"data-verdict": outcomes, "data-agrees": "yes" if looks == "agrees" else "no", "data-expected": "no" if is_surprise else "yes"}
    mark, tone = ("✗ ", f"{looks} surprise") if is_surprise else ("", looks)
    return Cell(f"{mark}{outcomes}", notes, tone, fills=True, link=first.page, attributes={**attributes, **data})


def expectation(found: SiteCell | Record) -> list[str]:
    """A note where the verdict is not the expected one, or the expected one is not agreement."""
    if found.as_expected:
        return [] if found.expected == "agrees" else ["as expected"]
    return [f"expected: {found.expected}"]


def engines(site: Site) -> Table:
    """A row for each engine and version; its name leads to its page."""
    pages = {column.engine: column.page for column in site.columns}
    return Table.of(
        site.counts,
        {
            "engine": lambda count: Cell(count.engine, link=pages[count.engine]),
            "version": "version",
            Column("agree", "plain"): lambda count: f"{count.agrees} of {count.asked}",
            Column("unsupported", "count"): "unsupported",
            Column("findings", "count"): lambda count: sum(finding.engine == count.engine for finding in site.findings),
        },
        "Engines: how many pairs of row and format agree, of those that got an answer",
    )


def subjects(site: Site, engine: str) -> Table:
    """A row for each format and version of an engine."""
    own = grouped((cell.column, cell) for cell in site.cells)
    columns = [(column, own.get(column.name, [])) for column in site.columns if column.engine == engine]
    return Table.of(
        columns,
        {
            "subject": lambda one: one[0].name,
            "version": lambda one: one[0].version,
            Column("agree", "count"): lambda one: sum(cell.agrees for cell in one[1]),
            Column("answered", "count"): lambda one: sum(cell.verdict != "unsupported" for cell in one[1]),
            Column("unsupported", "count"): lambda one: sum(cell.verdict == "unsupported" for cell in one[1]),
            Column("worst that agrees", "error"): lambda one: largest(cell.backward_error for cell in one[1] if cell.verdict == "agrees"),
        },
        f"Verdicts of {engine}",
    )


def features(site: Site, engine: str) -> Table:
    """A row for each feature and subject of an engine."""
    own = {column.name for column in site.columns if column.engine == engine}
    lines = [line for line in site.features if line.column in own]
    rows = [
        [line.feature, line.column, line.line, line.agrees, line.asked, value_of(line.worst), value_of(line.from_rigid)] for line in lines
    ]
    heads = [Column("agree", "count"), Column("rows", "count"), Column("worst", "error"), Column("from rigid", "error")]
    return Table(["feature", "subject", "in a line", *heads], rows, f"What {engine} makes of each feature of a model")


def changes(site: Site, row: str | None = None) -> Table:
    """A row for each change point, of one mechanism or of all: of the latest night first, and of a night the largest first."""
    pages = {one.name: one.page for one in site.rows if one.kind != "robot"}
    found = [(site.nights[one.study][change.place], one, change) for one in site.trends if row in (None, one.row) for change in one.changes]
    found.sort(key=lambda entry: (entry[1].row, entry[1].column, entry[1].number))
    found.sort(key=lambda entry: abs(change_of(entry[2].before, entry[2].now, entry[1].number)), reverse=True)
    found.sort(key=lambda entry: entry[0], reverse=True)
    table = Table.of(
        found[:MOST_SHOWN],
        {
            "run started (UTC)": lambda entry: entry[0][:16].replace("T", " "),
            "system": lambda entry: Cell(entry[1].row, link=pages[entry[1].row]),
            "subject or method": lambda entry: entry[1].column,
            "number": lambda entry: entry[1].number,
            Column("before", "error"): lambda entry: entry[2].before,
            Column("now", "error"): lambda entry: entry[2].now,
            Column("runs before", "count"): lambda entry: entry[2].nights,
            "found by": lambda entry: entry[2].found_by,
        },
        "Changed in the trend" + (f", {MOST_SHOWN} of {len(found)}" if len(found) > MOST_SHOWN else ""),
    )
    return table if row is None else table.without("system")


def shown(page: str, name: str, table: Table) -> ShownTable:
    """A table as the data hold it."""
    rows = [[_shown_cell(head, cell) for head, cell in zip(table.heads, row, strict=True)] for row in table.rows]
    return ShownTable(page=page, name=name, caption=table.caption, columns=[ShownColumn(**vars(head)) for head in table.heads], rows=rows)


def _shown_cell(head: Column, cell: object) -> ShownCell:
    look = cell if isinstance(cell, Cell) else Cell(cell)
    value = look.value
    if isinstance(value, bool) or not (value is None or isinstance(value, int | float | str)):
        value = head.text(value)
    if isinstance(value, float) and not math.isfinite(value):
        value = str(value)
    return ShownCell(value=value, notes=[note for note in look.notes if note])
