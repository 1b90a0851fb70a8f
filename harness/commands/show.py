"""``harness show``."""

from __future__ import annotations

import click

from harness.commands import MECHANISM
from harness.commands.frame.bracket import Bracket, computing
from harness.commands.frame.pages import leave_page
from harness.commands.frame.robots import show_robot
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
    Of a robot's FILE it prints what the file is, and what no body can have.

    \b
    Examples:
      harness show collar
      harness show collar --html collar.html
      harness show robot.urdf
    """
    from harness.show.exhibit import Exhibition, as_text, render

    if is_file(bracket.library, name):
        show_robot(bracket, name, html_path)
    bracket.library.select([name], with_variants=True)
    bracket.workers = 1
    study = Exhibition(bracket.library, name, html_path is not None)
    exhibit = bracket.complete(study)
    for text in as_text(exhibit):
        say(*text.split("\n"))
    leave_page(html_path, lambda: render(exhibit, bracket.library.name, study.problems))
    bracket.finish(study.problems, study.crashed, True)
