"""Command line: ``harness list``, ``show``, ``new``, ``check``, ``report``.

Exit status: 0 all verdicts as expected and nothing superfluous in a model; 1 not so; 2 bad usage or an
invalid model or system file; 3 an engine crashed or timed out.
"""

from __future__ import annotations

import functools
import json
import math
import shlex
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from harness import __version__
from harness.errors import InvalidInput, InvalidRequest

if TYPE_CHECKING:
    from harness.records import Record, Run
    from harness.run import CrossCheck, Settings

AS_EXPECTED, NOT_AS_EXPECTED, INVALID, CRASHED = 0, 1, 2, 3
# States per system of a report; the check command's own default is the same as quick.
PROFILES = {"quick": 1000, "nightly": 100_000}


@click.group(context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="harness")
def main() -> None:
    """Cross-check physics engines against certified accelerations of textbook mechanisms."""


def _told(command: Callable[..., None]) -> Callable[..., None]:
    """Turn the errors of input files and names into one message and exit status 2."""

    @functools.wraps(command)
    def wrapper(*arguments: Any, **options: Any) -> None:
        try:
            command(*arguments, **options)
        except (InvalidInput, InvalidRequest) as error:
            _tell([error])

    return wrapper


def _tell(problems: Sequence[Exception]) -> None:
    """Print each problem; exit with status 2 if there is one."""
    for problem in problems:
        click.echo(f"harness: {problem}", err=True)
    if problems:
        sys.exit(INVALID)


library_option = click.option(
    "--library",
    "library_path",
    metavar="DIR",
    help="Folder with systems/, mjcf/ and urdf/, or the name of an installed library, instead of the built-in one.",
)
seed_option = click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Seed of the sampled states.")
json_option = click.option("--json", "json_path", type=click.Path(dir_okay=False), help="Write versions and records to this file.")
workers_option = click.option("--workers", type=click.IntRange(min=1), help="Local worker processes; one per CPU by default.")
scheduler_option = click.option("--scheduler", metavar="ADDRESS", help="Use the dask.distributed cluster at this address.")
time_limit_option = click.option(
    "--time-limit",
    type=click.FloatRange(min=0, min_open=True),
    default=60.0,
    show_default=True,
    help="Seconds an engine may take over one batch.",
)


@main.command("list")
@library_option
@click.option("--json", "json_path", type=click.Path(dir_okay=False), help="Write the list to this file.")
@_told
def list_command(library_path: str | None, json_path: str | None) -> None:
    """Mechanisms with their degrees of freedom, and the engines available."""
    from harness.derivation import load_mechanism
    from harness.engines import engine_names, installed_version, load_engine
    from harness.library import Library, installed_libraries

    library = Library.at(library_path)
    installed = list(installed_libraries())
    problems: list[InvalidInput] = []
    systems: dict[str, tuple[int, str]] = {}
    for name in library.select(()):
        try:
            mechanism = load_mechanism(library, name)
        except InvalidInput as problem:
            problems.append(problem)
        else:
            systems[name] = mechanism.nv, mechanism.description.splitlines()[0]
    engines = {name: load_engine(library, name) for name in engine_names(library)}
    if json_path:
        from harness.records import write_atomically

        listed = {
            "systems": [{"name": name, "degrees_of_freedom": nv, "description": text} for name, (nv, text) in systems.items()],
            "engines": [
                {"name": name, "formats": engine.formats, "version": installed_version(engine)} for name, engine in engines.items()
            ],
            "libraries": installed,
        }
        write_atomically(json_path, json.dumps(listed, indent=2) + "\n")
    width = max(map(len, [*systems, *engines]))
    for name, (nv, text) in systems.items():
        click.echo(f"{name:<{width}}  {nv:>2} dof  {text}")
    click.echo()
    for name, engine in engines.items():
        click.echo(f"{name:<{width}}  {installed_version(engine) or 'not installed'}  ({', '.join(engine.formats)})")
    click.echo(f"\ninstalled libraries: {', '.join(installed) or 'none'}")
    _tell(problems)


@main.command()
@click.argument("name")
@click.option("--html", "html_path", type=click.Path(dir_okay=False), help="Write one offline page with a picture to this file.")
@library_option
@time_limit_option
@_told
def show(name: str, html_path: str | None, library_path: str | None, time_limit: float) -> None:
    """Equations, parameters, joints of both models, and what each engine holds."""
    from harness.library import Library
    from harness.show import as_text, look_at
    from harness.workers import Workers

    library = Library.at(library_path)
    library.select([name])
    exhibit = look_at(library, name, html_path is not None, Workers(1, time_limit=time_limit))
    for line in as_text(exhibit):
        click.echo(line)
    if html_path is not None:
        from harness.page import render
        from harness.records import write_atomically

        write_atomically(html_path, render(exhibit, library.name))
        click.echo(f"\npage: {click.format_filename(html_path)}")
    _tell(exhibit.problems)
    if exhibit.crashed:
        sys.exit(CRASHED)


