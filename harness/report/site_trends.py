"""Trends as data of the site."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from harness.report.benchmarks import BenchmarkSummary
from harness.report.summary import Summary
from harness.results.site import SiteChange, SiteRow, SiteTrend, plain_number
from harness.results.trend import Trend

CROSS_CHECK, BENCHMARK = "cross-check", "benchmark"


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
