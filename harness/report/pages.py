"""The pages of the site: for each, its template and what stands on it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from harness.report import benchmark_charts, charts, comparison, site_tables
from harness.report import survey as robots
from harness.report.benchmarks import BenchmarkSummary
from harness.report.figures import styles
from harness.report.hard_cases import HardSummary
from harness.report.html import Drawn, draw
from harness.report.issue_texts import page_of, text_of
from harness.report.markup import thumbnail
from harness.report.site_counts import slugs
from harness.report.site_data import collect, issues, split
from harness.report.summary import Summary, trends_on, verdicts_on, worst
from harness.results.atlas import Atlas
from harness.results.benchmark import Benchmark
from harness.results.comparison import FilesComparison, short_names
from harness.results.cross_check import CrossCheckResult
from harness.results.detail import Detail
from harness.results.pareto import acceleration_front, motion_front, way_of
from harness.results.run import Run
from harness.results.site import SiteRow
from harness.results.table import Cell, Column, Table, counted, grouped
from harness.verdict import DECLARED, SOFT

# Looks of a cell and what they say. Shapes are the style sheet's, so that no verdict is told by its colour alone.
KEY = {
    "agrees": "right to rounding",
    DECLARED: "constraints give by the file's settings, as the engine documents; the cell says how far from rigid",
    "explained": "the engine reads the file otherwise, or departs from its own documentation, and it is known how",
    "unstable": "digits lost by the algorithm",
    "undecided": "no certified truth",
    "misreads": "another mechanism read, known which",
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

    @property
    def place(self) -> str:
        """Origin of the robots: the places of a survey, or the library of a report."""
        _, is_survey, places = self.run.profile.partition("survey ")
        return places if is_survey else f"the {self.run.library} library"


@dataclass
class Pages:
    """Everything that there is to show; ``drawn`` yields the pages with their addresses."""

    run: Run
    summary: Summary | None
    measured: BenchmarkSummary | None
    hard: HardSummary | None
    survey: Survey | None

    def __post_init__(self) -> None:
        # What was not measured is shown as if nothing had been found.
        self._verdicts = self.summary or Summary(self.run, CrossCheckResult())
        self._costs = self.measured or BenchmarkSummary(self.run, Benchmark())
        self._cases = self.hard or HardSummary(self.run, Atlas())
        self._files = self.survey.found if self.survey else FilesComparison()
        self.site = collect(self.run, self._verdicts, self._costs, self._cases, self._files)
        self._paths = {name: path for path, name in short_names(self._files).items()}
        self._has_changes = bool(self._verdicts.earlier or self.site.nights)
        self._row_pages = {row.name: row.page for row in self.site.rows if row.kind != "robot"}
        self._cell_pages = {(cell.row, cell.column, cell.quantity): cell.page for cell in [*self.site.cells, *self.site.quantities]}
        words = slugs(family.name for family in self._cases.families)
        self._hard_anchors = {name: f"hard-{word}" for name, word in words.items()}

    def drawn(self) -> Iterator[tuple[str, Drawn]]:
        """Address and page, the index first."""
        yield site_tables.INDEX, self._index()
        yield site_tables.ABOUT, draw("about.html", site_tables.ABOUT, {}, run=self.run)
        yield site_tables.DIFFERENCES, self._differences()
        if self._has_changes:
            yield site_tables.CHANGES, self._changes()
        for row in self.site.rows:
            if row.kind != "robot":
                yield row.page, self._mechanism(row)
        for engine, page in dict.fromkeys((column.engine, column.page) for column in self.site.columns):
            yield page, self._engine(engine, page)
        if self.measured is not None:
            yield site_tables.BENCHMARK, self._benchmark(self.measured)
        if self.hard is not None:
            yield site_tables.HARD, self._hard(self.hard)
        if self.survey is not None:
            yield from self._robots(self.survey)
        yield from self._issues()

    def _index(self) -> Drawn:
        tones = {cell.tone for cell in self.site.cells}
        drawings = {row.name: thumbnail(self._picture(row)) for row in self.site.rows}
        return draw(
            "index.html",
            site_tables.INDEX,
            {},
            run=self.run,
            site=self.site,
            summary=self.summary,
            measured=self.measured,
            hard=self.hard,
            systems=sum(row.kind == "mechanism" for row in self.site.rows),
            robots=sum(row.kind == "robot" for row in self.site.rows),
            cell_pages=self._cell_pages,
            matrix=site_tables.matrix(self.site, drawings),
            engines=site_tables.engines(self.site),
            own_code=site_tables.own_code(self.site),
            changed=self._changed() if self._has_changes else "",
            columns=site_tables.asked_columns(self.site),
            outcomes=sorted({cell.outcome for cell in self.site.cells}),
            features=sorted({feature for row in self.site.rows for feature in row.features}),
            key={tone: (SOFT if tone == DECLARED else tone, words) for tone, words in KEY.items() if tone in tones},
            about=site_tables.ABOUT,
            differences=site_tables.DIFFERENCES,
            changes=site_tables.CHANGES,
        )

    def _picture(self, row: SiteRow) -> str:
        """The drawing of a row; a variant looks like its mechanism."""
        return self._verdicts.pictures.get(self._paths.get(row.name) or row.name.partition(".")[0], "")

    def _changed(self) -> str:
        numbers = counted(sum(bool(trend.changes) for trend in self.site.trends), "number")
        runs = max(map(len, self.site.nights.values()), default=0)
        return f"{self._verdicts.changed} {f'{numbers} changed in the trend of {runs} runs.' if runs else ''}".strip()

    def _differences(self) -> Drawn:
        about = {"summary": self._verdicts, "cell_pages": self._cell_pages, "subject_styles": styles(self._verdicts.subjects)}
        return draw("differences.html", site_tables.DIFFERENCES, charts.plots(self._verdicts), **about)

    def _changes(self) -> Drawn:
        about = {"summary": self._verdicts, "site": self.site, "changes": site_tables.changes(self.site)}
        return draw(
            "changes.html", site_tables.CHANGES, charts.trend_plots(self._verdicts), subject_styles=styles(self._verdicts.subjects), **about
        )

    def _mechanism(self, row: SiteRow) -> Drawn:
        summary, measured, name = self._verdicts, self._costs, row.name
        records = summary.of_system(name)
        plots = charts.plots_of(summary, name) | benchmark_charts.plots_of(measured, name)
        subjects = list(dict.fromkeys(record.subject for record in records))
        return draw(
            "mechanism.html",
            row.page,
            plots,
            row=row,
            card=summary.cards.get(name),
            picture=summary.pictures.get(name, ""),
            records=records,
            quantities=site_tables.quantities(self.site, name),
            further=[record for record in summary.further if record.system == name and record.is_noteworthy],
            verdicts=verdicts_on(summary, name),
            trends=trends_on(summary, name),
            changes=site_tables.changes(self.site, name),
            differs=[finding for finding in summary.differs if finding.system == name],
            told={subject: [record for record in records if record.subject == subject] for subject in subjects},
            places=slugs(summary.subjects),
            causes={subject: cause for (system, subject), cause in summary.causes.items() if system == name},
            cases={case.subject: case for cases in summary.worst_cases.values() for case in cases if case.system == name},
            upstream={subject: issues(split(subject)[0], row.features) for subject in subjects},
            measured=measured if name in measured.systems else None,
            subject_styles=styles(summary.subjects),
            families=[family for family in self._cases.families if name in family.systems],
            hard_anchors=self._hard_anchors,
            **benchmark_charts.styles_of(measured),
        )

    def _engine(self, engine: str, page: str) -> Drawn:
        own = {column.name for column in self.site.columns if column.engine == engine}
        features = dict.fromkeys(line.feature for line in self.site.features if line.column in own)
        known = {name: issues(engine, [name]) for name in features}
        return draw(
            "engine.html",
            page,
            {},
            engine=engine,
            counts=[count for count in self.site.counts if count.engine == engine],
            subjects=site_tables.subjects(self.site, engine),
            features=site_tables.features(self.site, engine),
            feature_issues={name: found for name, found in known.items() if found},
            findings=[finding for finding in self.site.findings if finding.engine == engine],
            red=[cell for cell in self.site.cells if cell.column in own and not cell.agrees],
            worst_cases={subject: cases for subject, cases in self._verdicts.worst_cases.items() if subject in own},
            worst=worst(record for record in self._verdicts.records if record.subject in own),
            hard_sizes={subject: self._cases.sizes(subject) for subject in self._cases.subjects if subject in own},
            readings=self._readings(engine),
            row_pages=self._row_pages,
            cell_pages=self._cell_pages,
        )

    def _readings(self, engine: str) -> Table:
        """A row for each reading of an engine that applies to a robot of the survey."""
        asked = [subject for subject in self._files.subjects if subject.engine == engine and not subject.aided]
        found = grouped(((one.sentence, one.source), one.alone or 0.0) for subject in asked for one in subject.readings)
        rows = [[sentence, len(alone), max(alone), source] for (sentence, source), alone in sorted(found.items())]
        heads = [Column("files", "count"), Column("alone it moves qdd by", "error")]
        return Table(["reading", *heads, "source"], rows, f"Readings of {engine} that apply to the robots of the survey")

    def _benchmark(self, measured: BenchmarkSummary) -> Drawn:
        return draw(
            "benchmark_page.html",
            site_tables.BENCHMARK,
            benchmark_charts.plots(measured),
            run=self.run,
            benchmark=measured,
            cost_pages={system: f"{self._row_pages[system]}#cost" for system in measured.systems},
            fronts=self._fronts(measured),
            **benchmark_charts.styles_of(measured),
        )

    def _fronts(self, measured: BenchmarkSummary) -> Table:
        rows: list[list[object]] = []
        for system in measured.systems:
            accelerations = [way_of(cost) for cost in acceleration_front(measured.accelerations[system])]
            motions = [way_of(cost) for cost in motion_front(measured.motion[system], "seconds")]
            rows.append([Cell(system, link=f"{self._row_pages[system]}#cost"), "; ".join(accelerations), "; ".join(motions)])
        return Table(["system", "accelerations", "motion, by wall time"], rows, "Pareto front of each system", "matrix")

    def _hard(self, hard: HardSummary) -> Drawn:
        about = {"hard_styles": styles(hard.subjects), "hard_anchors": self._hard_anchors}
        return draw("hard_page.html", site_tables.HARD, charts.hard_plots(hard), run=self.run, hard=hard, **about)

    def _issues(self) -> Iterator[tuple[str, Drawn]]:
        """The texts for trackers that expected verdicts and hard cases link to."""
        links = [link for further in (False, True) for _, _, link in self._verdicts.expectations(further)]
        links += [reason.link for family in self._cases.families for _, reason in family.reasons]
        for link in dict.fromkeys(links):
            if page := page_of(link):
                title, _, text = text_of(link).partition("\n")
                yield page, draw("issue.html", page, {}, title=title.removeprefix("# "), text=text.strip())

    def _robots(self, survey: Survey) -> Iterator[tuple[str, Drawn]]:
        found, names = robots.published(survey.found), short_names(survey.found)
        pages = {row.name: row.page for row in self.site.rows if row.kind == "robot"}
        places = {file.path: pages[file.path] for file in found.files}
        before = survey.before and (survey.before[0], robots.published(survey.before[1]))
        sections = [
            *robots.survey_sections(found, Detail.VERBOSE, before, places, [robots.published(one, names) for one in survey.earlier])
        ]
        title = f"Robots of {survey.place}"
        yield (
            site_tables.ROBOTS,
            draw("robot.html", site_tables.ROBOTS, {}, title=title, run=survey.run, sections=sections, picture="", is_one=False),
        )
        drawings = {row.page: self._picture(row) for row in self.site.rows}
        for page, file in ((places[file.path], file) for file in found.files):
            about = {"sections": [*comparison.robot_sections(found, file)], "picture": drawings[page], "is_one": True}
            yield page, draw("robot.html", page, {}, title=file.path, run=None, **about)
