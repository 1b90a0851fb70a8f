"""``harness report``."""

from __future__ import annotations

import click

from harness.commands import STUDIES
from harness.commands.frame.bracket import Bracket, computing
from harness.commands.frame.cross_check import cross_check, finish
from harness.commands.frame.options import STATES_OF_PROFILE
from harness.commands.frame.pages import write_page

SECTION = STUDIES


@click.command("report")
@click.option(
    "--profile", type=click.Choice(sorted(STATES_OF_PROFILE)), default="quick", show_default=True, help="How many states per system."
)
@computing(time_limit=60.0, scheduler=True, directory=True)
def command(bracket: Bracket, profile: str) -> None:
    """Cross-check everything and write the report.

    Accelerations are compared at all states, the other quantities at a few.

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

    states = STATES_OF_PROFILE[profile]
    settings = Settings(
        library=bracket.library, states=states, seed=bracket.seed, componentwise=True, replay_options=bracket.replay_options
    )
    bracket.begin(states, profile, CrossCheckResult)
    study = cross_check(bracket, settings, brief=True)
    ranking = ranked(bracket.library, study.result().records, bracket.pool)
    bracket.keep(CrossCheckResult(worst_cases=ranking))
    bracket.complete(Gallery(bracket.library, bracket.library.select((), with_variants=True), study.crashes))
    write_page(bracket, bracket.number)
    finish(bracket, study)
