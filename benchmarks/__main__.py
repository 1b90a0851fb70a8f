"""The command line of the benchmarks."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import click

from benchmarks import history
from benchmarks.benchmark import chosen, suites
from benchmarks.comparison import Row, first_line, last_measured, lines, rows
from benchmarks.history import HISTORY, REPOSITORY, Run
from benchmarks.running import checkout, measure

FILE = click.option(
    "--history",
    "path",
    type=click.Path(path_type=Path, dir_okay=False),
    default=HISTORY,
    show_default="reports/benchmarks.jsonl",
    help="Runs, one a line.",
)


class Main(click.Group):
    """A group whose first word is a command, or else the name of a benchmark."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        if not args or (args[0] not in self.commands and args[0] not in {"--help", "-h"}):
            args = ["run", *args]
        return super().parse_args(ctx, args)


@click.group(cls=Main, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
def main() -> None:
    """Benchmarks of the harness. `python -m benchmarks [NAME...]` is `python -m benchmarks run [NAME...]`."""


def _end(found: Sequence[Row], before: str, after: str) -> None:
    click.echo(first_line(found, before, after))
    for line in lines(found):
        click.echo(line)
    sys.exit(int(any(row.verdict.is_bad for row in found)))


@main.command()
@click.argument("names", nargs=-1, metavar="[NAME]...")
@click.option("--against", metavar="COMMIT", help="Measure this state of the code too, in turns; it is what is before.")
@click.option("--rounds", type=click.IntRange(1), help="At most so many rounds of each.")
@FILE
def run(names: tuple[str, ...], against: str | None, rounds: int | None, path: Path) -> None:
    """Measure benchmarks, append them to the history, and hold them against their bars and against what was measured before.

    NAME is a pattern, as 'certified/*', or a suite. The exit status is 1 where one is slower, above its bar, or fails.
    """
    total = sum(len(chosen(names, suite)) for suite in suites())
    if not total:
        raise click.UsageError(f"no benchmark matches {' or '.join(names)}; python -m benchmarks list names them")
    earlier = [one for one in _read(path) if one.machine == history.machine()]
    done = 0

    def say(name: str) -> None:
        nonlocal done
        done += 1
        if sys.stderr.isatty():
            click.echo(f"\r\x1b[K{done} of {total * (4 if against else 1)}  {name}", nl=False, err=True)

    if against is None:
        [measured] = measure(names, rounds, [REPOSITORY], say)
        before, known = "the last run", last_measured(earlier)
    else:
        try:
            with checkout(against) as tree:
                before = history.commit_of(tree).rstrip("+")
                known, measured = measure(names, rounds, [tree, REPOSITORY], say)
        except subprocess.CalledProcessError as error:
            raise click.UsageError(f"git gives no state of the code for {against}: {error.stderr.strip()}") from None
        history.append(history.run_of(known, before), path)
    if sys.stderr.isatty():
        click.echo("\r\x1b[K", nl=False, err=True)
    now = history.run_of(measured, history.commit_of())
    history.append(now, path)
    asked = {one.name for one in measured}
    _end(rows([one for one in known if one.name in asked], measured), before, now.commit)


@main.command()
@click.argument("before", required=False)
@click.argument("after", required=False)
@FILE
def compare(before: str | None, after: str | None, path: Path) -> None:
    """Hold what the history has of two commits against one another: by default its last two runs on this machine.

    BEFORE and AFTER are the first digits of commits, as the history has them; a commit with changes ends in "+".
    """
    runs = [one for one in _read(path) if one.machine == history.machine()]
    if len(runs) < 2:
        raise click.UsageError(f"{path} has {len(runs)} runs on this machine; two are compared")
    newer = _of_commit(runs, after) if after else runs[-1:]
    older = _of_commit(runs, before) if before else runs[-2:-1]
    names = older[-1].commit, newer[-1].commit
    _end(rows(last_measured(older), [one for run in newer for one in run.measured]), *names)


@main.command(name="list")
def list_names() -> None:
    """Name each benchmark, with its bar."""
    for suite in suites():
        for one in chosen((), suite):
            bar = "" if one.most == float("inf") else f"at most {one.most:.3g} " + (f"times {one.beside}" if one.beside else one.unit)
            click.echo(f"{one.name:<60}{bar}".rstrip())


@main.command()
@FILE
def page(path: Path) -> None:
    """Write docs/reference/costs.md from the last measurements of all commands on this machine."""
    from benchmarks.page import PAGE, page

    runs = [one for one in _read(path) if one.machine == history.machine()]
    try:
        PAGE.write_text(page(last_measured(runs)), encoding="utf-8")
    except LookupError as error:
        raise click.UsageError(str(error.args[0])) from None


@main.command(name="solvers")
def write_solvers() -> None:
    """Measure solvers of constraints on dm_control's robots and over numbers of contacts, and write docs/reference/solvers.md."""
    from benchmarks.solvers import PAGE, files, measured, page, trays

    try:
        paths = files()
    except LookupError as error:
        raise click.UsageError(str(error.args[0])) from None
    with tempfile.TemporaryDirectory() as folder:
        of_trays = measured(trays(Path(folder)))
    PAGE.write_text(page(measured(paths), of_trays), encoding="utf-8")


def _read(path: Path) -> list[Run]:
    try:
        return history.read(path)
    except ValueError as error:
        raise click.UsageError(str(error)) from None


def _of_commit(runs: Sequence[Run], commit: str) -> list[Run]:
    found = [run for run in runs if run.commit == commit] or [run for run in runs if run.commit.startswith(commit)]
    if not found:
        known = ", ".join(dict.fromkeys(run.commit for run in runs))
        raise click.UsageError(f"the history has no run at {commit} on this machine; it has {known}")
    return found


if __name__ == "__main__":
    main(prog_name="python -m benchmarks")
