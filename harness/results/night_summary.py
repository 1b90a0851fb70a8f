"""Everything that is said of a night when it ends, as plain data for Markdown, JUnit XML and JSON."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from harness.results.night import Case, Night, NightSettings, counts, new_since
from harness.results.records import Run
from harness.results.table import counted
from harness.results.trend import ChangedCell


@dataclass(frozen=True, kw_only=True)
class NightSummary:
    """A night that is complete.

    Attributes:
        run: of the night. night: its course. cases: by stage, group and name.
        before: the cases of the last night that ended; None where there is none.
        changes: of the trend, that were found this night.
        problems: what the user has to mend.
        resumed: how many units were complete when the night went on; 0 where it was not interrupted.
    """

    run: Run
    night: Night
    cases: Sequence[Case]
    before: Sequence[Case] | None = None
    changes: Sequence[ChangedCell] = field(default_factory=list)
    problems: Sequence[str] = ()
    resumed: int = 0

    @property
    def settings(self) -> NightSettings:
        return self.night.settings[0]

    @cached_property
    def bad(self) -> list[Case]:
        """What is not as expected, what is new first."""
        new = set() if self.since is None else {case.key for case in self.since.worse}
        return sorted((case for case in self.cases if not case.is_good), key=lambda case: (case.key not in new, case.key))

    @cached_property
    def since(self) -> Any:
        """What is new since the night before; None where there is none."""
        return None if self.before is None else new_since(self.before, self.cases)

    @property
    def as_expected(self) -> bool:
        """True where every case is good; what a trend says, and what a computation costs, changes nothing of it."""
        return not self.bad

    @property
    def sentence(self) -> str:
        """The result in one sentence."""
        total, bad = len(self.cases), len(self.bad)
        if not total:
            return "Nothing was compared."
        if not bad:
            return f"All {counted(total, 'case')} are as expected." if total > 1 else "The one case is as expected."
        new = "" if self.since is None else f", {len(self.since.worse)} of them new since the last night"
        return f"{bad} of {counted(total, 'case')} {'is' if bad == 1 else 'are'} not as expected{new}."

    @property
    def counts(self) -> Mapping[str, Mapping[str, int]]:
        """Stage to outcome to number of cases."""
        return counts(self.cases)

    def to_json(self) -> dict[str, Any]:
        """Plain data for ``harness.results.json_document.to_json``."""
        return {
            "night": {
                "settings": self.settings,
                "sentence": self.sentence,
                "as_expected": self.as_expected,
                "resumed": self.resumed,
                "problems": list(self.problems),
                "faults": self.night.faults,
                "crashed": self.night.crashed,
            },
            "counts": self.counts,
            "cases": list(self.cases),
            "since_last_night": self.since,
            "changes": list(self.changes),
        }
