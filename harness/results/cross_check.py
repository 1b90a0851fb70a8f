"""Everything one cross-check found."""

from __future__ import annotations

from dataclasses import dataclass, field

from harness.results.causes import Cause
from harness.results.hard_states import RankedCase
from harness.results.records import Record, SystemCard
from harness.results.study_result import StudyResult
from harness.results.superfluous import SuperfluousPart


@dataclass(kw_only=True)
class CrossCheckResult(StudyResult):
    """The records of a cross-check with what belongs to them.

    Attributes:
        records: one for each pair of system and subject; systems: what a report shows of each system.
        superfluous: parts of models that their scenes do not need.
        causes: why records that are not as expected are wrong.
        worst_cases: of each subject, the worst first.
    """

    STUDY = "cross-check"

    records: list[Record] = field(default_factory=list)
    systems: list[SystemCard] = field(default_factory=list)
    superfluous: list[SuperfluousPart] = field(default_factory=list)
    causes: list[Cause] = field(default_factory=list)
    worst_cases: list[RankedCase] = field(default_factory=list)

    @property
    def as_expected(self) -> bool:
        """True where every verdict is the expected one and no model holds more than its scene needs."""
        return all(record.as_expected for record in self.records) and not self.superfluous
