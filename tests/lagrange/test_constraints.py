"""Constraints: what a system file may declare, and the forces that hold them, by two ways and by a law that lets them give."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import sympy as sp
from exact import mechanism_of
from loops import CRANK_ROCKER, R, a, coupler, crank, d, follower, four_bar, spin, upright_disc, x, y, yaw
from support_constraints import by_reduction

from harness.arrays import Array
from harness.lagrange.constraint import Constraint
from harness.lagrange.euler_angles import Attitude
from harness.lagrange.system import TIME
from harness.programs.evaluation import values
from harness.programs.kernels import full_matrices
from harness.programs.mechanisms import softened as softened_equations
from harness.programs.mechanisms.constraint_forces import constrained_program, products_of_elimination
from harness.programs.mechanisms.mechanism import Constraints, Mechanism
from harness.programs.mechanisms.softened import Softness, softened_program
from harness.programs.program import StraightLineProgram, right_hand_side
from harness.programs.states import States
from harness.programs.terms import Builder
from harness.storage import Kept
from harness.truth import declared
from harness.truth.compare import compare
from harness.truth.declared import softened
from harness.truth.manifold import closed
from harness.truth.reference import Reference, ReferenceKernel, energy_norm

SYSTEMS = {"four bar": four_bar(), "upright disc": upright_disc()}
LAW = Softness(impedance=0.9, stiffness=2770.0, damping=105.0, inverse_masses=(0.5, 0.5))


@pytest.fixture(params=SYSTEMS)
def mechanism(request: pytest.FixtureRequest) -> Mechanism:
    return mechanism_of(SYSTEMS[request.param])


def states_of(mechanism: Mechanism, count: int = 200) -> States:
    """Closed states, at rates and forces of the order of 1."""
    random = np.random.default_rng(5)
    q, v, tau = (random.uniform(-3.0, 3.0, (count, mechanism.nv)) for _ in range(3))
    return closed(mechanism, States.at(q, v, tau))


def distance(one: Reference, other: Reference) -> Array:
    """The energy norm between two certified answers, less both radii: at most 0 where each ball holds part of the other."""
    apart = energy_norm(one.norm_factor, (one.high - other.high) + (one.low - other.low))
    return np.asarray(apart - one.radius - other.radius)


def parts_of(mechanism: Mechanism, states: States) -> tuple[Array, Array, Array, dict[str, Array]]:
    """M, (n, nv, nv), the tree's force, (n, nv), the Jacobian, (n, m, nv), and the outputs of the rows, in float64."""
    constraints, inputs, nv = mechanism.constraints, mechanism.inputs(states), mechanism.nv
    assert constraints is not None
    tree, tied = values(constraints.tree, inputs), values(constraints.program, inputs)
    force = np.array(right_hand_side({name: list(column) for name, column in tree.items()}, list(states.tau.T))).T
    return full_matrices(tree["mass"]), force, tied["jacobian"].reshape(-1, nv, len(states)).transpose(2, 0, 1), tied


def by_hand(mechanism: Mechanism, states: States) -> tuple[Array, Array]:
    """Accelerations and multipliers of the KKT system, (n, nv) and (n, m), by numpy's solver in float64."""
    mass, force, jacobian, tied = parts_of(mechanism, states)
    assert mechanism.constraints is not None
    chosen, nv = list(mechanism.constraints.independent), mechanism.nv
    jacobian = jacobian[:, chosen]
    corner = np.zeros((len(states), len(chosen), len(chosen)))
    left = np.block([[mass, jacobian.transpose(0, 2, 1)], [jacobian, corner]])
    right = np.concatenate([force, -tied["bias"][chosen].T], axis=1)
    found = np.linalg.solve(left, right[:, :, None])[:, :, 0]
    return found[:, :nv], found[:, nv:]


