"""A cross-check as a command runs it, with the causes of what is not as expected."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from harness.commands._bracket import Bracket

if TYPE_CHECKING:
    from harness.check.run import CrossCheck, CrossChecked
    from harness.check.settings import Settings
    from harness.results.causes import Cause


def cross_check(bracket: Bracket, settings: Settings, keep: Callable[[Any], Any] = lambda value: None) -> tuple[CrossCheck, list[Cause]]:
    """Run to the end, giving each record to ``keep`` as it comes, find why some are not as expected, and write the JSON file."""
    from harness.check.run import CrossCheck

    study = CrossCheck(settings)
    found = study.result()
    for part in bracket.parts(study, lambda: {"records": found.records, "superfluous": found.superfluous}):
        keep(part.value)
    found.records.sort(key=lambda record: (record.system, record.subject))
    for value in (*found.cards, *found.superfluous):
        keep(value)
    causes = causes_of(bracket, study)
    further = {"causes": [cause.as_json() for cause in causes]} if causes else None
    bracket.write_json(found.records, superfluous=found.superfluous, further=further)
    return study, causes


def causes_of(bracket: Bracket, study: CrossCheck, **limits: int) -> list[Cause]:
    """Why those records are wrong that are not as expected, by system and subject; ``limits`` as for ``Diagnoses``."""
    records = study.result().records
    if all(record.as_expected for record in records):
        return []
    # Imported late: a run in which all is well needs nothing of it.
    from harness.diagnose.causes import Diagnoses

    diagnoses = Diagnoses(study.settings, records, crashes=study.crashes, **limits)
    for _ in bracket.parts(diagnoses):
        pass
    return diagnoses.result()


def is_as_expected(found: CrossChecked) -> bool:
    """Whether every verdict is the expected one and no model holds more than its scene needs."""
    return all(record.as_expected for record in found.records) and not found.superfluous


def finish(bracket: Bracket, study: CrossCheck, causes: list[Cause]) -> None:
    """Print the table and what is not as expected, and exit."""
    from harness.commands._terminal import print_causes, print_superfluous, print_table, print_unexpected

    found = study.result()
    print_table(found.records)
    print_unexpected(found.records)
    print_superfluous(found.superfluous)
    print_causes(causes, study.settings)
    bracket.finish(study.problems, study.crashed, is_as_expected(found))
