"""From everything that a subject answered on a system to its record, with what was expected of it and how to see it again."""

from __future__ import annotations

import math
import shlex
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from statistics import median

import numpy as np
from msgspec import structs

from harness.arrays import Array
from harness.crosscheck.assignment import Assignment, why_left_out
from harness.crosscheck.expected import AGREES, Expectation, Expectations, on_file
from harness.crosscheck.hypothesis_search import Found
from harness.crosscheck.settings import DEFAULT_STATES, Settings
from harness.crosscheck.stages import NOT_OFFERED
from harness.engines import EQUATIONS, Subject, engine_files
from harness.files.model_file import ModelFile, features_of
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.states import States
from harness.results.cross_check import SystemCard
from harness.results.hard_states import replay_command
from harness.results.quantiles import half_decade, half_decade_edges, quantile_ranks
from harness.results.readings import Effect, are_misread, by_effect
from harness.results.records import ACCELERATIONS, Record, Representative, quantity_options, quantity_words
from harness.results.table import counted, error_text
from harness.truth.compare import Comparison
from harness.verdict import Verdict, gravest

# A smaller sample says nothing of a median or a share.
FEWEST_SAMPLED = 100
# Rows of ``Pair.shown``.
GRAVEST, LARGEST = 0, 1


@dataclass(kw_only=True)
class Pair:
    """A subject on a system and its answers; of each state, what the record needs of it.

    Attributes:
        quantity: what it is asked for. assignment: with what it is asked; None until that is known, and where it cannot be.
        componentwise: the componentwise backward error at the worst state; None where it was not measured.
        counts: of verdicts. backward: the backward errors that are known, part by part.
        granted: to how many answers the share of motion and weight was. left_of_zero: of those whose exact value is zero, how many
            there are and their largest component. in_balls: how many truths took ball arithmetic.
        sampled: the backward errors among them, and verdicts, that are of sampled states.
        shown: the answer that decides, and the one with the largest backward error, with their states.
        stored: how many of the first batch are stored with the system. found: what hypothesis found.
        seconds: cost per state of each timing [s]. failed_at: the state at which an engine crashed.
        failure, unsupported, misread: as of ``Answers``, where some of them are missing. refused: whether the failure is that a file
            cannot be used.
        explained: the sentence of ``Explanation`` where one number explains what would be lost digits; None where none was looked for.
        readings: that explain what a file is read as. rest: sentences on what they leave, or on why a user's file is refused.
        remarks: sentences that change no verdict.
        from_rigid: how far answers that are held against a declared truth are from the rigid one, relative, part by part.
        unequal_worlds: as of ``Record``.
    """

    subject: Subject
    quantity: str = ACCELERATIONS
    assignment: Assignment | None = None
    componentwise: float | None = None
    counts: Counter[str] = field(default_factory=Counter)
    granted: int = 0
    left_of_zero: tuple[int, float] = (0, 0.0)
    in_balls: int = 0
    backward: list[Array] = field(default_factory=list)
    shown: tuple[States, Comparison] | None = None
    sampled: list[Array] = field(default_factory=list)
    sampled_verdicts: Counter[str] = field(default_factory=Counter)
    stored: int = 0
    found: Found | None = None
    seconds: list[float] = field(default_factory=list)
    failure: str = ""
    unsupported: bool = False
    misread: bool = False
    refused: bool = False
    failed_at: dict[str, list[float]] | None = None
    explained: str | None = None
    readings: list[Effect] = field(default_factory=list)
    rest: list[str] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)
    from_rigid: list[Array] = field(default_factory=list)
    unequal_worlds: float | None = None

    @property
    def key(self) -> str:
        """Its name among the pairs of its system, as ``Assignment.title``."""
        return " ".join([str(self.subject), *quantity_words(self.quantity)])

    def fail(self, failure: str, unsupported: bool = False, refused: bool = False, misread: bool = False) -> None:
        """The first failure is the one that is reported."""
        if not self.failure:
            self.failure, self.unsupported, self.refused, self.misread = failure, unsupported, refused, misread

    @property
    def verdict(self) -> str:
        """The gravest of the answers.

        Where one number explains the errors of all states they are no lost digits. An explanation by a misreading is one, with digits
        lost or not.
        """
        if self.failure or not self.counts:
            return (Verdict.MISREADS if self.misread else Verdict.UNSUPPORTED if self.unsupported else Verdict.ERROR).value
        verdict = gravest(self.counts)
        if verdict == Verdict.UNSTABLE and self.explained:
            return Verdict.DISAGREES.value
        return Verdict.MISREADS.value if verdict in (Verdict.EXPLAINED, Verdict.UNSTABLE) and are_misread(self.readings) else verdict

    def add(self, states: States, comparison: Comparison, sampled: slice = slice(0)) -> None:
        """Take the judgement of the answers at ``states``; ``sampled`` are those of the sample."""
        if not len(states):
            return
        self.counts.update(comparison.verdicts.tolist())
        self.granted += int(comparison.granted.sum())
        left = comparison.left_of_zero
        self.left_of_zero = self.left_of_zero[0] + int(np.count_nonzero(left)), max(self.left_of_zero[1], float(left.max()))
        self.in_balls += int(comparison.in_balls.sum())
        self.backward.append(comparison.known("backward_error"))
        self.sampled.append(comparison[sampled].known("backward_error"))
        self.sampled_verdicts.update(comparison[sampled].verdicts.tolist())
        before = () if self.shown is None else (self.shown,)
        states = States.concatenate([*(known for known, _ in before), states])
        comparison = Comparison.concatenate([*(known for _, known in before), comparison])
        places = [comparison.worst, comparison.largest]
        self.shown = states[places], comparison[places]


