"""``harness faults``."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

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
    told,
    workers_option,
)

if TYPE_CHECKING:
    from harness.diagnose.faults.summary import Fault
    from harness.results.records import Run
    from harness.workers import Scheduler, Task


# What only a campaign does.
_OF_A_CAMPAIGN = {"kinds": "--kind", "sizes": "--size", "diagnoses": "--diagnoses", "every_diagnosis": "--every-diagnosis"}


@click.command("faults")
@click.argument("names", nargs=-1, metavar="[NAME]...")
@click.option("--kind", "kinds", multiple=True, metavar="KIND", help="Only this kind of fault; repeatable. An unknown one lists all.")
@click.option(
    "--size",
    "sizes",
    multiple=True,
    type=click.FloatRange(min=0, max=1, min_open=True),
    help="Relative size of a changed number; repeatable. Decades from 1e-12 to 1 by default.",
)
@click.option("--states", type=click.IntRange(min=1), default=PROFILES["quick"], show_default=True, help="States per system.")
@click.option(
    "--diagnoses",
    type=click.IntRange(min=0),
    default=4,
    show_default=True,
    help="Faults of each kind in each model that are diagnosed, spread evenly.",
)
@click.option("--every-diagnosis", is_flag=True, help="Diagnose every fault, which takes hours for the whole catalogue.")
@click.option("--smallest", is_flag=True, help="Only each number, and the smallest change of it that is caught, beside theory.")
@seed_option
@click.option("--subject", "subjects", multiple=True, metavar="ENGINE/FORMAT", help="With --smallest: only this subject; repeatable.")
@library_option
@json_option
@workers_option
@scheduler_option
@click.option(
    "--time-limit", type=click.FloatRange(min=0, min_open=True), default=36000.0, show_default=True, help="Seconds one model may take."
)
@told
def command(
    names: tuple[str, ...],
    kinds: tuple[str, ...],
    sizes: tuple[float, ...],
    states: int,
    diagnoses: int,
    every_diagnosis: bool,
    smallest: bool,
    seed: int,
    subjects: tuple[str, ...],
    library_path: str | None,
    json_path: str | None,
    workers: int | None,
    scheduler: Scheduler | None,
    time_limit: float,
) -> None:
    """Plant every kind of fault in the models of NAMEs, and print what is caught and what is named.

    Exit status 0 where every fault is caught that changes the dynamics, 95 % of those diagnosed are named first or in
    their class, and nobody sound is blamed.
    """
    from harness.check.description import describe_run
    from harness.commands._terminal import print_caught, print_kinds
    from harness.diagnose.faults.campaign import SIZES, CampaignSettings, campaigns, kinds_of_faults, run_campaign, without_campaign
    from harness.diagnose.faults.summary import broken_bars, by_kind
    from harness.diagnose.faults.walk import unwalkable, walk, walkable
    from harness.errors import InvalidRequest
    from harness.library import Library, nearest
    from harness.workers import Task, Workers

    if subjects and not smallest:
        raise InvalidRequest("--subject belongs to --smallest; a campaign plants its faults for every subject that reads the file")
    source = click.get_current_context().get_parameter_source
    given = [option for name, option in _OF_A_CAMPAIGN.items() if source(name) is not ParameterSource.DEFAULT]
    if given and smallest:
        raise InvalidRequest(f"--smallest plants no faults of a campaign and takes no {' or '.join(given)}; drop one or the other")
    for kind in kinds:
        if kind not in kinds_of_faults():
            known = "".join(f"\n  {name}: {title}" for name, title in kinds_of_faults().items())
            raise InvalidRequest(f"no fault is of kind {kind!r}; {nearest(kind, kinds_of_faults())} of{known}")
    library = Library.at(library_path)
    run = describe_run(library, states, seed, "faults", ["harness", *sys.argv[1:]])
    pool = Workers(workers, scheduler, time_limit)
    if smallest:
        tasks = [Task(pair, walk, (library, *pair, states, seed)) for pair in walkable(library, names, subjects)]
        caught, problems, crashed = _run(pool, tasks, lambda rows: _write(json_path, run, rows))
        caught.sort(key=lambda number: (number.system, number.subject, number.number.start))
        if caught:
            print_caught(caught)
        _print_left_out({(name, str(subject)): reason for (name, subject), reason in unwalkable(library, names, subjects).items()})
        broken = [] if all(number.as_promised for number in caught) else [""]
    else:
        settings = CampaignSettings(
            kinds=kinds, sizes=sorted(sizes) or SIZES, states=states, seed=seed, diagnosed=None if every_diagnosis else diagnoses
        )
        tasks = [Task(pair, run_campaign, (library, *pair, settings)) for pair in campaigns(library, names)]
        caught, problems, crashed = _run(pool, tasks, lambda rows: _write(json_path, run, rows))
        caught.sort(key=lambda fault: (fault.system, fault.format, fault.kind))
        if caught:
            print_kinds(by_kind(caught))
        elif tasks and not problems and not crashed:
            click.echo("no faults: mistakes of these kinds can be made nowhere in the models")
        _print_left_out(without_campaign(library, names))
        _print_faults(caught)
        cleared = sorted({fault.cleared for fault in caught if fault.cleared})
        if cleared:
            count = sum(bool(fault.cleared) for fault in caught)
            click.echo(f"{count} faults are felt by one reader alone ({', '.join(cleared)}); the diagnosis finds them in the file")
        broken = broken_bars(caught)
        for sentence in broken:
            click.echo(sentence)
    _write(json_path, run, caught)
    tell(problems)
    if crashed:
        sys.exit(CRASHED)
    sys.exit(NOT_AS_EXPECTED if broken else AS_EXPECTED)


def _run(pool: Any, tasks: Sequence[Task], write: Callable[[list[Any]], None]) -> tuple[list[Any], list[Exception], bool]:
    """Everything the tasks return, what went wrong, and whether a process died; what is there is written after each."""
    from harness.commands._terminal import progress
    from harness.errors import InvalidInput, InvalidRequest

    rows: list[Any] = []
    problems: list[Exception] = []
    crashed = False
    with pool, progress(len(tasks), "faults") as advance:
        for outcome in pool.run(tasks):
            name, what = outcome.task.key
            rows += outcome.value or []
            if outcome.crash is not None:
                crashed = True
                noted = f" at {outcome.crash.note}" if outcome.crash.note else ""
                click.echo(f"harness: {name}, {what}: {outcome.crash}{noted}", err=True)
            elif outcome.exception is not None:
                problem = outcome.exception
                problem = problem if isinstance(problem, InvalidInput) else InvalidRequest(f"{name}, {what}: {problem}")
                # Both models of a system may come upon the same.
                if str(problem) not in map(str, problems):
                    problems.append(problem)
            write(rows)
            advance(f"{name} {what}")
    return rows, problems, crashed


def _print_left_out(reasons: Mapping[tuple[str, str], str]) -> None:
    """One line for each system of which (system, subject or format) are expected to be unsupported, with the reason of the first."""
    for system in dict.fromkeys(name for name, _ in reasons):
        left_out = [(what, reason) for (name, what), reason in reasons.items() if name == system]
        click.echo(f"{system}: no {' and no '.join(what for what, _ in left_out)}, as expected: {left_out[0][1]}")


def _print_faults(faults: Sequence[Fault]) -> None:
    """A line for each fault that was not caught, not named, or blamed on somebody sound."""
    for fault in faults:
        if not fault.live:
            continue
        wrong = (
            [] if fault.caught else ["not caught" + (f" in size {', '.join(f'{size:g}' for size in fault.missed)}" if fault.missed else "")]
        )
        wrong += [f"blamed on {fault.blamed}"] if fault.blamed else []
        wrong += ["not named"] if fault.judged and not (fault.named or fault.in_class) else []
        if wrong:
            line, element, attribute = fault.where[0]
            size = f" by {fault.diagnosed:g}" if fault.sizes and fault.diagnosed else ""
            what = f"{fault.kind}{size}: {fault.statement}" if fault.statement else f"{fault.kind}{size}"
            answer = f"; {fault.answer}" if fault.answer else ""
            click.echo(f"{fault.system}/{fault.format}:{line}: <{element} {attribute}> {what}: {', '.join(wrong)}{answer}")


def _write(path: str | None, run: Run, rows: list[Any]) -> None:
    """{"harness": versions, "run", "faults": [...]}."""
    from harness.results.records import dumps
    from harness.storage import write_atomically

    if path:
        about = asdict(run)
        faults = [row.as_json() for row in rows]
        write_atomically(path, dumps({"harness": about.pop("versions"), "run": about, "faults": faults}, indent=2) + "\n")
