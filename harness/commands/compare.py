"""``harness compare``."""

from __future__ import annotations

from pathlib import Path

import click

from harness.commands._bracket import Bracket, computing
from harness.commands._options import subjects_option
from harness.commands._robots import compare_robots
from harness.commands._terminal import say


@click.command("compare")
@click.argument("files", nargs=-1, required=True, metavar="FILE...", type=click.Path(path_type=Path))
@click.option(
    "--map", "renamed", multiple=True, metavar="JOINT=OTHER", help="Joint of the first file, and its name in another; repeatable."
)
@click.option("--states", type=click.IntRange(min=1), default=64, show_default=True, help="States per file.")
@click.option("--html", "html_path", type=click.Path(dir_okay=False), help="Write one offline page to this file.")
@subjects_option
@computing(time_limit=300.0, library=False, floating_base=True)
def command(
    bracket: Bracket, files: tuple[Path, ...], renamed: tuple[str, ...], subjects: tuple[str, ...], states: int, html_path: str | None
) -> None:
    """Compare engines on a robot's FILE, or several FILEs.

    FILE is a URDF or an MJCF, as its root element says. Prints what the file is, what no body
    can have, what each engine makes of it and why, and whether several files are one robot.
    Plain is an engine as its user calls it; aided, one with what it leaves out of the file supplied.
    The exit status is 0 where every answer is explained and all files are one robot.

    \b
    Examples:
      harness compare robot.urdf
      harness compare robot.urdf robot.xml --map shoulder=joint1
      harness compare robot.urdf --subject drake/urdf --subject mujoco@3.13.0/urdf
      harness compare robot.urdf --floating-base --html robot.html
    """
    from harness.comparison.study import RobotComparison, Settings
    from harness.report.comparison import render, sections
    from harness.storage import write_atomically

    settings = Settings(
        tuple(dict.fromkeys(files)), states, bracket.seed, bracket.floating_base, dict(map(_names, renamed)), subjects=subjects
    )
    study = RobotComparison(settings)
    title = ", ".join(path.name for path in settings.paths)
    bracket.begin(states, "compare")
    found = compare_robots(bracket, study, sections)
    if html_path is not None:
        write_atomically(html_path, render(bracket.run, title, sections(found)))
        say("", f"page: {html_path}")
    bracket.finish(study.problems, study.crashed, found.as_expected)


def _names(text: str) -> tuple[str, str]:
    """Raises click.BadParameter where ``text`` is not JOINT=OTHER."""
    one, _, other = text.partition("=")
    if not one or not other:
        raise click.BadParameter(f"{text!r}: expected JOINT=OTHER, a joint of the first file and its name in another", param_hint="--map")
    return one, other
