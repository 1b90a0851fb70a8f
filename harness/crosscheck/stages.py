"""The comparison of a batch of states, as a worker process runs it.

``compare_all`` is the way of every state from the sample to its verdicts: ``Truths`` certifies each truth once, and ``ask`` holds the
answers of each subject against it. What was loaded or compiled stays in the process for the next task.

An engine that keeps something from call to call, or from state to state of a batch, answers another question than it was asked. Nothing
that it says is evidence about a model, so that such answers are an error and no disagreement.
"""

from __future__ import annotations

import json
import time
from collections.abc import Hashable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from harness.arrays import Array
from harness.crosscheck.assignment import (
    Assignment,
    answers_what_is_read,
    load_audited,
)
from harness.crosscheck.together import answered_together
from harness.engines import (
    Calls,
    InvalidAnswer,
    Misread,
    Model,
    NotOffered,
    Unsupported,
    load_engine,
    require_offered,
    timed_answers_of,
)
from harness.errors import InvalidInput
from harness.programs.loops.interpreter import loop
from harness.programs.states import States
from harness.study import Note, sentence
from harness.truth.compare import Certified, Comparison, compare
from harness.truth.quantities import ASKED_ELSEWHERE, Truth
from harness.truth.reference import Reference, moves, precision_in_words
from harness.verdict import Verdict

# Begins the message of a subject whose engine does not claim to compute a quantity.
NOT_OFFERED = "not offered: "
# Why a further quantity of such a subject is another one.
MISREAD = "its reader makes another mechanism of the file, and its accelerations are those of that"
# Timings of a batch: the least where these take that long, else the most.
LEAST_TIMINGS, ENOUGH_SECONDS, MOST_TIMINGS = 3, 0.02, 5
# A longer call is timed once; one that is shorter is set up for the size of its batch by a call before.
REPEATED_BELOW_SECONDS = 0.25


@dataclass(frozen=True)
class Answers:
    """The answers of one subject at a batch of states.

    Attributes:
        comparison: the judgement of each answer; None where there is none.
        seconds: cost per state of each timing [s]; none where there is no answer.
        failure: why there are no answers, "" where there are. problem: the same where a file is invalid.
        remark: what the answers have in common, as a sentence; "" for nothing.
        unsupported: whether the failure is that the engine cannot express the mechanism.
        misread: whether it is that the engine's reader is known to make another mechanism of the file.
        states: at which they were given, where these are others than those that the batch holds: see ``Truth.asked_at``.
        from_rigid: how far answers that are held against a declared truth are from the rigid one where states close the constraints,
            relative; none for the others.
    """

    comparison: Comparison | None = None
    seconds: Sequence[float] = ()
    failure: str = ""
    problem: InvalidInput | None = None
    unsupported: bool = False
    misread: bool = False
    remark: str = ""
    from_rigid: Array = field(default_factory=lambda: np.empty(0))
    states: States | None = None

    @classmethod
    def missing(cls, error: Exception) -> Answers:
        """No answers because of ``error``; only what can be mended in a file keeps its type."""
        if isinstance(error, InvalidInput):
            return cls(failure=str(error), problem=error)
        return cls(failure=str(error), unsupported=True) if isinstance(error, Unsupported) else cls(failure=sentence(error))


class Truths:
    """The truths at one batch of states, each certified once: two files of a mechanism mostly say the same.

    ``share``: of the states that a declared truth takes elsewhere, as of ``Truth.asked_at``.

    Attributes:
        seconds: per certified state, of the truth that takes longest. compilation_seconds: the same of compiling; 0 where this process
            had compiled already.
    """

    def __init__(self, states: States, share: float = ASKED_ELSEWHERE) -> None:
        self._states, self._share = states, share
        self._known: dict[Hashable, Certified] = {}
        self.seconds = self.compilation_seconds = 0.0

    def asked_at(self, truth: Truth) -> States:
        """The states at which answers are held against a truth."""
        return truth.asked_at(self._states, self._share)

    def of(self, truth: Truth) -> Certified:
        """The values of a truth there; raises as ``Truth.evaluate``."""
        if truth.key not in self._known:
            # So that making or loading the loops, which all systems share, is not charged to this one.
            loop("evaluate")
            started = compiled = time.perf_counter()
            states = self.asked_at(truth)
            if not truth.is_compiled:
                truth.evaluate(states[:1])
                compiled = time.perf_counter()
            self._known[truth.key] = truth.evaluate(states)
            self.seconds = max(self.seconds, (time.perf_counter() - compiled) / len(self._states))
            self.compilation_seconds = max(self.compilation_seconds, compiled - started)
        return self._known[truth.key]


