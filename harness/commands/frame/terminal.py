"""Output of the command line: lines, progress, the table of records, and what is not as expected."""

from __future__ import annotations

import contextlib
import itertools
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from operator import attrgetter
from typing import TYPE_CHECKING, Any

import click

from harness.results.brief import quantities_in_brief
from harness.results.records import ACCELERATIONS, Record, Records, Run
from harness.results.table import Cell, Column, Table, printable
from harness.verdict import AGREEMENT

if TYPE_CHECKING:
    from rich.console import Console

    from harness.crosscheck.held import Difference
    from harness.crosscheck.settings import Settings
    from harness.diagnosis.faults.summary import KindOfFault, SmallestChange
    from harness.report.benchmarks import BenchmarkSummary
    from harness.report.comparison import Section
    from harness.report.hard_cases import HardSummary
    from harness.results.cross_check import Cause, HeldDifference, SuperfluousPart

_PIPE_WIDTH = 160
SECONDS_BETWEEN_LINES, LOOK_SECONDS = 10.0, 0.5
# Below it, rich drops columns.
_LEAST_WIDTH = 40


def say(*lines: str, err: bool = False) -> None:
    """Print each line on standard output or error; no markup or control character in it is obeyed, no end of a line either."""
    for line in lines:
        click.echo(printable(line), err=err)


@contextlib.contextmanager
def progress(total: int, what: str, clock: Callable[[], float] = time.monotonic) -> Iterator[Callable[[str], None]]:
    """Progress on standard error: a bar on a terminal, else a plain line every ten seconds of ``clock``.

    Yields a function that marks one more as done; its argument says what that was.
    """
    if not sys.stderr.isatty():
        with _progress_lines(total, what, clock) as advance:
            yield advance
        return
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    with Progress(
        TextColumn(what),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("{task.description}", markup=False),
        console=console(stderr=True),
        transient=True,
    ) as bar:
        task = bar.add_task("", total=total)
        yield lambda description: bar.update(task, advance=1, description=printable(description))


@contextlib.contextmanager
def _progress_lines(total: int, what: str, clock: Callable[[], float]) -> Iterator[Callable[[str], None]]:
    started, done, last, ended = clock(), 0, "", threading.Event()

    def advance(description: str) -> None:
        nonlocal done, last
        done, last = done + 1, description

    def tell() -> None:
        told = started
        # A task may take minutes, so that it is not the end of one that brings a line.
        while not ended.wait(LOOK_SECONDS):
            now = clock()
            if now - told >= SECONDS_BETWEEN_LINES:
                told = now
                # Whoever closed the stream wants no lines.
                with contextlib.suppress(OSError, ValueError):
                    say(f"harness: {what}: {done} of {total} after {now - started:.0f} s{last and '; last '}{last[:60]}", err=True)

    teller = threading.Thread(target=tell, daemon=True)
    # Where a limit leaves no room for a thread, the work goes on without its lines.
    with contextlib.suppress(RuntimeError):
        teller.start()
    try:
        yield advance
    finally:
        ended.set()
        if teller.is_alive():
            teller.join()


def console(stderr: bool = False) -> Console:
    """Standard output or error, wide enough in a pipe that tables do not wrap."""
    from rich.console import Console

    stream = sys.stderr if stderr else sys.stdout
    made = Console(stderr=stderr, width=None if stream.isatty() else _PIPE_WIDTH)
    made.width = max(made.width, _LEAST_WIDTH)
    return made


def _print(table: Table) -> None:
    """A table on standard output; a terminal that is too narrow for its numbers wraps the lines, and loses none."""
    console().print(table.terminal(), crop=False)


def print_table(records: Sequence[Record], run: Run) -> None:
    """One row per record on standard output, where their states come from, and under which load they were timed."""
    shown = Records(records)
    _print(shown.brief())
    if any(record.seconds_per_state is not None for record in shown):
        say(*filter(None, [shown.origins, f"times: median and fastest call, {run.load}"]))


def print_titled(title: str, table: Table) -> None:
    """A table under its title; nothing without rows."""
    if table.rows:
        say("", title)
        _print(table)


def print_section(parts: Sequence[str | Table]) -> None:
    """Lines of text, which a terminal wraps, and tables."""
    for part in parts:
        if isinstance(part, Table):
            _print(part)
        else:
            indent = len(part) - len(part.lstrip())
            say(f"  {' ' * indent}{part.strip()}")


def print_sections(sections: Iterable[Section]) -> None:
    """Each section below its title, with an empty line between two."""
    for number, section in enumerate(sections):
        say(*([""] if number else []), section.title)
        print_section(section.parts)


