"""What changed between two records of one system: of two versions of an engine, or of two runs."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field

from harness.results.records import Record
from harness.results.table import error_text, seconds_text
from harness.verdict import SEVERITY, Verdict

# An error or a cost that grows by less is no change. Errors of less than a data roundoff are one as good as the other.
FACTOR = 2.0
LEAST_ERROR = 1.0
COST = "cost"
_COMPARED = (Verdict.AGREES, Verdict.UNSTABLE, Verdict.DISAGREES)


@dataclass(frozen=True, kw_only=True)
class Change:
    """One thing that changed.

    Attributes:
        what: "verdict", "error", "answer", "cost", "reading" or "terms".
        before, after: as text. is_worse: never of a cost, which the load of the machine changes too.
    """

    what: str
    before: str
    after: str
    is_worse: bool = False

    def __str__(self) -> str:
        return f"{self.what}: {self.before} -> {self.after}"


@dataclass(frozen=True, kw_only=True)
class Changes:
    """All that changed for a system and a subject; ``subject`` is without version where two versions are compared."""

    system: str
    subject: str
    changes: list[Change] = field(default_factory=list)

    @property
    def is_worse(self) -> bool:
        """True where one of the changes is for the worse."""
        return any(change.is_worse for change in self.changes)


def record_changes(before: Record, after: Record) -> Iterator[Change]:
    """The changes from one record to another: verdict, errors of the sampled states, what is said instead of an answer, and cost."""
    if before.verdict != after.verdict:
        worse = SEVERITY[after.verdict] > SEVERITY[before.verdict]
        yield Change(what="verdict", before=before.verdict, after=after.verdict, is_worse=worse)
    if before.verdict in _COMPARED and after.verdict in _COMPARED:
        for title, attribute in (("median", "median_backward_error"), ("99th percentile", "percentile_99_backward_error")):
            yield from error_changes(f"{title} of backward errors", getattr(before, attribute), getattr(after, attribute))
    elif " ".join(before.message.split()) != " ".join(after.message.split()):
        yield Change(what="answer", before=before.message or "answers", after=after.message or "answers")
    yield from _cost_changes(before.fastest_seconds_per_state, after.fastest_seconds_per_state)


def error_changes(title: str, before: float | None, after: float | None, what: str = "error") -> Iterator[Change]:
    """The change of an error [data roundoffs], where it is one."""
    if before is None or after is None or before == after:
        return
    grown = max(after, LEAST_ERROR) / max(before, LEAST_ERROR)
    # inf / inf is no change; a NaN is never equal and never grown.
    if grown >= FACTOR or grown <= 1 / FACTOR or math.isnan(after) != math.isnan(before):
        yield Change(what=what, before=f"{title} {error_text(before)}", after=error_text(after), is_worse=not grown <= 1)


def _cost_changes(before: float | None, after: float | None) -> Iterator[Change]:
    if before and after and not 1 / FACTOR < after / before < FACTOR:
        yield Change(what=COST, before=f"{seconds_text(before)} per state", after=seconds_text(after))
