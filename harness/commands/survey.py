"""``harness survey``."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import click

from harness.commands import ROBOT
from harness.commands.frame.bracket import Bracket, computing
from harness.commands.frame.options import states_option, subjects_option
from harness.commands.frame.pages import tell, write_page
from harness.commands.frame.terminal import say
from harness.results.detail import Detail
from harness.storage import write_atomically

if TYPE_CHECKING:
    from harness.report.comparison import Section
    from harness.results.comparison import FilesComparison

SECTION = ROBOT


@click.command("survey")
@click.argument("places", nargs=-1, required=True, metavar="FOLDER|PACKAGE...")
@click.option(
    "--against",
    metavar="FOLDER",
    type=click.Path(path_type=Path),
    help="Say what changed against this earlier state of the folder.",
)
@click.option("--markdown", "markdown_path", metavar="FILE", help="Write what is printed, with every robot, to this file as Markdown.")
@states_option(32, "file")
@subjects_option
@computing(time_limit=300.0, library=False, directory=True, floating_base=True, detail=True)
def command(
    bracket: Bracket, places: tuple[str, ...], against: Path | None, markdown_path: str | None, states: int, subjects: tuple[str, ...]
) -> None:
    """Compare engines on every robot of a FOLDER or PACKAGE.

    Finds URDF and MJCF files by their root elements, and USD stages. The output begins with the number of
    robots on which all engines agree. A line for each engine follows, and a row for each other robot: what
    every engine makes of it, the readings that explain most, and the links with impossible inertias.
    `harness compare FILE` shows one robot in full. A file that cannot be read is a row too.
    Adds the page robots.html to the report, with the trend of earlier surveys of the same places, and says
    what has changed since the last one.

    With --against, the output begins with the robots that differ from those in that folder, such as a
    checkout of another commit. Two lines for each say which number differs at which line, and which engine
    gives a different answer. The report stays as it is.

    \b
    Examples:
      harness survey robots/
      harness survey example_robot_data --out reports
      harness survey robots/ --against ../main --markdown summary.md
    """
    from harness.comparison.collection import files_before, find_files, is_as_before
    from harness.comparison.study import ComparisonSettings, RobotComparison
    from harness.report.comparison import Section, markdown_of
    from harness.report.site_tables import ROBOTS
    from harness.report.survey import survey_sections
    from harness.results.comparison import FilesComparison, survey_profile
    from harness.results.survey_conclusion import conclude_changes, survey_summary

    before = {} if against is None else files_before(places, against)
    # The earlier state may lie in one of the places.
    paths = [path for path in find_files(places) if against is None or not path.resolve().is_relative_to(against.resolve())]
    pairs = [(before[path], path) for path in paths if path in before and not is_as_before(path, before[path])]
    asked, floating = (*paths, *(old for old, _ in pairs)), bracket.floating_base
    study = RobotComparison(ComparisonSettings(asked, states, bracket.seed, floating, pairs=pairs, subjects=subjects), "survey")
    profile, here = survey_profile(places, floating), {str(path): str(path) for path in paths}
    earlier = None if against is not None else bracket.history.latest(FilesComparison, bracket.library.name, profile)
    bracket.begin(states, profile, FilesComparison if against is None else None)

    def told(found: FilesComparison, detail: Detail) -> Iterator[Section]:
        if against is not None:
            changed = conclude_changes(found, list(here), {str(path): str(old) for path, old in before.items()}, str(against))
            yield Section(changed.sentence, changed.rows, is_answer=True)
        yield from survey_sections(found.among(here), detail, earlier)

    found = tell(bracket, study, told, lambda found: survey_summary(found.among(here)))
    if markdown_path is not None:
        write_atomically(markdown_path, markdown_of(told(found, Detail.ALL)))
    if against is None:
        write_page(bracket)
        say("", f"page: {bracket.directory / ROBOTS}")
    bracket.finish(study.faults, study.crashed, found.among(here).as_expected)
