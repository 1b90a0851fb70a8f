"""``harness report``."""

from __future__ import annotations

import functools

import click

from harness.commands._bracket import Bracket, computing
from harness.commands._cross_check import cross_check, finish
from harness.commands._options import STATES_OF_PROFILE
from harness.commands._page import write_page


@click.command("report")
@click.option(
    "--profile", type=click.Choice(sorted(STATES_OF_PROFILE)), default="quick", show_default=True, help="How many states per system."
)
@computing(time_limit=60.0, scheduler=True, directory=True)
def command(bracket: Bracket, profile: str) -> None:
    """Cross-check everything and write the report.

    Example: harness report --profile nightly --out night
    """
    from harness.check.settings import Settings
    from harness.hard.worst_cases import ranked

    states = STATES_OF_PROFILE[profile]
    settings = Settings(library=bracket.library, states=states, seed=bracket.seed, replay_options=bracket.replay_options)
    history = bracket.history
    run = bracket.begin(states, profile)
    identifier = history.begin(run)
    study, causes = cross_check(bracket, settings, functools.partial(history.append, identifier))
    for cause in causes:
        history.append(identifier, cause)
    ranking = ranked(bracket.library, run, study.result().records, bracket.pool, replay_options=bracket.replay_options)
    history.append_worst_cases(identifier, ranking)
    write_page(bracket.directory, history, bracket.library.name, identifier)
    finish(bracket, study, causes)
