"""The diagnosis that a cross-check asks for; a run in which all is well imports nothing of it."""

from __future__ import annotations

from harness.crosscheck.run import CrossCheck
from harness.results.records import ACCELERATIONS
from harness.study import Study


def wanted_diagnosis(study: CrossCheck, quantity: str = ACCELERATIONS, **limits: int) -> Study | None:
    """The study of why those records of a quantity are wrong that are not as expected; None where all are.

    Its result is a list of ``Cause``; ``limits`` as for ``Diagnoses``, which is of accelerations.
    """
    records = [record for record in study.result().records if record.quantity == quantity]
    if all(record.as_expected for record in records):
        return None
    if quantity != ACCELERATIONS:
        from harness.diagnosis.quantities import QuantityDiagnoses

        return QuantityDiagnoses(study.settings, records, crashes=study.crashes)
    from harness.diagnosis.causes import diagnoses_of

    return diagnoses_of(study.settings.library, study.settings, records, crashes=study.crashes, **limits)
