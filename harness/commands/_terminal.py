"""What the command line prints: a progress bar, the table of records, and what is not as expected."""

from __future__ import annotations

import itertools
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING

import click
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table
from rich.text import Text

from harness.results.explanation import explain
from harness.results.records import Record
from harness.verdict import AGREEMENT

if TYPE_CHECKING:
    from harness.check.settings import Settings
    from harness.diagnose.faults.smallest import SmallestChange
    from harness.diagnose.faults.summary import KindOfFault
    from harness.diagnose.held import Difference
    from harness.results.causes import Cause
    from harness.results.superfluous import SuperfluousPart

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


def print_table(records: list[Record]) -> None:
    """One row per record on standard output."""
    table = Table(box=None, header_style="bold", pad_edge=False)
    for heading in ("system", "subject"):
        table.add_column(heading, no_wrap=True)
    for heading in ("states", "verdict", "backward error", "relative error", "time per state"):
        table.add_column(heading, justify="left" if heading == "verdict" else "right")
    for record in records:
        style = "green" if record.as_expected else "bold red"
        verdict = record.verdict if record.as_expected else f"{record.verdict} (expected {record.expected})"
        seconds = "" if record.seconds_per_state is None else f"{record.seconds_per_state * 1e9:,.0f} ns"
        table.add_row(
            record.system,
            record.subject,
            f"{record.states:,}",
            Text(verdict, style),
            _number(record.backward_error),
            _number(record.relative_error),
            seconds,
        )
    console().print(table)


def print_unexpected(records: list[Record]) -> None:
    """What is not as expected, and how many records are."""
    unexpected = [record for record in records if not record.as_expected]
    for record in unexpected:
        click.echo("\n" + explain(record))
    agreeing = len(records) - len(unexpected)
    click.echo(f"\n{agreeing} of {len(records)} as expected; backward error counts data roundoffs, up to {AGREEMENT:g} agrees")


def print_rows(title: str, heads: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    """A table under its title; nothing without rows."""
    rows = list(rows)
    if not rows:
        return
    click.echo(f"\n{title}")
    table = Table(box=None, header_style="bold", pad_edge=False)
    for head in heads:
        table.add_column(head, overflow="fold")
    for row in rows:
        table.add_row(*map(str, row))
    console().print(table, markup=False)


def print_superfluous(findings: Sequence[SuperfluousPart]) -> None:
    """A line for each part of a model that its scene does not need."""
    if findings:
        click.echo("\n1 superfluous part of a model:" if len(findings) == 1 else f"\n{len(findings)} superfluous parts of models:")
    for finding in sorted(findings, key=lambda finding: (finding.path, finding.subject, finding.line)):
        click.echo(f"  {finding}")


def print_causes(causes: Sequence[Cause], settings: Settings) -> None:
    """For each system who is at fault; for each wrong subject which terms are, and the first line of its diagnosis.

    Ends with the command that shows the rest, of a cross-check with ``settings``.
    """
    for (system, inference), own in itertools.groupby(causes, key=lambda cause: (cause.system, cause.inference)):
        click.echo(f"\n{system}: {inference}")
        for cause in own:
            if cause.is_shared:
                click.echo(f"  {cause.subject}: as {cause.diagnosed}")
            else:
                for line in [*cause.terms, *([cause.first_line] if cause.first_line != inference else [])]:
                    click.echo(f"  {cause.subject}: {line}")
    if causes:
        systems = {cause.system for cause in causes}
        click.echo(f"\nthe whole diagnosis: {settings.diagnosis('NAME' if len(systems) > 1 else causes[0].system)}")


def print_diagnoses(causes: Sequence[Cause], held: Sequence[Difference]) -> None:
    """For each system who is at fault, what its subjects do not hold alike, and the whole diagnosis of each wrong subject."""
    for (system, inference), own in itertools.groupby(causes, key=lambda cause: (cause.system, cause.inference)):
        click.echo(f"\n{system}: {inference}")
        for difference in held:
            click.echo(f"  held after loading: {difference}")
        for cause in own:
            click.echo(f"\n{cause.subject}")
            if cause.is_shared:
                click.echo(f"  as {cause.diagnosed}, which reads the same file")
            else:
                for line in [*cause.terms, *itertools.chain.from_iterable(cause.sides)]:
                    click.echo(f"  {line}")


def print_caught(caught: Sequence[SmallestChange]) -> None:
    """One row per live number of a model, and how far theory was kept in all."""
    from harness.diagnose.faults.baseline import MOST_ABOVE_THEORY

    table = Table(box=None, header_style="bold", pad_edge=False)
    for heading in ("system", "subject", "where", "number"):
        table.add_column(heading, no_wrap=True)
    for heading in ("value", "smallest caught", "theory", "ratio"):
        table.add_column(heading, justify="right")
    for found in caught:
        ratio = Text(f"{found.ratio:.2f}", "" if found.as_in_theory else "bold red")
        figures = [f"{found.value:g}", f"{found.smallest:.2g}", f"{found.theory:.2g}"]
        table.add_row(found.system, found.subject, f"{found.file}:{found.place.line}", found.number, *figures, ratio)
    if not caught:
        click.echo("no live numbers: no model was walked")
        return
    console().print(table)
    fine = sum(found.smallest < 1e-10 for found in caught) / len(caught)
    furthest = max(found.ratio for found in caught)
    click.echo(
        f"\n{len(caught)} live numbers; {fine:.1%} caught below 1e-10; at most {furthest:.2f} times theory, {MOST_ABOVE_THEORY:g} allowed"
    )


def print_kinds(kinds: Sequence[KindOfFault]) -> None:
    """One row per kind of fault of a campaign, and one for all."""
    table = Table(box=None, header_style="bold", pad_edge=False)
    table.add_column("kind", no_wrap=True)
    for heading in ("planted", "live", "caught", "judged", "named first", "in class", "blamed", "smallest", "theory", "seconds", "longest"):
        table.add_column(heading, justify="right")
    for one in kinds:
        shares = [f"{count / one.judged:.0%}" if one.judged else "" for count in (one.named, one.in_class)]
        counts = [str(count) for count in (one.planted, one.live, one.caught, one.judged)]
        table.add_row(one.kind, *counts, *shares, str(one.blamed), *map(_number, (one.smallest, one.theory, one.seconds, one.longest)))
    if not kinds:
        click.echo("no faults: no model was found to plant them in")
        return
    console().print(table)
    judged, known = sum(one.judged for one in kinds), sum(one.in_class for one in kinds)
    live, caught = sum(one.live for one in kinds), sum(one.caught for one in kinds)
    named = f"; {sum(one.named for one in kinds) / judged:.1%} named first, {known / judged:.1%} first or in their class" if judged else ""
    click.echo(f"\n{live} faults that change the dynamics, {caught} caught; {judged} of them judged{named}")


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.3g}"