@main.command()
@click.argument("name")
@click.option(
    "--dof", type=click.IntRange(1, 12), default=1, show_default=True, help="Degrees of freedom: plates of the chain that is the example."
)
@click.option(
    "--library",
    "library_path",
    metavar="DIR",
    default=".",
    help="Folder of the library, made where it is missing; the current one by default.",
)
@_told
def new(name: str, dof: int, library_path: str) -> None:
    """Write the three files of a mechanism NAME: a working example with the places to edit marked."""
    from harness.new import write_example

    for path in write_example(name, dof, Path(library_path)):
        click.echo(f"written: {click.format_filename(path)}")
    click.echo(f"edit what is marked EDIT:, and watch it with\n  {shlex.join(['harness', 'check', name, '--library', library_path])}")


@main.command()
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
@_told
def check(
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
    scheduler: str | None,
    time_limit: float,
) -> None:
    """Cross-check NAMEs, or every mechanism, and print a table."""
    from harness.description import describe_run
    from harness.library import Library
    from harness.run import Settings

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
    cross_check, records = _cross_check(settings, run, workers, scheduler, time_limit, json_path)
    _finish(cross_check, records)


@main.command()
@click.option("--profile", type=click.Choice(sorted(PROFILES)), default="quick", show_default=True, help="How many states per system.")
@click.option(
    "--out",
    "directory",
    type=click.Path(file_okay=False, path_type=Path),
    default=Path("reports"),
    show_default=True,
    help="Folder of the report and its history.",
)
@seed_option
@library_option
@json_option
@workers_option
@scheduler_option
@time_limit_option
@_told
def report(
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
    from harness.description import describe_run
    from harness.history import History
    from harness.library import Library
    from harness.report import build, write
    from harness.run import Settings

    try:
        directory.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InvalidInput(directory, None, f"cannot be made: {error.strerror}; name a folder that can be written with --out") from error
    settings = Settings(
        library=Library.at(library_path),
        states=PROFILES[profile],
        seed=seed,
        replay_options=["--library", library_path] if library_path else [],
    )
    run = describe_run(settings.library, PROFILES[profile], seed, profile, ["harness", *sys.argv[1:]])
    with History(directory / "history.sqlite") as history:
        identifier = history.begin(run)
        keep = functools.partial(history.append, identifier)
        cross_check, records = _cross_check(settings, run, workers, scheduler, time_limit, json_path, keep)
        for card in cross_check.cards:
            history.append_system(identifier, card)
        write(directory, build(run, cross_check.cards, records, history.earlier(identifier)))
    click.echo(f"report: {click.format_filename(directory / 'index.html')}")
    _finish(cross_check, records)


def _cross_check(
    settings: Settings,
    run: Run,
    workers: int | None,
    scheduler: str | None,
    time_limit: float,
    json_path: str | None,
    keep: Callable[[Record], Any] = lambda record: None,
) -> tuple[CrossCheck, list[Record]]:
    """Run to the end, keeping each record as it comes, and write the JSON file as it grows."""
    from harness.records import write_json
    from harness.run import CrossCheck
    from harness.terminal import progress
    from harness.workers import Workers

    records: list[Record] = []
    pool = Workers(workers, scheduler, time_limit)
    cross_check = CrossCheck(settings, pool)
    try:
        with pool, progress(cross_check.expected_records) as advance:
            for record in cross_check.records():
                keep(record)
                records.append(record)
                if json_path:
                    write_json(json_path, run, records, superfluous=cross_check.superfluous)
                advance(f"{record.system} {record.subject}")
    except OSError as error:
        raise InvalidRequest(f"no cluster at {scheduler}: {error}; start one or drop --scheduler") from error
    records.sort(key=lambda record: (record.system, record.subject))
    if json_path:
        write_json(json_path, run, records, superfluous=cross_check.superfluous)
    return cross_check, records


def _finish(cross_check: CrossCheck, records: list[Record]) -> None:
    """Print the table and what is not as expected; exit with the status the run has earned, invalid input first."""
    from harness.terminal import print_superfluous, print_table, print_unexpected

    print_table(records)
    print_unexpected(records)
    print_superfluous(cross_check.superfluous)
    _tell(cross_check.problems)
    if cross_check.crashed:
        sys.exit(CRASHED)
    as_expected = all(record.as_expected for record in records) and not cross_check.superfluous
    sys.exit(AS_EXPECTED if as_expected else NOT_AS_EXPECTED)


def _parse_state(text: str | None) -> Any:
    """One state from JSON.

    Raises:
        click.BadParameter: it is not {"q": numbers, "v": numbers, "tau": numbers} of one length.
    """
    if text is None:
        return None
    from harness.states import States

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