def test_both_ways_and_a_plain_solution_give_the_same_accelerations(mechanism: Mechanism) -> None:
    assert mechanism.constraints is not None
    states = states_of(mechanism)
    other = replace(mechanism, program=constrained_program(mechanism.constraints, by_reduction))
    one, another = (ReferenceKernel(each).evaluate(states) for each in (mechanism, other))
    assert one.certified.all() and another.certified.all()
    assert (distance(one, another) <= 0).all()
    # What one rounding in every number of the state does is the same by both.
    np.testing.assert_allclose(one.sensitivity, another.sensitivity, rtol=1e-9)
    accelerations, multipliers = by_hand(mechanism, states)
    np.testing.assert_allclose(one.high, accelerations, rtol=1e-9, atol=1e-9)
    found = values(mechanism.program, mechanism.inputs(states))["multipliers"].T
    np.testing.assert_allclose(found, multipliers, rtol=1e-9, atol=1e-9)
    assert set(compare(one, mechanism.float64().accelerations(states.q, states.v, states.tau)).verdicts) == {"agrees"}


def bias_forgotten(constraints: Constraints) -> Constraints:
    return replace(constraints, program=replaced(constraints.program, "bias", constraints.program.outputs["rate"]))


def row_forgotten(constraints: Constraints) -> Constraints:
    return replace(constraints, redundant=(*constraints.redundant[:-1], True), rates=constraints.rates[:-1])


def replaced(program: StraightLineProgram, name: str, places: tuple[int, ...]) -> StraightLineProgram:
    return replace(program, outputs={**program.outputs, name: places})


@pytest.mark.parametrize("fault", [bias_forgotten, row_forgotten])
def test_the_two_ways_would_show_a_fault_of_one(mechanism: Mechanism, fault: Any) -> None:
    assert mechanism.constraints is not None
    wrong = constrained_program(fault(mechanism.constraints), by_reduction)
    states = states_of(mechanism, 8)
    one, another = (ReferenceKernel(each).evaluate(states) for each in (mechanism, replace(mechanism, program=wrong)))
    assert (distance(one, another) > 1e-6).any()


def test_forces_do_no_work_and_rows_stay_closed(mechanism: Mechanism) -> None:
    assert mechanism.constraints is not None
    states = states_of(mechanism)
    inputs = mechanism.inputs(states)
    tied = values(mechanism.constraints.program, inputs)
    forces = values(mechanism.program, inputs)["passive"] - values(mechanism.constraints.tree, inputs)["passive"]
    np.testing.assert_allclose((forces * states.v.T).sum(axis=0), 0.0, atol=1e-10)
    jacobian = tied["jacobian"].reshape(len(mechanism.constraints.rows), mechanism.nv, -1)
    moved = np.einsum("rjn,nj->rn", jacobian, ReferenceKernel(mechanism).evaluate(states).high) + tied["bias"]
    np.testing.assert_allclose(moved, 0.0, atol=1e-9)


def test_a_redundant_row_changes_nothing() -> None:
    gap = four_bar().constraints["closure"].rows
    plain, doubled = mechanism_of(four_bar()), mechanism_of(four_bar(more=(gap[0] + 2 * gap[1],)))
    assert doubled.constraints is not None and doubled.constraints.redundant == (False, False, True)
    states = states_of(plain, 20)
    one, another = (ReferenceKernel(each).evaluate(states) for each in (plain, doubled))
    assert another.certified.all() and (distance(one, another) <= 0).all()


def test_the_angles_of_the_text_and_those_of_the_joints_say_the_same() -> None:
    text, joints = four_bar(measured_from={coupler: crank}, assembly={coupler: 0.82, follower: 1.77}), four_bar()
    relative, absolute = mechanism_of(text), mechanism_of(joints)
    states = states_of(relative, 20)
    q, v, tau = states.q.copy(), states.v.copy(), states.tau.copy()
    q[:, 1] += q[:, 0]
    v[:, 1] += v[:, 0]
    tau[:, 0] -= tau[:, 1]
    found, expected = ReferenceKernel(relative).evaluate(states).high, ReferenceKernel(absolute).evaluate(States.at(q, v, tau)).high
    expected[:, 1] -= expected[:, 0]
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9)


