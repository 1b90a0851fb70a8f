"""States of a mechanism with constraints: the coordinates that constraints determine, found on the branch of its assembly.

Proofs and sources: docs/inside/numerics.md, "Closing a loop".
"""

from __future__ import annotations

import contextlib
import functools
import math
from dataclasses import replace

import numpy as np

from harness.arrays import Array
from harness.programs.evaluation import values, values_and_spread
from harness.programs.loops.interpreter import bounded_outputs
from harness.programs.mechanisms.mechanism import JACOBIAN, RATE, RESIDUAL, Constraints, Mechanism
from harness.programs.numbers import SMALLEST_SCALE, UNIT_ROUNDOFF
from harness.programs.program import OUTPUTS, StraightLineProgram, right_hand_side, without_unused
from harness.programs.states import States
from harness.storage import Kept
from harness.truth.compare import Flags
from harness.truth.enclosure import Configurations, Encloser, Enclosure, nearest_float64

# Of the way from the assembly, which is at most half a turn of each angle; more are taken where the first do not arrive.
STEPS = (32, 256)
# Of Newton's method: at the assembly, which is known to a few digits and is closed once, and at the end of the way.
_FIRST_CORRECTIONS, _CORRECTIONS = 16, 2
# Largest change by the last correction, relative to the coordinate or 1, for which it has converged.
_CONVERGED = 1e-6
# Another branch is as far as two roots are from one another: a step that Newton's method corrects by much may have left its own. Of the
# step along the tangent, and the least that is much [m or rad].
_MUCH, _LEAST_MUCH = 0.5, 1e-3


class Branch:
    """The branch of one mechanism at its own parameters; ``loops`` go along it where they have code for its rows."""

    def __init__(self, mechanism: Mechanism, loops: Configurations | None) -> None:
        assert mechanism.constraints is not None
        self._mechanism, self._constraints = mechanism, mechanism.constraints
        self._holding = [row for row in self._constraints.independent if row < self._constraints.holonomic]
        self._others = [place for place in range(mechanism.nv) if place not in self._constraints.positions]
        self._follow = self._followed if loops is None else loops.follow

    def at(self, wanted: Array) -> Array:
        """The branch of the assembly at the coordinates of ``wanted`` that no row determines; NaN where it is lost."""
        found, left = wanted.copy(), np.arange(len(wanted))
        places = list(self._constraints.positions)
        if not places:
            return found
        target = self._nearest_turn(wanted)
        for steps in STEPS:
            found[left[:, None], places] = self._arrived(self._assembly, target[left], steps, _CORRECTIONS)
            left = left[~np.isfinite(found[left]).all(axis=1)]
            if not len(left):
                break
        return found

    @functools.cached_property
    def _assembly(self) -> Array:
        """The assembly, (nv,), with its rows closed; NaN where they cannot be."""
        q = np.array(self._constraints.assembly)
        q[list(self._constraints.positions)] = self._arrived(q, q[None, self._others], 0, _FIRST_CORRECTIONS)[0]
        return q

    def _nearest_turn(self, wanted: Array) -> Array:
        """The coordinates that no row determines, (n, others): whole turns change nothing, and the way would be long."""
        target = wanted[:, self._others]
        turning = set(self._constraints.program.turning)
        for column, place in enumerate(self._others):
            if place in turning:
                start = self._constraints.assembly[place]
                away = np.arctan2(np.sin(target[:, column]), np.cos(target[:, column])) - start
                target[:, column] = start + away - 2 * math.pi * np.rint(away / (2 * math.pi))
        return target

    def _arrived(self, begun: Array, target: Array, steps: int, corrections: int) -> Array:
        """The determined positions, (n, m), at the end of the way; NaN where Newton's method has not converged there."""
        found, last = self._follow(begun, target, steps, corrections, _MUCH, _LEAST_MUCH)
        with np.errstate(all="ignore"):
            found[~(last <= _CONVERGED * np.maximum(1.0, np.abs(found).max(axis=1)))] = np.nan
        return found

    def _followed(self, begun: Array, target: Array, steps: int, corrections: int, much: float, least_much: float) -> tuple[Array, Array]:
        """As ``Configurations.follow``, for any rows."""
        places, others = list(self._constraints.positions), self._others
        q = np.tile(begun, (len(target), 1))
        step = (target - begun[others]) / max(steps, 1)
        tangent = np.zeros((len(q), len(places)))
        with np.errstate(all="ignore"):
            for number in range(steps + 1):
                q[:, places] -= tangent
                q[:, others] = begun[others] + number * step if number < steps else target
                allowed = np.maximum(least_much, much * np.abs(tangent).max(axis=1)) if number else np.inf
                change, tangent = self._step(q, step)
                q[:, places] -= change
                q[~(np.abs(change).max(axis=1) <= allowed)] = np.nan
            for _ in range(corrections):
                change, _ = self._step(q, step)
                q[:, places] -= change
        return q[:, places], np.abs(change).max(axis=1)

    def _step(self, q: Array, step: Array) -> tuple[Array, Array]:
        """Changes of the determined positions, (n, m): the step of Newton's method, and that for a step of the others along the tangent."""
        still = np.zeros_like(q)
        found = values(self._constraints.placing, self._mechanism.inputs(States(q, still, still, np.zeros(len(q)))))
        rows = found[JACOBIAN].reshape(len(self._constraints.rows), self._mechanism.nv, -1).transpose(2, 0, 1)[:, self._holding]
        columns = found[RESIDUAL][self._holding].T, np.einsum("nij,nj->ni", rows[:, :, self._others], step)
        solution = _solved(rows[:, :, list(self._constraints.positions)], np.stack(columns, axis=2))
        return solution[:, :, 0], solution[:, :, 1]


