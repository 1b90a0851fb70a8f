"""The terms of the equations of motion, certified at the exact float64 inputs, each with its own data roundoff.

Proofs and sources: docs/inside/numerics.md, "Terms".
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from harness.arrays import Array, Indices, Rows, norm_over_first_axis
from harness.engines import Terms
from harness.programs.evaluation import jacobians
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.numbers import SMALLEST_SCALE, UNIT_ROUNDOFF
from harness.programs.program import OUTPUTS, upper_triangle
from harness.programs.states import States
from harness.truth.balls import factorise, forward_substitute, parts_of
from harness.truth.compare import CERTIFIED_RADIUS, SOUGHT_RADIUS, in_order
from harness.truth.reference import PRECISIONS, ChartKernel, ReferenceKernel

MASS, VELOCITY, GRAVITY, PASSIVE = OUTPUTS
APPLIED = "applied"
# As the fields of ``harness.engines.Terms``.
TERMS = (*OUTPUTS, APPLIED)
# Numbers in the derivatives that are held at once.
_MOST_AT_ONCE = 2**24


@dataclass(frozen=True)
class TermReference(Rows):
    """Certified terms of n states.

    Attributes:
        high, low: the certified midpoints are high + low.
        norm_factor: (n, nv, nv) upper triangular R with M = R'R.
        sensitivity: data roundoff over ``UNIT_ROUNDOFF``, per term: "mass" (n, nv, nv), every other one (n,).
        certified: per term, (n,) whether its radius is at most ``CERTIFIED_RADIUS`` times its sensitivity.
    """

    high: Terms
    low: Terms
    norm_factor: Array
    sensitivity: Terms
    certified: Terms


def certify_terms(kernel: ReferenceKernel, states: States) -> TermReference:
    """The terms at ``states``, in the frames of ``kernel``; what cannot be certified is marked, never dropped."""

    def parts() -> Iterator[tuple[TermReference, Indices]]:
        for chart, chosen in kernel.by_chart(states):
            at_once = max(1, _MOST_AT_ONCE // (len(chart.program.instructions) * len(chart.program.inputs)))
            for start in range(0, max(len(chosen), 1), at_once):
                places = chosen[start : start + at_once]
                yield _certify(kernel.mechanism, chart, states[places]), places

    return in_order(parts())


def dual_norm(norm_factor: Array, forces: Array) -> Array:
    """|f| = |M^-1 f|_M per state, (n,), for norm_factor (n, nv, nv) and generalised forces (n, nv)."""
    return np.asarray(_dual_norms(norm_factor, forces.T[:, None])[0])


def _dual_norms(norm_factor: Array, columns: Array) -> Array:
    """(k, n) norms of columns (nv, k, n)."""
    return norm_over_first_axis(forward_substitute(norm_factor.transpose(2, 1, 0), columns))


def _inverses(norm_factor: Array) -> Array:
    """(nv, nv, n) inverses of the transposed factors, so that M^-1 is the product of their transposes and them."""
    n, nv = norm_factor.shape[:2]
    return forward_substitute(norm_factor.transpose(2, 1, 0), np.broadcast_to(np.eye(nv)[:, :, None], (nv, nv, n)))


def _certify(mechanism: Mechanism, chart: ChartKernel, states: States) -> TermReference:
    import flint

    n, nv = len(states), mechanism.nv
    pairs = upper_triangle(nv)
    parameters = mechanism.parameters_at(states)
    inputs = mechanism.inputs(states, parameters)
    slopes = jacobians(chart.program, inputs)
    moved = {name: slopes[name] * np.maximum(np.abs(inputs), SMALLEST_SCALE) for name in OUTPUTS}
    found = np.zeros((3, len(pairs) + 3 * nv, n))
    applied_parts: tuple[Array | float, ...] = (states.tau, 0.0, 0.0)
    scale, factor = np.empty((nv, n)), np.empty((nv, nv, n))
    pending = np.arange(n)
    with np.errstate(all="ignore"):
        for precision in PRECISIONS:
            with flint.ctx.workprec(precision):
                outputs = [values[: found.shape[1]] for _, values in chart.balls.outputs(states[pending], parameters[pending])]
                for index, values in zip(pending.tolist(), outputs, strict=True):
                    found[:, :, index] = np.transpose([parts_of(value) for value in values])
                scale[:, pending], factor[:, :, pending] = factorise([values[: len(pairs)] for values in outputs], nv)
            high, low, radius = (_as_terms(part, nv, applied) for part, applied in zip(found, applied_parts, strict=True))
            norm_factor = factor.transpose(2, 1, 0) * scale.T[:, None, :]
            sensitivity = _sensitivities(mechanism, states, high, moved, norm_factor)
            excess = _excess(radius, norm_factor, sensitivity)
            sought = np.all([each <= SOUGHT_RADIUS for each in excess.values()], axis=0)
            pending = np.flatnonzero(~sought & np.isfinite(inputs).all(axis=0))
            if not len(pending):
                break
    # Where M is singular a force moves nothing, or without bound.
    certified: dict[str, Any] = {
        name: (each <= CERTIFIED_RADIUS) & np.isfinite(sensitivity[name].T).all(axis=tuple(range(sensitivity[name].ndim - 1)))
        for name, each in excess.items()
    }
    return TermReference(high, low, norm_factor, Terms(**sensitivity), Terms(**certified))


def _as_terms(flat: Array, nv: int, applied: Array | float) -> Terms:
    """Terms from the program's outputs (number of outputs, n)."""
    pairs = upper_triangle(nv)
    mass = np.empty((flat.shape[1], nv, nv))
    for entry, (i, j) in zip(flat, pairs, strict=False):
        mass[:, i, j] = mass[:, j, i] = entry
    velocity, gravity, passive = (np.ascontiguousarray(vector.T) for vector in flat[len(pairs) :].reshape(3, nv, -1))
    return Terms(mass, velocity, gravity, passive, np.broadcast_to(applied, velocity.shape))