def given_way(mechanism: Mechanism, law: Softness) -> Mechanism:
    assert mechanism.constraints is not None
    return softened(mechanism, dict.fromkeys(mechanism.constraints.names, law))


@pytest.mark.parametrize("inverse_mass", [0.5, None])
def test_soft_constraints_minimise_the_documented_function(inverse_mass: float | None) -> None:
    mechanism = mechanism_of(four_bar())
    law = replace(LAW, inverse_masses=(inverse_mass, inverse_mass))
    states = states_of(mechanism, 20)
    # Off the manifold too: the optimum is at any state.
    states = States(states.q + 1e-3, states.v + 1e-2, states.tau, states.time)
    mass, force, jacobian, tied = parts_of(mechanism, states)
    free = np.linalg.solve(mass, force[:, :, None])[:, :, 0]
    wanted = -(law.damping * tied["rate"] + law.stiffness * law.impedance * tied["residual"]).T - tied["bias"].T
    own = np.einsum("nrj,njk,nrk->nr", jacobian, np.linalg.inv(mass), jacobian) if inverse_mass is None else np.full((20, 2), inverse_mass)
    weights = np.sqrt(law.impedance / ((1 - law.impedance) * own))
    # Least squares: |L'(a - free)|^2 + |w (J a - wanted)|^2.
    root = np.linalg.cholesky(mass).transpose(0, 2, 1)
    left = np.concatenate([root, weights[:, :, None] * jacobian], axis=1)
    right = np.concatenate([np.einsum("nij,nj->ni", root, free), weights * wanted], axis=1)
    expected = np.array([np.linalg.lstsq(one, other, rcond=None)[0] for one, other in zip(left, right, strict=True)])
    found = ReferenceKernel(given_way(mechanism, law)).evaluate(states)
    assert found.certified.all()
    np.testing.assert_allclose(found.high, expected, rtol=1e-8, atol=1e-8)


def test_stiffer_constraints_approach_rigid_ones() -> None:
    mechanism = mechanism_of(four_bar())
    states = states_of(mechanism, 20)
    rigid = ReferenceKernel(mechanism).evaluate(states)
    errors = []
    for impedance in (0.9, 0.999, 0.999999):
        soft = ReferenceKernel(given_way(mechanism, replace(LAW, impedance=impedance))).evaluate(states)
        errors.append(compare(rigid, soft.high).relative_error.max())
    # The error goes with (1 - d) / d.
    assert errors[1] < errors[0] / 50 and errors[2] < errors[1] / 500


def test_an_elimination_from_the_tips_gives_the_same_forces(monkeypatch: pytest.MonkeyPatch) -> None:
    """As of trees with so many bodies that the other way would fill the whole matrix."""
    mechanism = mechanism_of(four_bar())
    found = []
    for most in (softened_equations.MOST_PRODUCTS, 0):
        monkeypatch.setattr(softened_equations, "MOST_PRODUCTS", most)
        monkeypatch.setattr(softened_equations, "_WRITTEN", Kept(1))
        monkeypatch.setattr(declared, "_DECLARED", Kept(1))
        found.append(given_way(mechanism, LAW))
    root_first, tips_first = found
    states = states_of(mechanism, 20)
    assert root_first.program != tips_first.program
    one, other = (values(each.program, each.inputs(states))["passive"] for each in found)
    np.testing.assert_allclose(other, one, rtol=1e-8, atol=1e-8)


def test_products_of_an_elimination_are_counted_with_what_it_fills() -> None:
    """Of a hub with four arms: the hub first couples all arms with one another, and last none."""
    builder = Builder(["x"])
    hub = builder.zeros(5, 5)
    hub[0, :] = hub[:, 0] = builder.inputs[0]
    hub[range(5), range(5)] = builder.inputs[0]
    assert products_of_elimination(hub) == 4 * 5 // 2 + 3 * 4 // 2 + 2 * 3 // 2 + 1
    assert products_of_elimination(hub[::-1, ::-1]) == 4


