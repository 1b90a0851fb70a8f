"""From everything one subject answered on one system to its record."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from harness.certify.compare import Comparison
from harness.crosscheck.expected import Expectation
from harness.crosscheck.hypothesis_search import Found
from harness.equations.states import States
from harness.results.records import Record, half_decade
from harness.verdict import Verdict, gravest


@dataclass
class Evidence:
    """The answers of one subject on one system.

    Attributes:
        bulk: batches of sampled states with their comparisons, in the order of the sample. found: what hypothesis found.
        seconds: cost per state of each batch [s]. failed_at: the state at which an engine crashed.
        failure, unsupported: as of ``Answers``, where some of them are missing.
    """

    bulk: dict[int, tuple[States, Comparison]] = field(default_factory=dict)
    found: Found | None = None
    seconds: list[float] = field(default_factory=list)
    failure: str = ""
    unsupported: bool = False
    failed_at: dict[str, list[float]] | None = None

    @property
    def parts(self) -> list[tuple[States, Comparison]]:
        """The bulk in order, then what hypothesis found."""
        found = [] if self.found is None else [(self.found.states, self.found.comparison)]
        return [*(self.bulk[index] for index in sorted(self.bulk)), *found]


def judge(system: str, subject: str, evidence: Evidence, expectation: Expectation) -> Record:
    """The record of ``evidence``: gravest verdict, worst error, and the state that shows it best."""
    parts = evidence.parts
    nothing = Comparison(np.empty(0), np.empty(0), np.empty(0, dtype=np.bool_), np.empty(0, dtype=np.str_))
    comparison = Comparison.concatenate([nothing, *(part for _, part in parts)])
    backward, relative = comparison.known("backward_error"), comparison.known("relative_error")
    counts = Counter(comparison.verdicts.tolist())
    failed = Verdict.UNSUPPORTED if evidence.unsupported else Verdict.ERROR
    verdict = failed.value if evidence.failure or not parts else gravest(counts)
    worst_state, remarks = evidence.failed_at, [evidence.failure or ("" if parts else "nothing was compared")]
    if not_finite := counts[Verdict.ERROR.value]:
        remarks.append(f"{not_finite} of {len(comparison.verdicts)} answers are not finite.")
    if parts and worst_state is None:
        worst_state, remark = _representative_state(parts, comparison, evidence.found, verdict)
        remarks.append(remark)
    return Record(
        system=system,
        subject=subject,
        states=len(comparison.verdicts),
        verdict=verdict,
        expected=expectation.verdict,
        backward_error=max(backward.tolist(), default=None),
        relative_error=max(relative.tolist(), default=None),
        worst_state=worst_state,
        seconds_per_state=float(np.median(evidence.seconds)) if evidence.seconds else None,
        message=" ".join(filter(None, remarks)),
        median_backward_error=float(np.median(backward)) if len(backward) else None,
        distribution=dict(Counter(map(half_decade, backward.tolist()))),
        verdict_counts=dict(counts),
        expected_backward_error=expectation.limit,
        expected_reason=expectation.reason,
        expected_link=expectation.link,
    )


def _representative_state(
    parts: Sequence[tuple[States, Comparison]], comparison: Comparison, found: Found | None, verdict: str
) -> tuple[dict[str, list[float]], str]:
    """The simplest state that gives the verdict where hypothesis found one, else the worst; and a remark on it."""
    if found is not None and found.simplest_failure is not None and found.comparison.verdicts[found.simplest_failure] == verdict:
        error = found.comparison.backward_error[found.simplest_failure]
        remark = f"The state shown is the simplest that fails; its backward error is {error:.3g}."
        return found.states.as_json(found.simplest_failure), remark
    states = States.concatenate([part for part, _ in parts])
    return states.as_json(comparison.worst), ""
