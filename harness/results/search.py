"""The result of a search, as plain data and as text.

Exit statuses are those of the command line: 0 as expected, 1 worse than expected, 3 a crash or time-out.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from harness.results.hard_states import FoundState


@dataclass(frozen=True, kw_only=True)
class FoundCase:
    """One hard state with what a person needs to go on.

    Attributes:
        found: the state, shrunk.
        expected: the verdict that is expected; as_expected: whether the state is no worse than that.
        replay: shell command; reproducer: program in the engine's own Python API, "" where there is none.
    """

    found: FoundState
    expected: str
    as_expected: bool
    replay: str
    reproducer: str = ""


@dataclass(kw_only=True)
class SearchResult:
    """The result of a search.

    Attributes:
        cases: the worst first; at least one for each subject that answered.
        states, undecided: subject to states tried, and to those of them without certified truth.
        worst: subject to the largest backward error before shrinking; inf for an answer that is not finite.
        failures: subject to why a part of its search gave nothing.
        crashed: whether an engine's process died or ran out of time.
        place: where what was found would be stored, and not_stored why it was not; "" where it was.
    """

    cases: list[FoundCase] = field(default_factory=list)
    states: dict[str, int] = field(default_factory=dict)
    undecided: dict[str, int] = field(default_factory=dict)
    worst: dict[str, float] = field(default_factory=dict)
    failures: dict[str, str] = field(default_factory=dict)
    crashed: bool = False
    place: Path
    not_stored: str = "the search has not ended"

    @property
    def status(self) -> int:
        """Exit status: 3 an engine crashed or timed out, 1 something worse than expected, 0 neither."""
        if self.crashed:
            return 3
        return int(bool(self.failures) or not all(case.as_expected for case in self.cases))

    def to_json(self) -> dict[str, Any]:
        """Plain data for ``harness.results.plain_json.dumps``."""
        numbers = {name: getattr(self, name) for name in ("states", "undecided", "worst", "failures", "not_stored")}
        return {"found": self.cases, "stored": not self.not_stored} | numbers


def as_lines(result: SearchResult) -> list[str]:
    """Plain text for the terminal: each case with its state, digits, term, replay and reproducer, then what was stored."""
    lines = []
    for case in result.cases:
        found = case.found
        error = "no finite answer" if found.backward_error is None else f"{found.backward_error:.3g} data roundoffs"
        lines += [
            f"{found.subject}: {found.verdict}, expected {case.expected}: {error}, {found.digits_lost:.1f} digits lost ({found.term})",
            f"  {found.statement}",
            "  at " + ", ".join(f"{name} = {values}" for name, values in found.state.items()),
            f"  replay: {case.replay}",
        ]
        if not case.as_expected:
            lines += [f"    {line}" for line in case.reproducer.splitlines()]
        lines.append("")
    for subject, reason in result.failures.items():
        lines.append(f"{subject}: {reason}")
    for subject, count in result.states.items():
        without = f", {result.undecided[subject]:,} of them without certified truth" if result.undecided[subject] else ""
        lines.append(f"{subject}: {count:,} states tried{without}; the worst had {result.worst[subject]:.3g} data roundoffs")
    lines.append(f"not stored: {result.not_stored}; its place is {result.place}" if result.not_stored else f"stored in {result.place}")
    return lines
