"""``harness faults``."""

from __future__ import annotations

import sys
from dataclasses import asdict
from typing import TYPE_CHECKING

import click

from harness.commands._options import (
    AS_EXPECTED,
    CRASHED,
    NOT_AS_EXPECTED,
    PROFILES,
    json_option,
    library_option,
    scheduler_option,
    seed_option,
    tell,
    time_limit_option,
    told,
    workers_option,
)

if TYPE_CHECKING:
    from harness.fault_walk import Caught
    from harness.records import Run


@click.command("faults")
@click.argument("names", nargs=-1, metavar="[NAME]...")
@click.option("--states", type=click.IntRange(min=1), default=PROFILES["quick"], show_default=True, help="States per system.")
@seed_option
@click.option("--subject", "subjects", multiple=True, metavar="ENGINE/FORMAT", help="Only this subject; repeatable.")
@library_option
@json_option
@workers_option
@scheduler_option
@time_limit_option
@told
def command(
    names: tuple[str, ...],
    states: int,
    seed: int,
    subjects: tuple[str, ...],
    library_path: str | None,
    json_path: str | None,
    workers: int | None,
    scheduler: str | None,
    time_limit: float,
) -> None:
    """Change each number of the models of NAMEs and print the smallest change that is caught, beside theory."""
    from harness.description import describe_run
    from harness.errors import InvalidInput, InvalidRequest
    from harness.fault_walk import walk, walkable
    from harness.library import Library
    from harness.terminal import print_caught, progress
    from harness.workers import Task, Workers

    library = Library.at(library_path)
    run = describe_run(library, states, seed, "faults", ["harness", *sys.argv[1:]])
    pairs = walkable(library, names, subjects)
    caught: list[Caught] = []
    problems: list[Exception] = []
    crashed = False
    pool = Workers(workers, scheduler, time_limit)
    try:
        with pool, progress(len(pairs)) as advance:
            for outcome in pool.run(Task(pair, walk, (library, *pair, states, seed)) for pair in pairs):
                name, subject = outcome.task.key
                caught += outcome.value or []
                if outcome.crash is not None:
                    crashed = True
                    click.echo(f"harness: {name}, {subject}: {outcome.crash}", err=True)
                elif outcome.exception is not None:
                    problem = outcome.exception
                    problems.append(problem if isinstance(problem, InvalidInput) else InvalidRequest(f"{name}, {subject}: {problem}"))
                if json_path:
                    _write(json_path, run, caught)
                advance(f"{name} {subject}")
    except OSError as error:
        raise InvalidRequest(f"no cluster at {scheduler}: {error}; start one or drop --scheduler") from error
    caught.sort(key=lambda number: (number.system, number.subject, number.number.start))
    if json_path:
        _write(json_path, run, caught)
    print_caught(caught)
    tell(problems)
    if crashed:
        sys.exit(CRASHED)
    sys.exit(AS_EXPECTED if all(number.as_promised for number in caught) else NOT_AS_EXPECTED)


def _write(path: str, run: Run, caught: list[Caught]) -> None:
    """{"harness": versions, "run", "faults": [...]}."""
    from harness.records import dumps, write_atomically

    about = asdict(run)
    rows = [number.as_json() for number in caught]
    write_atomically(path, dumps({"harness": about.pop("versions"), "run": about, "faults": rows}, indent=2) + "\n")
