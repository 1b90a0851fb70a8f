"""``harness faults``."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from operator import attrgetter
from typing import TYPE_CHECKING, Annotated, Any

import click
from click.core import ParameterSource

from harness.commands import STUDIES
from harness.commands.frame.bracket import Bracket, computing
from harness.commands.frame.options import states_option, subjects_option, takes
from harness.commands.frame.terminal import print_rows, say
from harness.errors import InvalidRequest
from harness.library import nearest
from harness.results.table import Cell, Column, Table, grouped

if TYPE_CHECKING:
    from harness.diagnosis.faults.campaign import CampaignSettings
    from harness.diagnosis.faults.study import FaultStudy
    from harness.diagnosis.faults.summary import Fault, KindOfFault, SmallestChange
    from harness.library import Library

# Options of a campaign alone.
SECTION = STUDIES
_OF_A_CAMPAIGN = {"kinds": "--kind", "sizes": "--size", "diagnoses": "--diagnoses", "every_diagnosis": "--every-diagnosis"}


@dataclass(frozen=True, kw_only=True)
class FaultOptions:
    """Faults that are asked for."""

    names: Annotated[tuple[str, ...], click.argument("names", nargs=-1, metavar="[NAME|FILE]...")]
    kinds: Annotated[
        tuple[str, ...],
        click.option(
            "--kind", "kinds", multiple=True, metavar="KIND", help="Only this kind of fault; repeatable. harness list faults has them."
        ),
    ]
    sizes: Annotated[
        tuple[float, ...],
        click.option(
            "--size",
            "sizes",
            multiple=True,
            type=click.FloatRange(min=0, max=1, min_open=True),
            help="Relative size of a changed number; repeatable. Decades from 1e-12 to 1 by default.",
        ),
    ]
    states: Annotated[int, states_option()]
    diagnoses: Annotated[
        int,
        click.option(
            "--diagnoses",
            type=click.IntRange(min=0),
            default=4,
            show_default=True,
            help="Faults of each kind in each model that are diagnosed, spread evenly.",
        ),
    ]
    every_diagnosis: Annotated[
        bool, click.option("--every-diagnosis", is_flag=True, help="Diagnose every fault, which takes hours for the whole catalogue.")
    ]
    smallest: Annotated[
        bool,
        click.option("--smallest", is_flag=True, help="Only each number, and the smallest change of it that is caught, beside theory."),
    ]
    subjects: Annotated[tuple[str, ...], subjects_option]


@click.command("faults")
@takes(FaultOptions)
@computing(time_limit=36000.0, scheduler=True)
def command(bracket: Bracket, asked: FaultOptions) -> None:
    """Plant mistakes in models, and count those that are found.

    Every kind of mistake is planted in the models of NAMEs, or of all mechanisms. In a robot's FILE it is the numbers of actuators, dry
    friction, limits and equalities, each changed by 1 % and by 10 times what data roundoff can hide; there a kind is an attribute, such as
    gear or solreflimit. With --smallest, each number is changed by less and less until no check sees it.

    Exit status: 0 if every mistake that changes the dynamics is caught, 95 % of those diagnosed are named first or in their class, and no
    sound party is blamed; else 1.

    \b
    Examples:
      harness faults arm_2r --kind axis
      harness faults arm_2r --kind number --size 1e-6 --diagnoses 0
      harness faults arm_2r --smallest --subject mujoco/mjcf
      harness faults robot.xml --kind gear
    """
    from harness.diagnosis.faults.campaign import SIZES, CampaignSettings, kinds_of_faults
    from harness.diagnosis.faults.study import campaign, smallest
    from harness.diagnosis.faults.summary import broken_bars, by_kind, shares

    if asked.subjects and not asked.smallest:
        raise InvalidRequest("--subject belongs to --smallest; a campaign plants its faults for every subject that reads the file")
    source = click.get_current_context().get_parameter_source
    given = [option for name, option in _OF_A_CAMPAIGN.items() if source(name) is not ParameterSource.DEFAULT]
    if given and asked.smallest:
        raise InvalidRequest(f"--smallest plants no faults of a campaign and takes no {' or '.join(given)}; drop one or the other")
    bracket.choose_library(asked.names, anywhere=True)
    of_files = bracket.library.reads_files
    if of_files and asked.smallest:
        raise InvalidRequest(f"--smallest is of mechanisms' models, and {asked.names[0]} is a robot's file; drop it")
    for kind in asked.kinds:
        if not of_files and kind not in kinds_of_faults():
            raise InvalidRequest(f"no fault is of kind {kind!r}; {nearest(kind, kinds_of_faults())}; see harness list faults")
    if asked.smallest:
        study = smallest(bracket.library, asked.names, asked.subjects, asked.states, bracket.seed)
    else:
        diagnosed = None if asked.every_diagnosis else asked.diagnoses
        settings = CampaignSettings(
            kinds=asked.kinds, sizes=sorted(asked.sizes) or SIZES, states=asked.states, seed=bracket.seed, diagnosed=diagnosed
        )
        study = _of_files(bracket.library, asked, settings) if of_files else campaign(bracket.library, asked.names, settings)
    bracket.begin(asked.states, "faults")

    def document() -> dict[str, Any]:
        rows = study.result()
        summary = {} if asked.smallest else {"shares": shares(by_kind(rows))}
        return {"faults": [row.as_json() for row in rows], **summary}

    rows = bracket.complete(study, document)
    broken = [row for row in rows if not row.as_in_theory] if asked.smallest else broken_bars(rows)
    say(*(f"harness: {sentence}" for sentence in study.deaths), err=True)
    if rows and asked.smallest:
        print_caught(rows)
    elif rows:
        print_kinds(by_kind(rows))
    elif not study.problems and not study.crashed:
        say("no faults were planted: nothing in the models can be wrong in this way; name other kinds or mechanisms")
    _print_left_out(study.left_out)
    if not asked.smallest:
        _print_faults(rows)
        say(*broken)
    bracket.finish(study.problems, study.crashed, bool(rows) and not broken and not study.refused)


def _of_files(library: Library, asked: FaultOptions, settings: CampaignSettings) -> FaultStudy:
    """The campaign over robots' files, with states and sizes of its own where none are given."""
    from harness.comparison.planted import STATES, file_campaign

    is_given = click.get_current_context().get_parameter_source("states") is not ParameterSource.DEFAULT
    return file_campaign(library, replace(settings, sizes=sorted(asked.sizes), states=asked.states if is_given else STATES))


