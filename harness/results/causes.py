"""The cause of a wrong record, as plain data."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, kw_only=True)
class Cause:
    """The reason why one subject is wrong on one system.

    Attributes:
        system, subject: names.
        inference: what the verdicts of all subjects say together.
        first_line: the answer in one line.
        diagnosed: the subject that was examined: of those that a wrong model makes wrong, its format's own engine.
        found: ``SubjectDiagnosis.as_json``; None without a diagnosis.
    """

    system: str
    subject: str
    inference: str
    first_line: str
    diagnosed: str = ""
    found: dict[str, Any] | None = None

    @property
    def is_shared(self) -> bool:
        """True where the diagnosis is that of another subject, which reads the same file."""
        return self.diagnosed not in ("", self.subject)

    @property
    def terms(self) -> list[str]:
        """A sentence for each term that is wrong."""
        return list(self.found["terms"]["sentences"]) if self.found else []

    @property
    def sides(self) -> list[list[str]]:
        """The diagnosis on the side of the model, where there is one, and on that of the textbook, in lines; or why there is none."""
        if not self.found:
            return [[self.first_line]]
        return [list(side["text"]) for side in (self.found["model"], self.found["textbook"]) if side]
