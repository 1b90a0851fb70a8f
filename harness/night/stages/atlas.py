"""The atlas, case by case, and where motion is asked for the motions that part."""

from __future__ import annotations

from collections.abc import Iterator

from harness.hard.atlas import AtlasStudy
from harness.hard.cases import STATES, hard_cases
from harness.night.stages import NightChoice, Stage, cases_about, one_study
from harness.results.atlas import Atlas
from harness.results.night import BROKEN, FAILED, Case

NAME = "atlas"
_MOTION = "motion"


def _units(choice: NightChoice) -> list[str]:
    names = choice.settings.cases or list(hard_cases())
    return [*dict.fromkeys(names), *([_MOTION] if choice.settings.motion else [])]


def _study(choice: NightChoice, name: str) -> AtlasStudy:
    of_motion = name == _MOTION
    return AtlasStudy(choice.library, () if of_motion else [name], motion=of_motion, families=not of_motion)


def _cases(found: Atlas) -> Iterator[Case]:
    for row in found.rows:
        outcome, replay = BROKEN if row.crashed else FAILED, f"harness atlas {row.case} --subject {row.subject}"
        yield Case.of((NAME, row.case, row.subject), row.problems, outcome=outcome, replay=replay, seconds=row.seconds)
    yield from cases_about(NAME, _MOTION, Atlas(partings=found.partings, stable_steps=found.stable_steps).unexpected)
    yield from cases_about(NAME, "not measured", found.problems, BROKEN)


STAGE = Stage(
    name=NAME,
    place=2,
    kind=Atlas,
    time_limit=600.0,
    units=_units,
    steps=one_study(_study),
    cases=_cases,
    profile=lambda choice: NAME,
    states=lambda choice: STATES,
)
