"""The survey of robots' files in the folders and packages that were given."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from operator import attrgetter
from pathlib import Path

from harness.comparison.collection import find_files
from harness.comparison.study import ComparisonSettings, RobotComparison
from harness.night.stages import NightChoice, Stage, one_study
from harness.report.comparison import subject_lines
from harness.results.comparison import FilesComparison, survey_profile
from harness.results.night import BROKEN, FAILED, LEFT_OUT, Case
from harness.verdict import Verdict

NAME = "survey"
STATES = 32


def _units(choice: NightChoice) -> list[str]:
    return [str(path) for path in find_files(choice.settings.survey)] if choice.settings.survey else []


def _study(choice: NightChoice, path: str) -> RobotComparison:
    return RobotComparison(ComparisonSettings((Path(path),), STATES, choice.settings.seed, pairwise=False), NAME)


def _cases(found: FilesComparison) -> Iterator[Case]:
    for file in found.files:
        wrong = [file.problem] if file.problem else []
        yield Case.of((NAME, file.path, file.format or "file"), wrong, replay=_replay(file.path))
    for one in found.subjects:
        name, outcome = f"{one.subject}, {one.kind}", BROKEN if one.verdict == Verdict.ERROR else FAILED
        if one.explained and one.verdict == Verdict.UNSUPPORTED:
            yield Case(stage=NAME, group=one.path, name=name, outcome=LEFT_OUT, message=one.message)
        else:
            wrong = [] if one.explained else subject_lines(one) or [one.outcome]
            yield Case.of((NAME, one.path, name), wrong, outcome=outcome, replay=_replay(one.path))
    for held in found.equalities:
        wrong = [] if held.explained else [held.message or f"{held.verdict}, not explained"]
        yield Case.of((NAME, held.path, f"{held.subject}, plain, with the file's equalities"), wrong, replay=_replay(held.path))


def _replay(path: str) -> str:
    return shlex.join(["harness", "compare", path])


STAGE = Stage(
    name=NAME,
    place=3,
    kind=FilesComparison,
    time_limit=300.0,
    units=_units,
    steps=one_study(_study, problems=attrgetter("faults")),
    cases=_cases,
    profile=lambda choice: survey_profile(choice.settings.survey),
    states=lambda choice: STATES,
)
