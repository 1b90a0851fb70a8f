"""The catalogue's worst cases per subject, each explained and with a program that reproduces it: what a report ranks.

A case is a cross-check's record, or a stored state of the very versions that the cross-check ran; of other versions
the cross-check has compared the state anew.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from harness.crosscheck import tasks
from harness.engines import Subject, select_subjects
from harness.equations.states import States
from harness.hard.lost_digits import locate
from harness.hard.reproducer import reproduce
from harness.library import Library
from harness.results.hard_states import FoundState, RankedCase, load_found, worst_cases
from harness.results.records import Record, Run
from harness.verdict import Verdict
from harness.workers import Task, Workers


def ranked(
    library: Library, run: Run, records: Sequence[Record], workers: Workers, most: int = 10, replay_options: Sequence[str] = ()
) -> list[RankedCase]:
    """The worst cases of each subject, worst first, at most ``most`` each, on workers whose context the caller has entered.

    To what a record says is added which term loses the digits at the state shown; a case that cannot be explained, as
    where the engine crashes, keeps its own words.

    Raises:
        InvalidInput: the stored states of a system cannot be used.
    """
    systems = sorted({record.system for record in records})
    # The cross-check has compared the states of other versions anew.
    found = {name: [one for one in load_found(library, name) if one.versions.items() <= run.versions.items()] for name in systems}
    cases = worst_cases(records, found, most, replay_options)
    subjects = {str(subject): subject for subject in select_subjects(library, [])}
    work = [
        Task((index, function), function, (library, case.system, subjects[case.subject], case.state))
        for index, case in enumerate(cases)
        for function in _functions(case, found[case.system])
    ]
    for outcome in workers.run(work):
        index, function = outcome.task.key
        case, text = cases[index], outcome.value or ""
        if function is write_reproducer:
            cases[index] = replace(case, reproducer=text)
        else:
            cases[index] = replace(case, statement=" ".join(filter(None, [case.statement, text])))
    return cases


def state_loss(library: Library, system: str, subject: Subject, state: dict[str, list[float]], note: tasks.Note) -> str:
    """In a sentence, which term of the equations loses the digits there."""
    return locate(tasks.Assignment.of(library, system, subject), States.at(**state)).statement


def write_reproducer(library: Library, system: str, subject: Subject, state: dict[str, list[float]], note: tasks.Note) -> str:
    """The program in the engine's own Python API; the engine is not asked at the state."""
    return reproduce(tasks.Assignment.of(library, system, subject), States.at(**state))


def _functions(case: RankedCase, found: Sequence[FoundState]) -> list[Callable[..., str]]:
    # An engine that gave no number, or no answer at all, would do so again.
    explained = case.verdict == Verdict.ERROR or case.statement in {one.statement for one in found}
    return [write_reproducer] if explained else [write_reproducer, state_loss]
