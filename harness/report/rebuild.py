"""Computes the numbers of the pages beside this file again from ``site.json``, and compares them with what the pages say.

    python3 rebuild.py [--json]

It needs Python 3.11 and nothing else. Verdict counts, the matrix and the lines on features are computed from the cells, one for each
mechanism or robot and subject; trends of errors, and how much changed in a trend, from the values of every run. Every other table is
written again from the values that the data hold in full. With ``--json`` what was computed goes to standard output, by page and table.
The exit status is 1 where a page says something else.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Callable, Iterator
from functools import partial
from html.parser import HTMLParser
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from harness.report.site_counts import badge_text, engine_counts, feature_lines, value_of
from harness.report.site_tables import CHANGES, INDEX, changes, engines, features, matrix, quantities, subjects
from harness.report.sparkline import NO_TREND, Sparkline
from harness.results.table import Cell, Column, Table
from harness.results.trend_numbers import TRACKED, logarithm_of, number_of

Lines = list[list[str]]


def lines_of(table: Table) -> Lines:
    """The texts of a table's cells, with their notes, as a page has them."""
    return [[" ".join(text.split()) for text in line] for line in table.texts(" ")]


def held(table: Any) -> Table:
    """A table as the data hold it, with its numbers in full."""
    heads = [Column(column.title, column.kind, column.unit) for column in table.columns]
    return Table(heads, [[_cell(head, cell) for head, cell in zip(heads, row, strict=True)] for row in table.rows])


def _cell(head: Column, cell: Any) -> Cell:
    is_unbounded = head.is_number and cell.value in ("inf", "-inf", "nan")
    return Cell(float(cell.value) if is_unbounded else cell.value, cell.notes)


def count_again(site: Any) -> None:
    """Compute from the cells what the data say of them, and from the values of trends what they say of changes."""
    site.nights = vars(site.nights)
    site.counts = [*engine_counts(site.columns, site.cells)]
    site.features = [*feature_lines(site.columns, [*site.cells, *site.quantities])]
    for trend in site.trends:
        trend.values = [value_of(value) for value in trend.values]
        places = [place for place, value in enumerate(trend.values) if value is not None]
        logarithms = [logarithm_of(trend.values[place], trend.number) for place in places]
        begin = 0
        for change in trend.changes:
            end = places.index(change.place) + 1
            before, shown = logarithms[begin : end - change.run], logarithms[end - change.run : end]
            begin, mean = end - change.run, sum(before) / len(before)
            _, now = min((abs(value - mean), value) for value in shown)
            change.before, change.now, change.nights = number_of(mean, trend.number), number_of(now, trend.number), len(before)


def trends(site: Any, row: str, shown: Any) -> Table:
    """The trends of each subject of a mechanism, as far as its table has them."""
    found = {
        (one.column, one.number): Sparkline(one.values, [change.place for change in one.changes])
        for one in site.trends
        if (one.study, one.row) == ("cross-check", row)
    }
    heads = [column.title for column in shown.columns]
    lines = [[subject.value, *(found.get((subject.value, TRACKED[head]), NO_TREND) for head in heads[1:])] for subject, *_ in shown.rows]
    return Table(heads, lines)


def rebuilt(site: Any) -> dict[str, dict[str, Lines]]:
    """The rows of every table, by page and by the table's name there; those that follow from cells and trends are computed from these."""
    count_again(site)
    pages: dict[str, dict[str, Lines]] = {}
    for shown in site.tables:
        made = next((make for start, make in makers(site, shown).items() if shown.caption.startswith(start)), partial(held, shown))
        pages.setdefault(shown.page, {})[shown.name] = lines_of(made())
    return pages


def makers(site: Any, shown: Any) -> dict[str, Callable[[], Table]]:
    """Functions that compute a table from cells and trends on the page of another one, by the beginning of its caption."""
    if shown.page in (INDEX, CHANGES):
        makers = {"Verdict and worst": matrix, "Engines:": engines, "Changed in the trend": changes}
        return {start: partial(make, site) for start, make in makers.items()}
    for row in (one.name for one in site.rows if one.kind != "robot" and one.page == shown.page):
        made = {"Other quantities on ": partial(quantities, site, row), "Changed in the trend": partial(changes, site, row)}
        return {**made, "Trends of ": partial(trends, site, row, shown)}
    for engine in (one.engine for one in site.columns if one.page == shown.page):
        return {"Verdicts of ": partial(subjects, site, engine), "What ": partial(features, site, engine)}
    return {}


class Tables(HTMLParser):
    """The texts of the cells of a page's tables, by the name of the table."""

    def __init__(self, source: str) -> None:
        super().__init__()
        self.tables: dict[str, Lines] = {}
        self._name, self._in_body = "", False
        self._cell: str | None = None
        self.feed(source)

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        if tag == "table":
            self._name = dict(attributes).get("data-table") or ""
            self.tables.setdefault(self._name, [])
        elif tag == "tbody":
            self._in_body = True
        elif tag == "tr" and self._in_body:
            self.tables[self._name].append([])
        elif tag in ("td", "th") and self._in_body:
            self._cell = ""

    def handle_endtag(self, tag: str) -> None:
        if tag == "tbody":
            self._in_body = False
        elif tag in ("td", "th") and self._cell is not None:
            self.tables[self._name][-1].append(" ".join(self._cell.split()))
            self._cell = None

    def handle_data(self, data: str) -> None:
        if self._cell is not None:
            self._cell += data


def differences(folder: Path, pages: dict[str, dict[str, Lines]], site: Any) -> Iterator[str]:
    """A line for each text of a page that is not what was computed, and each table that is nowhere in the data."""
    for page, tables in pages.items():
        said = Tables((folder / page).read_text(encoding="utf-8")).tables
        for name in said.keys() - tables.keys():
            yield f"{page}: {name or 'a table without a name'}: not in the data"
        for name, lines in tables.items():
            told = said.get(name, [])
            if len(told) != len(lines):
                yield f"{page}: {name}: {len(told)} rows, computed {len(lines)}"
            for row, (own, other) in enumerate(zip(lines, told, strict=False), 1):
                for column, (computed, text) in enumerate(zip(own, other, strict=False), 1):
                    if computed != text:
                        yield f"{page}: {name}, row {row}, column {column}: says {text!r}, computed {computed!r}"
    for count in site.counts:
        if badge_text(count) not in (folder / count.badge).read_text(encoding="utf-8"):
            yield f"{count.badge}: does not say {badge_text(count)}"


def main() -> int:
    folder = Path(__file__).resolve().parent
    site = json.loads((folder / "site.json").read_text(encoding="utf-8"), object_hook=lambda part: SimpleNamespace(**part))
    pages = rebuilt(site)
    if "--json" in sys.argv[1:]:
        print(json.dumps(pages, indent=1))
    found = list(differences(folder, pages, site))
    texts = [text for tables in pages.values() for lines in tables.values() for line in lines for text in line]
    numbers = sum(bool(re.search(r"\d", text)) for text in texts)
    print(*found, f"{numbers} cells with numbers in {len(pages)} pages computed again; {len(found)} differ", sep="\n", file=sys.stderr)
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
