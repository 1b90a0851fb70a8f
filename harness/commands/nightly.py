"""``harness nightly``."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from harness.commands import STUDIES
from harness.commands.frame.bracket import Bracket, computing, cut_short
from harness.commands.frame.options import STATES_OF_PROFILE, states_option, time_limit_option
from harness.commands.frame.pages import write_page
from harness.commands.frame.terminal import print_titled, progress, say
from harness.errors import InvalidInput, InvalidRequest, require
from harness.library import matching
from harness.results.table import counted
from harness.workers import SchedulerLost

if TYPE_CHECKING:
    from harness.night.course import Course
    from harness.night.stage import NightChoice, Stage
    from harness.report.night import NightSummary

SECTION = STUDIES
SUMMARY, JUNIT = "nightly.md", "nightly.xml"
# Where GitHub's runner reads the summary of a step.
STEP_SUMMARY = "GITHUB_STEP_SUMMARY"


@click.command("nightly")
@click.argument("names", nargs=-1, metavar="[NAME]...")
@states_option(STATES_OF_PROFILE["nightly"])
@click.option(
    "--stage", "stages", multiple=True, metavar="NAME", help="Only this stage: cross-check, atlas, survey, bench or faults; repeatable."
)
@click.option("--survey", multiple=True, metavar="FOLDER", help="Survey the robots of this folder or package; repeatable.")
@click.option("--engine", "engines", multiple=True, metavar="ENGINE@VERSION", help="Ask this one beside the installed ones; repeatable.")
@click.option("--case", "cases", multiple=True, metavar="CASE", help="Only this case of the atlas; repeatable.")
@click.option(
    "--faults",
    "models",
    type=click.IntRange(min=0),
    default=4,
    show_default=True,
    help="Models that faults are planted in, drawn by the seed.",
)
@click.option("--motion", is_flag=True, help="Measure motion too, in atlas and benchmark.")
@click.option(
    "--profile", type=click.Choice(["quick", "nightly"]), default="quick", show_default=True, help="How thorough the benchmark is."
)
@click.option("--resume", is_flag=True, help="Go on with the last night in the folder of the report where it has not ended.")
@time_limit_option(None, shown="of each stage")
@computing(scheduler=True, directory=True)
def command(bracket: Bracket, names: tuple[str, ...], stages: tuple[str, ...], resume: bool, **asked: Any) -> None:
    """Run everything in a night that may be killed.

    Cross-check, atlas, survey, benchmark and a sample of the fault campaign. Each system, case, robot and model is stored when it is
    complete, and its answers as they come in; --resume goes on from there. The folder of the report gets the page, a summary (nightly.md,
    which is also the summary of a GitHub step), nightly.xml for CI (JUnit), and what is new since the last night.

    \b
    Examples:
      harness nightly
      harness nightly --resume --out night
      harness nightly --survey robots/ --states 10000
      harness nightly --library mine --stage cross-check --stage bench
      harness nightly --engine mujoco@3.13.0 --scheduler tls://cluster:8786
    """
    from harness.night.course import Course
    from harness.night.stages import select_stages

    require("a night takes charts, searches and machine code", "bokeh", "cma", "heyoka")
    chosen = select_stages(stages)
    choice = _choice(bracket, chosen, names, {name: list(value) if isinstance(value, tuple) else value for name, value in asked.items()})
    begun = bracket.begin(choice.settings.states, "nightly")
    course = (Course.resume if resume else Course.begin)(bracket.history, begun, choice)
    if resume:
        say(f"harness: {_how_it_goes_on(course)}", err=True)
    bracket.run = course.run
    asked_for = [stage for stage in chosen if stage.name in choice.settings.stages]
    try:
        for stage in asked_for:
            _complete(bracket, course, stage)
    except SchedulerLost as loss:
        cut_short(bracket, loss, f"the night has {counted(len(course.night.done), 'complete unit')}, and --resume goes on with the others")
    summary = _summary(course, asked_for, choice, is_complete=bracket.cut_short is None)
    _write(bracket, course, summary)
    if bracket.cut_short is None:
        course.end(summary.sentence)
    _print(bracket, summary)
    bracket.finish(
        [InvalidRequest(problem) for problem in summary.problems], summary.night.crashed, summary.as_expected, summary.night.faults
    )


def _choice(bracket: Bracket, stages: Sequence[Stage], names: Sequence[str], asked: dict[str, Any]) -> NightChoice:
    """Choice of the night.

    Raises:
        InvalidInput: the library, or a place to survey, cannot be used.
        InvalidRequest: a name of anything that does not exist.
    """
    from harness.crosscheck.settings import describe_run
    from harness.night.course import digests, subjects_of
    from harness.night.stage import NightChoice
    from harness.results.night import NightSettings

    library = bracket.library
    settings = NightSettings(
        stages=[],
        names=matching(library, names),
        seed=bracket.seed,
        versions=describe_run(library, asked["states"], bracket.seed, "nightly", [], "").versions,
        inputs=digests(library, asked["survey"]),
        **asked,
    )
    choice = NightChoice(library, settings, subjects_of(library, settings.engines), bracket.replay_options)
    settings = replace(settings, stages=[stage.name for stage in stages if stage.units(choice)])
    if not settings.stages:
        raise InvalidRequest("no stage has anything to do: a survey needs --survey FOLDER, a campaign --faults of 1 at least")
    return replace(choice, settings=settings)


def _how_it_goes_on(course: Course) -> str:
    kept = course.answered.count()
    if not course.resumed and not kept:
        return f"no night of this library was interrupted with anything answered; this one began at {course.run.started}"
    under_way = f", and {counted(kept, 'answer')} of those under way" if kept else ""
    return f"the night that began at {course.run.started} goes on: it has {counted(course.resumed, 'complete unit')}{under_way}"


def _complete(bracket: Bracket, course: Course, stage: Stage) -> None:
    """Run what is left of a stage."""
    steps = course.steps(stage)
    if steps:
        with bracket.pool_for(bracket.time_limit or stage.time_limit, stage.is_timed) as workers, progress(steps, stage.name) as advance:
            for part in course.complete(stage, workers):
                advance(part.label)


def _summary(course: Course, stages: Sequence[Stage], choice: NightChoice, is_complete: bool) -> NightSummary:
    from harness.night.course import cases_of, changes_of
    from harness.report.night import NightSummary

    cases = [case for stage in sorted(stages, key=lambda stage: stage.name) for case in cases_of(course.history, course.night, stage)]
    return NightSummary(
        run=course.run,
        night=course.night,
        cases=cases,
        before=course.night_before(stages) if is_complete else None,
        changes=changes_of(course, stages) if is_complete else [],
        problems=list(dict.fromkeys([*(str(problem) for stage in stages for problem in stage.problems(choice)), *course.night.problems])),
        resumed=course.resumed,
    )


def _write(bracket: Bracket, course: Course, summary: NightSummary) -> None:
    """The page, the summary, JUnit XML and JSON."""
    from harness.report import write
    from harness.report.night import render_junit, render_summary

    write_page(bracket, course.night.study_of("cross-check"))
    text = render_summary(summary)
    write(bracket.directory, {SUMMARY: text, JUNIT: render_junit(summary)})
    if path := os.environ.get(STEP_SUMMARY):
        try:
            with Path(path).open("a", encoding="utf-8") as stream:
                stream.write(text)
        except OSError as error:
            raise InvalidInput(path, None, f"cannot be written ({error.strerror}); {STEP_SUMMARY} names it") from error
    bracket.write_json(**summary.to_json())


def _print(bracket: Bracket, summary: NightSummary) -> None:
    from harness.report.night import counts_table
    from harness.results.trend import trend_changes_table

    say(summary.sentence)
    for case in summary.bad:
        say("", f"{case.title}: {case.outcome}", *(f"  {line}" for line in (case.details or case.message).split("\n")))
        say(*([f"  replay: {case.replay}"] if case.replay and case.replay not in case.details else []))
    print_titled("cases", counts_table(summary))
    print_titled("changed in the trend", trend_changes_table(summary.changes))
    say("", f"summary: {bracket.directory / SUMMARY}", f"JUnit XML: {bracket.directory / JUNIT}")
