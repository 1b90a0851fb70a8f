"""States of a mechanism with constraints: the coordinates that constraints determine, found on the branch of its assembly.

The other coordinates are given float64 numbers. ``harness.certify.branch`` finds the configuration in float64, and
``harness.certify.configurations`` proves in double-double that it is one; what that leaves open ``harness.certify.enclosure`` decides in
balls. A state holds the float64 numbers nearest to what was enclosed.

Where that fails the state keeps the determined coordinates of the assembly. It does not close the constraints there, so that its truth
is undecided (``harness.certify.reference``), and nobody is judged by a state that was made up.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.certify.branch import Branch
from harness.certify.certified import Flags
from harness.certify.configurations import Configurations
from harness.certify.enclosure import Encloser, Enclosure, nearest_float64
from harness.certify.numbers import SMALLEST_SCALE, UNIT_ROUNDOFF
from harness.equations.constraints import RATE, RESIDUAL
from harness.equations.evaluation import values_and_spread
from harness.equations.kernels import BallKernel
from harness.equations.mechanism import Mechanism
from harness.equations.program import without_unused
from harness.equations.states import States
from harness.storage import Kept

# Of data roundoffs of a row: evaluating it in float64 rounds about as often as its inputs are rounded.
_ROUNDINGS = 16
_BITS = 192


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
    return States(q, v, states.tau, states.time)


def enclosed(mechanism: Mechanism, q: Array, v: Array) -> Enclosure | None:
    """The configuration that has the given coordinates that no constraint determines, and the others near those of q, (nv,).

    None where no ball can be proved to hold one configuration and no other. ``mechanism`` has constraints.
    """
    return _closures(mechanism)[2].enclose(q.tolist(), v.tolist())


def closes(mechanism: Mechanism, states: States, parameters: Array | None = None) -> Flags:
    """(n,) whether a state closes all constraints, in positions and in rates, as far as half an ulp of each input leaves it open.

    ``parameters`` are as of ``Mechanism.inputs``.
    """
    if mechanism.constraints is None:
        return np.ones(len(states), dtype=np.bool_)
    left, open_by_data = rows_left(mechanism, states, parameters)
    return np.asarray((np.abs(left) <= _ROUNDINGS * open_by_data).all(axis=1))


def distances(mechanism: Mechanism, states: States) -> dict[str, Array]:
    """How far each constraint is from where it holds, (n,), by its name: the length of its holonomic rows, known to every bit of float64.

    ``mechanism`` has constraints.
    """
    import flint

    constraints = mechanism.constraints
    assert constraints is not None
    found: dict[str, list[float]] = {name: [] for name in constraints.names}
    with flint.ctx.workprec(_BITS):
        for index in range(len(states)):
            left = _rows_in_balls(mechanism, states, index, mechanism.parameter_values)
            for name, lengths in found.items():
                own = [left[row] ** 2 for row in range(constraints.holonomic) if constraints.rows[row] == name]
                lengths.append(float(sum(own, flint.arb(0)).sqrt().mid()))
    return {name: np.array(lengths) for name, lengths in found.items()}


def _rows_in_balls(mechanism: Mechanism, states: States, index: int, parameters: Sequence[float]) -> list[Any]:
    """The middles of what the rows and their rates leave at one state, as in ``rows_left``, in balls of ``_BITS``."""
    import flint

    assert mechanism.constraints is not None
    program, nv = mechanism.constraints.program, mechanism.nv
    state = [*states.q[index].tolist(), *states.v[index].tolist(), *[0.0] * nv, float(states.time[index])]
    # Parameters that stand behind those of the rows are of a declared law.
    own = parameters[: len(program.inputs) - len(state)]
    with flint.ctx.workprec(_BITS):
        outputs = iter(_BALLS.get(program.key, lambda: BallKernel(program, len(own))).bind(own)(*state))
        rows = {name: [next(outputs) for _ in places] for name, places in program.outputs.items()}
    return [ball.mid() for name in (RESIDUAL, RATE) for ball in rows[name]]


_BALLS: Kept[BallKernel] = Kept(64)


def rows_left(mechanism: Mechanism, states: States, parameters: Array | None = None) -> tuple[Array, Array]:
    """What the rows and their rates leave, (n, rows), in float64, and the data roundoff of each; the holonomic rows come first.

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
