"""``harness survey``."""

from __future__ import annotations

import click

from harness.commands import ROBOT
from harness.commands.frame.bracket import Bracket, computing
from harness.commands.frame.options import states_option, subjects_option
from harness.commands.frame.pages import tell, write_page
from harness.commands.frame.terminal import say

SECTION = ROBOT


@click.command("survey")
@click.argument("places", nargs=-1, required=True, metavar="FOLDER|PACKAGE...")
@states_option(32, "file")
@subjects_option
@computing(time_limit=300.0, library=False, directory=True, floating_base=True, detail=True)
def command(bracket: Bracket, places: tuple[str, ...], states: int, subjects: tuple[str, ...]) -> None:
    """Compare engines on every robot of a FOLDER or PACKAGE.

    Finds URDF and MJCF files by their root elements. Begins with how many robots every engine agrees
    on; a line for each engine follows, and a row for each other robot: what every engine makes of it,
    the readings that explain most, and the links that no body can be.
    `harness compare FILE` shows one of them in full. A file without meaning is a row too.
    Adds the page robots.html to the report, with the trend of the last surveys of the same places, and says what changed since the last.

    \b
    Examples:
      harness survey robots/
      harness survey example_robot_data --out reports
    """
    from harness.comparison.collection import find_files
    from harness.comparison.study import ComparisonSettings, RobotComparison
    from harness.report.site_tables import ROBOTS
    from harness.report.survey import survey_sections
    from harness.results.comparison import FilesComparison, survey_profile
    from harness.results.survey_conclusion import survey_summary

    paths, floating = tuple(find_files(places)), bracket.floating_base
    study = RobotComparison(ComparisonSettings(paths, states, bracket.seed, floating, pairwise=False, subjects=subjects), "survey")
    profile = survey_profile(places, bracket.floating_base)
    before = bracket.history.latest(FilesComparison, bracket.library.name, profile)
    bracket.begin(states, profile, FilesComparison)
    found = tell(bracket, study, lambda found, detail: survey_sections(found, detail, before), survey_summary)
    write_page(bracket)
    say("", f"page: {bracket.directory / ROBOTS}")
    bracket.finish(study.faults, study.crashed, found.as_expected)
