"""From everything one subject answered on one system to its record."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

import numpy as np

from harness.arrays import Array
from harness.certify.compare import Comparison
from harness.crosscheck.expected import Expectation
from harness.crosscheck.hypothesis_search import Found
from harness.equations.states import States
from harness.results.records import Record, half_decade
from harness.verdict import Verdict, gravest


@dataclass
class Evidence:
    """The answers of one subject on one system; of each state, what the record needs of it.

    Attributes:
        counts: of verdicts. distribution: of backward errors by half decade. backward: those that are known, part by part.
        relative: the largest relative error. worst: the answer that decides, and its state.
        found: what hypothesis found. seconds: cost per state of each batch [s]. failed_at: the state at which an engine crashed.
        failure, unsupported: as of ``Answers``, where some of them are missing.
    """

    counts: Counter[str] = field(default_factory=Counter)
    distribution: Counter[str] = field(default_factory=Counter)
    backward: list[Array] = field(default_factory=list)
    relative: float | None = None
    worst: tuple[States, Comparison] | None = None
    found: Found | None = None
    seconds: list[float] = field(default_factory=list)
    failure: str = ""
    unsupported: bool = False
    failed_at: dict[str, list[float]] | None = None

    def add(self, states: States, comparison: Comparison) -> None:
        """Take the judgement of the answers at ``states``."""
        if not len(states):
            return
        backward, relative = comparison.known("backward_error"), comparison.known("relative_error")
        self.counts.update(comparison.verdicts.tolist())
        self.distribution.update(map(half_decade, backward.tolist()))
        self.backward.append(backward)
        self.relative = max([*relative.tolist(), *([] if self.relative is None else [self.relative])], default=None)
        worst = () if self.worst is None else (self.worst,)
        states = States.concatenate([*(known for known, _ in worst), states])
        comparison = Comparison.concatenate([*(known for _, known in worst), comparison])
        self.worst = states[[comparison.worst]], comparison[[comparison.worst]]


def judge(system: str, subject: str, evidence: Evidence, expectation: Expectation) -> Record:
    """The record of ``evidence``: gravest verdict, worst error, and the state that shows it best."""
    counts, backward = evidence.counts, np.concatenate([np.empty(0), *evidence.backward])
    failed = Verdict.UNSUPPORTED if evidence.unsupported else Verdict.ERROR
    verdict = failed.value if evidence.failure or not counts else gravest(counts)
    worst_state, remarks = evidence.failed_at, [evidence.failure or ("" if counts else "nothing was compared")]
    if not_finite := counts[Verdict.ERROR.value]:
        remarks.append(f"{not_finite} of {counts.total()} answers are not finite.")
    if evidence.worst is not None and worst_state is None:
        worst_state, remark = _representative_state(evidence.worst[0], evidence.found, verdict)
        remarks.append(remark)
    return Record(
        system=system,
        subject=subject,
        states=counts.total(),
        verdict=verdict,
        expected=expectation.verdict,
        backward_error=float(backward.max()) if len(backward) else None,
        relative_error=evidence.relative,
        worst_state=worst_state,
        seconds_per_state=float(np.median(evidence.seconds)) if evidence.seconds else None,
        message=" ".join(filter(None, remarks)),
        median_backward_error=float(np.median(backward)) if len(backward) else None,
        distribution=dict(evidence.distribution),
        verdict_counts=dict(counts),
        expected_backward_error=expectation.limit,
        expected_reason=expectation.reason,
        expected_link=expectation.link,
    )


def _representative_state(worst: States, found: Found | None, verdict: str) -> tuple[dict[str, list[float]], str]:
    """The simplest state that gives the verdict where hypothesis found one, else the worst; and a remark on it."""
    if found is not None and found.simplest_failure is not None and found.comparison.verdicts[found.simplest_failure] == verdict:
        error = found.comparison.backward_error[found.simplest_failure]
        remark = f"The state shown is the simplest that fails; its backward error is {error:.3g}."
        return found.states.as_json(found.simplest_failure), remark
    return worst.as_json(0), ""
