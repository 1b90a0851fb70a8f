"""Trends as data of the site, and what the pages show of them: lines, and tables of the changes."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from harness.report.benchmarks import BenchmarkSummary
from harness.report.summary import Summary
from harness.results.site import Site, SiteChange, SiteRow, SiteTrend, plain_number
from harness.results.table import Cell, Column, Table
from harness.results.trend import COST, LEAST_ERROR, Trend

CROSS_CHECK, BENCHMARK = "cross-check", "benchmark"
# Rows of a table: a new version of an engine may change every cell. The data have all of them.
MOST_SHOWN = 200
_HEADS: list[Column | str] = [
    "run started (UTC)", "system", "subject or method", "number",
    Column("before", "error"), Column("now", "error"), Column("runs before", "count"), "found by",
]  # fmt: skip


def collect(
    rows: Sequence[SiteRow], summary: Summary | None, measured: BenchmarkSummary | None
) -> tuple[dict[str, list[str]], list[SiteTrend]]:
    """``nights`` and ``trends`` of the data, for the mechanisms that have a page."""
    nights: dict[str, list[str]] = {}
    found: list[SiteTrend] = []
    mechanisms = {row.name for row in rows if row.kind != "robot"}
    sources: Mapping[str, Summary | BenchmarkSummary | None] = {CROSS_CHECK: summary, BENCHMARK: measured}
    for study, source in sources.items():
        if source is not None and len(source.nights) > 1:
            nights[study] = [run.started for run, _ in source.nights]
            found += [_site_trend(study, trend) for trend in source.trends if trend.system in mechanisms]
    return nights, found


def _site_trend(study: str, trend: Trend) -> SiteTrend:
    changes = [
        SiteChange(place=one.place, run=one.run, before=one.before, now=one.now, nights=one.nights, found_by=one.found_by)
        for one in trend.changes
    ]
    values = [plain_number(value) for value in trend.values]
    return SiteTrend(study=study, row=trend.system, column=trend.subject, number=trend.number, values=values, changes=changes)


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
    found.sort(key=lambda entry: (-_size(entry[1], entry[2]), entry[1].row, entry[1].column, entry[1].number))
    found.sort(key=lambda entry: entry[0], reverse=True)
    return found


def _size(trend: SiteTrend, change: SiteChange) -> float:
    """The logarithm of the ratio, of either sign."""
    floor = 0.0 if trend.number == COST else LEAST_ERROR
    return abs(math.log((change.now + floor) / (change.before + floor)))


def _moment(started: str) -> str:
    """ "2026-01-31 02:00" of ISO 8601 in UTC."""
    return started[:16].replace("T", " ")