def test_a_law_is_for_every_row() -> None:
    constraints = mechanism_of(four_bar()).constraints
    assert constraints is not None
    with pytest.raises(ValueError, match="1 laws for 2 rows"):
        softened_program(constraints, dict.fromkeys(constraints.names, replace(LAW, inverse_masses=(0.5,))))
    rolling = mechanism_of(upright_disc()).constraints
    assert rolling is not None
    with pytest.raises(ValueError, match="of which 0 hold positions"):
        softened_program(rolling, dict.fromkeys(rolling.names, LAW))


def test_a_mechanism_with_constraints_comes_back_from_json(mechanism: Mechanism) -> None:
    assert Mechanism.from_json(mechanism.to_json()) == mechanism
    assert mechanism.constraints is not None
    broken = replace(mechanism, constraints=replace(mechanism.constraints, rates=mechanism.constraints.rates[:-1]))
    with pytest.raises(ValueError, match="constraints do not fit"):
        Mechanism.from_json(broken.to_json())


def closure(**changes: Any) -> dict[str, Any]:
    rows = four_bar().constraints["closure"].rows
    return {"constraints": {"closure": Constraint(**{"rows": rows, "determines": (coupler, follower), **changes})}}


rate = crank.diff(TIME)
REFUSED = {
    "no rows": (lambda: four_bar(**closure(rows=(), determines=())), "has no rows"),
    "one row for two coordinates": (
        lambda: four_bar(**closure(determines=(coupler,))),
        "determines 1 coordinates; expected one for each of its 2",
    ),
    "a redundant row that is not there": (lambda: four_bar(**closure(redundant=(2,))), "row 2 is said to be redundant"),
    "a row that is zero": (lambda: four_bar(**closure(rows=(a - a, d))), "row 0 is zero"),
    "a coordinate that is not there": (lambda: four_bar(**closure(determines=(coupler, spin))), "determines spin"),
    "a coordinate twice": (lambda: four_bar(**closure(determines=(coupler, coupler))), "determined already"),
    "rows of both kinds": (lambda: four_bar(**closure(rows=(crank - d * coupler, rate))), "rows of coordinates and rows of rates"),
    "a square of a rate": (lambda: four_bar(**closure(rows=(rate**2, d * rate))), "linear in the rates"),
    "a rate and a number": (lambda: four_bar(**closure(rows=(rate - 1, d * rate))), "linear in the rates"),
    "time": (lambda: four_bar(**closure(rows=(crank - TIME, d * follower))), "depends on time"),
    "a symbol without value": (lambda: four_bar(**closure(rows=(crank - R, follower))), "contains R, which has no value"),
    "an assembly of a stranger": (lambda: four_bar(assembly={spin: 1.0}), "assembly has spin"),
    "an assembly at infinity": (lambda: four_bar(assembly={coupler: float("inf")}), "assembly has coupler"),
    "all coordinates determined": (
        lambda: four_bar(**closure(rows=(d * crank, coupler, follower), determines=(crank, coupler, follower))),
        "so that nothing moves",
    ),
    "a free joint beside them": (
        lambda: upright_disc(
            attitudes=(Attitude("turn", (x, yaw, spin), "zxz"),), coordinates={x: "turn", yaw: "turn", spin: "turn", y: "y"}
        ),
        "beside ball or free joints",
    ),
    "an assembly of a tree": (lambda: upright_disc(constraints={}, assembly={x: 1.0}), "there is no constraint"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_a_declaration_that_contradicts_itself_is_refused(name: str) -> None:
    declare, message = REFUSED[name]
    with pytest.raises(ValueError, match=message):
        declare()


def test_a_parameter_may_stand_in_a_constraint_alone() -> None:
    extra = sp.Symbol("extra", positive=True)
    parameters = {**CRANK_ROCKER, extra: (0.25, "m")}
    rows = four_bar().constraints["closure"].rows
    mechanism = mechanism_of(four_bar(parameters=parameters, **closure(rows=(rows[0] - extra, rows[1]))))
    assert [name for name, _, _ in mechanism.parameters][-1] == "extra"
    with pytest.raises(ValueError, match="nor constraint"):
        four_bar(parameters=parameters)