def distribution_of(backward: Array) -> dict[str, int]:
    """Number of errors in each half decade, in the order in which the half decades come first.

    ``half_decade`` of each error by itself takes 0.4 us, which the process that serves all workers has to spend on each subject.
    """
    bins = np.where(np.isfinite(backward), np.searchsorted(half_decade_edges(), backward, side="right"), -1)
    _, first, counts = np.unique(bins, return_index=True, return_counts=True)
    order = np.argsort(first)
    return {half_decade(float(backward[index])): int(count) for index, count in zip(first[order], counts[order], strict=True)}


def record_of(settings: Settings, expectations: Expectations, system: SystemProgress, pair: Pair) -> Record:
    """The record of a pair of a system, with the expectations of its quantity.

    It has the gravest verdict, the worst error with its state, and another state that shows the verdict better.
    """
    name, counts, backward = system.name, pair.counts, np.concatenate([np.empty(0), *pair.backward])
    sample, verdicts = np.concatenate([np.empty(0), *pair.sampled]), pair.sampled_verdicts
    if not len(sample):
        sample, verdicts = backward, counts
    remarks = [pair.failure or ("" if counts else "nothing was compared")]
    if not_finite := counts[Verdict.ERROR.value]:
        remarks.append(f"{not_finite} of {counts.total()} answers are not finite.")
    remarks += [pair.explained or "", *pair.remarks, _distance(pair), _left_of_zero(pair)]
    found = pair.found
    searched, added = (0, 0) if found is None else (len(found.states) - found.added, found.added)
    stored = min(pair.stored, counts.total() - searched - added)
    shown, subject, message = pair.shown, str(pair.subject), " ".join(filter(None, remarks))
    expectation = _expected(settings, expectations, name, pair, message)
    worst = pair.failed_at if shown is None else shown[0].as_json(LARGEST)
    options = [*settings.replay_options, *quantity_options(pair.quantity)]
    command = ["harness", "check", name, "--subject", subject, *options, "--states", str(settings.states), "--seed", str(settings.seed)]
    representative = None if shown is None else _representative(*shown, pair)
    if representative is not None:
        representative = replace(representative, replay=replay_command(name, subject, representative.state, options))
    return Record(
        system=name,
        subject=subject,
        quantity=pair.quantity,
        states=counts.total(),
        verdict=pair.verdict,
        expected=expectation.verdict,
        backward_error=float(backward.max()) if len(backward) else None,
        relative_error=None if shown is None else shown[1].relative_error_at(LARGEST),
        worst_state=worst,
        seconds_per_state=float(np.median(pair.seconds)) if pair.seconds else None,
        fastest_seconds_per_state=min(pair.seconds, default=None),
        message=message,
        failed=bool(pair.failure) and not (pair.unsupported or pair.refused or pair.misread),
        median_backward_error=float(np.median(sample)) if len(sample) else None,
        percentile_99_backward_error=float(np.percentile(sample, 99)) if len(sample) else None,
        median_bounds=_bounds(sample, 0.5),
        percentile_99_bounds=_bounds(sample, 0.99),
        share=_share(verdicts),
        distribution=distribution_of(backward),
        verdict_counts=dict(counts),
        granted=pair.granted,
        in_balls=pair.in_balls,
        expected_backward_error=expectation.limit,
        expected_median_backward_error=expectation.median_limit if len(sample) >= FEWEST_SAMPLED else math.inf,
        expected_share=expectation.share_limit if len(sample) >= FEWEST_SAMPLED else 1.0,
        expected_reason=expectation.reason,
        expected_link=expectation.link,
        from_rigid=float(np.median(np.concatenate(pair.from_rigid))) if pair.from_rigid else None,
        replay=shlex.join(command) if worst is None else replay_command(name, subject, worst, options),
        representative=representative,
        origins={"stored": stored, "sampled": counts.total() - searched - added - stored, "searched": searched, "simplest": added}
        if settings.state is None
        else {},
        readings=by_effect(pair.readings),
        rest=pair.rest,
        unequal_worlds=pair.unequal_worlds,
        stance=str(settings.library.stance) if settings.library.reads_files else "",
        features=_asked_features(system, pair),
        componentwise_error=None if pair.componentwise is None or math.isnan(pair.componentwise) else pair.componentwise,
    )