def _solved(matrices: Array, columns: Array) -> Array:
    """The solutions, (n, m, k), of n systems; NaN where one has none."""
    finite = np.asarray(np.isfinite(matrices).all(axis=(1, 2)) & np.isfinite(columns).all(axis=(1, 2)))
    if finite.all():
        # A singular one among them is rare, and looking for it costs as much as to solve all.
        with contextlib.suppress(np.linalg.LinAlgError):
            return np.asarray(np.linalg.solve(matrices, columns))
    determinants = np.asarray(np.linalg.det(np.where(finite[:, None, None], matrices, 0.0)))
    regular = np.flatnonzero(finite & (determinants != 0))
    found = np.full_like(columns, np.nan)
    found[regular] = np.linalg.solve(matrices[regular], columns[regular])
    return found


# Of data roundoffs of a row: evaluating it in float64 rounds about as often as its inputs are rounded.
_ROUNDINGS = 16


def closed(mechanism: Mechanism, states: States) -> States:
    """``states`` with the coordinates and rates that constraints determine at their values; the same states for a tree.

    A state that the branch does not reach keeps the positions of the assembly for them.
    """
    if mechanism.constraints is None or not len(states):
        return states
    constraints = mechanism.constraints
    positions, rates = list(constraints.positions), list(constraints.rates)
    branch, loops, encloser = _closures(mechanism)
    q, v = branch.at(states.q), states.v.copy()
    left = np.arange(len(q))
    if loops is not None:
        nearest = loops.enclose(q, v)
        is_known = nearest.rounded
        known, left = left[is_known, None], left[~is_known]
        q[known, positions] = nearest.high[is_known, : len(positions)]
        v[known, rates] = nearest.high[is_known, len(positions) :]
    for index in left.tolist():
        found = encloser.enclose(q[index].tolist(), v[index].tolist()) if np.isfinite(q[index]).all() else None
        if found is None:
            q[index, positions] = np.array(constraints.assembly)[positions]
            continue
        q[index, positions] = [nearest_float64(ball) for ball in found.positions]
        v[index, rates] = [nearest_float64(ball) for ball in found.rates]
    return replace(states, q=q, v=v)


def enclosed(mechanism: Mechanism, q: Array, v: Array) -> Enclosure | None:
    """The configuration that has the given coordinates that no constraint determines, and the others near those of q, (nv,).

    None where no ball can be proved to hold one configuration and no other. ``mechanism`` has constraints.
    """
    return _closures(mechanism)[2].enclose(q.tolist(), v.tolist())


def closes(mechanism: Mechanism, states: States, parameters: Array | None = None) -> Flags:
    """(n,) whether a state closes all constraints, in positions and in rates, as far as one unit roundoff of each input leaves it open.

    ``parameters`` are as of ``Mechanism.inputs``.
    """
    if mechanism.constraints is None:
        return np.ones(len(states), dtype=np.bool_)
    left, open_by_data = rows_left(mechanism, states, parameters)
    return np.asarray((np.abs(left) <= _ROUNDINGS * open_by_data).all(axis=1))


