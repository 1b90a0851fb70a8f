"""Whether the answers of an engine are a function of the state, and of all its digits.

An engine that keeps something from call to call, or from state to state of a batch, answers another question than it was asked.
Nothing that it says is evidence about a model, so that such answers are an error and no disagreement.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from harness.arrays import Array
from harness.certify.certified import Certified
from harness.certify.compare import compare
from harness.certify.quantities import Truth
from harness.engines import InvalidAnswer, Model
from harness.equations.states import States
from harness.verdict import Verdict

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
    straight = _answer(truth, model, states[few])
    turned, again = (_answer(truth, model, states[backwards]) for _ in range(2))
    alone = _answer(truth, model, states[:1])
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
    exact = _answer(truth, model, few)[moved]
    # An answer that feels no state feels no rounding either.
    if len(np.unique(exact, axis=0)) >= FEWEST_NUMBERS and _same(exact, _answer(truth, model, rounded)[moved]):
        return "answers have the precision of float32: they are the same, bit by bit, where q, v and tau are rounded to it"
    return ""


def _answer(truth: Truth, model: Model, states: States) -> Array:
    """The answer as a copy: an engine may return one array each time."""
    return np.array(truth.answers(model, states))


def _same(one: Array, other: Array) -> bool:
    return np.array_equal(one, other, equal_nan=True)


def _differ(certified: Certified, one: Array, other: Array, factorises: bool) -> bool:
    """Whether answers are further apart than roundings; where the truth is not certified nobody can tell."""
    taken = replace(certified, high=np.asarray(one, dtype=np.float64), low=np.zeros_like(certified.low))
    verdicts = compare(taken, other, factorises).verdicts
    finite = [np.isfinite(answers).reshape(len(answers), -1).all(axis=1) for answers in (one, other)]
    apart = (verdicts == Verdict.DISAGREES.value) & finite[0] & finite[1]
    return bool((apart | (finite[0] != finite[1]))[certified.certified].any())
