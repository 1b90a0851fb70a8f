"""Two versions of an engine asked about the same mechanisms or files, and what changed between their answers."""

from __future__ import annotations

import functools
import math
from bisect import bisect_left
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TypeVar

from harness.crosscheck.assignment import Assignment, acceleration_truth_of, load_audited
from harness.crosscheck.settings import Settings
from harness.engines import Subject, engine_files, subjects_of
from harness.environments import AT, split_name, the_version
from harness.errors import InvalidRequest
from harness.explain.terms import compare_terms
from harness.library import Library
from harness.results.records import Record
from harness.results.table import grouped
from harness.results.trend import Key, RunChange, run_changes
from harness.results.upgrade import READING, TERMS, Asked
from harness.study import Inquiry, Note, Part, Study, ask
from harness.truth.sampling import generic_sample
from harness.upgrade.portraits import STATES, Portrait, changes_between, portray
from harness.verdict import SEVERITY, Verdict

_UNANSWERED = (Verdict.UNSUPPORTED, Verdict.ERROR)


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
    apart = {split_name(name)[1]: name for name in files if name.startswith(f"{engine}{AT}")}
    if found := the_version(version, apart):
        return apart[found]
    beside = None if files[engine].elsewhere else files[engine].version
    if beside is not None and the_version(version, [beside]):
        return engine
    said = "" if beside is None else f"; beside the harness is {beside}"
    raise InvalidRequest(f"{engine} {version} is in no environment{said}; make one: harness engines add {engine}=={version}")


def settings_of(settings: Settings, versions: Iterable[str]) -> Settings:
    """The settings of a cross-check that asks every version in every format."""
    chosen = [str(subject) for name in dict.fromkeys(versions) for subject in subjects_of(settings.library, name)]
    return replace(settings, subjects=chosen)


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


# By system and subject, of a version.
Portraits = Mapping[Key, Portrait]


def held_against(records: Sequence[Record], portraits: Portraits, before: str, now: str, further: Iterable[RunChange] = ()) -> list[Asked]:
    """Each mechanism or file in each format as two versions have it; ``before`` and ``now`` as of ``version_name``.

    ``further``: changes that were found besides.
    """
    old, new = ({(one.system, one.subject): one for one in of_version(records, version)} for version in (before, now))
    of_records = run_changes(old.values(), new.values(), in_one_run=True)
    of_readings = [change for key in sorted(old.keys() & new.keys()) for change in _of_readings(key, old[key], new[key])]
    changes = grouped(((one.system, one.subject), one) for one in [*of_records, *of_readings, *further])
    found = []
    for system, subject in sorted(old.keys() & new.keys()):
        names = (str(Subject(version, subject.partition("/")[2])) for version in (before, now))
        one, other = (portraits.get((system, name), Portrait()) for name in names)
        moved, numbers = changes_between(system, subject, one, other)
        key = system, subject
        asked = Asked(
            before=old[key],
            now=new[key],
            changes=[*changes.get(key, ()), *moved],
            numbers=numbers,
            left_out=other.left_out or one.left_out,
            actuators=other.actuators or one.actuators,
            has_numbers=bool(one.numbers and other.numbers),
        )
        found.append(asked)
    return found


def _of_readings(key: Key, before: Record, now: Record) -> Iterator[RunChange]:
    """The readings of a file that only one of two versions has, of answers that are accounted for."""
    if not {before.verdict, now.verdict} <= {Verdict.AGREES, Verdict.EXPLAINED, Verdict.MISREADS, Verdict.UNSTABLE}:
        return
    old, new = ({one.name: one for one in record.readings} for record in (before, now))
    change = functools.partial(RunChange, system=key[0], subject=key[1], what=READING)
    for name in [name for name in old if name not in new]:
        yield change(before=old[name].statement, now="", is_better=True, size=old[name].alone)
    for one in [new[name] for name in new if name not in old]:
        yield change(before="", now="; ".join(filter(None, [one.statement, one.remedy])), is_worse=True, size=one.alone)


class PortraitStudy(Study):
    """The portrait of each mechanism or file that each version answered about; a ``harness.study.Study``."""

    title = "compiled numbers"

    def __init__(self, settings: Settings, records: Sequence[Record]) -> None:
        super().__init__(dict[Key, Portrait]())
        self._library, self._seed = settings.library, settings.seed
        self._keys = [(one.system, one.subject) for one in records if one.verdict not in _UNANSWERED]
        self.steps = len(self._keys)

    def inquiries(self) -> Iterator[Iterable[Inquiry[None]]]:
        yield [self._portrayed(*key) for key in self._keys]

    def _portrayed(self, system: str, name: str) -> Inquiry[None]:
        engine, _, model_format = name.partition("/")
        outcome = yield from ask(portray, self._library, system, Subject(engine, model_format), self._seed, affinity=system)
        self.found[system, name] = outcome.value or Portrait(failure=self.failure(outcome))
        yield Part(f"{system} {name}", None)


class Explanations(Study):
    """The terms of the equations that changed, where both versions answered; a ``harness.study.Study``."""

    title = "explanations"

    def __init__(self, settings: Settings, records: Sequence[Record], before: str, now: str) -> None:
        super().__init__(list[RunChange]())
        self._library, self._seed, self._versions = settings.library, settings.seed, (before, now)
        old, new = (
            {(one.system, one.subject) for one in of_version(records, version) if one.verdict not in _UNANSWERED}
            for version in (before, now)
        )
        # What an engine says of its terms is of mechanisms that it is handed.
        self._keys = [] if settings.library.reads_files else sorted(old & new)
        self.steps = len(self._keys)

    def inquiries(self) -> Iterator[Iterable[Inquiry[None]]]:
        yield [self._explained(*key) for key in self._keys]

    def _explained(self, system: str, subject: str) -> Inquiry[None]:
        outcome = yield from ask(explain_changes, self._library, system, subject, self._versions, self._seed, affinity=system)
        found = outcome.value
        if failure := self.failure(outcome):
            found = [RunChange(system=system, subject=subject, what=TERMS, before="", now=f"not compared: {failure}")]
        yield self.kept(f"{system} {subject}", found)


def explain_changes(library: Library, system: str, subject: str, versions: tuple[str, str], seed: int, note: Note) -> list[RunChange]:
    """The terms of the equations that two versions compute otherwise, of one system from one file; nothing where one cannot say.

    Raises:
        Exception: whatever an engine raises.
    """
    before, after = (Assignment.of(library, system, Subject(version, subject.partition("/")[2])) for version in versions)
    return [replace(change, system=system) for change in _terms(before, after, seed, note)]


def _change(of: Assignment, what: str, before: str, now: str, by: int = 0) -> RunChange:
    name, subject = of.mechanism.name, str(of.subject.without_version)
    return RunChange(system=name, subject=subject, what=what, before=before, now=now, is_worse=by > 0, is_better=by < 0)


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
            yield _change(after, TERMS, old.sentence, new.sentence, SEVERITY[new.verdict] - SEVERITY[old.verdict])


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