def _expected(settings: Settings, expectations: Expectations, name: str, pair: Pair, message: str) -> Expectation:
    """The expectation that a record is held against."""
    library, verdict = settings.library, pair.verdict
    expectation = expectations.of(library.label(name), pair.subject)
    if library.reads_files and not (verdict == Verdict.UNSTABLE and pair.explained is None):
        expectation = on_file(expectation, verdict)
    if expectation is AGREES and pair.unsupported and engine_files(library)[pair.subject.engine].elsewhere:
        # What an engine beside the harness cannot do is listed, so that a new refusal shows. Others and other versions say why.
        expectation = structs.replace(AGREES, verdict=Verdict.UNSUPPORTED.value, reason=pair.failure)
    if quantity_words(pair.quantity) and (expectation.verdict, verdict) == (Verdict.MISREADS, Verdict.AGREES):
        # It need not feel what the reader makes of the file.
        return AGREES
    if (
        expectation is AGREES
        and verdict == Verdict.EXPLAINED
        and pair.assignment is not None
        and (left_out := why_left_out(pair.assignment))
    ):
        # What an engine documents that it applies none of needs no entry.
        return structs.replace(AGREES, verdict=verdict, reason="; ".join(left_out.values()))
    if (expectation.verdict, verdict) == (Verdict.DISAGREES, Verdict.UNSTABLE):
        # How many digits are left of those that an algorithm loses depends on the states that are met.
        return structs.replace(expectation, verdict=verdict)
    few = settings.state is not None or settings.states < DEFAULT_STATES
    # What a reader makes of a file is felt at almost every state.
    wanted = (Verdict.UNSUPPORTED, *((Verdict.MISREADS,) if settings.state is None else ()))
    if few and verdict == Verdict.AGREES and expectation.verdict not in wanted:
        # So few states need not meet the one that the expectation is about.
        return AGREES
    if pair.unsupported and message.startswith(NOT_OFFERED):
        # What nobody claims to compute needs no entry that excuses it.
        return structs.replace(expectation, verdict=Verdict.UNSUPPORTED.value, reason=message.removeprefix(NOT_OFFERED))
    return expectation


def _bounds(sample: Array, share: float) -> list[float]:
    """The bounds of a quantile of a sample, none where it is too small."""
    ranks = quantile_ranks(len(sample), share)
    return [] if ranks is None else [float(error) for error in np.partition(sample, ranks)[list(ranks)]]


def _share(verdicts: Counter[str]) -> float:
    """The share of answers that do not agree; where there is no certified truth nobody can tell."""
    agree, known = verdicts[Verdict.AGREES.value], verdicts.total() - verdicts[Verdict.UNDECIDED.value]
    return (known - agree) / max(1, known)


