"""``harness compare``."""

from __future__ import annotations

from pathlib import Path

import click

from harness.commands.frame.bracket import Bracket, computing
from harness.commands.frame.options import subjects_option
from harness.commands.frame.robots import compare_robots
from harness.commands.frame.terminal import print_section, say


@click.command("compare")
@click.argument("files", nargs=-1, required=True, metavar="FILE...", type=click.Path(path_type=Path))
@click.option(
    "--map", "renamed", multiple=True, metavar="JOINT=OTHER", help="Joint of the first file, and its name in another; repeatable."
)
@click.option("--states", type=click.IntRange(min=1), default=64, show_default=True, help="States per file.")
@click.option("--steps", type=click.IntRange(min=1), help="Compare the motions of two engines after so many steps instead.")
@click.option(
    "--by",
    multiple=True,
    metavar="ENGINE/INTEGRATOR[@SECONDS]",
    help="Who moves the first file, and who the second or the same one; with --steps, twice. SECONDS is the step length.",
)
@click.option("--start", default="", metavar="JSON", help='With --steps: {"q": [...], "v": [...]} by the joints of the first file.')
@click.option("--html", "html_path", type=click.Path(dir_okay=False), help="Write one offline page to this file.")
@subjects_option
@computing(time_limit=300.0, library=False, floating_base=True)
def command(
    bracket: Bracket,
    files: tuple[Path, ...],
    renamed: tuple[str, ...],
    subjects: tuple[str, ...],
    states: int,
    steps: int | None,
    by: tuple[str, ...],
    start: str,
    html_path: str | None,
) -> None:
    """Compare engines on a robot's FILE, or several FILEs.

    FILE is a URDF or an MJCF, as its root element says. Prints what the file is, what no body
    can have, what each engine makes of it and why, and whether several files are one robot.
    Plain is an engine as its user calls it; aided, one with what it leaves out of the file supplied.
    The exit status is 0 where every answer is explained and all files are one robot.

    With --steps two engines, or two integrators, move the robot from one start. Prints how much of the
    gap between them is due to the equations that they read, to the integrator and to the step length,
    and what rounding has in it. An engine without integrators is stepped by its accelerations.

    \b
    Examples:
      harness compare robot.urdf
      harness compare robot.urdf robot.xml --map shoulder=joint1
      harness compare robot.urdf --subject mujoco@3.13.0/urdf
      harness compare robot.urdf --floating-base --html robot.html
      harness compare r.xml --steps 100 --by mujoco/Euler --by mujoco/RK4@0.001
    """
    if steps is not None:
        _compare_motions(bracket, files, dict(map(_names, renamed)), steps, by, start, html_path)
        return
    if by or start:
        raise click.UsageError("--by and --start are for motions; add --steps")
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


def _compare_motions(
    bracket: Bracket, files: tuple[Path, ...], renamed: dict[str, str], steps: int, by: tuple[str, ...], start: str, html_path: str | None
) -> None:
    """Print the gap between two motions, and end the command."""
    from harness.comparison.gap_study import By, GapStudy, Settings
    from harness.report.comparison import gap_sections

    if len(files) > 2 or len(by) != 2 or html_path is not None:
        raise click.UsageError("--steps takes one file or two, --by twice, and no --html")
    settings = Settings(
        (files[0], files[-1]), (By.parsed(by[0]), By.parsed(by[1])), steps, bracket.floating_base, tuple(renamed.items()), start
    )
    study = GapStudy(settings)
    bracket.begin(1, "gap")
    found = bracket.complete(study, lambda: vars(study.result()))
    for number, section in enumerate(gap_sections(found)):
        say(*([""] if number else []), section.title)
        print_section(section.parts)
    bracket.finish(study.problems, study.crashed, bool(found.gaps))


def _names(text: str) -> tuple[str, str]:
    """Raises click.BadParameter where ``text`` is not JOINT=OTHER."""
    one, _, other = text.partition("=")
    if not one or not other:
        raise click.BadParameter(f"{text!r}: expected JOINT=OTHER, a joint of the first file and its name in another", param_hint="--map")
    return one, other
