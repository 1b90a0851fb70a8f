"""The share of equalities that give: positions that an engine forms have cancelled in what a constraint leaves that nearly holds."""

from __future__ import annotations

import hashlib

import numpy as np

from harness.arrays import Array
from harness.files.rules import ConstraintLaw
from harness.programs.evaluation import values, values_and_spread
from harness.programs.mechanisms.mechanism import JACOBIAN, RESIDUAL, Constraints
from harness.programs.mechanisms.softened import IMPEDANCE, INVERSE_MASS, STIFFNESS, number_of
from harness.storage import Kept
from harness.truth.declared import DeclaredMechanism, alone
from harness.truth.manifold import whitened

# Of the last states, as of ``harness.truth.impedance.nearest``.
_AT: Kept[tuple[Array, Array]] = Kept(8)


def residual_share(mechanism: DeclaredMechanism, inputs: Array, norm_factor: Array) -> Array:
    """(n,) energy norm of what half an ulp in every use of an input moves accelerations by, through what equalities that give leave.

    A derivative by a length of the file that stands in both positions, as in an anchor that is measured at the reference, has cancelled
    as they have. With H = M + J'DJ of these rows, row i counts |H^-1 J_i' D_i|_M k d times the sum of absolute values along all ways from
    inputs to what it leaves.
    """
    rows, laws = mechanism.softened, dict(mechanism.laws)
    n, nv = norm_factor.shape[:2]
    holding = [
        row
        for row, name in enumerate(rows.rows if rows is not None else ())
        if name in laws and not (laws[name].is_rigid or laws[name].is_contact or laws[name].force_range != ConstraintLaw.force_range)
    ]
    if rows is None or not holding:
        return np.zeros(n)
    named = {name: inputs[place] for place, name in enumerate(mechanism.program.inputs)}
    jacobian, sizes = (part[..., holding] for part in _rows_at(rows, inputs[: len(rows.placing.inputs)]))
    columns = whitened(norm_factor, jacobian)
    impedances, stiffness = (np.array([named[number_of(rows.rows[row], what)] for row in holding]).T for what in (IMPEDANCE, STIFFNESS))
    own = (columns**2).sum(axis=1)
    inverse = [named.get(number_of(rows.rows[row], INVERSE_MASS, row), own[:, place]) for place, row in enumerate(holding)]
    with np.errstate(all="ignore"):
        weights = impedances / ((1 - impedances) * np.array(inverse).T)
        weighted = columns * weights[:, None, :]
        held = np.eye(nv) + weighted @ columns.transpose(0, 2, 1)
        usable = np.isfinite(held).all(axis=(1, 2)) & np.isfinite(weighted).all(axis=(1, 2))
        moved = np.linalg.solve(np.where(usable[:, None, None], held, np.eye(nv)), np.where(usable[:, None, None], weighted, 0.0))
        share = (np.linalg.norm(moved, axis=1) * stiffness * impedances * sizes).sum(axis=1)
    return np.where(usable & np.isfinite(share), share, 0.0)


def _rows_at(rows: Constraints, given: Array) -> tuple[Array, Array]:
    """The Jacobians, (n, nv, rows), and the sums of absolute values of what rows leave, (n, rows)."""

    def found() -> tuple[Array, Array]:
        jacobian = values(rows.placing, given)[JACOBIAN].reshape(len(rows.rows), -1, given.shape[1]).transpose(2, 1, 0)
        return jacobian, values_and_spread(alone(rows, RESIDUAL), given, np.abs(given))[1][RESIDUAL].T

    return _AT.get((rows.key, given.shape, hashlib.blake2b(given.tobytes()).digest()), found)
