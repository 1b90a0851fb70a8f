"""``harness upgrade``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from operator import attrgetter
from typing import TYPE_CHECKING, Annotated

import click

from harness.commands import ENGINES
from harness.commands.frame.bracket import Bracket, computing
from harness.commands.frame.options import states_option, takes
from harness.commands.frame.terminal import say
from harness.errors import InvalidRequest
from harness.library import matching
from harness.results.upgrade import FILE, MECHANISM, Asked, Upgraded

if TYPE_CHECKING:
    from harness.crosscheck.run import CrossCheck
    from harness.crosscheck.settings import Settings
    from harness.results.records import Record
    from harness.results.trend import RunChange
    from harness.upgrade.study import Portraits


SECTION = ENGINES


@dataclass(frozen=True, kw_only=True)
class UpgradeOptions:
    """Versions that are held against each other."""

    engine: Annotated[str, click.argument("engine")]
    names: Annotated[tuple[str, ...], click.argument("names", nargs=-1, metavar="[OLD NEW] [NAME|FILE]...")]
    span: Annotated[
        str | None,
        click.option("--bisect", "span", metavar="GOOD..BAD", help="Find the first version between these two that changed something."),
    ]
    allows_left_out: Annotated[
        bool,
        click.option(
            "--allow-uncompared",
            "allows_left_out",
            is_flag=True,
            help="End with 0 although actuators, contacts or the like were not compared.",
        ),
    ]
    states: Annotated[int, states_option()]


@click.command("upgrade")
@takes(UpgradeOptions)
@computing(time_limit=60.0, scheduler=True, floating_base=True, detail=True)
def command(bracket: Bracket, asked: UpgradeOptions) -> None:
    """Say whether a new version of an engine changes your robots.

    Both versions are asked about the same mechanisms, or robots' FILEs, at the same states, called as a user calls them. The command
    compares their verdicts and errors, how each version reads the file, the numbers that it holds after loading (those of actuators and
    contacts too), and the accelerations without contacts. For the contacts of an MJCF it says which shapes touch and what changed: the
    points, the law, or the solver. It also says what it did not compare. --verbose adds the costs.

    Install a version that is not beside the harness with `harness engines add`; 3.13 means 3.13.0. --bisect installs the versions in
    between from the package index as it needs them.

    \b
    Examples:
      harness upgrade mujoco 3.13.0 4.0.0
      harness upgrade mujoco 3.13.0 4.0.0 robot.urdf
      harness upgrade mujoco --bisect 3.3.0..4.0.0 four_bar

    Exit status: 1 if something became worse, or changed where no truth says which version is right, or moves a robot and was not
    compared.
    """
    from harness.crosscheck.settings import Settings

    if asked.span is None and len(asked.names) < 2:
        raise click.UsageError("name two versions, as `harness upgrade mujoco 3.13.0 4.0.0`, or --bisect GOOD..BAD")
    versions, systems = (asked.names[:2], asked.names[2:]) if asked.span is None else (tuple(asked.span.split("..")), asked.names)
    if len(versions) != 2 or not all(versions):
        raise click.UsageError(f"--bisect {asked.span}: expected two versions as 3.3.0..4.0.0")
    bracket.choose_library(systems, anywhere=True, acts=True)
    settings = Settings(
        library=bracket.library, names=matching(bracket.library, systems), states=asked.states, seed=bracket.seed, examples=None
    )
    bracket.begin(asked.states, "upgrade")
    (_upgrade if asked.span is None else _bisect)(bracket, settings, asked, versions)


@dataclass(frozen=True)
class _Answers:
    """Answers of versions.

    Attributes:
        name: of a version, as of ``version_name``. study: that asked; records of it. portraits: of the same subjects.
    """

    study: CrossCheck
    records: Sequence[Record]
    portraits: Portraits


def _upgrade(bracket: Bracket, settings: Settings, asked: UpgradeOptions, versions: Sequence[str]) -> None:
    from harness.engines import engine_files
    from harness.upgrade.study import version_name

    before, now = (version_name(bracket.library, asked.engine, version) for version in versions)
    if before == now:
        raise InvalidRequest(f"{before} is one version; name two")
    found = _ask(bracket, settings, before, now)
    files = engine_files(bracket.library)
    upgraded = _explained(bracket, settings, asked, found, (before, now), [str(files[name].version) for name in (before, now)])
    say(*upgraded.lines(asked.allows_left_out, bracket.detail))
    crashed = any(subject is not None and subject.startswith(f"{now}/") for _, subject in found.study.crashes)
    bracket.finish(found.study.problems, crashed, upgraded.is_fine(asked.allows_left_out), found.study.faults)


def _bisect(bracket: Bracket, settings: Settings, asked: UpgradeOptions, ends: Sequence[str]) -> None:
    from harness.commands.engines import add, requested
    from harness.engines import engine_files
    from harness.environments import versions_between
    from harness.upgrade.study import first_changed, held_against

    ((engine, _),) = requested(bracket, [asked.engine])
    versions = versions_between(engine_files(bracket.library)[engine].requires[1], *ends)
    answers: dict[str, tuple[str, _Answers]] = {}

    def ask(version: str) -> tuple[str, _Answers]:
        name = add(bracket, engine, version, err=True)
        answers[version] = name, _ask(bracket, settings, name)
        return answers[version]

    def held(one: tuple[str, _Answers], other: tuple[str, _Answers]) -> list[Asked]:
        records = [*one[1].records, *other[1].records]
        return held_against(records, {**one[1].portraits, **other[1].portraits}, one[0], other[0])

    def changed(one: tuple[str, _Answers], other: tuple[str, _Answers]) -> bool:
        return any(pair.is_changed for pair in held(one, other))

    found = first_changed(versions, ask, changed)
    ends = found or (versions[0], versions[-1])
    (before, old), (now, new) = (answers[version] for version in ends)
    both = _Answers(new.study, [*old.records, *new.records], {**old.portraits, **new.portraits})
    upgraded = _explained(bracket, settings, asked, both, (before, now), ends)
    which = f"{upgraded.engine} {ends[1]} is the first version that changes anything, and {ends[0]} is as {versions[0]}"
    none = f"No version of {upgraded.engine} up to {ends[1]} changes what {ends[0]} does"
    say(f"{which if found else none}; asked: {', '.join(answers)} of {len(versions)} versions")
    say(*upgraded.lines(asked.allows_left_out, bracket.detail))
    bracket.finish([], False, upgraded.is_fine(asked.allows_left_out))


def _ask(bracket: Bracket, settings: Settings, *names: str) -> _Answers:
    from harness.crosscheck.run import CrossCheck
    from harness.upgrade.study import PortraitStudy, settings_of

    study = CrossCheck(settings_of(settings, names))
    records = bracket.complete(study, kept=False).records
    portraits = bracket.complete(PortraitStudy(settings, records), kept=False)
    if bracket.cut_short is not None:
        # From versions that were not asked to the end nothing follows.
        bracket.write_json(records)
        bracket.finish([], True, False)
    return _Answers(study, records, portraits)


def _explained(
    bracket: Bracket, settings: Settings, asked: UpgradeOptions, found: _Answers, names: tuple[str, str], versions: Sequence[str]
) -> Upgraded:
    """The changes from one of two versions, by their names as engines, to the other; the JSON file has them."""
    from harness.upgrade.study import Explanations, held_against

    changes: list[RunChange] = bracket.complete(Explanations(settings, found.records, *names), kept=False)
    pairs = held_against(found.records, found.portraits, *names, changes)
    noun = FILE if bracket.library.reads_files else MECHANISM
    engine = names[0].partition("@")[0]
    upgraded = Upgraded(engine=bracket.run.titles.get(engine, engine), before=versions[0], now=versions[1], noun=noun, asked=pairs)
    records = sorted(found.records, key=attrgetter("system", "subject"))
    bracket.write_json(records, changes=[one for pair in pairs for one in pair.changes], **upgraded.plain)
    return upgraded
