"""A cross-check as a command runs it, with the causes of what is not as expected."""

from __future__ import annotations

import functools
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from harness.commands._bracket import Bracket
from harness.results.records import ACCELERATIONS

if TYPE_CHECKING:
    from harness.crosscheck.run import CrossCheck
    from harness.crosscheck.settings import Settings
    from harness.results.cross_check import Cause, CrossCheckResult


def cross_check(bracket: Bracket, settings: Settings, quantities: Sequence[str] = (ACCELERATIONS,)) -> CrossCheck:
    """Run to the end, and find why some records are not as expected; the causes are added to the result.

    One cross-check follows the other where there are several quantities; the last has the records of all, and what failed.
    """
    from harness.results.cross_check import CrossCheckResult

    before: CrossCheck | None = None
    for study in _studies(settings, quantities):
        found: CrossCheckResult = study.result()
        if before is not None:
            _append(before, study)
        bracket.complete(study, functools.partial(_document, found))
        before = study
    # What engines hold is the same whatever they are asked for.
    found.differs[:] = [one for place, one in enumerate(found.differs) if one not in found.differs[:place]]
    found.records.sort(key=lambda record: (record.system, record.subject, record.quantity))
    found.causes += causes_of(bracket, study)
    bracket.keep(CrossCheckResult(systems=found.systems, superfluous=found.superfluous, differs=found.differs, causes=found.causes))
    further = {"causes": found.causes, "remarks": settings.library.remarks()}
    present = {name: part for name, part in further.items() if part}
    bracket.write_json(found.records, superfluous=found.superfluous, differs=found.differs, **present)
    return study


def _document(found: CrossCheckResult) -> Mapping[str, Any]:
    """The parts of the JSON file while a cross-check runs."""
    return {"records": found.records, "superfluous": found.superfluous, "differs": found.differs}


def _studies(settings: Settings, quantities: Sequence[str]) -> Iterator[CrossCheck]:
    """The cross-check of each quantity, each made when the one before is complete; accelerations come first."""
    from harness.certify.quantities import find_quantities
    from harness.crosscheck.quantities import QuantityCheck
    from harness.crosscheck.run import CrossCheck

    if ACCELERATIONS in quantities:
        yield CrossCheck(settings)
    yield from (QuantityCheck(settings, quantity) for name, quantity in find_quantities().items() if name in quantities)


def _append(before: CrossCheck, study: CrossCheck) -> None:
    """Add what was found before to what a study has found so far."""
    study.result().extend(before.result())
    for problem in before.problems:
        study.report(problem)
    study.faults += before.faults
    study.crashes |= before.crashes
    study.crashed |= before.crashed


def causes_of(bracket: Bracket, study: CrossCheck, **limits: int) -> list[Cause]:
    """Why those records of accelerations are wrong that are not as expected, by system and subject; ``limits`` as for ``Diagnoses``."""
    from harness.diagnosis.wanted import wanted_diagnosis

    diagnoses = wanted_diagnosis(study, **limits)
    if diagnoses is None:
        return []
    bracket.complete(diagnoses, kept=False)
    causes: list[Cause] = diagnoses.result()
    return causes


def finish(bracket: Bracket, study: CrossCheck) -> None:
    """Print the table and what is not as expected, and exit."""
    from harness.commands._terminal import print_causes, print_count, print_differs, print_superfluous, print_table, print_unexpected, say

    found = study.result()
    print_table(found.records, bracket.run)
    say(*study.settings.library.remarks())
    print_unexpected(found.records)
    print_superfluous(found.superfluous)
    print_differs(found.differs)
    print_count(found.records, found.superfluous, found.differs)
    print_causes(found.causes, study.settings)
    bracket.finish(study.problems, study.crashed, found.as_expected, study.faults)
