"""The pages of the site: for each, its template and what stands on it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

from harness.report import addresses, benchmark_charts, charts, comparison, hard_charts, site_data, site_tables, upstream
from harness.report.benchmarks import BenchmarkSummary, acceleration_front, motion_front
from harness.report.figures import styles
from harness.report.hard_cases import HardSummary
from harness.report.html import Drawn, draw
from harness.report.summary import Summary, trends_on, verdicts_on, worst
from harness.results.comparison import FilesComparison
from harness.results.comparison_tables import short_names
from harness.results.pareto import way_of
from harness.results.records import Run
from harness.results.site import Site, SiteRow
from harness.results.table import Cell, Column, Table

# Shapes are the style sheet's, so that no verdict is told by its colour alone.
KEY = {
    "agrees": "right to rounding",
    "unstable": "digits lost by the algorithm",
    "undecided": "no certified truth",
    "disagrees": "wrong",
    "error": "failed",
    "unsupported": "not expressible, or refused",
}


@dataclass(frozen=True)
class Survey:
    """The latest survey of robots, the one before of the same places, and ``earlier`` ones for trends, oldest first."""

    run: Run
    found: FilesComparison
    before: tuple[Run, FilesComparison] | None = None
    earlier: Sequence[FilesComparison] = ()


@dataclass
class Pages:
    """Everything that there is to show; ``drawn`` yields the pages with their addresses."""

    run: Run
    summary: Summary | None
    measured: BenchmarkSummary | None
    hard: HardSummary | None
    survey: Survey | None
    site: Site = field(init=False)

    def __post_init__(self) -> None:
        self.site = site_data.collect(self.run, self.summary, self.measured, self.hard, self.survey.found if self.survey else None)

    def drawn(self) -> Iterator[tuple[str, Drawn]]:
        """Address and page, the index first."""
        yield addresses.INDEX, self._index()
        for row in self.site.rows:
            if row.kind != "robot":
                yield row.page, self._mechanism(row)
        for engine, page in dict.fromkeys((column.engine, column.page) for column in self.site.columns):
            yield page, self._engine(engine, page)
        if self.measured is not None:
            yield addresses.BENCHMARK, self._benchmark(self.measured)
        if self.hard is not None:
            yield addresses.HARD, self._hard(self.hard)
        if self.survey is not None:
            yield from self._robots(self.survey)

    @cached_property
    def _row_pages(self) -> dict[str, str]:
        return {row.name: row.page for row in self.site.rows if row.kind != "robot"}

    @cached_property
    def _cell_pages(self) -> dict[tuple[str, str, str], str]:
        return {(cell.row, cell.column, cell.quantity): cell.page for cell in [*self.site.cells, *self.site.quantities]}

    @cached_property
    def _hard_anchors(self) -> dict[str, str]:
        words = addresses.slugs(family.name for family in self.hard.families) if self.hard else {}
        return {name: f"hard-{word}" for name, word in words.items()}

    def _index(self) -> Drawn:
        outcomes = sorted({cell.outcome for cell in self.site.cells})
        return draw(
            "index.html",
            addresses.INDEX,
            charts.plots(self.summary) if self.summary else {},
            run=self.run,
            site=self.site,
            summary=self.summary,
            measured=self.measured,
            hard=self.hard,
            robots=self.survey.found if self.survey else None,
            cell_pages=self._cell_pages,
            subject_styles=styles(self.summary.subjects) if self.summary else {},
            matrix=site_tables.matrix(self.site),
            engines=site_tables.engines(self.site),
            changes=site_tables.changes(self.site),
            outcomes=outcomes,
            features=sorted({feature for row in self.site.rows for feature in row.features}),
            key={verdict: KEY[verdict] for verdict in KEY if any(cell.verdict == verdict for cell in self.site.cells)},
        )

    def _mechanism(self, row: SiteRow) -> Drawn:
        summary, measured, hard = self.summary, self.measured, self.hard
        records = summary.of_system(row.name) if summary else []
        is_measured = measured is not None and row.name in measured.systems
        plots = charts.plots_of(summary, row.name) if summary else {}
        plots |= benchmark_charts.plots_of(measured, row.name) if measured is not None and is_measured else {}
        subjects = list(dict.fromkeys(record.subject for record in records))
        families = [family for family in hard.families if row.name in family.systems] if hard else []
        return draw(
            "mechanism.html",
            row.page,
            plots,
            row=row,
            card=summary.cards.get(row.name) if summary else None,
            picture=summary.pictures.get(row.name, "") if summary else "",
            records=records,
            quantities=site_tables.quantities(self.site, row.name),
            further=[record for record in summary.further if record.system == row.name and record.is_noteworthy] if summary else [],
            verdicts=verdicts_on(summary, row.name) if summary else None,
            trends=trends_on(summary, row.name) if summary else None,
            changes=site_tables.changes(self.site, row.name),
            differs=[finding for finding in summary.differs if finding.system == row.name] if summary else [],
            told={subject: [record for record in records if record.subject == subject] for subject in subjects},
            places=addresses.slugs(summary.subjects) if summary else {},
            causes={subject: cause for (system, subject), cause in summary.causes.items() if system == row.name} if summary else {},
            cases={case.subject: case for cases in summary.worst_cases.values() for case in cases if case.system == row.name}
            if summary
            else {},
            upstream={subject: self._issues(subject, row.features) for subject in subjects},
            measured=measured if is_measured else None,
            subject_styles=styles(summary.subjects) if summary else {},
            method_styles=benchmark_charts.method_styles(measured) if measured else {},
            quantity_styles=benchmark_charts.quantity_styles(measured) if measured else {},
            derivative_styles=benchmark_charts.derivative_styles(measured) if measured else {},
            integrator_styles=styles(measured.integrators) if measured else {},
            families=families,
            hard_anchors=self._hard_anchors,
        )

    def _issues(self, subject: str, features: Sequence[str]) -> list[Any]:
        engine = site_data.split(subject)[0]
        return [issue for feature in features for issue in upstream.of_feature(engine, feature)]

    def _engine(self, engine: str, page: str) -> Drawn:
        own = {column.name for column in self.site.columns if column.engine == engine}
        lines = [line for line in self.site.features if line.column in own]
        records = [record for record in self.summary.records if record.subject in own] if self.summary else []
        issues = {name: upstream.of_feature(engine, name) for name in dict.fromkeys(line.feature for line in lines)}
        return draw(
            "engine.html",
            page,
            {},
            engine=engine,
            counts=[count for count in self.site.counts if count.engine == engine],
            subjects=site_tables.subjects(self.site, engine),
            features=site_tables.features(lines, engine),
            feature_issues={name: found for name, found in issues.items() if found},
            findings=[finding for finding in self.site.findings if finding.engine == engine],
            red=[cell for cell in self.site.cells if cell.column in own and not cell.agrees],
            worst_cases={subject: cases for subject, cases in self.summary.worst_cases.items() if subject in own} if self.summary else {},
            worst=worst(records),
            hard_sizes={subject: self.hard.sizes(subject) for subject in self.hard.subjects if subject in own} if self.hard else {},
            readings=self._readings(engine),
            row_pages=self._row_pages,
            cell_pages=self._cell_pages,
        )

    def _readings(self, engine: str) -> Table:
        """A row for each reading of an engine that applies to a robot of the survey."""
        found: dict[tuple[str, str], list[float]] = {}
        for subject in self.survey.found.subjects if self.survey else ():
            for reading in subject.readings if subject.engine == engine and not subject.aided else ():
                found.setdefault((reading.sentence, reading.source), []).append(reading.alone or 0.0)
        rows = [[sentence, len(alone), max(alone), source] for (sentence, source), alone in sorted(found.items())]
        heads = [Column("files", "count"), Column("alone it moves qdd by", "error")]
        return Table(["reading", *heads, "source"], rows, f"Readings of {engine} that apply to the robots of the survey")

    def _benchmark(self, measured: BenchmarkSummary) -> Drawn:
        return draw(
            "benchmark_page.html",
            addresses.BENCHMARK,
            benchmark_charts.plots(measured),
            run=self.run,
            benchmark=measured,
            method_styles=benchmark_charts.method_styles(measured),
            cost_pages={system: f"{self._row_pages[system]}#cost" for system in measured.systems},
            fronts=self._fronts(measured),
        )

    def _fronts(self, measured: BenchmarkSummary) -> Table:
        rows: list[list[object]] = []
        for system in measured.systems:
            accelerations = [way_of(cost) for cost in acceleration_front(measured.accelerations(system))]
            motions = [way_of(cost) for cost in motion_front(measured.motion(system), "seconds")]
            rows.append([Cell(system, link=f"{self._row_pages[system]}#cost"), "; ".join(accelerations), "; ".join(motions)])
        return Table(["system", "accelerations", "motion, by wall time"], rows, "Pareto front of each system", "matrix")

    def _hard(self, hard: HardSummary) -> Drawn:
        about = {"hard_styles": styles(hard.subjects), "hard_anchors": self._hard_anchors}
        return draw("hard_page.html", addresses.HARD, hard_charts.plots(hard), run=self.run, hard=hard, **about)

    def _robots(self, survey: Survey) -> Iterator[tuple[str, Drawn]]:
        found, names = published(survey.found), short_names(survey.found)
        pages = {row.name: row.page for row in self.site.rows if row.kind == "robot"}
        places = {file.path: pages[file.path] for file in found.files}
        before = survey.before and (survey.before[0], published(survey.before[1]))
        sections = [*comparison.survey_sections(found, places, before, [published(one, names) for one in survey.earlier])]
        title = f"Robots of {survey.run.profile.removeprefix('survey ')}"
        yield addresses.ROBOTS, draw("robot.html", addresses.ROBOTS, {}, title=title, run=survey.run, sections=sections, is_one=False)
        for file in found.files:
            own = [*comparison.robot_sections(found, file)]
            yield places[file.path], draw("robot.html", places[file.path], {}, title=file.path, run=None, sections=own, is_one=True)


def published(found: FilesComparison, names: dict[str, str] | None = None) -> FilesComparison:
    """A comparison whose files are named from the folder that all share: pages are published, and say nothing of this machine."""
    short = names or short_names(found)
    return FilesComparison(
        files=[replace(one, path=short.get(one.path, one.path)) for one in found.files],
        subjects=[replace(one, path=short.get(one.path, one.path)) for one in found.subjects],
        pairs=list(found.pairs),
        equalities=[replace(one, path=short.get(one.path, one.path)) for one in found.equalities],
    )
