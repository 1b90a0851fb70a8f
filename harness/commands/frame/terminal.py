"""Output of the command line: lines, progress, the table of records, and what is not as expected."""

from __future__ import annotations

import contextlib
import itertools
import sys
import textwrap
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING

import click

from harness.results.check_conclusion import engine_lines, first_rows, was_compared
from harness.results.cross_check import SUPERFLUOUS
from harness.results.detail import Detail
from harness.results.records import Record, Records
from harness.results.run import Run
from harness.results.table import Table, counted, grouped, printable
from harness.verdict import AGREEMENT, Verdict

if TYPE_CHECKING:
    from rich.console import Console

    from harness.crosscheck.held import Difference
    from harness.crosscheck.settings import Settings
    from harness.report.benchmarks import BenchmarkSummary
    from harness.report.comparison import Section
    from harness.report.hard_cases import HardSummary
    from harness.results.cross_check import Cause, CrossCheckResult, HeldDifference, SuperfluousPart

SECONDS_BETWEEN_LINES, LOOK_SECONDS = 10.0, 0.5
# Below it, rich drops columns.
_LEAST_WIDTH = 40


def say(*lines: str, err: bool = False) -> None:
    """Print each line on standard output or error; no markup or control character in it is obeyed, no end of a line either."""
    for line in lines:
        click.echo(printable(line), err=err)


@contextlib.contextmanager
def progress(
    total: int, what: str, clock: Callable[[], float] = time.monotonic, under_way: Callable[[], Sequence[str]] = tuple
) -> Iterator[Callable[[str], None]]:
    """Progress on standard error: a bar on a terminal, else a plain line every ten seconds of ``clock``.

    Yields a function that marks one more as done; its argument says what that was. ``under_way`` gives what a plain line names as going
    on: names of systems, and paths of files.
    """
    if not sys.stderr.isatty():
        with _progress_lines(total, what, clock, under_way) as advance:
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

        def advance(description: str) -> None:
            # What a step turns out to consist of may be more than was known before it.
            done = int(bar.tasks[task].completed) + 1
            bar.update(task, completed=done, total=max(total, done), description=printable(description))

        yield advance


@contextlib.contextmanager
def _progress_lines(
    total: int, what: str, clock: Callable[[], float], under_way: Callable[[], Sequence[str]]
) -> Iterator[Callable[[str], None]]:
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
                    # Many robots have one file name, as model.urdf.
                    names = ", ".join("/".join(Path(name).parts[-2:]) for name in under_way())
                    parts = [f"after {now - started:.0f} s", last and f"last {last[:60]}", names and f"now {names[:60]}"]
                    say(f"harness: {what}: {done} of {max(total, done)} {'; '.join(filter(None, parts))}", err=True)

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
    """Standard output or error, which is a terminal."""
    from rich.console import Console

    made = Console(stderr=stderr)
    made.width = max(made.width, _LEAST_WIDTH)
    return made


def print_rows(table: Table) -> None:
    """A table on standard output, without its caption.

    In a pipe each row is one line, in which ``grep`` finds every name. A terminal that is too narrow wraps words; one that is too
    narrow for a name or a number wraps the lines, and loses none.
    """
    if sys.stdout.isatty():
        console().print(table.terminal(), crop=False)
    else:
        click.echo(str(table))


def print_table(records: Sequence[Record], run: Run, detail: Detail = Detail.BRIEF) -> Records:
    """One row per record on standard output; of many those that are not plain agreement, and a line for each engine. The records shown.

    ``Detail.VERBOSE`` adds where their states come from, and under which load they were timed.
    """
    shown = first_rows(records, detail)
    if shown:
        print_rows(shown.brief(detail))
    if left_out := len(records) - len(shown):
        say("", *engine_lines(records), "")
    rest = [f"--all shows the {left_out} that agree"] if left_out else []
    if detail < Detail.VERBOSE:
        rest.append("--verbose tells where the states come from")
    elif any(record.seconds_per_state is not None for record in shown):
        say(*filter(None, [shown.origins, f"times: median and fastest call, {run.load}"]))
    if was_compared(records):
        say("; ".join([f"errors count data roundoffs, of which up to {AGREEMENT:g} agree", *rest]))
    return shown


def print_titled(title: str, table: Table) -> None:
    """A table under its title; nothing without rows."""
    if table.rows:
        say("", title)
        print_rows(table)


def print_sections(sections: Iterable[Section]) -> None:
    """Each section below its title, with an empty line between two: lines of text, which a terminal wraps, and tables."""
    for number, section in enumerate(sections):
        say_wrapped(*([""] if number else []), section.title)
        for part in section.parts:
            if isinstance(part, Table):
                print_rows(part)
            else:
                say_wrapped(f"  {part.rstrip()}")


def say_wrapped(*lines: str) -> None:
    """Lines of text, which a terminal has between words, further in from the second on; a pipe has each as it is."""
    width = console().width if sys.stdout.isatty() else sys.maxsize
    for line in map(printable, lines):
        indent = " " * (len(line) - len(line.lstrip()) + 2)
        say(
            *textwrap.wrap(line, width, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False, drop_whitespace=True)
            or [""]
        )


