"""Columns: what a change of one value does to answers, in data roundoffs.

A column is the derivative of the answers by the value: by central differences through a ``Watch``, one-sided where a reader or physics
refuses one direction, or the exact one of the certified truth. It is whitened: multiplied by the factor R of the truth, |x|_M = |R x|,
and divided by the data roundoff of its state, so that a column times a change of 1 counts data roundoffs, and residuals of all states
and coordinates weigh alike.

Values that no answer distinguishes are told by ``harness.explain.identifiable``.

Source: Khalil, Dombre, Modeling, Identification and Control of Robots (2002), chapter 12, on the observation matrix.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.engines import Calls, Engine, Model, Unsupported, asked_accelerations_and_gaps, loaded_and_asked
from harness.explain.changes import NUMBER, Change
from harness.explain.identifiable import SAFETY, EffectColumn
from harness.files.model_file import ModelFile
from harness.files.text.scan import TextPlace, Watch
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.states import States
from harness.truth.compare import Certified, Flags
from harness.truth.quantities.accelerations import closing_of, with_gaps
from harness.truth.reference import Reference, ReferenceKernel
from harness.truth.sampling import generic_sample
from harness.verdict import AGREEMENT

# Of the central differences, relative to a value's scale: their error is about u / DIFFERENCE, or DIFFERENCE^2.
DIFFERENCE = 1e-5
# Sampled states: of three, the last is held out of fits; of twelve, three are at rest and six without applied forces.
STATES = 96
HELD_OUT_OF = 3
# What two answers of a sound engine differ by, in data roundoffs, and the error of second order of a difference.
ROUNDOFFS = 4.0
SECOND_ORDER = 1e-8
# Of the first difference, from which on the second tells that answers bend within the step, and the most states that do so by themselves.
BENT, MOST_BENT = 0.1, 0.25


def watch(
    engine: Engine,
    mechanism: Mechanism,
    model: ModelFile,
    states: States,
    asks: Callable[[Model, States], Calls] | None = None,
    declared: Callable[[ModelFile], Array] | None = None,
) -> Watch:
    """The answers of an engine at ``states`` to what it is asked, accelerations with gaps by default; no model is audited.

    From those of a changed model is taken by how much the law that it has ``declared`` moves their truth, (n, nv).

    Raises:
        ValueError: the engine refuses the model as it is; harness.engines.Unsupported: it cannot express it.
    """
    calls = (asks or asked_accelerations_and_gaps)(engine.load(model, mechanism.joints, mechanism.gravity), states)
    # Of the mechanism, whatever a text is changed to.
    closing = closing_of(mechanism, states)

    def answer(changed: ModelFile) -> Array:
        try:
            answers = engine.run(loaded_and_asked, changed, mechanism.joints, mechanism.gravity, calls.each)
        except Unsupported as reason:
            raise ValueError(str(reason)) from reason
        found: Any = calls.formed(answers)
        if asks is None:
            accelerations, gaps = found
            found = with_gaps(accelerations, gaps, closing)
        return found if declared is None else beside_law(found, declared(changed))

    return Watch(model, answer, mechanism.nv)


def beside_law(answers: Array, moved: Array) -> Array:
    """Answers, (n, nv + rows of constraints), without what a law moves of the accelerations, (n, nv)."""
    return np.hstack([answers[:, : moved.shape[1]] - moved, answers[:, moved.shape[1] :]])


def diagnostic_states(mechanism: Mechanism, seed: int, count: int = STATES) -> States:
    """Sampled states of every kind, at rest, moving, and moving under applied forces, each among those that fits hold out."""
    states = generic_sample(mechanism, count, seed)
    kind = np.arange(count) // HELD_OUT_OF % 4
    v, tau = (np.where((kind >= quiet)[:, None], 0.0, values) for quiet, values in ((3, states.v), (2, states.tau)))
    return replace(states, v=v, tau=tau)


def held_out(count: int) -> Flags:
    """The states of ``count`` that fits do not see, (count,) bool."""
    return np.asarray(np.arange(count) % HELD_OUT_OF == HELD_OUT_OF - 1)


@dataclass(frozen=True)
class Whitening:
    """Answers at n states as multiples of data roundoffs beside their certified values: one row for each block of each state."""

    certified: Certified

    @cached_property
    def blocks(self) -> int:
        """Blocks of a state, 1 of accelerations."""
        return self.certified.sensitivity.size // max(1, len(self.certified))

    @cached_property
    def _factor(self) -> Array:
        roundoff = self.certified.roundoff_with_share.reshape(-1)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(np.repeat(self.certified.norm_factor, self.blocks, axis=0) / roundoff[:, None, None])

    def by_row(self, of_states: Flags) -> Flags:
        """Flags of rows from flags of states."""
        return np.repeat(of_states, self.blocks)

    def residual(self, answers: Array) -> Array:
        """Errors, (rows, size), whose norm in each row is the backward error of that block."""
        with np.errstate(all="ignore"):
            return self.change(self.certified.errors(answers))

    def change(self, difference: Array) -> Array:
        """A difference of answers, shaped as these, in the same measure."""
        difference = difference.reshape(len(self._factor), -1)
        with np.errstate(all="ignore"):
            whitened = np.asarray(np.einsum("nij,nj->ni", self._factor, difference))
        # A body at rest without gravity has no data roundoff, and nothing to explain.
        whitened[(difference == 0).all(axis=1)] = 0.0
        return whitened


def derivative(answer: Callable[[str], Array | None], text: Callable[[float], str], at: float, step: float) -> Array | None:
    """Derivative by the value of ``text`` of the answers that ``answer`` gives for a text, shaped as these; None where it is refused.

    By central differences; where one direction is refused, by three points in the other; None where both are.
    """
    up, down = (answer(text(at + sign * step)) for sign in (1.0, -1.0))
    if up is not None and down is not None:
        return (up - down) / (2 * step)
    near, sign = (up, 1.0) if up is not None else (down, -1.0)
    here = None if near is None else answer(text(at))
    if near is None or here is None:
        return None
    far = answer(text(at + 2 * sign * step))
    return sign * ((near - here) / step if far is None else (4 * near - 3 * here - far) / (2 * step))


@dataclass(frozen=True)
class ChangeColumn(EffectColumn):
    """One change with a value on which some answer depends, and what the value does.

    ``values``: whitened derivative of the answers by the value [data roundoffs per unit of the value]. ``noise``: what rounding and the
    second order leave uncertain.
    """

    change: Change


def without_bent(
    values: Array, answer: Callable[[str], Array | None], text: Callable[[float], str], whitening: Whitening, at: float, step: float
) -> Array:
    """A column, (rows, size), of central differences about ``at``, 0 at the few rows whose answers bend within the step.

    A limit that a state reaches by less than the step pushes on one side of it alone: there the quotient is not what the value does.
    """
    up, down, here = (answer(text(at + way * step)) for way in (1.0, -1.0, 0.0))
    if up is None or here is None or down is None:
        return values
    first, second = (np.linalg.norm(whitening.change(found), axis=1) for found in (up - down, (up - here) - (here - down)))
    with np.errstate(invalid="ignore"):
        bent = (second > BENT * first) & (second > SAFETY * ROUNDOFFS)
    # Where nearly all of them bend, so does the value's effect.
    is_few = bent.sum() <= MOST_BENT * (first > ROUNDOFFS).sum()
    return np.asarray(np.where((bent & is_few)[:, None], 0.0, values))


def find_columns(
    answer: Callable[[str], Array | None],
    certified: Certified,
    changes: Iterable[Change],
    is_spent: Callable[[], bool] = lambda: False,
    relative: float = DIFFERENCE,
) -> list[ChangeColumn]:
    """Columns of all changes with a free value on which some answer depends, at the model as it is.

    ``answer`` gives the answers to a text, None where it is refused; ``relative`` the step of a value in either direction, in its scale.
    Of changes of one kind and place, later ones stand in for those that are refused in both directions.
    """
    whitening = Whitening(certified)
    found: list[ChangeColumn] = []
    answered: set[tuple[str, TextPlace]] = set()
    for change in changes:
        if is_spent():
            break
        identity = change.kind, change.place
        if change.start is None or (change.kind == NUMBER and identity in answered):
            continue
        step, asked = relative * change.scale, cache(answer)
        slope = derivative(asked, change.text, change.start, step)
        if slope is None:
            continue
        answered.add(identity)
        values = without_bent(whitening.change(slope), asked, change.text, whitening, change.start, step)
        values[~np.isfinite(values).all(axis=1)] = 0.0
        if float(np.linalg.norm(values, axis=1).max()) * step > AGREEMENT:
            noise = ROUNDOFFS * math.sqrt(values.shape[0]) / (step * float(np.linalg.norm(values))) + SECOND_ORDER
            found.append(ChangeColumn(values, noise, change))
    return found


def parameter_derivatives(kernel: ReferenceKernel, states: States, reference: Reference, values: Sequence[float]) -> Array:
    """d(accelerations)/d(parameter), (parameters, n, nv) [SI], at parameter ``values``, by which ``reference`` was certified.

    Not a number at a state that is not certified.
    """
    parameters = kernel.mechanism.parameters_at(states, values)
    forces = kernel.derivatives(states, reference.high, parameters)[:, :, -len(values) :]
    factor = np.where(reference.certified[:, None, None], reference.norm_factor, np.eye(kernel.mechanism.nv))
    with np.errstate(all="ignore"):
        slopes = np.linalg.solve(factor, np.linalg.solve(factor.transpose(0, 2, 1), forces))
    return np.where(reference.certified[:, None], slopes.transpose(2, 0, 1), np.nan)
