"""``harness report``."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from harness.commands._cross_check import cross_check_all, finish
from harness.commands._options import (
    PROFILES,
    directory_option,
    json_option,
    library_option,
    make_folder,
    scheduler_option,
    seed_option,
    time_limit_option,
    told,
    workers_option,
)
from harness.commands._page import write_page


@click.command("report")
@click.option("--profile", type=click.Choice(sorted(PROFILES)), default="quick", show_default=True, help="How many states per system.")
@directory_option
@seed_option
@library_option
@json_option
@workers_option
@scheduler_option
@time_limit_option
@told
def command(
    profile: str,
    directory: Path,
    seed: int,
    library_path: str | None,
    json_path: str | None,
    workers: int | None,
    scheduler: str | None,
    time_limit: float,
) -> None:
    """Cross-check everything and write the discrepancy report."""
    from harness.check.description import describe_run
    from harness.check.run import CrossCheck
    from harness.check.settings import Settings
    from harness.hard.worst_cases import ranked
    from harness.library import Library
    from harness.results.cross_check import CrossCheckResult
    from harness.results.history import History
    from harness.results.records import Record
    from harness.workers import Workers

    make_folder(directory)
    settings = Settings(
        library=Library.at(library_path),
        states=PROFILES[profile],
        seed=seed,
        replay_options=["--library", library_path] if library_path else [],
    )
    run = describe_run(settings.library, PROFILES[profile], seed, profile, ["harness", *sys.argv[1:]])
    with History(directory / "history.sqlite") as history:
        identifier = history.begin(run, CrossCheckResult)

        def keep(record: Record) -> None:
            history.append(identifier, CrossCheckResult(records=[record]))

        def keep_rest(cross_check: CrossCheck) -> None:
            history.append(identifier, CrossCheckResult(systems=cross_check.cards, superfluous=cross_check.superfluous))

        cross_check, records, causes = cross_check_all(settings, run, workers, scheduler, time_limit, json_path, keep, keep_rest)
        history.append(identifier, CrossCheckResult(causes=causes))
        with Workers(workers, scheduler, time_limit) as pool:
            worst = ranked(settings.library, run, records, pool, replay_options=settings.replay_options)
        history.append(identifier, CrossCheckResult(worst_cases=worst))
        write_page(directory, history, settings.library.name, identifier)
    finish(cross_check, records, causes)
