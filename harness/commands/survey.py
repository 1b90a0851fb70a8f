"""``harness survey``."""

from __future__ import annotations

import click

from harness.commands._bracket import Bracket, computing
from harness.commands._robots import compare_robots


@click.command("survey")
@click.argument("places", nargs=-1, required=True, metavar="FOLDER|PACKAGE...")
@click.option("--floating-base", is_flag=True, help="Put a free joint under the root link of each URDF.")
@click.option("--states", type=click.IntRange(min=1), default=32, show_default=True, help="States per file.")
@click.option("--html", "html_path", type=click.Path(dir_okay=False), help="Write one offline page to this file.")
@computing(time_limit=300.0, library=False)
def command(bracket: Bracket, places: tuple[str, ...], floating_base: bool, states: int, html_path: str | None) -> None:
    """Compare engines on every robot of a FOLDER or PACKAGE.

    Finds URDF and MJCF files by their root elements, and prints a row for each: the verdict of
    every engine, the reading that explains most, and the links that no body can be.
    `harness compare FILE` shows one of them in full. A file without meaning is a row too.

    \b
    Examples:
      harness survey robots/
      harness survey example_robot_data --html robots.html
    """
    from harness.comparison.collection import find_files
    from harness.comparison.study import RobotComparison, Settings
    from harness.report.comparison import render, survey_overview

    study = RobotComparison(Settings(tuple(find_files(places)), states, bracket.seed, floating_base, pairwise=False), "survey")
    title = f"Robots of {', '.join(places)}"
    found = compare_robots(
        bracket, study, "survey", survey_overview, lambda found: render(bracket.run, found, title, of_survey=True), html_path
    )
    bracket.finish(study.faults, study.crashed, found.as_expected)
