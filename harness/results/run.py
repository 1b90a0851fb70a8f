"""One call of the harness, and the base of what studies find in one."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields
from datetime import datetime
from typing import Any, ClassVar, Self


@dataclass(frozen=True, kw_only=True)
class Run:
    """One call of the harness.

    Attributes:
        started: ISO 8601, UTC.
        versions, machine: name to text.
        states: number of states per system where a record says nothing else.
        engines: name of an engine to its version. titles: to its name as its authors write it.
        library: name of the library, never its path, because reports are published.
        command: how to repeat the run.

    Raises:
        ValueError: ``started`` is not ISO 8601 in UTC, or ``library`` is a path.
    """

    started: str
    versions: dict[str, str]
    machine: dict[str, str]
    seed: int
    profile: str
    states: int
    library: str
    command: str
    engines: dict[str, str] = field(default_factory=dict)
    titles: dict[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        moment = datetime.fromisoformat(self.started)
        if moment.utcoffset() is None or moment.utcoffset():
            raise ValueError(f"started is {self.started!r}; expected UTC, as 2026-01-31T02:00:00+00:00")
        if "/" in self.library or "\\" in self.library:
            raise ValueError(f"library is {self.library!r}; expected its name without a path")

    @property
    def load(self) -> str:
        """Load of the machine while something was timed, as "worker processes 2, cpus 4, load 0.35 at the start"."""
        return ", ".join(f"{name} {self.machine[name]}" for name in ("worker processes", "cpus", "load") if name in self.machine)


def changed_versions(before: Mapping[str, str], after: Mapping[str, str]) -> list[tuple[str, str, str]]:
    """Names of versions that differ, each with what it was and what it is."""
    names = sorted(name for name in before.keys() | after.keys() if before.get(name) != after.get(name))
    return [(name, before.get(name, "absent"), after.get(name, "absent")) for name in names]


@dataclass(kw_only=True)
class StudyResult:
    """Base of the results; a part that was not asked for is an empty list.

    Attributes:
        STUDY: name under which the history keeps results of this class.
    """

    STUDY: ClassVar[str]

    def extend(self, more: Self) -> None:
        """Add what another task of the same study found."""
        for part in fields(self):
            getattr(self, part.name).extend(getattr(more, part.name))

    def stored_parts(self) -> Iterator[tuple[str, Any]]:
        """(field, one of its items) of every field that does not follow from the others."""
        for part in fields(self):
            if not part.metadata.get("derived"):
                yield from ((part.name, item) for item in getattr(self, part.name))
