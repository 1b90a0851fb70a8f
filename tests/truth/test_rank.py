"""What solving for the forces of constraints may lose: by conditions that numpy finds of the matrices themselves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from exact import mechanism_of
from loops import four_bar, upright_disc

from harness.lagrange.system import System
from harness.programs.evaluation import values
from harness.programs.program import right_hand_side, upper_triangle
from harness.truth.manifold import free_size, rank_condition
from harness.truth.reference import ReferenceKernel
from harness.truth.sampling import sample


@pytest.mark.parametrize("system", [four_bar(), upright_disc()], ids=["four bar", "upright disc"])
def test_instability_counts_the_rank_of_the_rows_and_the_free_tree(system: System) -> None:
    mechanism = mechanism_of(system)
    constraints, states = mechanism.constraints, sample(mechanism, 24, seed=2)
    assert constraints is not None
    inputs, nv = mechanism.inputs(states), mechanism.nv
    reference = ReferenceKernel(mechanism).evaluate(states)
    tree = values(constraints.tree, inputs)
    jacobian = values(constraints.program, inputs)["jacobian"].reshape(len(constraints.rows), nv, -1)
    force = np.array(right_hand_side({name: list(rows) for name, rows in tree.items()}, list(states.tau.T)))
    conditions, sizes = [], []
    for index in range(len(states)):
        mass = np.empty((nv, nv))
        for entry, (i, j) in zip(tree["mass"][:, index], upper_triangle(nv), strict=True):
            mass[i, j] = mass[j, i] = entry
        compliance = jacobian[:, :, index] @ np.linalg.solve(mass, jacobian[:, :, index].T)
        scale = 1 / np.sqrt(np.diag(compliance))
        conditions.append(np.linalg.cond(compliance * scale * scale[:, None]))
        sizes.append(np.sqrt(force[:, index] @ np.linalg.solve(mass, force[:, index])))
    np.testing.assert_allclose(rank_condition(constraints, inputs, reference.norm_factor), conditions, rtol=1e-9)
    np.testing.assert_allclose(free_size(constraints, inputs, states.tau, reference.norm_factor), sizes, rtol=1e-9, atol=1e-12)
    plain = ReferenceKernel(replace(mechanism, constraints=None)).evaluate(states)
    expected = (plain.instability + 16 * nv * plain.condition * np.array(sizes)) * np.array(conditions)
    np.testing.assert_allclose(reference.instability, expected, rtol=1e-8)


def test_no_states_have_no_conditions() -> None:
    mechanism = mechanism_of(four_bar())
    assert len(ReferenceKernel(mechanism).evaluate(sample(mechanism, 1, seed=0)[:0])) == 0
