"""The data of the pages, ``harness.results.site``, out of the results of studies, and what is known of engines beside them.

Issues in the engines' own trackers stand in ``upstream.toml``, findings beside the mechanisms in ``known_findings.toml``.
"""

from __future__ import annotations

import functools
import math
import tomllib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from importlib.resources import files

from harness.report.benchmarks import BenchmarkSummary
from harness.report.hard_cases import HardSummary
from harness.report.site_counts import engine_counts, feature_lines, pages_in, slugs
from harness.report.summary import Summary
from harness.results.comparison import FilesComparison, short_names
from harness.results.readings import by_effect, explanation, names_of
from harness.results.records import Record
from harness.results.run import Run
from harness.results.site import Site, SiteCell, SiteChange, SiteColumn, SiteFinding, SiteRow, SiteTrend, Upstream, plain_number
from harness.results.table import counted_nouns
from harness.verdict import AGREEMENT, Verdict


@dataclass(frozen=True, kw_only=True)
class DeclaredIssue(Upstream):
    """An entry of ``upstream.toml``: of a ``feature`` of the engine, or of ways of asking it whose names begin with ``way``."""

    engine: str
    feature: str = ""
    way: str = ""


@functools.cache
def declared() -> list[DeclaredIssue]:
    """Every issue.

    Raises:
        TypeError: the file holds something else.
    """
    return [DeclaredIssue(**entry) for entry in tomllib.loads(files(__package__).joinpath("upstream.toml").read_text("utf-8"))["upstream"]]


def issues(engine: str, features: Iterable[str] = (), way: str = "") -> list[Upstream]:
    """The issues on features of an engine, by feature, and on a way of asking it."""
    found = [one for feature in features for one in declared() if (one.engine, one.feature) == (engine, feature)]
    found += [one for one in declared() if one.engine == engine and one.way and way.startswith(one.way)]
    return [Upstream(title=one.title, link=one.link, state=one.state, seen=one.seen) for one in found]


@functools.cache
def known_findings() -> list[SiteFinding]:
    """Findings beside the mechanisms; the last two lines that a program prints are what the engine says and what is right.

    Raises:
        TypeError: the file holds something else.
    """
    text = files(__package__).joinpath("known_findings.toml").read_text("utf-8")
    return [_known(**entry) for entry in tomllib.loads(text)["finding"]]


def _known(*, engine: str, version: str, title: str, link: str, reproducer: str) -> SiteFinding:
    return SiteFinding(
        engine=engine, way=f"{engine} {version}", row="", rows=[], statement=title, backward_error=None,
        reproducer=reproducer.strip() + "\n", upstream=[], link=link,
    )  # fmt: skip


def collect(run: Run, summary: Summary, measured: BenchmarkSummary, hard: HardSummary, robots: FilesComparison) -> Site:
    """Everything but the tables, which pages add as they are drawn."""
    subjects = {*summary.subjects, *hard.subjects, *(subject.subject for subject in robots.subjects)}
    columns = [*_columns(run, sorted(subjects))]
    rows = [*_mechanisms(summary, measured), *_robots(robots)]
    pages = {(row.kind == "robot", row.name): row.page for row in rows}
    cells = [*_cells(summary, pages), *_robot_cells(robots, pages)]
    quantities = [_cell(record, f"{pages[False, record.system]}#quantities") for record in summary.further]
    engines = {column.engine for column in columns}
    nights, trends = _trends(rows, summary, measured)
    return Site(
        run={name: value for name, value in asdict(run).items() if isinstance(value, str | int)},
        versions=dict(sorted(run.versions.items())), limit=AGREEMENT, columns=columns, rows=rows, cells=cells,
        counts=[*engine_counts(columns, cells)], features=[*feature_lines(columns, [*cells, *quantities])], quantities=quantities,
        findings=[*_findings(summary, measured), *(one for one in known_findings() if one.engine in engines)],
        nights=nights, trends=trends,
    )  # fmt: skip


def split(subject: str) -> tuple[str, str, str]:
    """Engine, version and format of "mujoco@3.13.0/mjcf"; "" for what it does not say."""
    asked, _, model_format = subject.partition("/")
    engine, _, version = asked.partition("@")
    return engine, version, model_format


def _columns(run: Run, subjects: Sequence[str]) -> Iterator[SiteColumn]:
    pages = pages_in("engines", dict.fromkeys(split(subject)[0] for subject in subjects))
    for subject in subjects:
        engine, version, model_format = split(subject)
        version = version or run.engines.get(engine) or run.versions.get(engine, "")
        title = run.titles.get(engine, engine)
        yield SiteColumn(name=subject, engine=engine, title=title, version=version, format=model_format, page=pages[engine])


def _mechanisms(summary: Summary, measured: BenchmarkSummary) -> Iterator[SiteRow]:
    systems = sorted({*summary.systems, *measured.systems})
    places = pages_in("mechanisms", systems)
    for system in systems:
        card, stem = summary.cards.get(system), system.partition(".")[0]
        yield SiteRow(
            name=system,
            kind="variant" if card is None and stem != system and stem in systems else "mechanism",
            description=card.description if card else "",
            features=sorted({feature for record in summary.of_system(system) for feature in record.features}),
            page=places[system],
        )


def _robots(robots: FilesComparison) -> Iterator[SiteRow]:
    names = short_names(robots)
    places = pages_in("robots", names.values())
    for file in robots.files:
        freedom = counted_nouns(file.degrees_of_freedom, "degrees of freedom")
        kind = file.problem or f"{file.format.upper()}, {freedom}"
        yield SiteRow(name=names[file.path], kind="robot", description=kind, features=[], page=places[names[file.path]])


