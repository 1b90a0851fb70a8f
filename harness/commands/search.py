"""``harness search``."""

from __future__ import annotations

import sys

import click

from harness.commands._options import json_option, library_option, long_time_limit_option, seed_option, told, workers_option


@click.command("search")
@click.argument("name")
@click.option("--subject", "subjects", multiple=True, metavar="ENGINE/FORMAT", help="Only this subject; repeatable.")
@click.option("--budget", type=click.IntRange(min=1), show_default="8000", help="States to ask a subject for.")
@click.option("--keep/--no-keep", default=True, show_default=True, help="Store what is found with the system, for every later run.")
@seed_option
@library_option
@json_option
@workers_option
@long_time_limit_option
@told
def command(
    name: str,
    subjects: tuple[str, ...],
    budget: int | None,
    keep: bool,
    seed: int,
    library_path: str | None,
    json_path: str | None,
    workers: int | None,
    time_limit: float,
) -> None:
    """Search for the hardest states of NAME.

    Stores with the system the states at which each subject does worst; every later run compares them again.

    Example: harness search chain_10 --subject mujoco/mjcf
    """
    from harness.check.description import describe_run
    from harness.commands._terminal import progress
    from harness.engines import select_subjects
    from harness.hard.search import DEFAULT_BUDGET, SearchSettings, hunts, run_search
    from harness.library import Library
    from harness.results.records import write_json
    from harness.results.search import as_lines
    from harness.workers import Workers

    library = Library.at(library_path)
    settings = SearchSettings(
        library=library,
        name=name,
        subjects=subjects,
        budget=budget or DEFAULT_BUDGET,
        seed=seed,
        keep=keep,
        replay_options=["--library", library_path] if library_path else [],
    )
    run = describe_run(library, settings.budget, seed, "search", ["harness", *sys.argv[1:]])
    pool = Workers(workers, time_limit=time_limit)
    # The equations, then of each subject its hunts and what they found.
    steps = 1 + (len(hunts(settings.budget)) + 1) * len(select_subjects(library, subjects, native_only=True))
    with pool, progress(steps, "search") as advance:
        result = run_search(settings, pool, advance)
    if json_path:
        write_json(json_path, run, [], further={"search": result.to_json()})
    for line in as_lines(result):
        click.echo(line)
    sys.exit(result.status)
