"""A cross-check as a command runs it: progress, JSON as it grows, and the exit status."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from harness.commands._options import AS_EXPECTED, CRASHED, NOT_AS_EXPECTED, tell

if TYPE_CHECKING:
    from harness.check.run import CrossCheck
    from harness.check.settings import Settings
    from harness.results.causes import Cause
    from harness.results.records import Record, Run
    from harness.workers import Scheduler, Workers


def cross_check_all(
    settings: Settings,
    run: Run,
    workers: int | None,
    scheduler: Scheduler | None,
    time_limit: float,
    json_path: str | None,
    keep: Callable[[Record], Any] = lambda record: None,
    keep_rest: Callable[[CrossCheck], Any] = lambda cross_check: None,
) -> tuple[CrossCheck, list[Record], list[Cause]]:
    """Run to the end, keeping each record as it comes, find why some are not as expected, and write the JSON file as it grows.

    ``keep_rest`` is given the cross-check once all records are there, before causes are looked for.
    """
    from harness.check.run import CrossCheck
    from harness.commands._terminal import progress
    from harness.results.records import write_json
    from harness.workers import Workers

    records: list[Record] = []
    pool = Workers(workers, scheduler, time_limit)
    cross_check = CrossCheck(settings, pool)
    with pool:
        with progress(cross_check.expected_records) as advance:
            for record in cross_check.records():
                keep(record)
                records.append(record)
                if json_path:
                    write_json(json_path, run, records, superfluous=cross_check.superfluous)
                advance(f"{record.system} {record.subject}")
        keep_rest(cross_check)
        causes = causes_of(cross_check, records, pool)
    records.sort(key=lambda record: (record.system, record.subject))
    if json_path:
        further = {"causes": [cause.as_json() for cause in causes]} if causes else None
        write_json(json_path, run, records, superfluous=cross_check.superfluous, further=further)
    return cross_check, records, causes


def causes_of(cross_check: CrossCheck, records: list[Record], pool: Workers, **limits: float) -> list[Cause]:
    """Why those of ``records`` are wrong that are not as expected, by system and subject; ``limits`` as for ``find_causes``."""
    if all(record.as_expected for record in records):
        return []
    # Imported late: a run in which all is well needs nothing of it.
    from harness.commands._terminal import progress
    from harness.diagnose.causes import find_causes, wrong_records

    causes: list[Cause] = []
    with progress(len(wrong_records(records)), "diagnosis") as advance:
        for cause in find_causes(cross_check.settings, records, pool, crashes=cross_check.crashes, **limits):
            causes.append(cause)
            advance(f"{cause.system} {cause.subject}")
    return sorted(causes, key=lambda cause: (cause.system, cause.subject))


def finish(cross_check: CrossCheck, records: list[Record], causes: list[Cause]) -> None:
    """Print the table and what is not as expected; exit with the status the run has earned, invalid input first."""
    from harness.commands._terminal import print_causes, print_superfluous, print_table, print_unexpected

    print_table(records)
    print_unexpected(records)
    print_superfluous(cross_check.superfluous)
    print_causes(causes, cross_check.settings)
    tell(cross_check.problems)
    if cross_check.crashes:
        sys.exit(CRASHED)
    as_expected = all(record.as_expected for record in records) and not cross_check.superfluous
    sys.exit(AS_EXPECTED if as_expected else NOT_AS_EXPECTED)
