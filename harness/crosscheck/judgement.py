"""From everything one subject answered on one system to its record."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, field

import numpy as np

from harness.arrays import Array
from harness.certify.compare import Comparison
from harness.crosscheck.expected import Expectation
from harness.crosscheck.hypothesis_search import Found
from harness.programs.states import States
from harness.results.quantiles import half_decade, half_decade_edges, quantile_ranks
from harness.results.records import Record, Representative
from harness.verdict import Verdict, gravest

# A smaller sample says nothing of a median or a share.
FEWEST_SAMPLED = 100
# Rows of ``Evidence.shown``.
GRAVEST, LARGEST = 0, 1


@dataclass
class Evidence:
    """The answers of one subject on one system; of each state, what the record needs of it.

    Attributes:
        counts: of verdicts. distribution: of backward errors by half decade. backward: those that are known, part by part.
        granted: to how many answers the share of the motion was. in_balls: how many truths took ball arithmetic.
        sampled: the backward errors among them, and verdicts, that are of sampled states.
        shown: the answer that decides, and the one with the largest backward error, with their states.
        stored: how many of the first batch are stored with the system. found: what hypothesis found.
        seconds: cost per state of each timing [s]. failed_at: the state at which an engine crashed.
        failure, unsupported: as of ``Answers``, where some of them are missing. refused: whether the failure is that a file
            cannot be used.
        explained: the sentence of ``Explanation`` where one number explains what would be lost digits; None where none was looked for.
        remarks: sentences that change no verdict.
        from_rigid: how far answers that are held against a declared truth are from the rigid one, relative, part by part.
    """

    counts: Counter[str] = field(default_factory=Counter)
    granted: int = 0
    in_balls: int = 0
    distribution: Counter[str] = field(default_factory=Counter)
    backward: list[Array] = field(default_factory=list)
    shown: tuple[States, Comparison] | None = None
    sampled: list[Array] = field(default_factory=list)
    sampled_verdicts: Counter[str] = field(default_factory=Counter)
    stored: int = 0
    found: Found | None = None
    seconds: list[float] = field(default_factory=list)
    failure: str = ""
    unsupported: bool = False
    refused: bool = False
    failed_at: dict[str, list[float]] | None = None
    explained: str | None = None
    remarks: list[str] = field(default_factory=list)
    from_rigid: list[Array] = field(default_factory=list)

    @property
    def verdict(self) -> str:
        """The gravest of the answers; where one number explains the errors of all states they are no lost digits."""
        if self.failure or not self.counts:
            return (Verdict.UNSUPPORTED if self.unsupported else Verdict.ERROR).value
        verdict = gravest(self.counts)
        return Verdict.DISAGREES.value if verdict == Verdict.UNSTABLE and self.explained else verdict

    def add(self, states: States, comparison: Comparison, sampled: slice = slice(0)) -> None:
        """Take the judgement of the answers at ``states``; ``sampled`` are those of the sample."""
        if not len(states):
            return
        backward = comparison.known("backward_error")
        self.counts.update(comparison.verdicts.tolist())
        self.granted += int(comparison.granted.sum())
        self.in_balls += int(comparison.in_balls.sum())
        self.distribution.update(distribution_of(backward))
        self.backward.append(backward)
        self.sampled.append(comparison[sampled].known("backward_error"))
        self.sampled_verdicts.update(comparison[sampled].verdicts.tolist())
        before = () if self.shown is None else (self.shown,)
        states = States.concatenate([*(known for known, _ in before), states])
        comparison = Comparison.concatenate([*(known for _, known in before), comparison])
        places = [comparison.worst, comparison.largest]
        self.shown = states[places], comparison[places]


def distribution_of(backward: Array) -> dict[str, int]:
    """How many errors are in each half decade, in the order in which the half decades come first.

    ``half_decade`` of each error by itself takes 0.4 us, which the process that serves all workers has to spend on each subject.
    """
    bins = np.where(np.isfinite(backward), np.searchsorted(half_decade_edges(), backward, side="right"), -1)
    _, first, counts = np.unique(bins, return_index=True, return_counts=True)
    order = np.argsort(first)
    return {half_decade(float(backward[index])): int(count) for index, count in zip(first[order], counts[order], strict=True)}


def judge(system: str, subject: str, evidence: Evidence, expectation: Expectation) -> Record:
    """The record of ``evidence``: gravest verdict, worst error with its state, and another state that shows the verdict better."""
    counts, backward = evidence.counts, np.concatenate([np.empty(0), *evidence.backward])
    sample, verdicts = np.concatenate([np.empty(0), *evidence.sampled]), evidence.sampled_verdicts
    if not len(sample):
        sample, verdicts = backward, counts
    verdict = evidence.verdict
    remarks = [evidence.failure or ("" if counts else "nothing was compared")]
    if not_finite := counts[Verdict.ERROR.value]:
        remarks.append(f"{not_finite} of {counts.total()} answers are not finite.")
    remarks += [evidence.explained or "", *evidence.remarks, _distance(evidence)]
    found = evidence.found
    searched, added = (0, 0) if found is None else (len(found.states) - found.added, found.added)
    stored = min(evidence.stored, counts.total() - searched - added)
    shown = evidence.shown
    return Record(
        system=system,
        subject=subject,
        states=counts.total(),
        verdict=verdict,
        expected=expectation.verdict,
        backward_error=float(backward.max()) if len(backward) else None,
        relative_error=None if shown is None else shown[1].relative_error_at(LARGEST),
        worst_state=evidence.failed_at if shown is None else shown[0].as_json(LARGEST),
        seconds_per_state=float(np.median(evidence.seconds)) if evidence.seconds else None,
        fastest_seconds_per_state=min(evidence.seconds, default=None),
        message=" ".join(filter(None, remarks)),
        failed=bool(evidence.failure) and not (evidence.unsupported or evidence.refused),
        median_backward_error=float(np.median(sample)) if len(sample) else None,
        percentile_99_backward_error=float(np.percentile(sample, 99)) if len(sample) else None,
        median_bounds=_bounds(sample, 0.5),
        percentile_99_bounds=_bounds(sample, 0.99),
        unstable_share=verdicts[Verdict.UNSTABLE.value] / max(1, verdicts.total()),
        distribution=dict(evidence.distribution),
        verdict_counts=dict(counts),
        granted=evidence.granted,
        in_balls=evidence.in_balls,
        expected_backward_error=expectation.limit,
        expected_median_backward_error=expectation.median_limit if len(sample) >= FEWEST_SAMPLED else math.inf,
        expected_share=expectation.share_limit if len(sample) >= FEWEST_SAMPLED else 1.0,
        expected_reason=expectation.reason,
        expected_link=expectation.link,
        from_rigid=float(np.median(np.concatenate(evidence.from_rigid))) if evidence.from_rigid else None,
        representative=None if shown is None else _representative(*shown, evidence, verdict),
        origins={"stored": stored, "sampled": counts.total() - searched - added - stored, "searched": searched, "simplest": added},
    )


def _bounds(sample: Array, share: float) -> list[float]:
    """The bounds of a quantile of a sample, none where it is too small."""
    ranks = quantile_ranks(len(sample), share)
    return [] if ranks is None else [float(error) for error in np.partition(sample, ranks)[list(ranks)]]


def _distance(evidence: Evidence) -> str:
    """How far a model whose constraints give is from rigid, as a sentence; "" for the others."""
    if not evidence.from_rigid:
        return ""
    distances = np.concatenate(evidence.from_rigid)
    return (
        "Held against what the file's softness of constraints declares, which is a property of the model: accelerations are "
        f"{np.median(distances):.2g} of their size from rigid ones (median; {distances.max():.2g} at most)."
    )


def _representative(states: States, comparison: Comparison, evidence: Evidence, verdict: str) -> Representative | None:
    """The state of a death; else the simplest state with the verdict that hypothesis found; else one, where the worst has another."""
    if evidence.failed_at is not None:
        return Representative(state=evidence.failed_at, backward_error=None)
    found, index, worst = evidence.found, GRAVEST, states.as_json(LARGEST)
    if found is not None and found.simplest_failure is not None and found.comparison.verdicts[found.simplest_failure] == verdict:
        states, comparison, index = found.states, found.comparison, found.simplest_failure
    elif comparison.verdicts[GRAVEST] == comparison.verdicts[LARGEST]:
        return None
    error, state = float(comparison.backward_error[index]), states.as_json(index)
    return None if state == worst else Representative(state=state, backward_error=None if math.isnan(error) else error)
