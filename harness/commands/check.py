"""``harness check``."""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from harness.commands._cross_check import cross_check_all, finish
from harness.commands._options import (
    PROFILES,
    json_option,
    library_option,
    scheduler_option,
    seed_option,
    time_limit_option,
    told,
    workers_option,
)

if TYPE_CHECKING:
    from harness.workers import Scheduler


@click.command("check")
@click.argument("names", nargs=-1, metavar="[NAME]...")
@click.option("--states", type=click.IntRange(min=1), default=PROFILES["quick"], show_default=True, help="States per system.")
@seed_option
@click.option("--subject", "subjects", multiple=True, metavar="ENGINE/FORMAT", help="Only this subject; repeatable.")
@library_option
@click.option("--mjcf", type=click.Path(), help="Stands in for the one system's MJCF model.")
@click.option("--urdf", type=click.Path(), help="Stands in for the one system's URDF model.")
@click.option("--state", help='Replay one state: {"q": [...], "v": [...], "tau": [...]}.')
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
    mjcf: str | None,
    urdf: str | None,
    state: str | None,
    json_path: str | None,
    workers: int | None,
    scheduler: Scheduler | None,
    time_limit: float,
) -> None:
    """Cross-check NAMEs, or every mechanism, and print a table."""
    from harness.check.description import describe_run
    from harness.check.settings import Settings
    from harness.library import Library

    stand_ins = {name: Path(path) for name, path in (("mjcf", mjcf), ("urdf", urdf)) if path}
    options = [("--library", library_path), ("--mjcf", mjcf), ("--urdf", urdf)]
    settings = Settings(
        library=Library.at(library_path),
        names=names,
        subjects=subjects,
        states=states,
        seed=seed,
        stand_ins=stand_ins,
        state=_parse_state(state),
        replay_options=[word for option, value in options if value for word in (option, value)],
    )
    run = describe_run(settings.library, states, seed, "check", ["harness", *sys.argv[1:]])
    finish(*cross_check_all(settings, run, workers, scheduler, time_limit, json_path))


def _parse_state(text: str | None) -> Any:
    """One state from JSON.

    Raises:
        click.BadParameter: it is not {"q": numbers, "v": numbers, "tau": numbers} of one length.
    """
    if text is None:
        return None
    from harness.equations.states import States

    try:
        data = json.loads(text)
        parts = [[float(value) for value in data[key]] for key in ("q", "v", "tau")]
    except (ValueError, TypeError, KeyError) as error:
        raise click.BadParameter('expected {"q": [...], "v": [...], "tau": [...]} with numbers', param_hint="--state") from error
    if not all(math.isfinite(value) for part in parts for value in part):
        raise click.BadParameter("every number must be finite", param_hint="--state")
    if len(parts[1]) != len(parts[2]):
        raise click.BadParameter("v and tau must have the same length", param_hint="--state")
    return States.at(*parts)
