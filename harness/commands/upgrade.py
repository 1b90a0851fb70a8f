"""``harness upgrade``."""

from __future__ import annotations

from collections.abc import Sequence
from operator import attrgetter
from typing import TYPE_CHECKING

import click

from harness.commands import ENGINES
from harness.commands.frame.bracket import Bracket, computing
from harness.commands.frame.options import states_option
from harness.commands.frame.terminal import print_titled, say
from harness.errors import InvalidRequest
from harness.library import matching
from harness.results.trend import TIME, RunChange
from harness.results.trend import changes_between as changes_table

if TYPE_CHECKING:
    from harness.crosscheck.run import CrossCheck
    from harness.crosscheck.settings import Settings
    from harness.results.records import Record


SECTION = ENGINES


@click.command("upgrade")
@click.argument("engine")
@click.argument("names", nargs=-1, metavar="[OLD NEW] [NAME|FILE]...")
@click.option("--bisect", "span", metavar="GOOD..BAD", help="Find the first version between these two that changed something.")
@states_option()
@computing(time_limit=60.0, scheduler=True, floating_base=True)
def command(bracket: Bracket, engine: str, names: tuple[str, ...], span: str | None, states: int) -> None:
    """Say what changed between two versions of an engine.

    Nothing else is printed.

    Both versions are asked about the same mechanisms, or robots' FILEs, at the same states: verdicts, errors, refusals, what is read
    from a file, terms of the equations, and cost. A version that is not installed beside the harness is one of `harness engines add`.
    With --bisect, the versions in between that the package index offers are installed as they are needed.

    \b
    Examples:
      harness upgrade mujoco 3.13.0 4.0.0
      harness upgrade mujoco 3.13.0 4.0.0 robot.urdf
      harness upgrade mujoco --bisect 3.3.0..4.0.0 four_bar

    \b
    Exit status: 1 if something became worse. A change of cost is no such thing.
    """
    from harness.crosscheck.settings import Settings

    if span is None and len(names) < 2:
        raise click.UsageError("name two versions, as `harness upgrade mujoco 3.13.0 4.0.0`, or --bisect GOOD..BAD")
    versions, systems = (names[:2], names[2:]) if span is None else (tuple(span.split("..")), names)
    if len(versions) != 2 or not all(versions):
        raise click.UsageError(f"--bisect {span}: expected two versions as 3.3.0..4.0.0")
    bracket.choose_library(systems)
    settings = Settings(library=bracket.library, names=matching(bracket.library, systems), states=states, seed=bracket.seed, examples=None)
    bracket.begin(states, "upgrade")
    if span is None:
        _upgrade(bracket, settings, engine, versions)
    else:
        _bisect(bracket, settings, engine, versions)


def _upgrade(bracket: Bracket, settings: Settings, engine: str, versions: Sequence[str]) -> None:
    from harness.upgrade.study import version_name

    before, after = (version_name(bracket.library, engine, version) for version in versions)
    if before == after:
        raise InvalidRequest(f"{before} is one version; name two")
    study = _ask(bracket, settings, before, after)
    is_worse = _tell(bracket, settings, study.result().records, (before, after), versions)
    crashed = any(subject is not None and subject.startswith(f"{after}/") for _, subject in study.crashes)
    bracket.finish(study.problems, crashed, not is_worse, study.faults)


def _bisect(bracket: Bracket, settings: Settings, engine: str, ends: Sequence[str]) -> None:
    from harness.commands.engines import add, requested
    from harness.engines import engine_files
    from harness.environments import versions_between
    from harness.upgrade.study import changes_between, first_changed

    ((engine, _),) = requested(bracket, [engine])
    versions = versions_between(engine_files(bracket.library)[engine].requires[1], *ends)
    asked: dict[str, tuple[str, list[Record]]] = {}

    def ask(version: str) -> tuple[str, list[Record]]:
        name = add(bracket, engine, version)
        found = _ask(bracket, settings, name).result().records
        say(*(f"  {one.system} {one.subject}: {one.verdict}" for one in sorted(found, key=attrgetter("system", "subject"))))
        asked[version] = name, found
        return asked[version]

    def changed(one: tuple[str, list[Record]], other: tuple[str, list[Record]]) -> bool:
        found = changes_between([*one[1], *other[1]], one[0], other[0])
        return any(change.what != TIME for change in found)

    found = first_changed(versions, ask, changed)
    records = [record for _, those in asked.values() for record in those]
    is_worse = _tell(bracket, settings, records, [asked[version][0] for version in found or ()], found)
    first = f"first changed by {engine} {found[1]}; {found[0]} is as {ends[0]}" if found else f"nothing changed from {ends[0]} to {ends[1]}"
    say("", f"{first}; asked: {', '.join(asked)} of {len(versions)} versions")
    bracket.finish([], False, not is_worse)


def _ask(bracket: Bracket, settings: Settings, *versions: str) -> CrossCheck:
    from harness.crosscheck.run import CrossCheck
    from harness.upgrade.study import settings_of

    study = CrossCheck(settings_of(settings, versions))
    bracket.complete(study, kept=False)
    return study


def _tell(bracket: Bracket, settings: Settings, records: Sequence[Record], names: Sequence[str], versions: Sequence[str] | None) -> bool:
    """Write and print what changed from one of two ``names`` of engines to the other; True where something became worse.

    Without ``versions`` nothing changed.
    """
    from harness.upgrade.study import Explanations, changes_between

    changes: list[RunChange] = []
    if versions is not None:
        explained = bracket.complete(Explanations(settings, records, *names), kept=False)
        changes = sorted([*changes_between(records, *names), *explained], key=attrgetter("system", "subject"))
    bracket.write_json(sorted(records, key=attrgetter("system", "subject")), changes=changes)
    if versions is None:
        return False
    print_titled(f"what changed from {versions[0]} to {versions[1]}", changes_table(changes))
    pairs = {(one.system, one.subject.partition("/")[2]) for one in records}
    changed = {(one.system, one.subject) for one in changes}
    worse = {(one.system, one.subject) for one in changes if one.is_worse}
    say("", f"{len(pairs) - len(changed)} of {len(pairs)} unchanged, {len(worse)} worse; errors count data roundoffs")
    return bool(worse)
