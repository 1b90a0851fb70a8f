"""``harness show``."""

from __future__ import annotations

from pathlib import Path

import click

from harness.commands import MECHANISM
from harness.commands.frame.bracket import Bracket, computing
from harness.commands.frame.pages import leave_page, tell
from harness.commands.frame.terminal import say
from harness.library import is_file

SECTION = MECHANISM


@click.command("show")
@click.argument("name", metavar="NAME|FILE")
@click.option("--html", "html_path", type=click.Path(dir_okay=False), help="Write one offline page with a picture to this file.")
@computing(time_limit=60.0, json=False, seed=False, workers=False, floating_base=True)
def command(bracket: Bracket, name: str, html_path: str | None) -> None:
    """Show equations, parameters and models of NAME.

    Prints the joints of both models side by side, and what each engine holds after loading.
    For a robot's FILE, prints what it holds, and which inertias no body can have.

    \b
    Examples:
      harness show collar
      harness show collar --html collar.html
      harness show robot.urdf
    """
    from harness.show.exhibit import Exhibition, as_text, render

    if is_file(bracket.library, name):
        _show_robot(bracket, Path(name), html_path)
    bracket.library.select([name], with_variants=True)
    bracket.workers = 1
    study = Exhibition(bracket.library, name, html_path is not None)
    exhibit = bracket.complete(study)
    for text in as_text(exhibit):
        say(*text.split("\n"))
    if html_path is not None:
        leave_page(html_path, render(exhibit, bracket.library.name, study.problems))
    bracket.finish(study.problems, study.crashed, not study.refused)


def _show_robot(bracket: Bracket, path: Path, html_path: str | None) -> None:
    """Print what a file is and what no body of it can have, write the same as a page, and end the command."""
    from harness.comparison.study import ComparisonSettings, RobotComparison
    from harness.report.comparison import file_sections

    study = RobotComparison(ComparisonSettings((path,), 1, floating_base=bracket.floating_base, stances=()), "reading")
    bracket.begin(1, "show")
    tell(bracket, study, lambda found, _: file_sections(found), html_path=html_path, title=path.name)
    bracket.finish(study.problems, study.crashed, not study.refused)
