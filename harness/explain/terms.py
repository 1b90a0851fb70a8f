"""The terms of an engine's equations that are wrong: entries or coordinates, and the first kind of state that shows it.

The same positions are asked for three times: at rest, moving, and moving under applied forces. A wrong gravity shows at
rest, a damper once it moves. A term may show nothing while the accelerations do: then it is the solution, or a force
that the engine counts as none of these terms. The applied force is what an engine says it applies; the built-in ones
say what they were given.

``harness.truth.terms`` says what a data roundoff of each term is.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.engines import Model, Terms, accelerations, driving_of
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.states import States
from harness.results.table import first_of
from harness.truth.compare import Flags, compare
from harness.truth.reference import ReferenceKernel
from harness.truth.terms import APPLIED, GRAVITY, MASS, PASSIVE, TERMS, VELOCITY, TermReference, certify_terms, term_errors
from harness.verdict import AGREEMENT, Verdict, gravest

AT_REST, MOVING, LOADED = "at rest", "moving", "loaded"
TITLES = {
    MASS: "mass matrix",
    VELOCITY: "velocity terms",
    GRAVITY: "gravity",
    PASSIVE: "springs, dampers and constraints",
    APPLIED: "applied forces",
}
# What is wrong at all states of a kind and of later ones, and what is wrong at some.
_WHEN = {AT_REST: "at every state", MOVING: "wherever it moves", LOADED: "wherever {given}"}
_SINCE = {AT_REST: "at rest already", MOVING: "once it moves", LOADED: "once {given}"}
_APPLIED, _GIVEN = "forces are applied", "forces or accelerations are given"
_WRONG = {Verdict.DISAGREES.value, Verdict.ERROR.value}
_MOST_NAMED = 3
_AXES = "xyz"
# Kinds of n states.
Kinds = np.ndarray[Any, np.dtype[np.str_]]


@dataclass(frozen=True)
class WrongPlace:
    """An entry of M, or a coordinate of a force, that is beyond its data roundoff.

    Attributes:
        coordinates: (row, column) of M, or the one of a force, counted from 0. names: what people call them.
        backward_error: the largest over all states [data roundoffs].
    """

    coordinates: tuple[int, ...]
    names: tuple[str, ...]
    backward_error: float

    def __str__(self) -> str:
        return f"({', '.join(self.names)})" if len(self.names) > 1 else self.names[0]


@dataclass(frozen=True)
class TermFinding:
    """The judgement of one term over all states.

    Attributes:
        term: "mass", "velocity", "gravity", "passive" or "applied".
        verdict: "agrees", "disagrees", "undecided", or "error" for an answer that is not finite.
        backward_error: the largest [data roundoffs]; None where none is certified, or some answer is not finite.
        since: the first kind of state at which it does not agree, "at rest", "moving" or "loaded"; "" where it agrees.
        wrong, states: at how many states it does not agree, of how many of that kind and of later ones.
        places: what is wrong, the worst first.
        worst_state: {"q", "v", "tau"} with the largest error, or one whose answer is not finite.
    """

    term: str
    verdict: str
    backward_error: float | None
    since: str
    wrong: int
    states: int
    places: tuple[WrongPlace, ...]
    worst_state: dict[str, list[float]]

    @property
    def sentence(self) -> str:
        """The finding in words."""
        title = TITLES[self.term]
        size = "" if self.backward_error is None else f"{self.backward_error:.3g} data roundoffs"
        if self.verdict in (Verdict.AGREES, Verdict.UNDECIDED):
            return f"{title}: {self.verdict}" + (f"; {size}" if size else "")
        when = _when(self.since, "" if self.wrong == self.states else f"at {self.wrong} of {self.states} states", _APPLIED)
        if self.verdict == Verdict.ERROR:
            return f"{title}: not finite {when}"
        kind = ("entry", "entries") if self.term == MASS else ("force on", "forces on")
        return f"{title}: {kind[len(self.places) > 1]} {_are_wrong(list(map(str, self.places)), when, size)}"


@dataclass(frozen=True)
class TermComparison:
    """The terms of one subject on one system.

    Attributes:
        system, subject: names.
        findings: one per term, in the order of the equation; () for an engine that states no terms.
        accelerations_since: the first kind of state at which an acceleration does not agree; "" where all do.
        loses_digits: true where those that do not agree are ``unstable`` only, which shows no wrong term.
    """

    system: str
    subject: str
    findings: tuple[TermFinding, ...]
    accelerations_since: str
    loses_digits: bool

    @property
    def wrong(self) -> tuple[TermFinding, ...]:
        """The terms that do not agree."""
        return tuple(finding for finding in self.findings if finding.verdict in _WRONG)

    @property
    def sentences(self) -> tuple[str, ...]:
        """A sentence for each term that is wrong; one sentence where none is."""
        if self.wrong:
            return tuple(finding.sentence for finding in self.wrong)
        if not self.accelerations_since:
            return ("every term agrees" if self.findings else "the engine states no terms",)
        since = _SINCE[self.accelerations_since].format(given=_APPLIED)
        if self.loses_digits:
            return (f"no term is wrong; solving for the accelerations loses digits, {since}",)
        if not self.findings:
            return (f"the engine states no terms; its accelerations are wrong, {since}",)
        return (
            f"every term agrees, but accelerations do not, {since}: "
            "solving for them is wrong, or a force that the engine counts as no term",
        )

    def as_json(self) -> dict[str, Any]:
        """Plain data, with the sentences."""
        return {**asdict(self), "sentences": list(self.sentences)}


def compare_terms(kernel: ReferenceKernel, states: States, model: Model, subject: str, factorises: bool = False) -> TermComparison:
    """Judge every term that ``model`` states, at the positions of ``states``: at rest, at their velocities, and under their forces.

    ``kernel`` has the model's frames; see ``harness.engines.Engine``. ``factorises`` as of ``harness.truth.compare.compare``.
    """
    batches = batches_at(states)
    verdicts = {
        name: gravest(compare(kernel.evaluate(batch), accelerations(model, batch), factorises).verdicts.tolist())
        for name, batch in batches.items()
    }
    wrong = [name for name, verdict in verdicts.items() if verdict in _WRONG]
    unstable = [name for name, verdict in verdicts.items() if verdict == Verdict.UNSTABLE]
    since = next(iter(wrong or unstable), "")
    stated = getattr(model, "terms", None)
    findings: tuple[TermFinding, ...] = ()
    if stated is not None:
        everywhere, kinds = States.concatenate(list(batches.values())), np.repeat(list(batches), len(states))
        reference, terms = (
            certify_terms(kernel, everywhere),
            stated(everywhere.q, everywhere.v, everywhere.tau, *driving_of(model, everywhere)),
        )
        names = coordinate_names(kernel.mechanism)
        findings = tuple(_finding(name, reference, terms, everywhere, kinds, names) for name in TERMS)
    return TermComparison(kernel.mechanism.name, subject, findings, since, bool(unstable and not wrong))


def _finding(name: str, reference: TermReference, terms: Terms, states: States, kinds: Kinds, coordinates: Sequence[str]) -> TermFinding:
    parts, whole, finite = term_errors(name, reference, terms)
    verdicts = np.select(
        [~finite, ~getattr(reference.certified, name), whole <= AGREEMENT],
        [Verdict.ERROR.value, Verdict.UNDECIDED.value, Verdict.AGREES.value],
        Verdict.DISAGREES.value,
    )
    wrong = np.isin(verdicts, list(_WRONG))
    # What is no number is worse than any number; what is undecided is none.
    worst = int(np.argmax(np.select([~finite, np.isnan(whole)], [np.inf, -1.0], whole)))
    since, later = _since(wrong, kinds) if wrong.any() else ("", wrong)
    return TermFinding(
        term=name,
        verdict=gravest(verdicts.tolist()),
        backward_error=None if np.isnan(whole[worst]) else float(whole[worst]),
        since=since,
        wrong=int(later.sum()),
        states=len(later),
        places=_places(parts[verdicts == Verdict.DISAGREES.value], coordinates),
        worst_state=states.as_json(worst),
    )


def _places(parts: Array, names: Sequence[str]) -> tuple[WrongPlace, ...]:
    """Entries or coordinates that are wrong somewhere in ``parts``, the worst first; the worst of all where none is by itself."""
    if not len(parts):
        return ()
    largest = np.nan_to_num(parts, nan=0.0, posinf=np.inf).max(axis=0)
    if largest.ndim == 2:
        largest = np.triu(largest)
    order = np.argsort(largest, axis=None)[::-1].tolist()
    chosen = [place for place in order if largest.flat[place] > AGREEMENT] or order[:1]
    places = [tuple(int(axis) for axis in np.unravel_index(place, largest.shape)) for place in chosen]
    return tuple(WrongPlace(place, tuple(names[axis] for axis in place), float(largest[place])) for place in places)


def coordinate_names(mechanism: Mechanism) -> list[str]:
    """The name of each velocity: its joint, and the axis along or about which a joint of several moves."""
    turning = {place + axis: _AXES[axis] for place in mechanism.attitudes for axis in range(3)}
    names = []
    for place, joint in enumerate(mechanism.joints):
        if mechanism.joints.count(joint) == 1:
            names.append(joint)
        elif place in turning:
            names.append(f"{joint} about {turning[place]}")
        else:
            names.append(f"{joint} along {_AXES[place - mechanism.joints.index(joint)]}")
    return names


def _since(wrong: Flags, kinds: Kinds) -> tuple[str, Flags]:
    """The first of the kinds of states (n,), in order, at which one is wrong, and which states of it and of later ones are."""
    since = str(kinds[np.argmax(wrong)])
    return since, wrong[int(np.argmax(kinds == since)) :]


def _when(since: str, at_some: str, given: str) -> str:
    """A phrase on what is wrong since a kind of state: at all of them, or ``at_some``."""
    return (f"{at_some}, {_SINCE[since]}" if at_some else _WHEN[since]).format(given=given)


def _are_wrong(named: Sequence[str], when: str, size: str) -> str:
    return f"{first_of(named, _MOST_NAMED)} {'are' if len(named) > 1 else 'is'} wrong {when}; {size}"


def batches_at(states: States) -> dict[str, States]:
    """The positions of ``states`` at rest, at their velocities, and with what is given besides."""
    still = np.zeros_like(states.v)
    at_rest, moving = (States(states.q, v, still, states.time) for v in (still, states.v))
    return {AT_REST: at_rest, MOVING: moving, LOADED: states}


def wrong_blocks(blocks: Sequence[str], errors: Array, kinds: Kinds) -> Iterator[str]:
    """A sentence for the blocks that are wrong since the same kind of state, and as often; ``errors`` are (n, blocks) [data roundoffs].

    ``kinds``, (n,), are kinds of states, in order. NaN counts as wrong.
    """
    wrong = ~(errors <= AGREEMENT)
    alike: dict[tuple[str, bool], list[int]] = {}
    for block in np.flatnonzero(wrong.any(axis=0)).tolist():
        since, later = _since(wrong[:, block], kinds)
        alike.setdefault((since, bool(later.all())), []).append(block)
    for (since, always), found in sorted(alike.items(), key=lambda item: list(_SINCE).index(item[0][0])):
        largest = np.nan_to_num(errors[:, found], nan=np.inf, posinf=np.inf).max(axis=0)
        worst = [blocks[found[place]] for place in np.argsort(-largest, kind="stable")]
        size = f"{largest.max():.3g} data roundoffs" if np.isfinite(largest.max()) else "not finite"
        yield _are_wrong(worst, _when(since, "" if always else "at some states", _GIVEN), size)