def _sensitivities(mechanism: Mechanism, states: States, high: Terms, moved: Mapping[str, Array], norm_factor: Array) -> dict[str, Array]:
    """``TermReference.sensitivity``; ``moved`` holds d(output)/dz z, (outputs of that name, number of inputs, n)."""
    n, nv = states.v.shape
    inverse = _inverses(norm_factor)
    reach = norm_over_first_axis(inverse)
    rotating = np.array(mechanism.rotating, dtype=np.float64)
    lengths = _lengths(mechanism, states, high.mass)
    of_lengths = (lengths.T * reach).sum(axis=0)
    found = {}
    for name in (VELOCITY, GRAVITY, PASSIVE):
        rounded = (np.abs(getattr(high, name)).T * reach).sum(axis=0)
        found[name] = _dual_norms(norm_factor, moved[name]).sum(axis=0) + rounded
    twice_kinetic = ((lengths * states.v) ** 2).sum(axis=1)
    # Products of small velocities underflow.
    found[VELOCITY] += twice_kinetic * (rotating @ reach) + SMALLEST_SCALE * lengths.sum(axis=1) * of_lengths
    if mechanism.constraints is not None:
        forces = states.tau + high.passive - high.velocity - high.gravity
        accelerations = np.einsum("kin,kjn,nj->ni", inverse, inverse, forces)
        found[PASSIVE] += of_lengths * (lengths * np.abs(accelerations)).sum(axis=1)
    found[GRAVITY] += mechanism.gravity * np.sqrt(mechanism.total_mass) * of_lengths
    found[APPLIED] = (np.maximum(np.abs(states.tau), SMALLEST_SCALE).T * reach).sum(axis=0)
    of_data = _as_terms(np.vstack([np.abs(moved[MASS]).sum(axis=1), np.zeros((3 * nv, n))]), nv, 0.0).mass
    found[MASS] = of_data + lengths[:, :, None] * lengths[:, None, :]
    return found


def _lengths(mechanism: Mechanism, states: States, mass: Array) -> Array:
    """(n, nv) |J_i| of the module's docstring."""
    own = np.diagonal(mass, axis1=1, axis2=2)
    rotating = np.array(mechanism.rotating)
    # A rotation takes one position more than it has coordinates.
    places = [place + sum(first + 3 <= place for first in mechanism.attitudes) for place in range(mechanism.nv)]
    of_slides = np.where(rotating, 0.0, own * states.q[:, places] ** 2).sum(axis=1)
    largest = np.maximum(np.where(rotating, own, 0.0).max(axis=1), of_slides)
    return np.sqrt(np.where(rotating, largest[:, None], own))


def _excess(radius: Terms, norm_factor: Array, sensitivity: Mapping[str, Array]) -> dict[str, Array]:
    """(n,) per term, the radius over the sensitivity; 0 where there is no radius at all."""
    inverse = np.abs(_inverses(norm_factor))
    found = {MASS: quotient(radius.mass, sensitivity[MASS]).max(axis=(1, 2))}
    for name in TERMS[1:]:
        reached = norm_over_first_axis(np.einsum("ijn,nj->in", inverse, getattr(radius, name)))
        found[name] = quotient(np.where(getattr(radius, name).any(axis=1), reached, 0.0), sensitivity[name])
    return found


def quotient(errors: Array, sensitivity: Array) -> Array:
    """Quotients; 0 for no error, whatever the sensitivity."""
    return np.divide(errors, sensitivity, out=np.zeros_like(errors), where=errors != 0)


def term_errors(name: str, reference: TermReference, terms: Terms) -> tuple[Array, Array, np.ndarray[Any, np.dtype[np.bool_]]]:
    """Errors of each entry (n, nv, nv) or coordinate (n, nv), and of the whole term (n,) [data roundoffs]; (n,) finite answers.

    The error of the whole is NaN where an answer is not finite or the reference not certified.
    """
    with np.errstate(all="ignore"):
        difference = (getattr(terms, name) - getattr(reference.high, name)) - getattr(reference.low, name)
        sensitivity = UNIT_ROUNDOFF * getattr(reference.sensitivity, name)
        if name == MASS:
            parts = quotient(np.abs(difference), sensitivity)
            whole = parts.max(axis=(1, 2))
        else:
            # A component is at most the norm times sqrt(M_ii).
            lengths = np.sqrt(np.diagonal(reference.high.mass, axis1=1, axis2=2))
            parts = quotient(np.abs(difference) / lengths, sensitivity[:, None])
            whole = quotient(dual_norm(reference.norm_factor, difference), sensitivity)
            whole = np.where(difference.any(axis=1), whole, 0.0)
        finite = np.isfinite(getattr(terms, name)).all(axis=tuple(range(1, parts.ndim)))
        return parts, np.where(finite & getattr(reference.certified, name), whole, np.nan), finite