def print_sentences(measured: BenchmarkSummary | HardSummary) -> None:
    """A line for all that could not be measured, and for all that is not as expected."""
    for problem in measured.problems:
        say("", f"not measured: {problem}")
    for sentence in measured.unexpected:
        say("", f"not as expected: {sentence}")


def print_further_quantities(records: Sequence[Record]) -> None:
    """A line for each subject: what it was asked for beside accelerations, and the worst of it."""
    by_subject: dict[str, list[Record]] = {}
    for record in records:
        by_subject.setdefault(record.subject, []).append(record)
    if records:
        most = max(record.states for record in records)
        names = ", ".join(dict.fromkeys(record.quantity for record in records))
        say("", f"further quantities at {most} states each, of which harness check NAME --quantity QUANTITY tells more:", f"  {names}")
    for subject, own in sorted(by_subject.items()):
        say(f"  {subject}: {quantities_in_brief(own)}")


def print_unexpected(records: Sequence[Record]) -> None:
    """Each unexpected record, and what there is to say of one that is as expected although it was compared."""
    for record in Records(records).unexpected:
        say("", *record.explanation.split("\n"))
    for record in Records(records):
        if record.as_expected and record.message and record.backward_error is not None:
            say("", f"{record.title}: {record.message}")


def print_count(
    records: Sequence[Record], findings: Sequence[SuperfluousPart], differs: Sequence[HeldDifference] = (), others: Sequence[Record] = ()
) -> None:
    """The number of records that are as expected, of all records, superfluous parts and differences that fail the check.

    ``others`` are records of quantities that were not asked for by name; they are counted by themselves.
    """
    failing = sum(part.fails for part in findings)
    warnings = len(findings) - failing
    apart = sum(finding.fails for finding in differs)
    good, in_all = sum(record.as_expected for record in records), len(records) + failing + apart
    counts = [_superfluous(failing)] if failing else []
    counts += [f"{apart} difference{'' if apart == 1 else 's'} after loading"] if apart else []
    parts = f": {' and '.join(counts)} {'is' if failing + apart == 1 else 'are'} not" if counts else ""
    parts += f", and {_superfluous(warnings)} {'is a warning' if warnings == 1 else 'are warnings'}" if warnings else ""
    parts += f", {sum(record.as_expected for record in others)} of {len(others)} of further quantities" if others else ""
    say("", f"{good} of {in_all} as expected{parts}; backward error counts data roundoffs, up to {AGREEMENT:g} agrees")


def _superfluous(count: int) -> str:
    return "1 superfluous part of a model" if count == 1 else f"{count} superfluous parts of models"


def print_superfluous(findings: Sequence[SuperfluousPart]) -> None:
    """A line for each part of a model that its scene does not need, those that fail the check first."""
    for fails in (True, False):
        parts = [part for part in findings if part.fails == fails]
        if parts:
            warning = "" if fails else f", which {'is a warning' if len(parts) == 1 else 'are warnings'}"
            say("", f"{_superfluous(len(parts))}{warning}:")
        for part in sorted(parts, key=attrgetter("path", "subject", "line")):
            say(f"  {part}")


def print_differs(findings: Sequence[HeldDifference]) -> None:
    """A line for each quantity that subjects do not hold alike after loading, those that are not expected first."""
    for fails in (True, False):
        found = [finding for finding in findings if finding.fails == fails]
        if found:
            expected = "" if fails else ", as expected"
            say("", f"not held alike after loading, whether the motion feels it or not{expected}:")
        for finding in sorted(found, key=attrgetter("system", "joint", "quantity")):
            say(f"  {finding}")


def print_causes(causes: Sequence[Cause], settings: Settings) -> None:
    """The party at fault in each system; for each wrong subject its wrong terms and the first line of its diagnosis.

    Ends with the command that shows the rest, of a cross-check with ``settings``.
    """
    for (system, inference), own in itertools.groupby(causes, key=attrgetter("system", "inference")):
        say("", f"{system}: {inference}")
        for cause in own:
            lines = [*cause.terms, *([cause.first_line] if cause.first_line != inference else [])]
            for line in [f"as {cause.diagnosed}"] if cause.is_shared else lines:
                say(f"  {cause.subject}: {line}")
    if causes:
        systems = {cause.system for cause in causes}
        say("", f"the whole diagnosis: {settings.diagnosis('NAME' if len(systems) > 1 else causes[0].system)}")