def compare_all(
    assignments: Sequence[Assignment], states: States, note: Note, *, each: bool = False, share: float = ASKED_ELSEWHERE
) -> tuple[float, float, dict[str, Answers]]:
    """Seconds per certified state, seconds of compilation, and by ``Assignment.title`` what was answered at ``states``.

    All assignments are of one mechanism; ``share`` as of ``Truths``. The note names the one that is being asked, or all that are asked
    together; with ``each`` none are, so that where a process dies the note names one.
    """
    truths, answers = Truths(states, share), dict[str, Answers]()
    for assignment in assignments:
        if assignment.asked.is_default:
            try:
                truth = assignment.truth
            except Exception as error:
                answers[assignment.title] = Answers.missing(error)
                continue
            try:
                # Before anybody is asked, who would be blamed for a death.
                for one in filter(None, (truth, truth.rigid)):
                    truths.of(one)
            except Unsupported as error:
                # Where bodies touch, an engine's own contacts are in its truth, and it may refuse their shapes.
                answers[assignment.title] = Answers.missing(error)

    def asks(assignment: Assignment, model: Model) -> Sequence[Calls]:
        truth = assignment.truth
        return _warmed_up(truth, model, truths.asked_at(truth))

    together = {} if each or len(assignments) == 1 else answered_together({one.title: one for one in assignments}, asks, note, {})
    for assignment in assignments:
        title = assignment.title
        if title not in answers:
            note(json.dumps({"subject": title}))
            answers[title] = ask(assignment, states, truths, together[title][-1] if title in together else None)
    return truths.seconds, truths.compilation_seconds, answers


def _warmed_up(truth: Truth, model: Model, states: States) -> tuple[Calls, Calls]:
    """The calls at ``states`` behind the same at one state: what is compiled or allocated on first use is not charged to the engine.

    Raises:
        NotOffered: the model does not offer it.
    """
    found = truth.asks(model, states[:1]), truth.asks(model, states)
    require_offered(model, found)
    return found


def ask(assignment: Assignment, states: States, truths: Truths, before: tuple[Array, float] | None = None) -> Answers:
    """The subject's answers at ``states``, timed, held against each other and compared with the truth there.

    ``before``: what it has answered there already, and its seconds.
    """
    quantity = assignment.asked
    try:
        model = load_audited(assignment)
        truth, closed = assignment.truth, states
        certified, states = truths.of(truth), truths.asked_at(truth)
        answers, seconds = timed_answers(truth, model, states, quantity.is_asked_again, before)
        if quantity.is_asked_again:
            require_repeatable(truth, model, states, answers, certified)
        comparison, of_solver = truth.judge(certified, states, answers[0], model), ""
        is_tied = assignment.mechanism.constraints is not None or assignment.mechanism.bounded is not None
        if quantity.is_default and (is_tied or (comparison.verdicts == Verdict.DISAGREES.value).any()):
            # Imported late: a run in which all is well needs nothing of it.
            from harness.crosscheck.solvers import by_defaults, judged_to_the_end

            comparison, stopped = judged_to_the_end(assignment, certified, model, states, comparison)
            of_solver = stopped or by_defaults(truth, certified, model, states)
        wrong = comparison.verdicts == Verdict.DISAGREES.value
        if wrong.any() and assignment.model is not None:
            # A reader that is mended agrees, and one that does something else disagrees with what it is known to read, too.
            read = answers_what_is_read(assignment, states)
            if quantity.is_default:
                comparison = replace(comparison, verdicts=np.where(wrong & read, Verdict.MISREADS.value, comparison.verdicts))
            elif read.all():
                return Answers(failure=MISREAD, misread=True)
        declared, remark = declared_precision(assignment), ""
        if (comparison.verdicts == Verdict.DISAGREES.value).any():
            remark = truth.describe(certified, states, answers[0], model)
            is_told = declared or not quantity.is_asked_again
            remark = remark or ("" if is_told else precision_of(truth, model, states, answers[0]))
        remark = ". ".join(filter(None, [declared, remark, of_solver]))
        if truth.rigid is None:
            return Answers(comparison, seconds, remark=remark, states=None if states is closed else states)
        of_rigid = truths.of(truth.rigid)
        assert isinstance(of_rigid, Reference)
        # What sticks has no acceleration, of which a distance would be a share.
        unmoved = (states.q == closed.q).all(axis=1) & (states.v == closed.v).all(axis=1) & moves(of_rigid)
        rigid = compare(of_rigid[np.flatnonzero(unmoved)], answers[0][unmoved])
        return Answers(comparison, seconds, remark=remark, states=states, from_rigid=rigid.known("relative_error"))
    except Misread as error:
        read = answers_what_is_read(assignment, states)
        if not quantity.is_default:
            return Answers(failure=str(error), misread=bool(read.all()))
        # What has other joints is compared with nothing.
        verdicts = np.where(read, Verdict.MISREADS.value, Verdict.DISAGREES.value)
        nothing, no = np.full(len(states), np.nan), np.zeros(len(states), dtype=bool)
        return Answers(Comparison(nothing, nothing, no, verdicts, no, np.zeros(len(states))), remark=str(error))
    except NotOffered as error:
        # Every engine claims to compute the default one.
        return Answers.missing(error) if quantity.is_default else Answers(failure=f"{NOT_OFFERED}{error}", unsupported=True)
    except Exception as error:
        return Answers.missing(error)