def rows_left(mechanism: Mechanism, states: States, parameters: Array | None = None) -> tuple[Array, Array]:
    """Residuals of the rows and their rates, (n, rows), in float64, and the data roundoff of each; the holonomic rows come first.

    ``mechanism`` has constraints; ``parameters`` are as of ``Mechanism.inputs``.
    """
    assert mechanism.constraints is not None
    program = mechanism.constraints.program
    rows = without_unused(replace(program, outputs={name: program.outputs[name] for name in (RESIDUAL, RATE)}))
    inputs = mechanism.inputs(states, parameters)
    scales = np.maximum(np.abs(inputs), SMALLEST_SCALE)
    # In a sum with another angle a large one would round its digits away.
    for place in set(program.turning) & set(range(mechanism.nq)):
        inputs[place] = np.arctan2(np.sin(inputs[place]), np.cos(inputs[place]))
    left, spread = values_and_spread(rows, inputs, scales)
    opened, moved = (np.hstack([part[RESIDUAL].T, part[RATE].T]) for part in (left, spread))
    return opened, UNIT_ROUNDOFF * moved


_CLOSURES: Kept[tuple[Branch, Configurations | None, Encloser]] = Kept(64)


def _closures(mechanism: Mechanism) -> tuple[Branch, Configurations | None, Encloser]:
    def made() -> tuple[Branch, Configurations | None, Encloser]:
        loops = Configurations.of(mechanism)
        return Branch(mechanism, loops), loops, Encloser(mechanism)

    return _CLOSURES.get(mechanism.key, made)


# What solving for the forces of constraints may lose: by the rank of their rows, and by forces that they cancel. Both are in the metric of
# M = R'R, whose factor R, (n, nv, nv), is ``norm_factor``.


def rank_condition(constraints: Constraints, inputs: Array, norm_factor: Array) -> Array:
    """(n,) condition number of J M^-1 J' scaled to unit diagonal, over the rows that are not redundant; infinite where they lose rank.

    ``inputs``, (number of inputs, n), are those of the mechanism's programs.
    """
    rows = without_unused(replace(constraints.program, outputs={JACOBIAN: constraints.program.outputs[JACOBIAN]}))
    n, nv = norm_factor.shape[:2]
    jacobian = values(rows, inputs)[JACOBIAN].reshape(len(constraints.rows), nv, n).transpose(2, 1, 0)
    columns = whitened(norm_factor, jacobian[:, :, list(constraints.independent)])
    with np.errstate(all="ignore"):
        columns = columns / np.linalg.norm(columns, axis=1, keepdims=True)
        usable = np.asarray(np.isfinite(columns).all(axis=(1, 2)))
        sizes = np.linalg.svd(np.where(usable[:, None, None], columns, 0.0), compute_uv=False)
        return np.where(usable, (sizes[:, 0] / sizes[:, -1]) ** 2, np.inf)


_FORCES: Kept[StraightLineProgram] = Kept(64)


def free_size(constraints: Constraints, inputs: Array, applied: Array, norm_factor: Array) -> Array:
    """(n,) energy norm of the accelerations M^-1 f that the tree would have without constraints, under forces ``applied``, (n, nv)."""
    names, tree = OUTPUTS[1:], constraints.tree
    program = _FORCES.get(tree.key, lambda: without_unused(replace(tree, outputs={name: tree.outputs[name] for name in names})))
    by_loops = bounded_outputs(program, inputs[: len(program.inputs)])
    found = values(program, inputs) if by_loops is None else dict(zip(program.outputs, np.split(by_loops.high.T, len(names)), strict=True))
    force = np.array(right_hand_side({name: list(found[name]) for name in names}, list(applied.T))).T
    return np.asarray(np.linalg.norm(whitened(norm_factor, force[:, :, None])[:, :, 0], axis=1))


def whitened(norm_factor: Array, columns: Array) -> Array:
    """R^-T times columns, (n, nv, k); NaN where M has no factor."""
    pivots = np.diagonal(norm_factor, axis1=1, axis2=2)
    regular = np.flatnonzero(np.isfinite(norm_factor).all(axis=(1, 2)) & (pivots != 0).all(axis=1))
    found = np.full_like(columns, np.nan)
    found[regular] = np.linalg.solve(norm_factor[regular].transpose(0, 2, 1), columns[regular])
    return found
