"""Tables of the index and of the engines' pages, from the data of the site."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from harness.report.addresses import slugs
from harness.results.site import FeatureLine, Number, ShownCell, ShownColumn, ShownTable, Site, SiteCell, SiteChange, SiteColumn, SiteTrend
from harness.results.table import Cell, Column, Table, error_text
from harness.results.trend_numbers import change_of
from harness.verdict import gravest

# Of a mechanism every subject is asked; of a variant and of a robot's file, those that read it.
_NOT_RUN, _NOT_ASKED = "not run", "not asked"
# Rows of a table: a new version of an engine may change every cell. The data have all of them.
MOST_SHOWN = 200
_HEADS: list[Column | str] = [
    "run started (UTC)", "system", "subject or method", "number",
    Column("before", "error"), Column("now", "error"), Column("runs before", "count"), "found by",
]  # fmt: skip


def value_of(number: Number) -> float | None:
    """The number that the data hold as text where it is not finite."""
    return None if number is None else float(number)


def error_of(number: Number) -> str:
    """Three digits; "nan" and "inf" as they are."""
    value = value_of(number)
    return str(number) if isinstance(number, str) else error_text(value)


def head_of(column: SiteColumn) -> str:
    """ "mujoco/mjcf (4.0.0)"; the subject alone where its name says the version, or nobody does."""
    return column.name if "@" in column.name or not column.version else f"{column.name} ({column.version})"


def matrix(site: Site) -> Table:
    """A row for each mechanism and robot, a column for each subject; a cell leads to the place where it is told."""
    held: dict[tuple[str, str], list[SiteCell]] = {}
    for cell in site.cells:
        held.setdefault((cell.row, cell.column), []).append(cell)
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
    notes = []
    for cell in cells:
        expected = "as expected" if cell.as_expected else f"expected: {cell.expected}"
        error = [] if cell.backward_error is None else [error_of(cell.backward_error)]
        notes += [*error, *([expected] if not cell.as_expected or cell.expected != "agrees" else [])]
    looks = "agrees" if all(cell.agrees for cell in cells) else gravest(cell.verdict for cell in cells)
    first = cells[0]
    numbers = {"error": first.backward_error, "median": first.median_backward_error, "seconds": first.seconds_per_state}
    data = {f"data-{name}": str(number) for name, number in numbers.items() if number is not None}
    data |= {"data-verdict": "; ".join(cell.outcome for cell in cells), "data-agrees": "yes" if looks == "agrees" else "no"}
    data |= {"data-expected": "no" if is_surprise else "yes"}
    words = ("✗ " if is_surprise else "") + data["data-verdict"]
    return Cell(words, notes, looks + (" surprise" if is_surprise else ""), fills=True, link=first.page, attributes={**attributes, **data})


def engines(site: Site) -> Table:
    """A row for each engine and version; its name leads to its page."""
    pages = {column.engine: column.page for column in site.columns}
    rows = []
    for count in site.counts:
        findings = sum(finding.engine == count.engine for finding in site.findings)
        share = f"{count.agrees} of {count.asked}"
        rows.append([Cell(count.engine, link=pages[count.engine]), count.version, share, count.unsupported, findings])
    heads: list[Column | str] = ["engine", "version", Column("agree", "plain"), Column("unsupported", "count"), Column("findings", "count")]
    return Table(heads, rows, "Engines: how many pairs of row and format agree, of those that got an answer")


def subjects(site: Site, engine: str) -> Table:
    """A row for each format and version of an engine."""
    rows: list[list[object]] = []
    for column in site.columns:
        if column.engine == engine:
            own = [cell for cell in site.cells if cell.column == column.name]
            errors = [value for cell in own if (value := value_of(cell.backward_error)) is not None and cell.verdict == "agrees"]
            unsupported = sum(cell.verdict == "unsupported" for cell in own)
            agrees = sum(cell.agrees for cell in own)
            worst = max(errors, key=lambda error: math.inf if math.isnan(error) else error, default=None)
            rows.append([column.name, column.version, agrees, len(own) - unsupported, unsupported, worst])
    heads = [Column("agree", "count"), Column("answered", "count"), Column("unsupported", "count"), Column("worst that agrees", "error")]
    return Table(["subject", "version", *heads], rows, f"Verdicts of {engine}")


def features(lines: Sequence[FeatureLine], engine: str) -> Table:
    """A row for each feature and subject of an engine."""
    rows = [
        [line.feature, line.column, line.line, line.agrees, line.asked, value_of(line.worst), value_of(line.from_rigid)] for line in lines
    ]
    heads = [Column("agree", "count"), Column("rows", "count"), Column("worst", "error"), Column("from rigid", "error")]
    return Table(["feature", "subject", "in a line", *heads], rows, f"What {engine} makes of each feature of a model")


def changes(site: Site, row: str | None = None) -> Table:
    """A row for each change point, of one mechanism or of all: of the latest night first, and of a night the largest first."""
    pages = {one.name: one.page for one in site.rows if one.kind != "robot"}
    rows: list[list[object]] = [
        [
            _moment(started),
            Cell(trend.row, link=pages[trend.row]),
            trend.column,
            trend.number,
            change.before,
            change.now,
            change.nights,
            change.found_by,
        ]
        for started, trend, change in _ordered(site, row)
    ]
    shown = f", {MOST_SHOWN} of {len(rows)}" if len(rows) > MOST_SHOWN else ""
    table = Table(_HEADS, rows[:MOST_SHOWN], f"Changed in the trend{shown}")
    return table if row is None else table.without("system")


def _ordered(site: Site, row: str | None) -> list[tuple[str, SiteTrend, SiteChange]]:
    found = [(site.nights[one.study][change.place], one, change) for one in site.trends if row in (None, one.row) for change in one.changes]
    found.sort(key=lambda entry: (entry[1].row, entry[1].column, entry[1].number))
    found.sort(key=lambda entry: abs(change_of(entry[2].before, entry[2].now, entry[1].number)), reverse=True)
    found.sort(key=lambda entry: entry[0], reverse=True)
    return found


def _moment(started: str) -> str:
    """ "2026-01-31 02:00" of ISO 8601 in UTC."""
    return started[:16].replace("T", " ")


def shown(page: str, name: str, table: Table) -> ShownTable:
    """A table as the data hold it."""
    columns = [ShownColumn(title=head.title, kind=head.kind, unit=head.unit) for head in table.heads]
    rows = [[_shown_cell(head, cell) for head, cell in zip(table.heads, row, strict=True)] for row in table.rows]
    return ShownTable(page=page, name=name, caption=table.caption, columns=columns, rows=rows)


def _shown_cell(head: Column, cell: object) -> ShownCell:
    look = cell if isinstance(cell, Cell) else Cell(cell)
    value = look.value
    if isinstance(value, bool) or not (value is None or isinstance(value, int | float | str)):
        value = head.text(value)
    if isinstance(value, float) and not math.isfinite(value):
        value = str(value)
    return ShownCell(value=value, notes=[note for note in look.notes if note])
