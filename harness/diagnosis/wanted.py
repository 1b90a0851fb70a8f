"""The diagnosis that a cross-check asks for; a run in which all is well imports nothing of it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from harness.crosscheck.run import CrossCheck
from harness.crosscheck.settings import Settings
from harness.results.cross_check import Cause
from harness.results.records import ACCELERATIONS, Record
from harness.study import Study, complete
from harness.verdict import Verdict
from harness.workers import Workers

# Of ``unstable`` the record itself says all there is to say.
_WRONG_ON_FILES = (Verdict.DISAGREES, Verdict.UNSUPPORTED)


class FileCauses(Study):
    """The causes of the records of users' files that are not as expected, which the cross-check has found; it asks nothing."""

    title, steps = "diagnosis", 0

    def __init__(self, records: Sequence[Record]) -> None:
        wrong = [record for record in records if record.verdict in _WRONG_ON_FILES and not record.as_expected]
        super().__init__(sorted(map(_cause, wrong), key=lambda cause: (cause.system, cause.subject)))


def _cause(record: Record) -> Cause:
    does = "refuses" if record.verdict == Verdict.UNSUPPORTED else "differs from"
    inference = f"the file is the truth, and {record.subject} {does} it"
    first = "; ".join([*(reading.statement for reading in record.readings), *record.rest]) or inference
    return Cause(system=record.system, subject=record.subject, inference=inference, first_line=first)


def diagnoses_of(settings: Settings, records: Sequence[Record], **options: Any) -> Study:
    """The study that finds the causes of a cross-check's records; its result is a list of ``Cause``.

    ``options`` are of ``harness.diagnosis.causes.Diagnoses``; those of robots' files are found without.
    """
    if settings.library.reads_files:
        return FileCauses(records)
    from harness.diagnosis.causes import Diagnoses

    return Diagnoses(settings, records, **options)


def wanted_diagnosis(study: CrossCheck, quantity: str = ACCELERATIONS, **limits: int) -> Study | None:
    """The study of why those records of a quantity are wrong that are not as expected; None where all are.

    ``limits`` as ``options`` of ``diagnoses_of``.
    """
    records = [record for record in study.result().records if record.quantity == quantity]
    if all(record.as_expected for record in records):
        return None
    return diagnoses_of(study.settings, records, crashes=study.crashes, **limits)


def find_causes(settings: Settings, records: Sequence[Record], workers: Workers, **options: Any) -> list[Cause]:
    """The result of ``diagnoses_of`` on workers whose context the caller has entered, by system and subject."""
    causes: list[Cause] = complete(diagnoses_of(settings, records, **options), workers)
    return causes
