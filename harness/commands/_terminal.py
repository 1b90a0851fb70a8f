"""Output of the command line: a progress bar, the table of records, and what is not as expected."""

from __future__ import annotations

import itertools
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from operator import attrgetter
from typing import TYPE_CHECKING, Any

import click
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from harness.results.records import Record, Records, Run
from harness.results.table import Cell, Column, Table
from harness.verdict import AGREEMENT

if TYPE_CHECKING:
    from harness.crosscheck.settings import Settings
    from harness.diagnosis.faults.summary import KindOfFault, SmallestChange
    from harness.diagnosis.held import Difference
    from harness.report.benchmarks import BenchmarkSummary
    from harness.report.hard_cases import HardSummary
    from harness.results.cross_check import Cause, SuperfluousPart

_PIPE_WIDTH = 160


@contextmanager
def progress(total: int, what: str = "cross-check") -> Iterator[Callable[[str], None]]:
    """A progress bar on a terminal, nothing in a pipe; yields a function that marks one more as done."""
    with Progress(
        TextColumn(what),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("{task.description}"),
        console=console(stderr=True),
        transient=True,
        disable=not sys.stderr.isatty(),
    ) as bar:
        task = bar.add_task("", total=total)
        yield lambda description: bar.update(task, advance=1, description=description)


def console(stderr: bool = False) -> Console:
    """Standard output or error, wide enough in a pipe that tables do not wrap."""
    stream = sys.stderr if stderr else sys.stdout
    return Console(stderr=stderr, width=None if stream.isatty() else _PIPE_WIDTH)


def print_table(records: Sequence[Record], run: Run) -> None:
    """One row per record on standard output, where their states come from, and under which load they were timed."""
    shown = Records(records)
    console().print(shown.brief().terminal())
    if any(record.seconds_per_state is not None for record in shown):
        click.echo("\n".join(filter(None, ["", shown.origins, f"times: median and fastest call, {run.load}"])))


def print_titled(title: str, table: Table) -> None:
    """A table under its title; nothing without rows."""
    if table.rows:
        click.echo(f"\n{title}")
        console().print(table.terminal())


def print_sentences(measured: BenchmarkSummary | HardSummary) -> None:
    """A line for all that could not be measured, and for all that is not as expected."""
    for problem in measured.problems:
        click.echo(f"\nnot measured: {problem}")
    for sentence in measured.unexpected:
        click.echo(f"\nnot as expected: {sentence}")


def print_unexpected(records: Sequence[Record]) -> None:
    """Each unexpected record."""
    for record in Records(records).unexpected:
        click.echo("\n" + record.explanation)


def print_count(records: Sequence[Record], findings: Sequence[SuperfluousPart]) -> None:
    """The number of records that are as expected, of all records and all superfluous parts, none of which is."""
    good, all_of_them = sum(record.as_expected for record in records), len(records) + len(findings)
    parts = f": {superfluous_parts(findings)} {'is' if len(findings) == 1 else 'are'} not" if findings else ""
    click.echo(f"\n{good} of {all_of_them} as expected{parts}; backward error counts data roundoffs, up to {AGREEMENT:g} agrees")


def superfluous_parts(findings: Sequence[SuperfluousPart]) -> str:
    return "1 superfluous part of a model" if len(findings) == 1 else f"{len(findings)} superfluous parts of models"


def print_superfluous(findings: Sequence[SuperfluousPart]) -> None:
    """A line for each part of a model that its scene does not need."""
    if findings:
        click.echo(f"\n{superfluous_parts(findings)}:")
    for part in sorted(findings, key=attrgetter("path", "subject", "line")):
        click.echo(f"  {part}")


def print_causes(causes: Sequence[Cause], settings: Settings) -> None:
    """The party at fault in each system; for each wrong subject its wrong terms and the first line of its diagnosis.

    Ends with the command that shows the rest, of a cross-check with ``settings``.
    """
    for (system, inference), own in itertools.groupby(causes, key=attrgetter("system", "inference")):
        click.echo(f"\n{system}: {inference}")
        for cause in own:
            lines = [*cause.terms, *([cause.first_line] if cause.first_line != inference else [])]
            for line in [f"as {cause.diagnosed}"] if cause.is_shared else lines:
                click.echo(f"  {cause.subject}: {line}")
    if causes:
        systems = {cause.system for cause in causes}
        click.echo(f"\nthe whole diagnosis: {settings.diagnosis('NAME' if len(systems) > 1 else causes[0].system)}")


def print_diagnoses(causes: Sequence[Cause], held: Sequence[Difference]) -> None:
    """The party at fault in each system, what its subjects do not hold alike, and the whole diagnosis of each wrong subject."""
    for (system, inference), own in itertools.groupby(causes, key=attrgetter("system", "inference")):
        click.echo(f"\n{system}: {inference}")
        for difference in held:
            click.echo(f"  held after loading: {difference}")
        for cause in own:
            click.echo(f"\n{cause.subject}")
            lines = [*cause.terms, *itertools.chain.from_iterable(cause.sides)]
            for line in [f"as {cause.diagnosed}, which reads the same file"] if cause.is_shared else lines:
                click.echo(f"  {line}")


def print_caught(caught: Sequence[SmallestChange]) -> None:
    """One row per live number of a model, and how far theory was kept in all."""
    from harness.diagnosis.faults.baseline import MOST_ABOVE_THEORY

    if not caught:
        click.echo("no live numbers: no model was walked")
        return
    table = Table.of(
        caught,
        {
            "system": "system",
            "subject": "subject",
            "where": lambda found: f"{found.file}:{found.place.line}",
            "number": "number",
            Column("value", "given"): "value",
            Column("smallest caught", "error"): "smallest",
            Column("theory", "error"): "theory",
            Column("ratio", "rounded"): lambda found: Cell(found.ratio, tone="" if found.as_in_theory else "surprise"),
        },
    )
    console().print(table.terminal())
    fine = sum(found.smallest < 1e-10 for found in caught) / len(caught)
    furthest = max(found.ratio for found in caught)
    click.echo(
        f"\n{len(caught)} live numbers; {fine:.1%} caught below 1e-10; at most {furthest:.2f} times theory, {MOST_ABOVE_THEORY:g} allowed"
    )


def print_kinds(kinds: Sequence[KindOfFault]) -> None:
    """One row per kind of fault of a campaign, and one for all."""
    if not kinds:
        click.echo("no faults: no model was found to plant them in")
        return
    columns: dict[Column | str, Any] = {"kind": "kind"}
    columns |= {Column(name, "count"): name for name in ("planted", "live", "caught", "judged")}
    columns[Column("named first", "count")] = lambda one: f"{one.named / one.judged:.0%}" if one.judged else ""
    columns[Column("in class", "count")] = lambda one: f"{one.in_class / one.judged:.0%}" if one.judged else ""
    columns[Column("blamed", "count")] = "blamed"
    columns |= {Column(name, "error"): name for name in ("smallest", "theory", "seconds", "longest")}
    console().print(Table.of(kinds, columns).terminal())
    judged, known = sum(one.judged for one in kinds), sum(one.in_class for one in kinds)
    live, caught = sum(one.live for one in kinds), sum(one.caught for one in kinds)
    named = f"; {sum(one.named for one in kinds) / judged:.1%} named first, {known / judged:.1%} first or in their class" if judged else ""
    click.echo(f"\n{live} faults that change the dynamics, {caught} caught; {judged} of them judged{named}")
