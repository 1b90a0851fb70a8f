"""From everything one subject answered on one system to its record."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, field

import numpy as np

from harness.certify.compare import Comparison
from harness.crosscheck.expected import Expectation
from harness.crosscheck.hypothesis_search import Found
from harness.equations.states import States
from harness.results.records import Record, Representative, half_decade
from harness.verdict import Verdict, gravest


@dataclass
class Evidence:
    """The answers of one subject on one system.

    Attributes:
        bulk: batches of sampled states with their comparisons, in the order of the sample. found: what hypothesis found.
        stored: how many of the first batch are stored with the system.
        seconds: cost per state of each timing [s]. failed_at: the state at which an engine crashed.
        failure, unsupported: as of ``Answers``, where some of them are missing.
    """

    bulk: dict[int, tuple[States, Comparison]] = field(default_factory=dict)
    found: Found | None = None
    stored: int = 0
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
    """The record of ``evidence``: gravest verdict, worst error with its state, and another state that shows the verdict better."""
    parts = evidence.parts
    nothing = Comparison(np.empty(0), np.empty(0), np.empty(0, dtype=np.str_))
    comparison = Comparison.concatenate([nothing, *(part for _, part in parts)])
    backward = comparison.known("backward_error")
    counts = Counter(comparison.verdicts.tolist())
    failed = Verdict.UNSUPPORTED if evidence.unsupported else Verdict.ERROR
    verdict = failed.value if evidence.failure or not parts else gravest(counts)
    remarks = [evidence.failure or ("" if parts else "nothing was compared")]
    if not_finite := counts[Verdict.ERROR.value]:
        remarks.append(f"{not_finite} of {len(comparison.verdicts)} answers are not finite.")
    worst = comparison.largest if parts else None
    states = States.concatenate([part for part, _ in parts]) if parts else None
    sampled = sum(len(batch) for batch, _ in evidence.bulk.values())
    stored = evidence.stored if 0 in evidence.bulk else 0
    return Record(
        system=system,
        subject=subject,
        states=len(comparison.verdicts),
        verdict=verdict,
        expected=expectation.verdict,
        backward_error=max(backward.tolist(), default=None),
        relative_error=None if worst is None else comparison.relative_error_at(worst),
        worst_state=evidence.failed_at if states is None or worst is None else states.as_json(worst),
        seconds_per_state=float(np.median(evidence.seconds)) if evidence.seconds else None,
        fastest_seconds_per_state=min(evidence.seconds, default=None),
        message=" ".join(filter(None, remarks)),
        median_backward_error=float(np.median(backward)) if len(backward) else None,
        distribution=dict(Counter(map(half_decade, backward.tolist()))),
        verdict_counts=dict(counts),
        expected_backward_error=expectation.limit,
        expected_reason=expectation.reason,
        expected_link=expectation.link,
        representative=None if states is None else _representative(states, comparison, evidence, verdict),
        origins={"stored": stored, "sampled": sampled - stored, "searched": len(comparison.verdicts) - sampled},
    )


def _representative(states: States, comparison: Comparison, evidence: Evidence, verdict: str) -> Representative | None:
    """The state of a death; else the simplest state with the verdict that hypothesis found; else one, where the worst has another."""
    if evidence.failed_at is not None:
        return Representative(state=evidence.failed_at, backward_error=None)
    found, index = evidence.found, comparison.worst
    if found is not None and found.simplest_failure is not None and found.comparison.verdicts[found.simplest_failure] == verdict:
        # What hypothesis found comes last.
        index = len(states) - len(found.states) + found.simplest_failure
    elif comparison.verdicts[comparison.largest] == comparison.verdicts[index]:
        index = comparison.largest
    if index == comparison.largest:
        return None
    error = float(comparison.backward_error[index])
    return Representative(state=states.as_json(index), backward_error=None if math.isnan(error) else error)