def declared_precision(assignment: Assignment) -> str:
    """A sentence where the subject's engine declares that it computes in another precision than float64, "" where it does not."""
    return precision_in_words(load_engine(assignment.library, assignment.subject.engine).unit_roundoff)


def timed_answers(
    truth: Truth, model: Model, states: States, again: bool = True, before: tuple[Array, float] | None = None
) -> tuple[list[Array], list[float]]:
    """The answers at ``states`` of each call, and seconds per state of each timing; of one call without ``again``.

    ``before``: the answer to the first call, where it is there already.
    """
    first, asked = _warmed_up(truth, model, states)
    found = [before or timed_answers_of(model, [first, asked])[1]]
    _, seconds_of_first = found[0]
    if again and seconds_of_first <= REPEATED_BELOW_SECONDS:
        # The call before has set the engine up for the size of the batch.
        count = LEAST_TIMINGS if seconds_of_first * LEAST_TIMINGS > ENOUGH_SECONDS else MOST_TIMINGS
        found += timed_answers_of(model, [asked] * count)
    answers, seconds = zip(*found, strict=True)
    return list(answers), [one / len(states) for one in seconds[1:] or seconds]


# States that are asked for again: alone, in a smaller batch, and in reverse.
ASKED_AGAIN = 64
# Numbers that are all of float32 by chance: one in 2^29 is.
FEWEST_NUMBERS = 3


def require_repeatable(truth: Truth, model: Model, states: States, answers: Sequence[Array], certified: Certified) -> None:
    """Ask for the first states again, in other batches, and hold all answers against each other.

    ``answers`` are those to ``states`` of several calls. The same question has the same answer bit by bit, NaN included. In
    another batch the order of additions may be another one: there answers differ where they are more than ``AGREEMENT`` data
    roundoffs apart, and further than lost digits explain where the engine factorises M (see ``compare``).

    Raises:
        InvalidAnswer: answers to one question differ.
    """
    few = slice(min(ASKED_AGAIN, len(states)))
    backwards = np.arange(len(states[few]))[::-1]
    reverse = truth.asks(model, states[backwards])
    asked = [truth.asks(model, states[few]), reverse, reverse, truth.asks(model, states[:1])]
    straight, turned, again, alone = (answer for answer, _ in timed_answers_of(model, asked))
    if _same(straight, turned) and not _same(straight, straight[backwards]) and not _same(turned, again):
        raise InvalidAnswer("forward_dynamics returns the answer of the call before")
    batches = [*answers, *([straight] if len(straight) == len(states) else [])]
    if not (_same(turned, again) and all(_same(batches[0], other) for other in batches[1:])):
        raise InvalidAnswer("answers differ from call to call at the same states: noise, or something kept between calls")
    known, factorises = certified[few], truth.may_lose_digits(model)
    pairs = ((answers[0][few], straight), (straight, turned[backwards]))
    if any(_differ(known, one, other, factorises) for one, other in pairs) or _differ(certified[:1], straight[:1], alone, factorises):
        raise InvalidAnswer("the answer depends on the batch: a state is answered differently alone, or beside others or in another order")


def precision_of(truth: Truth, model: Model, states: States, answer: Array) -> str:
    """A sentence where answers or inputs are rounded to float32, "" where they are not."""
    finite = answer[np.isfinite(answer)]
    with np.errstate(all="ignore"):
        numbers = np.unique(finite[finite != 0])
        if answer.dtype.itemsize < 8 or (len(numbers) >= FEWEST_NUMBERS and _same(numbers, numbers.astype(np.float32).astype(np.float64))):
            return "answers have the precision of float32: every one of them is a number of float32"
        few = states[: min(ASKED_AGAIN, len(states))]
        rounded = replace(few, **{name: getattr(few, name).astype(np.float32).astype(np.float64) for name in ("q", "v", "tau")})
    moved = np.hstack([getattr(few, name) != getattr(rounded, name) for name in ("q", "v", "tau")]).any(axis=1)
    exact = truth.answers(model, few)[moved]
    # An answer that feels no state feels no rounding either.
    if len(np.unique(exact, axis=0)) >= FEWEST_NUMBERS and _same(exact, truth.answers(model, rounded)[moved]):
        return "answers have the precision of float32: they are the same, bit by bit, where q, v and tau are rounded to it"
    return ""


def _same(one: Array, other: Array) -> bool:
    return np.array_equal(one, other, equal_nan=True)


def _differ(certified: Certified, one: Array, other: Array, factorises: bool) -> bool:
    """True where answers are further apart than roundings; where the truth is not certified nobody can tell."""
    taken = replace(certified, high=np.asarray(one, dtype=np.float64), low=np.zeros_like(certified.low))
    verdicts = compare(taken, other, factorises).verdicts
    finite = [np.isfinite(answers).reshape(len(answers), -1).all(axis=1) for answers in (one, other)]
    apart = (verdicts == Verdict.DISAGREES.value) & finite[0] & finite[1]
    return bool((apart | (finite[0] != finite[1]))[certified.certified].any())
