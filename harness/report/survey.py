"""A survey of robots in sections, for the terminal and for its page; it computes nothing."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from harness.report.comparison import Section, rest
from harness.report.sparkline import Sparkline
from harness.results.comparison import FilesComparison, names_apart, short_names
from harness.results.detail import Detail
from harness.results.run import Run
from harness.results.survey_conclusion import changes, conclude_survey, is_agreed, outcome_text, trends
from harness.results.table import Cell, Column, Table, counted

# Of which a trend is shown, this one among them.
MOST_SURVEYS = 12


def survey_sections(
    found: FilesComparison,
    detail: Detail = Detail.VERBOSE,
    before: tuple[Run, FilesComparison] | None = None,
    pages: Mapping[str, str] | None = None,
    earlier: Sequence[FilesComparison] = (),
) -> Iterator[Section]:
    """Sections of a survey: its answer, the robots that not every engine agrees on, and the changes since the survey ``before``.

    ``Detail.ALL`` adds the other robots; ``Detail.VERBOSE``, aided engines, who gave no answer, and the trend over surveys ``earlier``,
    of which the oldest stands first. ``pages`` are those of the robots, by path.
    """
    conclusion = conclude_survey(found)
    yield Section(conclusion.sentence, conclusion.rows, is_answer=True)
    yield Section("Robots and engines", [*_survey_table(found, detail, pages or {})])
    unexplained = rest(found, whole=detail == Detail.VERBOSE)
    if unexplained:
        yield Section("The rest", unexplained)
    if before is not None:
        yield Section(f"Since the survey of {before[0].started}", [*changes(before[1], found)] or ["nothing changed"])
    if earlier:
        yield Section("Trend", [_trend_table(earlier, found, pages or {})])


def _survey_table(found: FilesComparison, detail: Detail, pages: Mapping[str, str]) -> Iterator[Table | str]:
    """A row for each robot, a column for each subject; and how many robots have none."""
    stances = (False, True) if detail == Detail.VERBOSE else (False,)
    columns = [(engine, aided) for engine in sorted({subject.engine for subject in found.subjects}) for aided in stances]
    own = {
        (one.path, one.engine, one.aided): Cell(outcome_text(one), tone=one.tone, link=pages.get(one.path, ""))
        for one in reversed(found.subjects)
    }
    shown = [file for file in found.files if detail > Detail.BRIEF or not is_agreed(found, file)]
    names, rows = names_apart(file.path for file in found.files), list[list[object]]()
    for file in shown:
        impossible = counted(len(file.impossible), "link") if file.impossible else ""
        cells = [own.get((file.path, *column), "") for column in columns]
        rows.append([names[file.path], None if file.problem else file.degrees_of_freedom, *cells, impossible, file.problem])
    heads = [f"{engine} aided" if aided else engine for engine, aided in columns]
    caption = "Each engine's outcome, and the readings that move its accelerations most, each by as much of them as it does alone."
    table = Table(["robot", Column("dof", "count"), *heads, "unphysical", "problem"], rows, caption, "matrix")
    if rows:
        yield table.without(*(title for title in ("unphysical", "problem") if not any(row[-2 + (title == "problem")] for row in rows)))
    if left := len(found.files) - len(shown):
        yield f"{counted(left, 'more robot')} on which every engine agrees (--all)"


def _trend_table(earlier: Sequence[FilesComparison], found: FilesComparison, pages: Mapping[str, str]) -> Table:
    """A row for each robot, a line for each subject."""
    values, names = trends(earlier, found), short_names(found)
    columns = sorted({(subject.engine, subject.aided) for subject in found.subjects})
    rows = []
    for file in found.files:
        own = {(subject.engine, subject.aided): values[subject.path, subject.subject, subject.kind] for subject in found.of(file.path)}
        if any(own.values()):
            lines = [Sparkline(own[column]) if own.get(column) else "" for column in columns]
            rows.append([Cell(names[file.path], link=pages[file.path]), *lines])
    heads = [f"{engine} aided" if aided else engine for engine, aided in columns]
    caption = f"The worst backward error after readings, in data roundoffs, over the last surveys, {len(earlier) + 1} with this one."
    return Table(["robot", *heads], rows, caption)


def published(found: FilesComparison, names: Mapping[str, str] | None = None) -> FilesComparison:
    """A comparison whose files are named from the folder that all share: pages are published, and say nothing of this machine."""
    return found.among(names or short_names(found))