def print_quantity_diagnoses(records: Sequence[Record], settings: Settings) -> None:
    """The command that says what is wrong with each quantity beside accelerations that is not as expected."""
    wrong = [record for record in records if record.quantity != ACCELERATIONS and not record.as_expected]
    for quantity, own in itertools.groupby(sorted(wrong, key=attrgetter("quantity")), key=attrgetter("quantity")):
        systems = sorted({record.system for record in own})
        say("", f"the diagnosis of {quantity}: {settings.diagnosis('NAME' if len(systems) > 1 else systems[0], quantity)}")


def print_diagnoses(causes: Sequence[Cause], held: Sequence[Difference]) -> None:
    """The party at fault in each system, what its subjects do not hold alike, and the whole diagnosis of each wrong subject."""
    for (system, inference), own in itertools.groupby(causes, key=attrgetter("system", "inference")):
        say("", f"{system}: {inference}")
        for difference in held:
            say(f"  held after loading: {difference}")
        for cause in own:
            say("", cause.subject)
            lines = [*cause.terms, *itertools.chain.from_iterable(cause.sides)]
            for line in [f"as {cause.diagnosed}, which reads the same file"] if cause.is_shared else lines:
                say(f"  {line}")


def print_caught(caught: Sequence[SmallestChange]) -> None:
    """One row per live number of a model, and how far theory was kept in all."""
    from harness.diagnosis.faults.baseline import MOST_ABOVE_THEORY

    if not caught:
        say("no live numbers: no model was walked")
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
    _print(table)
    say("", "the number of each model that hides the largest error:")
    pairs = [list(own) for _, own in itertools.groupby(caught, key=attrgetter("system", "subject"))]
    _print(
        Table.of(
            [max(own, key=lambda found: found.smallest) for own in pairs],
            {
                "system": "system",
                "subject": "subject",
                "number": "number",
                Column("smallest caught", "error"): "smallest",
                Column("theory", "error"): "theory",
            },
        )
    )
    fine = sum(found.smallest < 1e-10 for found in caught) / len(caught)
    furthest = max(found.ratio for found in caught)
    of_theory = f"at most {furthest:.2f} times theory, {MOST_ABOVE_THEORY:g} allowed"
    say("", f"{len(caught)} live numbers; {fine:.1%} caught below 1e-10; {of_theory}")


def print_kinds(kinds: Sequence[KindOfFault]) -> None:
    """One row per kind of fault of a campaign, and sentences over the kinds that the diagnosis knows and over the others."""
    from harness.diagnosis.faults.summary import shares

    if not kinds:
        say("no faults: no model was found to plant them in")
        return
    columns: dict[Column | str, Any] = {"kind": "kind"}
    columns |= {Column(name, "count"): name for name in ("planted", "live", "caught", "judged")}
    columns[Column("named first", "count")] = lambda one: f"{one.named / one.judged:.0%}" if one.judged else ""
    columns[Column("in class", "count")] = lambda one: f"{one.in_class / one.judged:.0%}" if one.judged else ""
    columns[Column("blamed", "count")] = "blamed"
    columns |= {Column("value right", "count"): lambda one: f"{one.right} of {one.found}" if one.found else ""}
    columns |= {Column(name, "count"): name for name in ("misled", "stopped")}
    columns |= {Column(name, "error"): name for name in ("smallest", "theory", "seconds", "longest")}
    _print(Table.of(kinds, columns))
    live, caught = sum(one.live for one in kinds), sum(one.caught for one in kinds)
    found = shares(kinds)
    say("", f"{live} faults that change the dynamics, {caught} caught")
    if (of := found.get("known")) and of["judged"]:
        by_name = of["judged"] - of["diagnosed"]
        say(f"{of['judged']} judged: {of['share_named']:.1%} named first, {of['share_in_class']:.1%} first or in their class")
        if of["diagnosed"]:
            without = f"{of['share_found']:.1%} named first, {of['share_found_in_class']:.1%} first or in their class"
            say(f"{of['diagnosed']} of them diagnosed, without the {by_name} that a refusal names: {without}")
            right = f"; {of['share_right']:.1%} of those named first with the right number" if of["found"] else ""
            say(f"{of['misled']} explained by a change elsewhere, {of['stopped']} searches stopped{right}")
    if (of := found.get("unknown")) and of["diagnosed"]:
        outside = f"{of['diagnosed']} diagnosed of kinds that no hypothesis undoes"
        say(f"{outside}: {of['found_in_class']} explained at one of their places, {of['misled']} elsewhere, {of['stopped']} stopped")