def _cells(summary: Summary, pages: Mapping[tuple[bool, str], str]) -> Iterator[SiteCell]:
    programs = {(case.system, case.subject): case.reproducer for cases in summary.worst_cases.values() for case in cases}
    places = slugs(summary.subjects)
    for record in summary.records:
        pair = record.system, record.subject
        cause = summary.causes.get(pair)
        diagnosis = [] if cause is None else [cause.inference, *cause.lines]
        yield _cell(record, f"{pages[False, record.system]}#{places[record.subject]}", diagnosis, programs.get(pair, ""))


def _cell(record: Record, page: str, diagnosis: Sequence[str] = (), reproducer: str = "") -> SiteCell:
    return SiteCell(
        row=record.system,
        column=record.subject,
        verdict=record.verdict,
        expected=record.expected,
        as_expected=record.as_expected,
        outcome=record.outcome,
        agrees=record.verdict == Verdict.AGREES,
        is_robot=False,
        tone=record.tone,
        quantity=record.quantity,
        features=list(record.features),
        states=record.states,
        backward_error=plain_number(record.backward_error),
        median_backward_error=plain_number(record.median_backward_error),
        relative_error=plain_number(record.relative_error),
        from_rigid=plain_number(record.from_rigid),
        seconds_per_state=plain_number(record.seconds_per_state),
        reading=explanation(record.readings, 2),
        readings=names_of(record.readings),
        reason=record.expected_reason,
        link=record.expected_link,
        message=record.message,
        diagnosis=list(diagnosis),
        replay=record.replay,
        reproducer=reproducer,
        page=page,
    )


def _robot_cells(robots: FilesComparison, pages: Mapping[tuple[bool, str], str]) -> Iterator[SiteCell]:
    names = short_names(robots)
    for subject in (one for one in robots.subjects if not one.aided):
        name = names[subject.path]
        readings = by_effect(subject.readings)
        yield SiteCell(
            row=name,
            column=subject.subject,
            verdict=Verdict.MISREADS.value if subject.outcome == Verdict.MISREADS else subject.verdict,
            expected=Verdict.AGREES.value,
            as_expected=subject.as_expected,
            outcome=subject.outcome,
            agrees=subject.verdict == Verdict.AGREES,
            is_robot=True,
            tone=subject.tone.partition(" ")[0],
            quantity="accelerations",
            features=[],
            states=0,
            backward_error=plain_number(subject.backward_error),
            median_backward_error=None,
            relative_error=plain_number(subject.relative_error),
            from_rigid=None,
            seconds_per_state=None,
            reading=explanation(subject.readings, 2),
            readings=names_of(subject.readings),
            reason="; ".join(reading.sentence for reading in readings),
            link="",
            message=subject.message,
            diagnosis=list(subject.rest),
            replay=f"harness compare {name}",
            reproducer="",
            page=pages[True, name],
        )


def _findings(summary: Summary, measured: BenchmarkSummary) -> Iterator[SiteFinding]:
    """Faults of engines: ways of asking that a benchmark found, then subjects of the cross-check, each kind of error once."""
    groups: dict[tuple[str, str], list[SiteFinding]] = {}
    for found in measured.benchmark.findings:
        engine, _, way = found.method.partition(" ")
        finding = SiteFinding(
            engine=engine, way=way, row=found.system, rows=[found.system], statement=found.statement,
            backward_error=plain_number(found.backward_error), reproducer=found.reproducer, upstream=issues(engine, way=way),
        )  # fmt: skip
        groups.setdefault((engine, way), []).append(finding)
    for subject, cases in summary.worst_cases.items():
        for case in (one for one in cases if one.verdict != Verdict.AGREES and one.reproducer):
            engine, records = split(subject)[0], summary.cells.get((case.system, subject), [])
            reason = next((record.expected_reason for record in records if record.expected_reason), "")
            features = sorted({name for record in records for name in record.features})
            finding = SiteFinding(
                engine=engine, way=subject, row=case.system, rows=[case.system], statement=reason or case.statement,
                backward_error=plain_number(case.backward_error), reproducer=case.reproducer, upstream=issues(engine, features),
            )  # fmt: skip
            groups.setdefault((subject, finding.statement), []).append(finding)
    for alike in groups.values():
        # An answer that is not finite is worse than any other; of equals the shortest program is told.
        worst = max(alike, key=lambda one: (math.inf if one.backward_error is None else float(one.backward_error), -len(one.reproducer)))
        yield replace(worst, rows=sorted({row for one in alike for row in one.rows}))


def _trends(rows: Sequence[SiteRow], summary: Summary, measured: BenchmarkSummary) -> tuple[dict[str, list[str]], list[SiteTrend]]:
    """``nights`` and ``trends`` of the data, for the mechanisms that have a page."""
    nights: dict[str, list[str]] = {}
    found: list[SiteTrend] = []
    mechanisms = {row.name for row in rows if row.kind != "robot"}
    sources: Mapping[str, Summary | BenchmarkSummary] = {"cross-check": summary, "benchmark": measured}
    for study, source in sources.items():
        if len(source.nights) > 1:
            nights[study] = [run.started for run, _ in source.nights]
            for trend in (one for one in source.trends if one.system in mechanisms):
                changes = [
                    SiteChange(place=one.place, run=one.run, before=one.before, now=one.now, nights=one.nights, found_by=one.found_by)
                    for one in trend.changes
                ]
                values = [plain_number(value) for value in trend.values]
                about = {"row": trend.system, "column": trend.subject, "number": trend.number}
                found.append(SiteTrend(study=study, **about, values=values, changes=changes))
    return nights, found
