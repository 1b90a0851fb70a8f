"""The catalogue's worst cases per subject, each explained and with a program that reproduces it: what a report ranks.

A case is a cross-check's record. Stored states are among those that the cross-check compared.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from harness.crosscheck.assignment import Assignment
from harness.crosscheck.tasks import Note
from harness.engines import Subject, select_subjects
from harness.hard.lost_digits import locate
from harness.hard.reproducer import reproduce
from harness.library import Library
from harness.programs.states import States
from harness.results.hard_states import RankedCase, worst_cases
from harness.results.records import Record
from harness.verdict import Verdict
from harness.workers import Task, Workers


def ranked(library: Library, records: Sequence[Record], workers: Workers, most: int = 10) -> list[RankedCase]:
    """The worst cases of each subject, worst first, at most ``most`` each, on workers whose context the caller has entered.

    To what a record says is added which term loses the digits at the state shown; a case that cannot be explained, as
    where the engine crashes, keeps its own words.
    """
    cases = worst_cases(records, most)
    subjects = {str(subject): subject for subject in select_subjects(library, sorted({case.subject for case in cases}))}
    work = [
        Task((index, function), function, (library, case.system, subjects[case.subject], case.state))
        for index, case in enumerate(cases)
        for function in _functions(case)
    ]
    for outcome in workers.run(work):
        index, function = outcome.task.key
        case, text = cases[index], outcome.value or ""
        if function is write_reproducer:
            cases[index] = replace(case, reproducer=text)
        else:
            cases[index] = replace(case, statement=" ".join(filter(None, [case.statement, text])))
    return cases


def state_loss(library: Library, system: str, subject: Subject, state: dict[str, list[float]], note: Note) -> str:
    """In a sentence, which term of the equations loses the digits there."""
    return locate(Assignment.of(library, system, subject), States.at(**state)).statement


def write_reproducer(library: Library, system: str, subject: Subject, state: dict[str, list[float]], note: Note) -> str:
    """The program in the engine's own Python API; the engine is not asked at the state."""
    return reproduce(Assignment.of(library, system, subject), States.at(**state))


def _functions(case: RankedCase) -> list[Callable[..., str]]:
    # An engine that gave no number, or no answer at all, would do so again.
    return [write_reproducer] if case.verdict == Verdict.ERROR else [write_reproducer, state_loss]
