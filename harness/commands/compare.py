"""``harness compare``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import click

from harness.commands import ROBOT
from harness.commands.frame.bracket import Bracket, computing
from harness.commands.frame.options import states_option, subjects_option, takes
from harness.commands.frame.pages import tell

SECTION = ROBOT


@dataclass(frozen=True, kw_only=True)
class CompareOptions:
    """Comparison that is asked for, of files or of motions."""

    files: Annotated[tuple[Path, ...], click.argument("files", nargs=-1, required=True, metavar="FILE...", type=click.Path(path_type=Path))]
    renamed: Annotated[
        tuple[str, ...],
        click.option(
            "--map", "renamed", multiple=True, metavar="JOINT=OTHER", help="Joint of the first file, and its name in another; repeatable."
        ),
    ]
    without: Annotated[
        tuple[str, ...],
        click.option(
            "--without",
            multiple=True,
            metavar="JOINT",
            help="Let this joint stand still in all files while they are held against each other; repeatable.",
        ),
    ]
    states: Annotated[int, states_option(64, "file")]
    steps: Annotated[
        int | None,
        click.option(
            "--steps",
            type=click.IntRange(min=1),
            help="Compare the motions of two engines after so many steps instead. With controls and contacts: harness drift.",
        ),
    ]
    by: Annotated[
        tuple[str, ...],
        click.option(
            "--by",
            multiple=True,
            metavar="ENGINE[/INTEGRATOR[@SECONDS]]",
            help="Who moves the first file, and who the second or the same one; with --steps, twice. SECONDS is the step length. "
            "Without it the first two engines, by the integrator that the file chooses.",
        ),
    ]
    start: Annotated[
        str,
        click.option("--start", default="", metavar="JSON", help='With --steps: {"q": [...], "v": [...]} by the joints of the first file.'),
    ]
    html_path: Annotated[
        str | None, click.option("--html", "html_path", type=click.Path(dir_okay=False), help="Write one offline page to this file.")
    ]
    subjects: Annotated[tuple[str, ...], subjects_option]


@click.command("compare")
@takes(CompareOptions)
@computing(time_limit=300.0, library=False, floating_base=True, detail=True)
def command(bracket: Bracket, asked: CompareOptions) -> None:
    """Compare engines on a robot's FILE, or several FILEs.

    FILE is a URDF, an MJCF or a USD file. The output begins with whether the engines agree with the file,
    or whether several files are the same robot. Then come the few rows that say why, each with its share of
    the acceleration, its lines and what to do. --verbose prints all that is known.
    A plain engine is called as its users call it; an aided one is given what it leaves out of the file.
    Joints that move in only one file are held still in both while the rest of the files is compared.
    The exit status is 0 if every answer is explained and all files are the same robot. It is 1 if an engine
    refuses a file, if an answer cannot be judged, or if there is no engine to ask, unless
    expected_robots.toml beside the file expects that.

    With --steps, two engines or two integrators move the robot from the same start. The output says how
    much of the gap between them is due to the equations that they read, the integrator, the step length
    and rounding. An engine without integrators is stepped by its accelerations. Nothing drives or touches
    the robot then; harness drift moves it with controls and contacts.

    \b
    Examples:
      harness compare robot.urdf
      harness compare robot.urdf robot.xml --map shoulder=joint1
      harness compare robot.urdf with_gripper.urdf --without finger
      harness compare robot.urdf --subject mujoco@3.13.0/urdf
      harness compare robot.urdf --floating-base --html robot.html
      harness compare robot.urdf --steps 100
      harness compare r.xml --steps 100 --by mujoco/Euler --by mujoco/RK4@0.001
    """
    renamed = _renamed(asked.renamed)
    if (renamed or asked.without) and len(set(asked.files)) == 1:
        raise click.UsageError("--map and --without are for files that are held against each other; name a second file")
    if asked.without and asked.steps is not None:
        raise click.UsageError("--without is for files held against each other; with --steps engines move whole files")
    if asked.steps is not None:
        _compare_motions(bracket, asked, asked.steps, renamed)
        return
    if asked.by or asked.start:
        raise click.UsageError("--by and --start are for motions; add --steps")
    from harness.comparison.study import ComparisonSettings, RobotComparison
    from harness.report.comparison import told
    from harness.results.pair_conclusion import summary

    settings = ComparisonSettings(
        tuple(dict.fromkeys(asked.files)),
        asked.states,
        bracket.seed,
        bracket.floating_base,
        renamed,
        asked.without,
        subjects=asked.subjects,
    )
    study = RobotComparison(settings)
    title = ", ".join(path.name for path in settings.paths)
    bracket.begin(asked.states, "compare")
    found = tell(bracket, study, told, summary, asked.html_path, title)
    bracket.finish(study.problems, study.crashed, found.as_expected)


def _compare_motions(bracket: Bracket, asked: CompareOptions, steps: int, renamed: dict[str, str]) -> None:
    """Print the gap between two motions, and end the command."""
    from harness.comparison.gap_study import GapSettings, GapStudy, beside_the_harness, first_two
    from harness.engines.moving import MovedBy
    from harness.report.comparison import gap_sections

    if len(asked.files) > 2 or len(asked.by) not in (0, 2) or asked.html_path is not None:
        raise click.UsageError("--steps takes one file or two, --by twice or not at all, and no --html")
    if asked.subjects:
        raise click.UsageError("--subject chooses whose accelerations are compared; with --steps, --by says who moves the files")
    first, second = (beside_the_harness(MovedBy.parsed(text)) for text in asked.by) if asked.by else first_two(asked.files)
    settings = GapSettings(
        (asked.files[0], asked.files[-1]),
        (first, second),
        steps,
        bracket.floating_base,
        tuple(renamed.items()),
        asked.start,
    )
    study = GapStudy(settings)
    bracket.begin(1, "gap")
    found = tell(bracket, study, gap_sections, lambda found: found.summary)
    bracket.finish(study.problems, study.crashed, bool(found.gaps))


def _renamed(texts: Sequence[str]) -> dict[str, str]:
    """Raises click.BadParameter where one of ``texts`` is not JOINT=OTHER, or where a joint has two partners."""
    found: dict[str, str] = {}
    for text in texts:
        one, _, other = text.partition("=")
        if not one or not other:
            expected = "expected JOINT=OTHER, a joint of the first file and its name in another"
            raise click.BadParameter(f"{text!r}: {expected}", param_hint="--map")
        if found.get(one, other) != other or other in (its for name, its in found.items() if name != one):
            raise click.BadParameter(f"{text!r} gives a joint a second partner; expected one for each", param_hint="--map")
        found[one] = other
    return found
