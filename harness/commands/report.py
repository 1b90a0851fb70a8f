"""``harness report``."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from harness.commands import STUDIES
from harness.commands.frame.bracket import Bracket, computing
from harness.commands.frame.cross_check import cross_check, finish
from harness.commands.frame.options import STATES_OF_PROFILE
from harness.commands.frame.pages import write_page
from harness.errors import require

if TYPE_CHECKING:
    from harness.comparison.study import RobotComparison

SECTION = STUDIES


@click.command("report")
@click.option(
    "--profile", type=click.Choice(sorted(STATES_OF_PROFILE)), default="quick", show_default=True, help="How many states per system."
)
@computing(time_limit=60.0, scheduler=True, directory=True, detail=True)
def command(bracket: Bracket, profile: str) -> None:
    """Cross-check everything and write the report.

    Accelerations are compared at all states, the other quantities at a few. The robots in the library's folder robots/ are asked of
    every engine as its user calls it.

    \b
    Examples:
      harness report
      harness report --profile nightly --out night
      harness report --library mine --out mine-report
    """
    from harness.crosscheck.settings import Settings
    from harness.hard.worst_cases import ranked
    from harness.results.cross_check import CrossCheckResult
    from harness.show.gallery import Gallery

    require("a report has charts", "bokeh")
    states = STATES_OF_PROFILE[profile]
    settings = Settings(
        library=bracket.library, states=states, seed=bracket.seed, componentwise=True, replay_options=bracket.replay_options
    )
    bracket.begin(states, profile, CrossCheckResult)
    robots = _robots(bracket)
    study = cross_check(bracket, settings, brief=True, robots=robots)
    ranking = ranked(bracket.library, study.result().records, bracket.pool)
    bracket.keep(CrossCheckResult(worst_cases=ranking))
    drawn = robots.settings.paths if robots else ()
    bracket.complete(Gallery(bracket.library, bracket.library.select((), with_variants=True), study.crashes, drawn))
    finish(bracket, study, robots=robots, leave=lambda: write_page(bracket, bracket.number))


def _robots(bracket: Bracket) -> RobotComparison | None:
    """The plain engines on the robots' files of the library, run to the end; None where it has none."""
    from harness.comparison.collection import find_files
    from harness.comparison.study import ComparisonSettings, RobotComparison
    from harness.library import Stance, robots_folder

    folder = robots_folder(bracket.library)
    if not folder.is_dir():
        return None
    paths = find_files([str(folder)])
    study = RobotComparison(ComparisonSettings(paths, seed=bracket.seed, pairs=(), stances=(Stance.PLAIN,)), "robots")
    bracket.complete(study)
    return study
