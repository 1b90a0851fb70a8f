"""The data of the pages, ``harness.results.site``, out of the results of studies: plain functions from one to the other."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import asdict

from harness.report import addresses, upstream
from harness.report.benchmarks import BenchmarkSummary
from harness.report.hard_cases import HardSummary
from harness.report.site_features import engine_counts, feature_lines
from harness.report.summary import Summary
from harness.report.upstream import known_findings
from harness.results.comparison import FilesComparison, SubjectRecord
from harness.results.comparison_tables import short_names
from harness.results.hard_states import RankedCase
from harness.results.records import Record, Run
from harness.results.site import Number, Site, SiteCell, SiteChange, SiteColumn, SiteFinding, SiteRow, SiteTrend, plain_number
from harness.results.trend import Trend
from harness.verdict import AGREEMENT, Verdict

OWN = "lagrange"


def collect(
    run: Run, summary: Summary | None = None, measured: BenchmarkSummary | None = None, hard: HardSummary | None = None,
    robots: FilesComparison | None = None,
) -> Site:  # fmt: skip
    """Everything but the tables, which pages add as they are drawn."""
    subjects = {*(summary.subjects if summary else ()), *(hard.subjects if hard else ())}
    subjects |= {subject.subject for subject in robots.subjects} if robots else set()
    columns = _columns(run, sorted(subjects))
    rows = [*_mechanisms(summary, measured), *_robots(robots)]
    pages = {(row.kind == "robot", row.name): row.page for row in rows}
    cells = [*_cells(summary, pages), *_robot_cells(robots, pages)]
    quantities = [*_quantity_cells(summary, pages)]
    about = {name: value for name, value in asdict(run).items() if isinstance(value, str | int)}
    nights, trends = _trends(rows, summary, measured)
    return Site(
        run=about, versions=dict(sorted(run.versions.items())), limit=AGREEMENT, columns=columns, rows=rows, cells=cells,
        counts=[*engine_counts(columns, cells)], features=[*feature_lines(columns, [*cells, *quantities])], quantities=quantities,
        findings=[*_findings(summary, measured), *_known({column.engine for column in columns})],
        nights=nights, trends=trends,
    )  # fmt: skip


def split(subject: str) -> tuple[str, str, str]:
    """Engine, version and format of "mujoco@3.13.0/mjcf"; "" for what it does not say."""
    asked, _, model_format = subject.partition("/")
    engine, _, version = asked.partition("@")
    return engine, version, model_format


def _columns(run: Run, subjects: Sequence[str]) -> list[SiteColumn]:
    engines = addresses.pages("engines", dict.fromkeys(split(subject)[0] for subject in subjects))
    found = []
    for subject in subjects:
        engine, version, model_format = split(subject)
        version = version or run.engines.get(engine) or run.versions.get(engine, "")
        found.append(SiteColumn(name=subject, engine=engine, version=version, format=model_format, page=engines[engine]))
    return found


def _mechanisms(summary: Summary | None, measured: BenchmarkSummary | None) -> Iterator[SiteRow]:
    systems = sorted({*(summary.systems if summary else ()), *(measured.systems if measured else ())})
    places = addresses.pages("mechanisms", systems)
    for system in systems:
        records = summary.of_system(system) if summary else []
        card = summary.cards.get(system) if summary else None
        stem = system.partition(".")[0]
        is_variant = card is None and stem != system and stem in systems
        yield SiteRow(
            name=system,
            kind="variant" if is_variant else "mechanism",
            description=card.description if card else "",
            features=sorted({feature for record in records for feature in record.features}),
            page=places[system],
        )


def _robots(robots: FilesComparison | None) -> Iterator[SiteRow]:
    if robots is None:
        return
    names = short_names(robots)
    places = addresses.pages("robots", names.values())
    for file in robots.files:
        name = names[file.path]
        kind = f"{file.format.upper()}, {file.degrees_of_freedom} degrees of freedom" if not file.problem else file.problem
        yield SiteRow(name=name, kind="robot", description=kind, features=[], page=places[name])


def _cells(summary: Summary | None, pages: Mapping[tuple[bool, str], str]) -> Iterator[SiteCell]:
    if summary is None:
        return
    programs = {(case.system, case.subject): case.reproducer for cases in summary.worst_cases.values() for case in cases}
    places = addresses.slugs(summary.subjects)
    for record in summary.records:
        pair = record.system, record.subject
        cause = summary.causes.get(pair)
        diagnosis = [] if cause is None else [cause.inference, *cause.terms, *(line for side in cause.sides for line in side)]
        yield _cell(record, f"{pages[False, record.system]}#{places[record.subject]}", diagnosis, programs.get(pair, ""))


def _quantity_cells(summary: Summary | None, pages: Mapping[tuple[bool, str], str]) -> Iterator[SiteCell]:
    for record in summary.further if summary else ():
        yield _cell(record, f"{pages[False, record.system]}#quantities")


def _cell(record: Record, page: str, diagnosis: Sequence[str] = (), reproducer: str = "") -> SiteCell:
    return SiteCell(
        row=record.system,
        column=record.subject,
        verdict=record.verdict,
        expected=record.expected,
        as_expected=record.as_expected,
        outcome=record.verdict,
        agrees=record.verdict == Verdict.AGREES,
        quantity=record.quantity,
        features=list(record.features),
        states=record.states,
        **_numbers(record),
        reason=record.expected_reason,
        link=record.expected_link,
        message=record.message,
        diagnosis=list(diagnosis),
        replay=record.replay,
        reproducer=reproducer,
        page=page,
    )


def _numbers(record: Record) -> dict[str, Number]:
    names = ("backward_error", "median_backward_error", "relative_error", "from_rigid", "seconds_per_state")
    return {name: plain_number(getattr(record, name)) for name in names}


def _robot_cells(robots: FilesComparison | None, pages: Mapping[tuple[bool, str], str]) -> Iterator[SiteCell]:
    if robots is None:
        return
    names = short_names(robots)
    for subject in robots.subjects:
        if not subject.aided:
            yield _robot_cell(names[subject.path], subject, pages)


def _robot_cell(name: str, subject: SubjectRecord, pages: Mapping[tuple[bool, str], str]) -> SiteCell:
    reasons = [reading.sentence for reading in sorted(subject.readings, key=lambda one: -(one.alone or 0.0))]
    return SiteCell(
        row=name,
        column=subject.subject,
        verdict=subject.verdict,
        expected=Verdict.AGREES.value,
        as_expected=subject.explained,
        outcome=subject.outcome,
        agrees=subject.explained and subject.verdict in (Verdict.AGREES, Verdict.DISAGREES),
        quantity="accelerations",
        features=[],
        states=0,
        backward_error=plain_number(subject.backward_error),
        median_backward_error=None,
        relative_error=plain_number(subject.relative_error),
        from_rigid=None,
        seconds_per_state=None,
        reason="; ".join(reasons),
        link="",
        message=subject.message,
        diagnosis=list(subject.rest),
        replay=f"harness compare {name}",
        reproducer="",
        page=pages[True, name],
    )


def _findings(summary: Summary | None, measured: BenchmarkSummary | None) -> Iterator[SiteFinding]:
    """Faults of engines: ways of asking that a benchmark found, then subjects of the cross-check, each kind of error once."""
    groups: dict[tuple[str, str], list[SiteFinding]] = {}
    for found in measured.benchmark.findings if measured else ():
        engine, _, way = found.method.partition(" ")
        finding = SiteFinding(
            engine=engine, way=way, row=found.system, rows=[found.system], statement=found.statement,
            backward_error=plain_number(found.backward_error), reproducer=found.reproducer, upstream=upstream.of_way(engine, way),
        )  # fmt: skip
        groups.setdefault((engine, way), []).append(finding)
    for subject, cases in (summary.worst_cases if summary else {}).items():
        for case in cases:
            if summary and case.verdict != Verdict.AGREES and case.reproducer:
                finding = _of_case(case, summary.cells[case.system, subject])
                groups.setdefault((subject, finding.statement), []).append(finding)
    for alike in groups.values():
        yield _worst_of(alike)


def _known(engines: Collection[str]) -> Iterator[SiteFinding]:
    """Known findings of the engines of the site, beside the mechanisms."""
    for one in known_findings():
        if one.engine in engines:
            yield SiteFinding(
                engine=one.engine, way=f"{one.engine} {one.version}", row="", rows=[], statement=one.title, backward_error=None,
                reproducer=one.reproducer.strip() + "\n", upstream=[], link=one.link,
            )  # fmt: skip


def _of_case(case: RankedCase, records: Sequence[Record]) -> SiteFinding:
    engine = split(case.subject)[0]
    reason = next((record.expected_reason for record in records if record.expected_reason), "")
    features = sorted({name for record in records for name in record.features})
    return SiteFinding(
        engine=engine, way=case.subject, row=case.system, rows=[case.system], statement=reason or case.statement,
        backward_error=plain_number(case.backward_error), reproducer=case.reproducer,
        upstream=[issue for name in features for issue in upstream.of_feature(engine, name)],
    )  # fmt: skip


def _worst_of(alike: Sequence[SiteFinding]) -> SiteFinding:
    """The worst of findings of one kind, an answer that is not finite being worse than any other, of equals the one with the shortest
    program; with the rows of all."""
    worst = max(alike, key=lambda one: (math.inf if one.backward_error is None else float(one.backward_error), -len(one.reproducer)))
    return SiteFinding(**{**vars(worst), "rows": sorted({row for one in alike for row in one.rows})})


CROSS_CHECK, BENCHMARK = "cross-check", "benchmark"


def _trends(
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
