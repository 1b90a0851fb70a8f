"""Two versions of an engine asked about the same systems, and what changed between their records."""

from __future__ import annotations

import contextlib
import math
from bisect import bisect_left
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from typing import TypeVar

from harness.crosscheck.assignment import Assignment, acceleration_truth_of, load_audited
from harness.crosscheck.held import differences, held_by, written
from harness.crosscheck.settings import Settings
from harness.engines import HeldModel, Subject, Unsupported, engine_files, subjects_of
from harness.environments import AT, split_name
from harness.errors import InvalidRequest
from harness.explain.terms import compare_terms
from harness.library import Library
from harness.results.records import Record
from harness.results.trend import READING, TERMS, RunChange, run_changes
from harness.study import Inquiry, Note, Part, Study, ask
from harness.truth.sampling import generic_sample
from harness.verdict import SEVERITY, Verdict

# States at which terms are compared.
STATES = 16


def explain_changes(library: Library, system: str, subject: str, versions: tuple[str, str], seed: int, note: Note) -> list[RunChange]:
    """Differences of what two versions read and compute, of one system from one file; nothing where one of them cannot say.

    Raises:
        Exception: whatever an engine raises.
    """
    before, after = (Assignment.of(library, system, Subject(version, subject.partition("/")[2])) for version in versions)
    note("reading")
    return [replace(change, system=system) for change in (*_readings(before, after), *_terms(before, after, seed, note))]


def _readings(before: Assignment, after: Assignment) -> Iterator[RunChange]:
    held: dict[str, HeldModel] = {}
    for one in (before, after):
        # A version may have no interface for it.
        with contextlib.suppress(Unsupported):
            holding = held_by(load_audited(one))
            held |= {} if holding is None else {str(one.subject): holding}
    models = {one.model.format: one.model for one in (after,) if one.model is not None}
    if len(held) < 2:
        return
    for difference in differences(held, models):
        values = {name: written(value) for names, value in zip(difference.subjects, difference.values, strict=True) for name in names}
        owner = f" of {difference.joint}" if difference.joint else ""
        where = f" ({'; '.join(difference.places)})" if difference.places else ""
        old, new = (values.get(str(one.subject), "nothing") for one in (before, after))
        yield _change(after, READING, f"{difference.quantity}{owner}{where}: {old}", new)


def _change(of: Assignment, what: str, before: str, now: str, is_worse: bool = False) -> RunChange:
    name, subject = of.mechanism.name, str(of.subject.without_version)
    return RunChange(system=name, subject=subject, what=what, before=before, now=now, is_worse=is_worse)


def _terms(before: Assignment, after: Assignment, seed: int, note: Note) -> Iterator[RunChange]:
    states = generic_sample(after.mechanism, STATES, seed)
    found = []
    for one in (before, after):
        note(f"terms of {one.subject}")
        model = load_audited(one)
        truth = acceleration_truth_of(one)
        compared = compare_terms(truth.kernel, states, model, str(one.subject), truth.may_lose_digits(model))
        found.append({finding.term: finding for finding in compared.findings})
    for term in [term for term in found[0] if term in found[1]]:
        old, new = found[0][term], found[1][term]
        if old.verdict != new.verdict:
            yield _change(after, TERMS, old.sentence, new.sentence, SEVERITY[new.verdict] > SEVERITY[old.verdict])


_ANSWERED = (Verdict.AGREES, Verdict.UNSTABLE, Verdict.MISREADS, Verdict.DISAGREES, Verdict.UNDECIDED)


def version_name(library: Library, engine: str, version: str) -> str:
    """The name under which a version of an engine is asked: ``engine@version``, or ``engine`` where it is beside the harness.

    Raises:
        InvalidRequest: there is no such engine, or it is in no environment; the message says how to make one.
    """
    files = engine_files(library)
    known = {name for name in files if not split_name(name)[1]}
    by_distribution = {files[name].requires[1]: name for name in known}
    engine = by_distribution.get(engine, engine)
    if engine not in known:
        raise InvalidRequest(f"no engine is called {engine!r}; expected one of {', '.join(sorted(known))}")
    if (name := f"{engine}{AT}{version}") in files:
        return name
    if files[engine].version == version and not files[engine].elsewhere:
        return engine
    beside = "" if files[engine].elsewhere or files[engine].version is None else f"; beside the harness is {files[engine].version}"
    raise InvalidRequest(f"{engine} {version} is in no environment{beside}; make one: harness engines add {engine}=={version}")


def settings_of(settings: Settings, versions: Iterable[str]) -> Settings:
    """The settings of a cross-check that asks every version in every format."""
    chosen = [str(subject) for name in dict.fromkeys(versions) for subject in subjects_of(settings.library, name)]
    return replace(settings, subjects=chosen)


def changes_between(records: Sequence[Record], before: str, after: str) -> list[RunChange]:
    """Changes from one version to another in the records of one run; ``before`` and ``after`` as of ``version_name``."""
    return run_changes(of_version(records, before), of_version(records, after), in_one_run=True)


def of_version(records: Sequence[Record], version: str) -> list[Record]:
    """The records of a version, their subjects without it, and without what is expected of that version alone."""
    found = []
    for record in records:
        engine, _, model_format = record.subject.partition("/")
        if engine == version:
            subject = str(Subject(engine, model_format).without_version)
            unexpecting = replace(record, expected_backward_error=math.inf, expected_median_backward_error=math.inf, expected_share=1.0)
            found.append(replace(unexpecting, subject=subject, expected=record.verdict))
    return found


class Explanations(Study):
    """The terms and readings that changed, of every system and format that both versions answered; a ``harness.study.Study``."""

    title = "explanations"

    def __init__(self, settings: Settings, records: Sequence[Record], before: str, after: str) -> None:
        super().__init__()
        self._library, self._seed, self._versions = settings.library, settings.seed, (before, after)
        old, new = (
            {(one.system, one.subject) for one in of_version(records, version) if one.verdict in _ANSWERED} for version in (before, after)
        )
        self._keys = sorted(old & new)
        self.steps = len(self._keys)
        self._found: list[RunChange] = []

    def inquiries(self) -> Iterator[Iterable[Inquiry[None]]]:
        yield [self._explained(*key) for key in self._keys]

    def _explained(self, system: str, subject: str) -> Inquiry[None]:
        outcome = yield from ask(explain_changes, self._library, system, subject, self._versions, self._seed, affinity=system)
        found = outcome.value
        if failure := self.failure(outcome):
            found = [RunChange(system=system, subject=subject, what=TERMS, before="not compared", now=failure)]
        self._found += found
        yield Part(f"{system} {subject}", found)

    def result(self) -> list[RunChange]:
        return self._found


_Answer = TypeVar("_Answer")


def first_changed(
    versions: Sequence[str], ask: Callable[[str], _Answer], changed: Callable[[_Answer, _Answer], bool]
) -> tuple[str, str] | None:
    """The neighbours between which the answer leaves that of the first version; None where the last version has it too.

    ``versions`` go from the oldest to the newest, and are asked as often as a bisection needs, each once. Where the answer changes
    several times, one of the changes is found.
    """
    first = ask(versions[0])
    if not changed(first, ask(versions[-1])):
        return None
    place = bisect_left(versions, True, 1, len(versions) - 1, key=lambda version: changed(first, ask(version)))
    return versions[place - 1], versions[place]
