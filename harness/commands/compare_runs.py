"""``harness compare-runs``."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import click

from harness.commands import STUDIES
from harness.commands.frame.bracket import Bracket, computing
from harness.commands.frame.terminal import print_titled, say
from harness.errors import InvalidRequest
from harness.results.table import Column, Table

if TYPE_CHECKING:
    from harness.results.history import History
    from harness.results.trend import ComparedRun

SECTION = STUDIES
LATEST, PREVIOUS = "latest", "previous"


@click.command("compare-runs")
@click.argument("before", metavar="[A]", default=PREVIOUS)
@click.argument("now", metavar="[B]", default=LATEST)
@click.option("--list", "listed", is_flag=True, help="List the runs that there are, and compare none.")
@computing(directory=True, seed=False, workers=False)
def command(bracket: Bracket, before: str, now: str, listed: bool) -> None:
    """Compare two runs of the history.

    A and B are numbers of runs or nights, latest or previous: by default the last run and the
    one before. Prints for each system and subject what changed in verdict, error, cost
    and message, and which are new or gone. The exit status is 1 if something became worse:
    a graver verdict, one that is no longer expected, or a median or 99 % error that rose beyond
    the noise of its sample.

    \b
    Examples:
      harness compare-runs
      harness compare-runs --list
      harness compare-runs 12 latest --out night --json changes.json
    """
    from harness.report.summary import changes_table
    from harness.results.run import changed_versions
    from harness.results.trend import changes_between, run_changes

    if not (bracket.directory / "history.sqlite").is_file():
        raise InvalidRequest(f"{bracket.directory} holds no history; name the folder of a report with --out")
    known = _runs(bracket)
    if listed:
        _list([_run(bracket.history, number) for number in known])
        bracket.finish([], False, bool(known))
    first, second = (_run_called(bracket.history, known, name) for name in (before, now))
    if first.number == second.number:
        raise InvalidRequest(f"{before} and {now} are one run, {first.number}; see harness compare-runs --list")
    changes = run_changes(first.records, second.records)
    pair = {"before": first, "now": second}
    worse = sum(one.is_worse for one in changes)
    common = {one.title for one in first.records} & {one.title for one in second.records}
    pairs = len({(one.system, one.subject) for one in changes})
    said = f"{pairs} of {len(second.records)} records changed, {worse} changes for the worse" if changes else "nothing changed"
    say(said if common else "the runs have no record in common, so that nothing was compared; name two runs of the same mechanisms")
    for name, one in pair.items():
        asked = f"{one.run.profile}, {one.run.states:,} states a system, seed {one.run.seed}"
        say(f"{name}: run {one.number} of {one.run.started}, {asked}: {len(one.records)} records")
    print_titled("versions", changes_table("version", changed_versions(first.run.versions, second.run.versions)))
    print_titled("changes", changes_between(changes))
    bracket.run = second.run
    bracket.write_json(compared={name: {"number": one.number, "run": one.run} for name, one in pair.items()}, changes=changes)
    bracket.finish([], False, bool(common) and not worse)


def _runs(bracket: Bracket) -> list[int]:
    """Numbers of the cross-checks of the library that found anything, newest first."""
    from harness.library import Library
    from harness.results.cross_check import CrossCheckResult

    history, library = bracket.history, Library.at(bracket.library_path).name
    return [number for number in history.studies(CrossCheckResult, library) if history.read(number, CrossCheckResult, "records").records]


def _run(history: History, number: int) -> ComparedRun:
    from harness.results.cross_check import CrossCheckResult
    from harness.results.trend import ComparedRun

    found = history.read(number, CrossCheckResult, "records")
    return ComparedRun(number=number, run=history.studies(CrossCheckResult)[number], records=found.records)


def _run_called(history: History, known: Sequence[int], name: str) -> ComparedRun:
    """The run of that number, or of the cross-check of that night; ``known`` are the numbers of all runs.

    Raises:
        InvalidRequest: there is none.
    """
    from harness.results.night import Night

    place = {LATEST: 0, PREVIOUS: 1}.get(name)
    if place is not None:
        number = known[place] if place < len(known) else None
    else:
        number = int(name) if name.isdecimal() else None
        if number in history.studies(Night):
            number = history.read(number, Night).study_of("cross-check")
        number = number if number in known else None
    if number is None:
        there = ", ".join(map(str, known)) or "none"
        raise InvalidRequest(f"no run is called {name!r}; expected {LATEST}, {PREVIOUS} or a number; there are {there}")
    return _run(history, number)


def _list(runs: Sequence[ComparedRun]) -> None:
    versions = [one.run.versions for one in runs]
    differing = sorted({name for each in versions for name in each if len({one.get(name) for one in versions}) > 1})
    if not runs:
        say("no run of this library is in the history; harness report adds one")
    columns: dict[Column | str, str | Callable[[ComparedRun], object]] = {
        Column("run", "plain"): "number",
        "started": "run.started",
        "profile": "run.profile",
        Column("states", "count"): "run.states",
        Column("seed", "plain"): "run.seed",
        Column("records", "count"): lambda one: len(one.records),
        Column("not as expected", "count"): lambda one: sum(not record.as_expected for record in one.records),
        "versions that differ": lambda one: ", ".join(f"{name} {one.run.versions.get(name, 'absent')}" for name in differing),
    }
    print_titled("runs, newest first", Table.of(runs, columns))
