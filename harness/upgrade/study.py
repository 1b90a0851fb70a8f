"""Two versions of an engine asked about the same systems, and what changed between their records."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from harness.crosscheck.settings import Settings
from harness.crosscheck.tasks import Assignment
from harness.engines import Subject, engine_files, subjects_of
from harness.environments.folders import AT, split_name
from harness.errors import InvalidRequest
from harness.library import Library
from harness.results.changes import Change, Changes, record_changes
from harness.results.records import Record
from harness.study import Part, Rounds
from harness.upgrade.explanation import explain_changes
from harness.verdict import Verdict
from harness.workers import Outcome, Task

_ANSWERED = (Verdict.AGREES, Verdict.UNSTABLE, Verdict.DISAGREES, Verdict.UNDECIDED)


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


def changes_between(records: Sequence[Record], before: str, after: str) -> list[Changes]:
    """What changed from one version to another, by the names they are asked under; a system and format without change is among them."""
    found = []
    old, new = (_of_version(records, version) for version in (before, after))
    for key in sorted(old.keys() & new.keys()):
        system, model_format = key
        subject = _without_version(Subject(after, model_format))
        found.append(Changes(system=system, subject=subject, changes=list(record_changes(old[key], new[key]))))
    return found


def _without_version(subject: Subject) -> str:
    return str(replace(subject, engine=split_name(subject.engine)[0]))


def _of_version(records: Sequence[Record], version: str) -> Mapping[tuple[str, str], Record]:
    found = {}
    for record in records:
        engine, _, model_format = record.subject.partition("/")
        if engine == version:
            found[record.system, model_format] = record
    return found


@dataclass(frozen=True)
class _Pair:
    """What two versions answered about a system in a format."""

    library: Library
    system: str
    before: Subject
    after: Subject


class Explanations(Rounds):
    """The terms and readings that changed, of every system and format that both versions answered; a ``harness.study.Study``.

    ``changes`` are those of ``changes_between``; what is found is added to them.
    """

    title = "explanations"

    def __init__(self, settings: Settings, records: Sequence[Record], changes: Sequence[Changes], before: str, after: str) -> None:
        super().__init__()
        self._by_key = {(one.system, one.subject): one for one in changes}
        self._seed = settings.seed
        old, new = (_of_version(records, version) for version in (before, after))
        answered = [key for key in old.keys() & new.keys() if {old[key].verdict, new[key].verdict} <= set(_ANSWERED)]
        self._pairs = [_Pair(settings.library, system, Subject(before, form), Subject(after, form)) for system, form in sorted(answered)]
        self._changes = list(changes)

    @property
    def steps(self) -> int:
        return len(self._pairs)

    def rounds(self) -> Iterator[Sequence[Task]]:
        yield [Task((self._explained, pair), _explain, (pair, self._seed), pair.system) for pair in self._pairs]

    def _explained(self, outcome: Outcome, pair: _Pair) -> Iterator[Part]:
        system, subject, found = pair.system, _without_version(pair.after), outcome.value
        if failure := self.failure(outcome):
            found = [Change(what="terms", before="not compared", after=failure)]
        self._by_key[system, subject].changes.extend(found)
        yield Part(f"{system} {subject}", found)

    def result(self) -> list[Changes]:
        return self._changes


def _explain(pair: _Pair, seed: int, note: Any) -> list[Change]:
    before, after = (Assignment.of(pair.library, pair.system, subject) for subject in (pair.before, pair.after))
    return explain_changes(before, after, seed, note)