def _print_left_out(reasons: Mapping[tuple[str, str], str]) -> None:
    """One line for each system of which (system, subject or format) are expected to be unsupported, with the reason of the first."""
    for system, left_out in grouped((name, (what, reason)) for (name, what), reason in reasons.items()).items():
        say(f"{system}: no {' and no '.join(what for what, _ in left_out)}, as expected: {left_out[0][1]}")


def _print_faults(faults: Sequence[Fault]) -> None:
    """A line for each fault that was not caught, not named, or blamed on somebody sound; and how many one reader alone feels."""
    for fault in faults:
        if not fault.live:
            continue
        missed = f" in size {', '.join(f'{size:g}' for size in fault.missed)}" if fault.missed else ""
        wrong = [] if fault.caught else [f"not caught{missed}"]
        wrong += [f"blamed on {fault.blamed}"] if fault.blamed else []
        wrong += ["not named"] if fault.known and fault.judged and not (fault.named or fault.in_class) else []
        if wrong:
            line, element, attribute = fault.where[0]
            size = f" by {fault.diagnosed:g}" if fault.sizes and fault.diagnosed else ""
            what = ": ".join(filter(None, [f"{fault.kind}{size}", fault.statement, ", ".join(wrong)]))
            answer = f"; {fault.answer}" if fault.answer else ""
            say(f"{fault.system}/{fault.format}:{line}: <{element} {attribute}> {what}{answer}")
    if cleared := [fault.cleared for fault in faults if fault.cleared]:
        say(f"{len(cleared)} faults are felt by one reader alone ({', '.join(sorted(set(cleared)))}); the diagnosis finds them in the file")


def print_caught(caught: Sequence[SmallestChange]) -> None:
    """One row per live number of a model, and how far theory was kept in all."""
    from harness.diagnosis.faults.reader import MOST_ABOVE_THEORY

    columns: dict[Column | str, Any] = {
        "system": "system",
        "subject": "subject",
        "where": lambda found: f"{found.file}:{found.place.line}",
        "number": "number",
        Column("value", "given"): "value",
        Column("smallest caught", "error"): "smallest",
        Column("theory", "error"): "theory",
        Column("ratio", "rounded"): lambda found: Cell(found.ratio, tone="" if found.as_in_theory else "surprise"),
    }
    fine = sum(found.smallest < 1e-10 for found in caught) / len(caught)
    furthest, beyond = max(found.ratio for found in caught), sum(not found.as_in_theory for found in caught)
    of_theory = f"at most {furthest:.2f} times theory, {MOST_ABOVE_THEORY:g} allowed"
    worse = f", {beyond} of them beyond it" if beyond else ""
    say(f"{len(caught)} live numbers{worse}; {fine:.1%} caught below 1e-10; {of_theory}", "")
    print_rows(Table.of(caught, columns))
    say("", "the number of each model that hides the largest error:")
    pairs = itertools.groupby(caught, key=attrgetter("system", "subject"))
    hiding = Table.of([max(own, key=attrgetter("smallest")) for _, own in pairs], columns)
    print_rows(hiding.without("where", "value", "ratio"))


def print_kinds(kinds: Sequence[KindOfFault]) -> None:
    """One row per kind of fault of a campaign, and sentences over the kinds that the diagnosis knows and over the others."""
    from harness.diagnosis.faults.summary import shares

    columns: dict[Column | str, Any] = {
        "kind": "kind",
        **{Column(name, "count"): name for name in ("planted", "live", "caught", "judged")},
        Column("named first", "count"): lambda one: f"{one.named / one.judged:.0%}" if one.judged else "",
        Column("in class", "count"): lambda one: f"{one.in_class / one.judged:.0%}" if one.judged else "",
        Column("blamed", "count"): "blamed",
        Column("value right", "count"): lambda one: f"{one.right} of {one.found}" if one.found else "",
        **{Column(name, "count"): name for name in ("misled", "stopped")},
        **{Column(name, "error"): name for name in ("smallest", "theory", "seconds", "longest")},
    }
    live, caught = sum(one.live for one in kinds), sum(one.caught for one in kinds)
    found = shares(kinds)
    say(f"{caught} of {live} faults that change the dynamics are caught")
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
    say("")
    print_rows(Table.of(kinds, columns))