def _distance(pair: Pair) -> str:
    """Distance from rigid of a model whose constraints give, as a sentence; "" for the others."""
    if not pair.from_rigid:
        return ""
    distances = np.concatenate(pair.from_rigid)
    return (
        "Held against what the file's softness of constraints declares, which is a property of the model: accelerations are "
        f"{np.median(distances):.2g} of their size from rigid ones (median; {distances.max():.2g} at most)."
    )


def _left_of_zero(pair: Pair) -> str:
    """Size of answers where the exact one is zero, as a sentence; "" where they have nothing that needs one."""
    count, largest = pair.left_of_zero
    if not count:
        return ""
    return (
        f"Zero by cancellation at {counted(count, 'state')}: the exact answer is 0, and the largest component of the engine's is "
        f"{error_text(largest)}, which is within the rounding of the terms that cancel."
    )


def _representative(states: States, comparison: Comparison, pair: Pair) -> Representative | None:
    """The state of a death; else the simplest state with the verdict that hypothesis found; else one, where the worst has another."""
    if pair.failed_at is not None:
        return Representative(state=pair.failed_at, backward_error=None, is_alone=True)
    found, index, worst = pair.found, GRAVEST, states.as_json(LARGEST)
    is_alone = bool(comparison.verdicts[GRAVEST] != comparison.verdicts[LARGEST])
    if found is not None and found.simplest_failure is not None and found.comparison.verdicts[found.simplest_failure] == pair.verdict:
        states, comparison, index = found.states, found.comparison, found.simplest_failure
    elif not is_alone:
        return None
    error, state = float(comparison.backward_error[index]), states.as_json(index)
    return None if state == worst else Representative(state=state, backward_error=None if math.isnan(error) else error, is_alone=is_alone)


Pairs = Sequence[Pair]


def answering(pairs: Iterable[Pair]) -> list[Pair]:
    """The pairs that can be asked and have not failed."""
    return [pair for pair in pairs if pair.assignment is not None and not pair.failure]


@dataclass
class SystemProgress:
    """A system, or a variant of its models, while it is compared.

    Attributes:
        models: by format, those that a subject reads; why not, where one cannot be used.
        seconds: per certified state of each batch. compilation_seconds: of the certified kernel; None before the first batch.
    """

    name: str
    pairs: dict[str, Pair]
    mechanism: Mechanism | None = None
    models: dict[str, ModelFile | str] = field(default_factory=dict)
    seconds: list[float] = field(default_factory=list)
    compilation_seconds: float | None = None

    def fail(self, failure: str) -> None:
        """Nothing of it can be asked, for a file cannot be used."""
        for pair in self.pairs.values():
            pair.fail(failure, refused=True)


def _asked_features(system: SystemProgress, pair: Pair) -> list[str]:
    """Features that mechanism and model ask of the subject; of one that reads no model, those that the models of the mechanism would."""
    own = pair.subject.format
    models = [model for name, model in system.models.items() if isinstance(model, ModelFile) and own in (name, EQUATIONS)]
    ties = None if system.mechanism is None else system.mechanism.constraints
    rolling = {"rolling"} if ties is not None and ties.holonomic < len(ties.rows) else set()
    return sorted(rolling.union(*map(features_of, models)))


def card_of(system: SystemProgress, mechanism: Mechanism) -> SystemCard:
    """The card of a system in a report."""
    return SystemCard(
        name=mechanism.name,
        description=mechanism.description,
        source=mechanism.source,
        coordinates=[{"name": name, "joint": joint} for name, joint in zip(mechanism.coordinates, mechanism.joints, strict=True)],
        parameters=[{"name": name, "value": value, "unit": unit} for name, value, unit in mechanism.parameters],
        equations_mathml=mechanism.equations_mathml,
        equations_text=mechanism.equations_text,
        energies_text=mechanism.energies_text,
        operations=mechanism.program.operations,
        derivation_seconds=mechanism.derivation_seconds,
        reference_seconds_per_state=median(system.seconds) if system.seconds else None,
        compilation_seconds=system.compilation_seconds,
    )
