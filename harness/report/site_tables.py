"""The site from its data: addresses of its pages, and the tables of the index and the engines."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING

from harness.report.site_counts import error_of, gravest_tone, largest, slugs, value_of
from harness.results.readings import share_text
from harness.results.site import ShownCell, ShownColumn, ShownTable, Site, SiteCell, SiteColumn
from harness.results.table import Cell, Column, Table, grouped
from harness.results.trend_numbers import change_of
from harness.verdict import SOFT

if TYPE_CHECKING:
    from harness.results.records import Record

INDEX, BENCHMARK, HARD, ROBOTS = "index.html", "benchmark.html", "hard.html", "robots.html"
DIFFERENCES, CHANGES, ABOUT = "differences.html", "changes.html", "about.html"


# Of a mechanism every subject is asked; of a variant and of a robot's file, those that read it.
_NOT_RUN, _NOT_ASKED = "not run", "not asked"
# Rows of a table: a new version of an engine may change every cell. The data have all of them.
MOST_SHOWN = 200


def head_of(column: SiteColumn) -> str:
    """ "mujoco/mjcf (4.0.0)"; the subject alone where its name says the version, or nobody does."""
    return column.name if "@" in column.name or not column.version else f"{column.name} ({column.version})"


@dataclass(frozen=True)
class Pictured:
    """A name, with a drawing before it where a page shows it."""

    name: str
    drawing: str

    def __str__(self) -> str:
        return self.name

    def __html__(self) -> str:
        # A long name is broken where its words end.
        words = re.sub(r"([._])", r"\1<wbr>", escape(self.name))
        return f"{self.drawing}<span>{words}</span>"


def asked_columns(site: Site) -> list[SiteColumn]:
    """The subjects that read a file, which are engines; the harness's own code, which reads none, where there is no other."""
    return [column for column in site.columns if column.format] or site.columns


def own_code(site: Site) -> list[tuple[str, str, str]]:
    """Name, page and line of what is asked without a file beside engines."""
    shown = {column.engine for column in asked_columns(site)}
    pages = {column.engine: column.page for column in site.columns}
    return [(count.engine, pages[count.engine], count.line) for count in site.counts if count.engine not in shown]


def matrix(site: Site, drawings: Mapping[str, str] | None = None) -> Table:
    """A row for each mechanism and robot, with its drawing, and a column for each engine's subject; a cell leads to where it is told."""
    held = grouped(((cell.row, cell.column), cell) for cell in site.cells)
    shown = asked_columns(site)
    rows, columns = slugs(row.name for row in site.rows), slugs(column.name for column in shown)
    places = {(row, column): f"cell-{rows[row]}--{columns[column]}" for row in rows for column in columns}
    drawn: list[list[object]] = []
    for row in site.rows:
        about = {"data-kind": row.kind, "data-features": ", ".join(row.features)}
        name = Pictured(row.name, (drawings or {}).get(row.name, ""))
        line: list[object] = [Cell(name, tone="", fills=True, link=row.page, attributes={"data-row": row.name, **about})]
        for column in shown:
            pair = row.name, column.name
            absent = _NOT_RUN if row.kind == "mechanism" else _NOT_ASKED
            line.append(_matrix_cell(held.get(pair, []), absent, {"id": places[pair], "data-column": column.name}))
        drawn.append(line)
    caption = "Verdict and worst backward error [data roundoffs]; of a robot, whether the engine's reading of its file explains its answer"
    return Table(["mechanism or robot", *map(head_of, shown)], drawn, caption, "matrix verdicts")


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
    notes = [note for note in map(_note, cells) if note]
    first, outcomes = cells[0], "; ".join(cell.outcome for cell in cells)
    numbers = {"error": first.backward_error, "median": first.median_backward_error, "seconds": first.seconds_per_state}
    data = {f"data-{name}": str(number) for name, number in numbers.items() if number is not None}
    data |= {"data-verdict": outcomes, "data-agrees": "yes" if all(cell.agrees for cell in cells) else "no"}
    data |= {"data-expected": "no" if is_surprise else "yes"}
    mark, tone = ("✗ ", f"{gravest_tone(cells)} surprise") if is_surprise else ("", gravest_tone(cells))
    return Cell(f"{mark}{outcomes}", notes, tone, fills=True, link=first.page, attributes={**attributes, **data})


def _note(cell: SiteCell) -> str:
    """The line below the outcome: the distance from rigid constraints, the backward error, and what was expected."""
    away = f"{share_text(float(cell.from_rigid))} from rigid" if cell.outcome == SOFT and cell.from_rigid is not None else ""
    error = "" if cell.backward_error is None or cell.reading else error_of(cell.backward_error)
    return ", ".join(filter(None, [away, cell.reading, error, *expectation(cell)]))


def expectation(found: SiteCell | Record) -> list[str]:
    """A note where the verdict is not the expected one, or the expected one is not agreement."""
    if found.as_expected:
        return [] if found.expected == "agrees" else ["as expected"]
    return [f"expected: {found.expected}"]


def engines(site: Site) -> Table:
    """A row for each engine and version, with what was found of it; its name leads to its page."""
    pages = {column.engine: column.page for column in asked_columns(site)}
    rows = [
        [Cell(f"{count.title} {count.version}".rstrip(), tone=count.tone, link=pages[count.engine]), count.line]
        for count in site.counts
        if count.engine in pages
    ]
    return Table(["engine", "accelerations"], rows, "Engines: what was found of each", "lines")


def lines_of_engines(site: Site) -> dict[str, str]:
    """The same as text."""
    return dict(engines(site).texts())


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
