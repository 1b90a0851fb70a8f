"""The cross-check, system by system: records, causes of what is not as expected, and a picture; then the worst cases of all.

Other quantities than accelerations follow at fewer states where accelerations are as expected.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace

from harness.comparison.wanted import wanted_diagnosis
from harness.crosscheck.loading import orphans
from harness.crosscheck.run import CrossCheck
from harness.crosscheck.settings import Settings
from harness.errors import InvalidModel
from harness.hard.worst_cases import ranked
from harness.night.stages import NightChoice, Stage, Steps, TrendNumbers, UnitFound
from harness.results.change_points import NightValue
from harness.results.cross_check import CrossCheckResult
from harness.results.night import Case, case_of
from harness.results.trend import Cell, readings_of_records
from harness.show.gallery import Gallery
from harness.truth.quantities import further_quantities
from harness.workers import Workers

NAME = "cross-check"
# At which other quantities than accelerations are compared.
QUANTITY_STATES = 128
# Beside the subjects of a system: what its files hold.
_FILES = "models"


def _units(choice: NightChoice) -> list[str]:
    return choice.library.select(choice.settings.names, with_variants=True)


def _steps(choice: NightChoice, name: str) -> Steps:
    settings = Settings(
        library=choice.library,
        names=[name],
        subjects=choice.subjects,
        states=choice.settings.states,
        seed=choice.settings.seed,
        # The simplest failing states of an interrupted run would come on top of those that a night has otherwise.
        examples=None,
        componentwise=True,
        replay_options=choice.replay_options,
    )
    study = CrossCheck(settings)
    yield study
    found: CrossCheckResult = study.result()
    problems, faults, crashed = list(study.problems), list(study.faults), study.crashed
    if all(record.as_expected for record in found.records):
        few = replace(settings, states=min(settings.states, QUANTITY_STATES))
        for quantity in further_quantities():
            check = CrossCheck(few, [quantity.name], audits=False)
            yield check
            found.extend(check.result())
            problems, faults, crashed = [*problems, *check.problems], [*faults, *check.faults], crashed or check.crashed
    diagnosis = wanted_diagnosis(study)
    if diagnosis is not None:
        yield diagnosis
        found.causes += diagnosis.result()
    gallery = Gallery(choice.library, [name], study.crashes)
    yield gallery
    found.extend(gallery.result())
    return UnitFound(result=found, problems=problems, faults=faults, crashed=crashed)


def _closing(choice: NightChoice, found: CrossCheckResult, workers: Workers) -> CrossCheckResult:
    return CrossCheckResult(worst_cases=ranked(choice.library, found.records, workers))


def _problems(choice: NightChoice) -> Iterable[InvalidModel]:
    return () if choice.settings.names else orphans(choice.library)


def _cases(found: CrossCheckResult) -> Iterator[Case]:
    yield from (case_of(record, NAME) for record in found.records)
    wrong: dict[str, list[str]] = {system: [] for system in sorted({record.system for record in found.records})}
    for part in found.superfluous:
        wrong[part.system] += [f"superfluous: {part}"] if part.fails else []
    for finding in found.differs:
        wrong[finding.system] += [f"not held alike after loading: {finding}"] if finding.fails else []
    for system, sentences in wrong.items():
        yield Case.of((NAME, system, _FILES), sentences, replay=f"harness check {system}")


def _readings(found: CrossCheckResult) -> dict[Cell, NightValue]:
    """Numbers of accelerations: a median over the few states of another quantity may be any of the values that its answers often have."""
    return readings_of_records(record for record in found.records if not record.is_further)


STAGE = Stage(
    name=NAME,
    place=1,
    kind=CrossCheckResult,
    time_limit=60.0,
    units=_units,
    steps=_steps,
    cases=_cases,
    closing=_closing,
    problems=_problems,
    numbers=TrendNumbers(part="records", readings=_readings),
)