def print_sentences(measured: BenchmarkSummary | HardSummary) -> None:
    """A line for all that could not be measured, and for all that is not as expected."""
    for problem in measured.problems:
        say("", f"not measured: {problem}")
    for sentence in measured.unexpected:
        say("", f"not as expected: {sentence}")


def print_further_quantities(records: Sequence[Record]) -> None:
    """A line for each subject: what it was asked for beside accelerations, and the worst of it."""
    if most := max((record.states for record in records), default=0):
        names = ", ".join(dict.fromkeys(record.quantity for record in records))
        say("", f"further quantities at {most} states each, of which harness check NAME --quantity QUANTITY tells more:", f"  {names}")
    for subject, own in sorted(grouped((record.subject, record) for record in records).items()) if most else ():
        say(f"  {subject}: {_in_brief(own)}")


def _in_brief(records: Sequence[Record]) -> str:
    """The quantities that agree, with the worst of them, those with another verdict, and what is not as expected.

    ``records`` are of one subject. A quantity of which one record is not as expected counts as such.
    """
    wrong = sorted({record.quantity for record in records if not record.as_expected})
    good = [record for record in records if record.quantity not in wrong]
    agreeing = [record for record in good if record.verdict == Verdict.AGREES]
    parts = []
    if agreeing:
        worst = max(agreeing, key=lambda record: record.backward_error or 0.0)
        size = f"{worst.backward_error or 0.0:.3g} ({worst.quantity} of {worst.system})"
        count = len({record.quantity for record in agreeing})
        parts.append(f"{count} {'quantity agrees' if count == 1 else 'quantities agree'}, worst {size}")
    for verdict in sorted({record.verdict for record in good} - {Verdict.AGREES.value}):
        # What one mechanism has nothing of is no news where another one has.
        names = {record.quantity for record in good if record.verdict == verdict} - {record.quantity for record in agreeing}
        said = "not offered" if verdict == Verdict.UNSUPPORTED else f"{verdict} (as expected)"
        parts += [f"{', '.join(sorted(names))} {said}"] if names else []
    parts += [f"not as expected: {', '.join(wrong)}"] if wrong else []
    return "; ".join(parts)


def print_unexpected(records: Sequence[Record]) -> None:
    """Each unexpected record, and what there is to say of one that is as expected although it was compared."""
    say(*Records(records).remarks)


def print_superfluous(findings: Sequence[SuperfluousPart]) -> None:
    """A line for each part of a model that its scene does not need, those that fail the check first."""

    def title(fails: bool, count: int) -> str:
        return f"{counted(count, SUPERFLUOUS)} of models" + ("" if fails else f", which {'is a warning' if count == 1 else 'are warnings'}")

    _print_failing_first(sorted(findings, key=attrgetter("path", "subject", "line")), title)


def print_differs(findings: Sequence[HeldDifference]) -> None:
    """A line for each quantity that subjects do not hold alike after loading, those that are not expected first."""

    def title(fails: bool, count: int) -> str:
        return "not held alike after loading, whether the motion feels it or not" + ("" if fails else ", as expected")

    _print_failing_first(sorted(findings, key=attrgetter("system", "joint", "quantity")), title)


def _print_failing_first(findings: Sequence[SuperfluousPart | HeldDifference], title: Callable[[bool, int], str]) -> None:
    """Those that fail the check and those that do not, each under the title of whether they do and how many they are."""
    for fails in (True, False):
        if found := [finding for finding in findings if finding.fails == fails]:
            say("", f"{title(fails, len(found))}:", *(f"  {finding}" for finding in found))


def print_diagnoses_left(found: CrossCheckResult, settings: Settings) -> None:
    """The commands that say the rest of what is wrong: of accelerations, and of each other quantity that is not as expected."""
    if found.causes:
        say("", f"the whole diagnosis: {settings.diagnosis(_one_name(found.causes))}")
    # Of a robot's file accelerations alone are diagnosed.
    wrong = [] if settings.library.reads_files else [one for one in found.records if one.is_further and not one.as_expected]
    for quantity, own in itertools.groupby(sorted(wrong, key=attrgetter("quantity")), key=attrgetter("quantity")):
        say("", f"the diagnosis of {quantity}: {settings.diagnosis(_one_name(own), quantity)}")


def _one_name(found: Iterable[Cause | Record]) -> str:
    """The system of all of them; where they are of several, the word that stands for any."""
    first, *others = {one.system for one in found}
    return "NAME" if others else first


def print_diagnoses(causes: Sequence[Cause], held: Sequence[Difference], detail: Detail = Detail.VERBOSE) -> None:
    """The differences of what subjects of a system hold, and the whole diagnosis of each wrong subject."""
    say(*([""] if held else []), *(f"held after loading: {difference}" for difference in held))
    for cause in causes:
        if cause.lines != [cause.inference]:
            say(*cause.told_in_full(detail))
