"""Why a cross-check of robots' files is red: what the engines' readers make of elements, and single numbers of what is left.

The causes are those that a comparison of the file finds for its aided engines, so that a check says nothing else than ``harness compare``.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from harness.comparison.study import ComparisonSettings, RobotComparison
from harness.crosscheck.settings import Settings
from harness.results.comparison import SubjectRecord
from harness.results.cross_check import Cause
from harness.results.records import Record
from harness.verdict import Verdict

# Of ``unstable`` the record itself says all there is to say.
_EXPLAINED = {Verdict.DISAGREES.value, Verdict.UNSUPPORTED.value}


class RobotDiagnoses(RobotComparison):
    """The causes of the records of robots' files that are not as expected; a ``harness.study.Study``."""

    def __init__(self, settings: Settings, records: Sequence[Record], floating_base: bool) -> None:
        self._wrong = [record for record in records if record.verdict in _EXPLAINED and not record.as_expected]
        subjects = tuple(dict.fromkeys(record.subject for record in self._wrong))
        paths = tuple(dict.fromkeys(Path(record.system) for record in self._wrong))
        compared = ComparisonSettings(
            paths, seed=settings.seed, floating_base=floating_base, pairwise=False, stances=(True,), subjects=subjects
        )
        super().__init__(compared, "diagnosis")

    def causes(self) -> list[Cause]:
        """Of each wrong record that the comparison speaks of, by system and subject."""
        aided = {(record.path, record.subject): record for record in super().result().subjects}
        found = [(record, aided.get((str(Path(record.system)), record.subject))) for record in self._wrong]
        causes = [_cause(record, known) for record, known in found if known is not None]
        return sorted(causes, key=lambda cause: (cause.system, cause.subject))

    def result(self) -> Any:
        return self.causes()


def _cause(record: Record, known: SubjectRecord) -> Cause:
    refuses = known.verdict == Verdict.UNSUPPORTED
    inference = f"the file is the truth, and {record.subject} {'refuses' if refuses else 'differs from'} it"
    return Cause(system=record.system, subject=record.subject, inference=inference, first_line="; ".join(_sentences(known)) or inference)


def _sentences(known: SubjectRecord) -> Iterator[str]:
    for reading in sorted(known.readings, key=lambda one: -(one.alone or 0.0)):
        lines = ", ".join(map(str, reading.lines))
        yield f"{reading.sentence}{f' (lines {lines})' if lines else ''}"
    yield from known.rest
