"""What a model's constraints leave open where its system closes them: a part of its answers beside accelerations.

Where a loop is held on the ground stands in no Jacobian. So an engine that holds constraints rigid has the right accelerations of a
loop that closes elsewhere, until it moves.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from harness.arrays import Array
from harness.certify.compare import Comparison, compare
from harness.certify.manifold import rows_left
from harness.certify.reference import Reference
from harness.engines import Model, accelerations
from harness.equations.mechanism import Mechanism
from harness.equations.states import States
from harness.verdict import AGREEMENT

# Weight of a row that data leave no room at all, as where all joints stand at zero: what is open there counts, and zero times it is zero.
_LARGEST = 2.0**900
# The rows of each constraint, (n, rows), by name; none where a model has no constraints, or its engine does not say them.
Gaps = Mapping[str, Array]


def gaps_of(model: Model, states: States) -> Gaps:
    """What the constraints of a model leave at ``states``, in the order of their names."""
    of_model = getattr(model, "gaps", None)
    found = {} if of_model is None else of_model(states.q)
    return {name: found[name] for name in sorted(found)}


def with_gaps(answers: Array, gaps: Gaps) -> Array:
    """Accelerations, (n, nv), and behind them the rows of all constraints."""
    return np.hstack([answers, *gaps.values()])


def answers_with_gaps(model: Model, states: States) -> Array:
    """``with_gaps`` of what a model answers at ``states``."""
    return with_gaps(accelerations(model, states), gaps_of(model, states))


def beside_gaps(reference: Reference, mechanism: Mechanism, states: States, gaps: Gaps) -> Reference:
    """The reference of answers with gaps: all rows are zero, and one data roundoff of a constraint counts as one of the accelerations."""
    if not gaps:
        return reference
    n, nv = reference.high.shape
    units = _units(mechanism, states, gaps)
    with np.errstate(divide="ignore"):
        counts = {name: np.minimum(reference.data_roundoff / unit, _LARGEST) for name, unit in units.items()}
    weights = np.hstack([np.repeat(counts[name][:, None], rows.shape[1], axis=1) for name, rows in gaps.items()])
    factor = np.zeros((n, nv + weights.shape[1], nv + weights.shape[1]))
    factor[:, :nv, :nv] = reference.norm_factor
    own = np.arange(nv, factor.shape[1])
    factor[:, own, own] = weights
    none = np.zeros_like(weights)
    high, low = (np.hstack([part, none]) for part in (reference.high, reference.low))
    return replace(reference, high=high, low=low, norm_factor=factor)


def compare_with_gaps(
    reference: Reference, mechanism: Mechanism, states: States, answers: Array, gaps: Gaps, factorises: bool
) -> Comparison:
    """``harness.certify.compare.compare`` of accelerations, (n, nv), and of what the model's constraints leave open beside them."""
    return compare(beside_gaps(reference, mechanism, states, gaps), with_gaps(answers, gaps), factorises)


def remark_on(mechanism: Mechanism, states: States, gaps: Gaps) -> str:
    """A sentence on the constraint that is open by more than data explain, where it is widest; "" where none is."""
    units = _units(mechanism, states, gaps) if gaps else {}
    sizes = {name: np.linalg.norm(rows, axis=1) for name, rows in gaps.items()}
    with np.errstate(divide="ignore", invalid="ignore"):
        largest = {name: float(np.nan_to_num(size / units[name], nan=0.0).max(initial=0.0)) for name, size in sizes.items()}
    name = max(largest, key=lambda name: largest[name], default="")
    if not name or not largest[name] > AGREEMENT:
        return ""
    return f"Constraint {name!r} is open by {sizes[name].max():.3g} where the system closes it ({largest[name]:.3g} data roundoffs)"


def _units(mechanism: Mechanism, states: States, gaps: Gaps) -> dict[str, Array]:
    """The data roundoff of each constraint, (n,), of the length of its rows."""
    constraints = mechanism.constraints
    assert constraints is not None
    _, by_data = rows_left(mechanism, states)
    owners = np.array(constraints.rows[: constraints.holonomic])
    return {name: np.linalg.norm(by_data[:, : constraints.holonomic][:, owners == name], axis=1) for name in gaps}
