"""The certified acceleration at the exact float64 inputs, and its data roundoff.

Proofs and sources: docs/inside/numerics.md, "Accelerations"; docs/inside/numerics.md, "Data roundoff"; docs/inside/numerics.md,
"Share of the motion and of the weight".
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from harness.arrays import Array, Indices, norm_over_first_axis
from harness.programs.evaluation import jacobians
from harness.programs.loops.encoding import Encoded
from harness.programs.loops.interpreter import Norms, derivatives, encoded, evaluate, measure
from harness.programs.mechanisms.kernel import Charts
from harness.programs.mechanisms.mechanism import Constraints, Mechanism
from harness.programs.numbers import SMALLEST_SCALE, UNIT_ROUNDOFF
from harness.programs.program import StraightLineProgram, right_hand_side, upper_triangle
from harness.programs.states import States
from harness.truth.balls import (
    MOST_IN_FLOAT64,
    BallSolver,
    columns_in_balls,
    condition_number,
    forward_substitute,
)
from harness.truth.compare import CERTIFIED_RADIUS, DOUBLE_DOUBLE, MOST_DOUBT, SOUGHT_RADIUS, Certified, Flags, in_order
from harness.truth.sampling import beside_half_turns

PRECISIONS = (128, 256, 512, 1024, 2048, 4096)  # bits that are tried one after the other beyond double-double
# Of what double-double may leave open: a thirty-thousandth of a data roundoff, of which a backward error shows a hundredth at most.
_ENOUGH = 2.0**-68
_STATES_AT_ONCE = 2048
# Of every entry of M that an unstable factorisation may lose.
ROUNDINGS = 16
# Length of the exact answer, of a free fall, below which weights have cancelled for the most part.
MOSTLY_CANCELLED = 1 / 8


@dataclass(frozen=True)
class Reference(Certified):
    """Certified accelerations, one block whose arrays have no axis of blocks: high and low (n, nv), the other lengths (n,) [sqrt(J)/s].

    Attributes:
        norm_factor: (n, nv, nv) upper triangular R with |x|_M = |R x|.
        sensitivity: sum over inputs z of |dqdd/dz z|_M. share: of the motion, the sum over rotating
            coordinates i of 2 T |M^-1 e_i|_M, of the weight, g sqrt(m) where
            the accelerations are much shorter, of what equalities that give leave, see ``harness.truth.residual_share``, and of what
            slides, see ``harness.truth.slip_share``.
        instability: 16 nv kappa_s (|qdd|_M + norms of the separate terms of qdd); an error up to
            UNIT_ROUNDOFF times it is within what an unstable factorisation of M can lose. Under constraints the terms
            are the accelerations of the tree without them, too, and kappa_s of J M^-1 J' is a factor.
    """

    def lengths(self, vectors: Array) -> Array:
        """(n,) energy norms of vectors (n, nv)."""
        return energy_norm(self.norm_factor, vectors)

    def inverse_factor(self) -> Array:
        """The inverse of ``norm_factor``, (n, nv, nv), of 1 where a state is not certified."""
        return np.asarray(np.linalg.inv(np.where(self.certified[:, None, None], self.norm_factor, np.eye(self.high.shape[1]))))

    def twice_the_energy(self, v: Array) -> Array:
        """(n,) 2 T at velocities (n, nv), by the sum of squares; see the share of the motion."""
        return np.asarray((np.einsum("nij,nj->ni", self.norm_factor, v) ** 2).sum(axis=1))

    def why_undecided(self) -> Iterator[str]:
        """See ``Certified``."""
        for index in np.flatnonzero(~self.certified):
            if not np.isfinite(self.high[index]).all():
                regular = f"M is singular, or not certainly regular at {PRECISIONS[-1]} bits"
                yield f"{regular}, or it is not certain on which side of its range a force lies"
            elif not np.isfinite(self.condition[index]):
                yield "M is not certainly positive definite, so that data roundoff has no energy norm"
            elif not np.isfinite(self.sensitivity[index]):
                yield f"the equations have no derivative there that {PRECISIONS[-1]} bits would show, so that data roundoff is not known"
            elif self.radius[index] <= CERTIFIED_RADIUS * self.sensitivity[index]:
                yield "the state does not close the constraints: the branch of the assembly is lost on the way there"
            else:
                share = float(self.radius[index] / self.sensitivity[index]) if self.sensitivity[index] else math.inf
                reason = "" if self.bits[index] == PRECISIONS[-1] else "; accelerations cancel further than high + low holds them"
                found = f"the radius is {share:.1e} of the sensitivity at {int(self.bits[index])} bits"
                yield f"{found}; {CERTIFIED_RADIUS:.1e} is needed{reason}"


def asked_at(states: States, unit_roundoff: float, attitudes: Sequence[int] = ()) -> States:
    """The states as an engine takes them that computes in float64, or else in float32; ``attitudes`` as of a ``Mechanism``."""
    if unit_roundoff == UNIT_ROUNDOFF:
        return states
    given = {name: rounded(getattr(states, name), unit_roundoff) for name in ("q", "v", "tau", "control", "activation")}
    for order, place in enumerate(attitudes):
        columns = slice(place + order, place + order + 4)
        given["q"][:, columns] = beside_half_turns(given["q"][:, columns], unit_roundoff)
    return replace(states, **given)


def rounded(values: Array, unit_roundoff: float) -> Array:
    """Numbers as an engine takes them that computes in float64, or else in float32."""
    return values if unit_roundoff == UNIT_ROUNDOFF else values.astype(np.float32).astype(np.float64)


def precision_in_words(unit_roundoff: float) -> str:
    """A sentence on an engine that computes in another precision than float64, "" for one that does not."""
    if unit_roundoff == UNIT_ROUNDOFF:
        return ""
    bits = round(-math.log2(unit_roundoff))
    name = "float32" if bits == 24 else f"numbers of {bits} bits"
    return f"computes in {name}: judged in data roundoffs of 2^-{bits}, at states rounded to {name}"


class ReferenceKernel:
    """Certified accelerations of one mechanism; compile once, evaluate many batches.

    ``linear_velocity_in_body`` says in which frame the states give the linear velocity of a free joint.
    Each state is evaluated in the chart that is most regular there. For an engine that computes in float32, with ``unit_roundoff``
    2^-24, the states are rounded to it first, and data roundoff is what one unit roundoff of float32 in every input does.
    """

    def __init__(self, mechanism: Mechanism, linear_velocity_in_body: bool = False, unit_roundoff: float = UNIT_ROUNDOFF) -> None:
        self.mechanism = mechanism
        self.unit_roundoff = unit_roundoff
        self._choice = Charts(mechanism.charts(linear_velocity_in_body))
        self._charts = [ChartKernel(mechanism, program) for program in self._choice.programs]

    def evaluate(self, states: States, parameters: Array | None = None, values: Array | None = None, roughly: bool = False) -> Reference:
        """The reference at ``states``; a state that cannot be certified is marked, never dropped.

        ``parameters``, (n, number of parameters) in the mechanism's order and units, gives each state its own; by
        default they are what ``Mechanism.parameters_at`` makes of ``values``, of the same shape, and of the mechanism's own without
        these. Nothing is derived or compiled anew for them. ``roughly``: whether sensitivities of which float64 is not sure stay as they
        are, where the accelerations are asked for alone: those in balls cost a hundred times as much.
        """
        count, states = len(self.mechanism.parameters), self.asked_at(states)
        across = None
        if parameters is None:
            parameters = self.mechanism.parameters_at(states, values)
            across = self.mechanism.across(states, parameters, self.unit_roundoff)
        if parameters.shape != (len(states), count):
            raise ValueError(f"parameters have shape {parameters.shape}; expected {(len(states), count)}")
        starts = range(0, max(len(states), 1), _STATES_AT_ONCE)
        batches = [slice(start, start + _STATES_AT_ONCE) for start in starts]
        found = Reference.concatenate([self._evaluate(states[batch], parameters[batch], roughly) for batch in batches])
        if across is not None and len(kinks := np.flatnonzero((across != parameters).any(axis=1) & found.certified)):
            other = self._evaluate(states[kinks], across[kinks])
            found.sensitivity[kinks] = np.maximum(found.sensitivity[kinks], other.sensitivity)
        return found if self.unit_roundoff == UNIT_ROUNDOFF else found.for_unit_roundoff(self.unit_roundoff)

    def accelerations(self, states: States, values: Sequence[float] | Array | None = None) -> tuple[Array, Array]:
        """High and low of the accelerations as of ``Reference``, (n, nv) each, without their data roundoff; ``values`` as of ``evaluate``.

        Not a number where balls of ``PRECISIONS[0]`` bits leave more than a rounding of high open.
        """
        states = self.asked_at(states)
        parameters = self.mechanism.parameters_at(states, values)
        found = np.full((2, *states.v.shape), np.nan)
        for chart, chosen in self.by_chart(states):
            found[:, chosen] = chart.solved(states[chosen], parameters[chosen])
        return found[0], found[1]

    def derivatives(self, states: States, accelerations: Array, parameters: Array | None = None) -> Array:
        """d(force - M qdd)/dz at fixed qdd, (n, nv, number of inputs), in float64; ``parameters`` as of ``evaluate``."""
        inputs = self.mechanism.inputs(states, parameters)
        found = np.zeros((len(states), self.mechanism.nv, len(inputs)))
        for chart, chosen in self.by_chart(states):
            found[chosen] = chart.derivatives(np.ascontiguousarray(inputs.T[chosen]), np.ascontiguousarray(accelerations[chosen]))
        return found

    def asked_at(self, states: States) -> States:
        """The states as an engine of this unit roundoff takes them."""
        return asked_at(states, self.unit_roundoff, self.mechanism.attitudes)

    def by_chart(self, states: States) -> Iterator[tuple[ChartKernel, Indices]]:
        """The charts in use, each with the indices of the states at which it is the most regular one; at least one chart."""
        for number, chosen in self._choice.split(states.q):
            yield self._charts[number], chosen

    def _evaluate(self, states: States, parameters: Array, roughly: bool = False) -> Reference:
        parts = [(chart.evaluate(states[chosen], parameters[chosen], roughly), chosen) for chart, chosen in self.by_chart(states)]
        if len(parts) == 1:
            tied = self.mechanism.softened or self.mechanism.constraints
            return parts[0][0] if tied is None else self._constrained(parts[0][0], tied, states, parameters)
        return in_order(parts)

    def _constrained(self, found: Reference, tied: Constraints, states: States, parameters: Array) -> Reference:
        """The reference under constraints: certified where a state closes them, unstable also where they cancel forces or lose rank."""
        # Imported late: a tree needs nothing of it.
        from harness.truth.declared import DeclaredMechanism, lost
        from harness.truth.manifold import closes, free_size, rank_condition
        from harness.truth.residual_share import residual_share
        from harness.truth.slip_share import slip_share

        inputs = self.mechanism.inputs(states, parameters)
        free = free_size(tied, inputs, states.tau, found.norm_factor)
        cancelling = found.instability + ROUNDINGS * self.mechanism.nv * found.condition * free
        if isinstance(self.mechanism, DeclaredMechanism) and not self.mechanism.holds_rigid:
            # It has accelerations wherever its constraints are.
            radius = found.radius + lost(self.mechanism) * UNIT_ROUNDOFF**2 * found.sensitivity
            share = found.share + residual_share(self.mechanism, inputs, found.norm_factor)
            share = share + slip_share(self.mechanism, inputs, found.high, found.norm_factor)
            return replace(found, radius=radius, share=share, instability=cancelling)
        # Without a configuration in which the constraints hold there is no motion to be asked for.
        certified, held = found.certified & closes(self.mechanism, states, parameters), self.mechanism.constraints or tied
        return replace(found, certified=certified, instability=cancelling * rank_condition(held, inputs, found.norm_factor))


class ChartKernel:
    """The reference of one mechanism by one of its programs."""

    def __init__(self, mechanism: Mechanism, program: StraightLineProgram) -> None:
        self.mechanism = mechanism
        self.program = program

    @functools.cached_property
    def balls(self) -> BallSolver:
        """The program and its solution in balls, which most states do not need."""
        return BallSolver(self.mechanism, self.program)

    @functools.cached_property
    def encoded(self) -> Encoded | None:
        """The program for the loops of ``harness.programs.loops.interpreter``; None where they cannot interpret it."""
        return encoded(self.program)

    @functools.cached_property
    def swept(self) -> Encoded | None:
        """The equations that the loop solves, whose adjoints then need not pass an elimination."""
        return self.encoded if self.mechanism.stiffened is None else encoded(self.mechanism.stiffened)

    def evaluate(self, states: States, parameters: Array, roughly: bool = False) -> Reference:
        """The reference of a batch that fits into memory at once, each with its row of ``parameters``; ``roughly`` as of the kernel."""
        inputs = np.ascontiguousarray(self.mechanism.inputs(states, parameters).T)
        scales = np.maximum(np.abs(inputs), SMALLEST_SCALE)
        with np.errstate(all="ignore"):
            found = self._filtered(states, inputs, scales)
            # States that are not finite have no truth, at no precision.
            left = np.flatnonzero(~(found.bits > 0) & np.isfinite(inputs).all(axis=1)) if found is not None else np.arange(len(states))
            if found is not None and not len(left):
                return found
            in_balls = self._in_balls(states[left], parameters[left], inputs[left], scales[left], roughly)
        if found is None:
            return in_balls
        _put(found, left, in_balls)
        return found

    def solved(self, states: States, parameters: Array) -> tuple[Array, Array]:
        """High and low of the accelerations, (n, nv) each; see ``ReferenceKernel.accelerations``."""
        high, low = (np.full(states.v.shape, np.nan) for _ in range(2))
        inputs = np.ascontiguousarray(self.mechanism.inputs(states, parameters).T)
        left = np.isfinite(inputs).all(axis=1)
        if self.swept is not None:
            with np.errstate(all="ignore"):
                found = evaluate(self.swept, inputs, np.maximum(np.abs(inputs), SMALLEST_SCALE))
            known = _are_within_a_rounding(found.radius, found.high)
            high[known], low[known] = found.high[known], found.low[known]
            left &= ~known
        if left.any():
            own, rest, radius, *_ = self.balls.solve(states[left], parameters[left], PRECISIONS[0])
            is_open = ~_are_within_a_rounding(radius, own)
            own[is_open] = rest[is_open] = np.nan
            high[left], low[left] = own, rest
        return high, low

    def derivatives(self, inputs: Array, accelerations: Array) -> Array:
        """d(tau + passive - velocity - gravity - M qdd)/dz at fixed qdd, (n, nv, number of inputs), in float64."""
        if self.encoded is not None:
            return derivatives(self.encoded, inputs, accelerations)[0]
        nv, first = self.mechanism.nv, self.mechanism.nq + self.mechanism.nv
        slopes = jacobians(self.program, np.ascontiguousarray(inputs.T))
        applied = np.zeros((nv, inputs.shape[1], len(inputs)))
        applied[range(nv), range(first, first + nv)] = 1.0
        found = np.array(right_hand_side({name: list(slope) for name, slope in slopes.items()}, list(applied)))
        for slope, (i, j) in zip(slopes["mass"], upper_triangle(nv), strict=True):
            found[i] -= slope * accelerations[:, j]
            if i != j:
                found[j] -= slope * accelerations[:, i]
        return found.transpose(2, 0, 1)

    def _filtered(self, states: States, inputs: Array, scales: Array) -> Reference | None:
        """Results of the loop; ``bits`` is 0 where they are not enough. None where there is no loop for the program."""
        if self.swept is None:
            return None
        found = evaluate(self.swept, inputs, scales)
        norms = self._norms(states, found.high, found.radius, found.terms, found.scale, found.factor)
        doubt = found.doubt + found.spread * np.sqrt(norms.condition) * found.sensitivity
        is_known = self._is_believed(found.sensitivity, doubt, norms.condition) & (norms.condition < MOST_IN_FLOAT64)
        bits = np.where(is_known & (norms.radius <= _ENOUGH * found.sensitivity), DOUBLE_DOUBLE, 0)
        return self._reference(found.high, found.low, norms, found.sensitivity, bits > 0, bits)

    def _in_balls(self, states: States, parameters: Array, inputs: Array, scales: Array, roughly: bool) -> Reference:
        """The reference by ball arithmetic, at rising precision."""
        in_balls, pending = np.zeros(len(states), dtype=np.bool_), np.arange(len(states))
        found: Reference | None = None
        for precision in PRECISIONS:
            now = states[pending]
            high, low, radii, scale, factor, terms = self.balls.solve(now, parameters[pending], precision)
            norms = self._norms(now, high, radii, terms, scale.T, factor.transpose(2, 0, 1))
            sensitivity, is_known = self._sensitivity(inputs[pending], scales[pending], high, scale, factor)
            is_known = is_known | (roughly & np.isfinite(sensitivity))
            part = self._reference(high, low, norms, sensitivity, np.zeros_like(is_known), np.full(len(pending), precision))
            before = np.full(len(pending), np.inf) if found is None else found.radius[pending]
            if found is None:
                found = part
            else:
                np.copyto(part.sensitivity, found.sensitivity[pending], where=in_balls[pending])
                _put(found, pending, part)
            for index in pending[~is_known & ~in_balls[pending] & np.isfinite(inputs[pending]).all(axis=1)].tolist():
                _, found.sensitivity[index] = columns_in_balls(self.program, inputs[index].tolist(), scales[index].tolist(), PRECISIONS)
                in_balls[index] = True
            sought = found.radius[pending] <= SOUGHT_RADIUS * found.sensitivity[pending]
            # What precision no longer lowers is lost by high + low.
            lowered = ~(part.radius > before / 2)
            pending = pending[~sought & lowered & np.isfinite(now.q).all(axis=1)]
            if not len(pending):
                break
        assert found is not None
        return replace(found, certified=(found.radius <= CERTIFIED_RADIUS * found.sensitivity) & np.isfinite(found.sensitivity))

    def _reference(self, high: Array, low: Array, norms: Norms, sensitivity: Array, certified: Flags, bits: Indices) -> Reference:
        share = norms.motion + self._cancelled_weight(norms.norm_factor, high)
        lengths = norms.radius, norms.norm_factor, sensitivity, share, norms.instability, norms.condition
        return Reference(high, low, *lengths, certified, bits)

    def _sensitivity(self, inputs: Array, scales: Array, accelerations: Array, scale: Array, factor: Array) -> tuple[Array, Flags]:
        """Sensitivities in float64, (n,), at accelerations and factors of M that are known, and whether they can be believed."""
        if self.encoded is None:
            return np.full(len(inputs), np.nan), np.zeros(len(inputs), dtype=np.bool_)
        columns, sizes = derivatives(self.encoded, inputs, accelerations, scale.T)
        changes = (columns * scales[:, None]).transpose(1, 2, 0)
        found = norm_over_first_axis(forward_substitute(factor, changes / scale[:, None])).sum(axis=0)
        inverse = forward_substitute(factor, np.broadcast_to(np.eye(self.mechanism.nv)[:, :, None], factor.shape))
        doubt = self.encoded.gamma * np.sqrt((inverse**2).sum(axis=(0, 1))) * (sizes * scales).sum(axis=1)
        return found, self._is_believed(found, doubt, condition_number(factor))

    def _cancelled_weight(self, norm_factor: Array, accelerations: Array) -> Array:
        """Length of a fall of all that moves, where the exact answer is so short that most of it has cancelled; 0 elsewhere."""
        fall = self.mechanism.gravity * math.sqrt(abs(self.mechanism.total_mass))
        if not fall:
            return np.zeros(len(accelerations))
        return np.where(energy_norm(norm_factor, accelerations) < MOSTLY_CANCELLED * fall, fall, 0.0)

    def _is_believed(self, sensitivity: Array, doubt: Array, condition: Array) -> Flags:
        # Substituting into the factor of M costs the root of its condition number.
        lost = np.sqrt(condition) * UNIT_ROUNDOFF * self.mechanism.nv
        return np.asarray((doubt <= MOST_DOUBT * sensitivity) & (lost <= MOST_DOUBT) & np.isfinite(sensitivity))

    def _norms(self, states: States, accelerations: Array, radii: Array, terms: Array, scale: Array, factor: Array) -> Norms:
        """Norms at the given accelerations, their radii, terms, and factors of M."""
        separate = np.concatenate([states.tau[:, None], terms], axis=1)
        rotating = np.array(self.mechanism.rotating, dtype=np.float64)
        return measure(scale, factor, (accelerations, radii, states.v, separate), rotating, float(ROUNDINGS))


def _are_within_a_rounding(radius: Array, accelerations: Array) -> Flags:
    """(n,) whether errors, (n, nv), are below a rounding of the largest acceleration of each state."""
    return np.asarray((radius <= UNIT_ROUNDOFF * np.abs(accelerations).max(axis=1, keepdims=True)).all(axis=1))


def moves(reference: Reference) -> Flags:
    """(n,) whether there is an acceleration that is no rounding, as there is none of what sticks."""
    return np.asarray(reference.lengths(reference.high) > UNIT_ROUNDOFF * reference.sensitivity)


def _put(reference: Reference, places: Indices, part: Reference) -> None:
    """Replace the states at ``places``."""
    for name, values in vars(part).items():
        getattr(reference, name)[places] = values


def energy_norm(norm_factor: Array, vectors: Array) -> Array:
    """|x|_M per state, for norm_factor (n, nv, nv) and vectors (n, nv)."""
    # Reductions over the first axis of what numpy would lay out by states take four times as long.
    return norm_over_first_axis(np.einsum("nij,nj->in", norm_factor, vectors, order="C"))
