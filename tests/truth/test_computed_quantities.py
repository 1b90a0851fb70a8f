"""Quantities that the numbers of a file give: against the energies, against one another, in both engines, and after mistakes."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from catalogue import BUILT_IN, MODELLED, PLAIN, TREES

from harness.arrays import Array
from harness.crosscheck.assignment import Assignment, load_audited, truth_of
from harness.engines import Model, NotOffered, Subject, Unsupported
from harness.engines.coordinates import multiplied
from harness.errors import InvalidModel, InvalidRequest
from harness.files.model_file import parse_model, read_model
from harness.lagrange.derivation import load_mechanism
from harness.programs.mechanisms.kernel import EnergyKernel
from harness.programs.numbers import UNIT_ROUNDOFF
from harness.programs.states import States
from harness.truth.compare import Certified, compare, farthest_block
from harness.truth.quantities import Quantity, TruthBasis, find_quantities, of_files, select_quantities
from harness.truth.quantities.of_files import FileTruth
from harness.truth.reference import ReferenceKernel
from harness.truth.sampling import generic_sample, sample
from harness.verdict import AGREEMENT

SEED = 11
STATES = 8
# Reactions, derivatives, the regressor and sensors have tests of their own.
NAMES = [value.name for value in vars(of_files).values() if isinstance(value, Quantity) and value.is_quick]


def truth(name: str, quantity: str) -> FileTruth:
    declared = read_model(BUILT_IN.model_path(name, "mjcf"), "mjcf")
    found = find_quantities()[quantity].truth(TruthBasis(load_mechanism(BUILT_IN, name), declared, declared, False))
    assert isinstance(found, FileTruth)
    return found


def in_roundoffs(certified: Certified, answers: Array) -> Array:
    """Errors of each block, (n, blocks), with the share of its parts; 0 for none."""
    errors = np.linalg.norm(certified.errors(answers), axis=2)
    with np.errstate(all="ignore"):
        return np.where(errors == 0, 0.0, errors / (UNIT_ROUNDOFF * (certified.sensitivity + certified.share)))


@pytest.mark.ci
@pytest.mark.parametrize("modelled_name", MODELLED)
def test_engines_and_formats_agree_on_every_quantity(modelled_name: str) -> None:
    states = sample(load_mechanism(BUILT_IN, modelled_name), STATES, SEED)
    for engine, model_format in (("mujoco", "mjcf"), ("pinocchio", "urdf")):
        assignment = Assignment.of(BUILT_IN, modelled_name, Subject(engine, model_format))
        for quantity in NAMES:
            about = assignment.about(quantity)
            try:
                model, own = load_audited(about), truth_of(about)
            except NotOffered:
                assert quantity in ("inverse_dynamics", "power") and modelled_name not in TREES
                continue
            except Unsupported:
                break
            comparison = compare(own.evaluate(states), own.answers(model, states))
            assert set(comparison.verdicts.tolist()) == {"agrees"}, (quantity, engine, comparison.backward_error.max())


@pytest.mark.parametrize("modelled_name", TREES)
def test_the_parts_of_a_value_are_no_shorter_than_the_value(modelled_name: str) -> None:
    """But where positions of joints are among them, which are inputs that no algorithm forms."""
    states = sample(load_mechanism(BUILT_IN, modelled_name), STATES, SEED)
    for quantity in [name for name in NAMES if name not in ("position", "momentum")]:
        found = truth(modelled_name, quantity).evaluate(states)
        lengths = found.lengths(found.high)[found.certified]
        assert (found.share[found.certified] >= lengths * (1 - 1e-12)).all(), quantity


@pytest.mark.parametrize("modelled_name", TREES)
def test_energies_are_those_that_the_system_declares(modelled_name: str) -> None:
    mechanism = load_mechanism(BUILT_IN, modelled_name)
    states = sample(mechanism, STATES, SEED)
    own, zero = (
        truth(modelled_name, "energy"),
        States.at(np.zeros((1, mechanism.nq)), np.zeros((1, mechanism.nv)), np.zeros((1, mechanism.nv))),
    )
    for place in mechanism.attitudes:
        zero.q[0, place + sum(other < place for other in mechanism.attitudes)] = 1.0
    energies = EnergyKernel(mechanism)
    found, at_zero = energies.evaluate(states), energies.evaluate(zero)
    potential = (found.kinetic - found.lagrangian) - (at_zero.kinetic - at_zero.lagrangian)
    answers = np.stack([found.kinetic, potential], axis=1)[:, :, None]
    assert (in_roundoffs(own.evaluate(states), answers) <= AGREEMENT).all()


@pytest.mark.parametrize("modelled_name", TREES)
def test_inverse_dynamics_of_certified_accelerations_are_the_applied_forces(modelled_name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    mechanism = load_mechanism(BUILT_IN, modelled_name)
    states = generic_sample(mechanism, STATES, SEED)
    accelerations = ReferenceKernel(mechanism).evaluate(states).high
    own = truth(modelled_name, "inverse_dynamics")
    monkeypatch.setattr(own, "_accelerations", lambda _: accelerations)
    assert (in_roundoffs(own.evaluate(states), states.tau[:, :, None]) <= AGREEMENT).all()


@pytest.mark.parametrize("name", [name for name in ("double_pendulum", "arm_3r", "spring_pendulum", "puma_560") if name in PLAIN])
def test_energy_gains_what_applied_forces_do(name: str) -> None:
    """The balance of power, by differences of energies along the motion: nothing is damped in these."""
    mechanism, step = load_mechanism(BUILT_IN, name), 1e-6
    states, energy, power = generic_sample(mechanism, STATES, SEED), truth(name, "energy"), truth(name, "power")
    rates = power._accelerations(states)
    moved = [States(states.q + by * states.v, states.v + by * rates, states.tau, states.time) for by in (step, -step)]
    ahead, behind = (energy.evaluate(one).high.sum(axis=(1, 2)) for one in moved)
    done = power.evaluate(states).high[:, 0, 0]
    np.testing.assert_allclose((ahead - behind) / (2 * step), done, rtol=1e-5, atol=1e-6 * float(np.abs(done).max()))


@pytest.mark.parametrize("name", [name for name in ("double_pendulum", "furuta_pendulum", "arm_3r", "scara") if name in PLAIN])
def test_velocities_are_rates_of_positions_and_jacobians_times_rates(name: str) -> None:
    mechanism, step = load_mechanism(BUILT_IN, name), 1e-6
    states = generic_sample(mechanism, STATES, SEED)
    positions, velocities, jacobians = (truth(name, quantity) for quantity in ("position", "velocity", "jacobian"))
    moving = velocities.evaluate(states).high.reshape(STATES, -1, 2, 3)
    ahead, behind = (
        positions.evaluate(States(states.q + sign * step * states.v, states.v, states.tau, states.time)).high.reshape(STATES, -1, 4, 3)
        for sign in (1, -1)
    )
    rates = (ahead - behind) / (2 * step)
    np.testing.assert_allclose(rates[:, :, 0], moving[:, :, 0], rtol=1e-6, atol=1e-6)
    now = positions.evaluate(states).high.reshape(STATES, -1, 4, 3)[:, :, 1:]
    np.testing.assert_allclose(rates[:, :, 1:], np.cross(moving[:, :, None, 1], now), rtol=1e-6, atol=1e-6)
    columns = jacobians.evaluate(states).high.reshape(STATES, moving.shape[1], mechanism.nv, 2, 3)
    np.testing.assert_allclose(np.einsum("njvab,nv->njab", columns, states.v), moving, rtol=1e-12, atol=1e-12)


def test_what_floats_freely_keeps_its_momentum_but_for_its_weight() -> None:
    mechanism = load_mechanism(BUILT_IN, "free_body")
    states, step = generic_sample(mechanism, STATES, SEED), 1e-6
    still = States(states.q, states.v, np.zeros_like(states.tau), states.time)
    accelerations = ReferenceKernel(mechanism).evaluate(still).high
    own = truth("free_body", "momentum")

    def moved(by: float) -> Array:
        v, q = states.v + by * accelerations, states.q.copy()
        q[:, :3] += by * states.v[:, :3]
        spin = np.concatenate([np.zeros((STATES, 1)), states.v[:, 3:]], axis=1)
        q[:, 3:] += by * multiplied(states.q[:, 3:], spin) / 2
        return own.evaluate(States(q, v, still.tau, states.time)).high

    rates = (moved(step) - moved(-step)) / (2 * step)
    np.testing.assert_allclose(rates[:, 0], [[0.0, 0.0, -mechanism.gravity * mechanism.total_mass]] * STATES, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(rates[:, 2], 0.0, atol=1e-6 * np.abs(own.evaluate(still).high[:, 2]).max())


@pytest.mark.parametrize(("times", "verdict"), [(8, "agrees"), (1e4, "disagrees")])
@pytest.mark.parametrize("quantity", ["bias", "inverse_dynamics"])
def test_what_cancels_in_momenta_about_the_origin_of_the_world_is_granted(quantity: str, times: float, verdict: str) -> None:
    """A ball that is nearly on the axis of its beam has no moment about it, and v x (m v) is 0 in exact numbers alone."""
    own = truth("ball_and_beam", quantity)
    pivot = (joints := load_mechanism(BUILT_IN, "ball_and_beam").joints).index("pivot")
    q, v, still = {"slide": 2.0**-16, "pivot": -1.375}, {"slide": -1.125, "pivot": -3.125}, [[0.0, 0.0]]
    certified = own.evaluate(States.at([[q[joint] for joint in joints]], [[v[joint] for joint in joints]], still))
    twice_the_energy = 0.5 * 1.125**2
    answers = certified.high.copy()
    answers[0, pivot] += times * UNIT_ROUNDOFF * twice_the_energy
    judged = compare(certified, answers)
    assert judged.verdicts.tolist() == [verdict] and judged.granted.tolist() == [verdict == "agrees"]


class Spoiled:
    """A model after a mistake in what one method returns."""

    def __init__(self, model: Model, method: str, spoil: Any) -> None:
        self._model, self._method, self._spoil = model, method, spoil

    def __getattr__(self, name: str) -> Any:
        found = getattr(self._model, name)
        return (lambda *arguments: self._spoil(found(*arguments))) if name == self._method else found


def _scaled(place: Any, by: float) -> Any:
    def spoil(found: Array) -> Array:
        found = np.array(found)
        found[place] *= by
        return found

    return spoil


MISTAKES = [
    ("mass_matrix", "mass_matrix", _scaled((slice(None), 0, 1), 1 + 1e-11), "entry of M for joint 'shoulder' and joint 'elbow'"),
    ("bias", "bias", _scaled((slice(None), 1), 1 + 1e-12), "bias force on joint 'elbow'"),
    ("gravity", "gravity", _scaled((slice(None), 0), -1.0), "gravity force on joint 'shoulder'"),
    ("inverse_dynamics", "inverse_dynamics", _scaled((slice(None), 1), 1 + 1e-12), "generalised force on joint 'elbow'"),
    ("power", "inverse_dynamics", _scaled((slice(None), 1), 1 + 1e-11), "power of the applied forces"),
    ("energy", "energies", _scaled((slice(None), 0), 2.0), "kinetic energy"),
    ("energy", "energies", _scaled((slice(None), 1), 1 + 1e-12), "potential energy"),
    ("momentum", "momenta", _scaled((slice(None), slice(6, 9)), 1 + 1e-11), "angular momentum about the centre of mass"),
    ("position", "positions", _scaled((slice(None), 1, slice(0, 3)), 1 + 1e-13), "position at joint 'elbow'"),
    ("velocity", "velocities", _scaled((slice(None), 1, slice(3, 6)), 1 + 1e-12), "angular velocity at joint 'elbow'"),
    ("jacobian", "jacobians", _scaled((slice(None), 1, slice(0, 3), 0), 1 + 1e-12), "velocity at joint 'elbow' by joint 'shoulder'"),
]


@pytest.mark.parametrize(("quantity", "method", "spoil", "block"), MISTAKES, ids=[f"{one[0]}-{one[3]}" for one in MISTAKES])
def test_a_mistake_of_an_engine_is_seen_and_its_block_named(quantity: str, method: str, spoil: Any, block: str) -> None:
    assignment = Assignment.of(BUILT_IN, "arm_2r", Subject("pinocchio", "urdf"))
    states, model, own = generic_sample(assignment.mechanism, STATES, SEED), load_audited(assignment), truth("arm_2r", quantity)
    certified, answers = own.evaluate(states), own.answers(model, states)
    assert set(compare(certified, answers).verdicts.tolist()) == {"agrees"}
    wrong = own.answers(Spoiled(model, method, spoil), states)  # type: ignore[arg-type]
    assert (compare(certified, wrong).verdicts == "disagrees").mean() >= 0.75
    assert own.blocks[farthest_block(certified, wrong)] == block


def test_numbers_that_are_not_those_of_the_energies_are_no_truth() -> None:
    path = BUILT_IN.model_path("arm_2r", "mjcf")
    declared = parse_model(path, path.read_text().replace('mass="3"', 'mass="3.0000001"'), "mjcf")
    mechanism = load_mechanism(BUILT_IN, "arm_2r")
    own = find_quantities()["position"].truth(TruthBasis(mechanism, declared, declared, False))
    with pytest.raises(InvalidModel, match=r"arm_2r.xml.*the mass terms of its numbers are .* from those of the energies"):
        own.evaluate(generic_sample(mechanism, 4, SEED))


def test_applied_forces_of_a_loop_are_not_one_answer() -> None:
    with pytest.raises(NotOffered, match="not determined by its accelerations"):
        truth("four_bar", "inverse_dynamics")


BOTH = ["forward_dynamics_derivatives", "inverse_dynamics_derivatives"]


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        ([], ["accelerations"]),
        (["gravity", "bias", "gravity"], ["bias", "gravity"]),
        (["derivatives"], BOTH),
        ([BOTH[1], "derivatives", "accelerations"], ["accelerations", *BOTH]),
        (["all", "derivatives"], [*find_quantities()]),
    ],
)
def test_names_stand_for_quantities_in_a_fixed_order(names: list[str], expected: list[str]) -> None:
    assert select_quantities(names) == expected


@pytest.mark.parametrize(("name", "nearest"), [("derivative", "derivatives"), ("mass_matrx", "mass_matrix"), ("al", "all")])
def test_another_name_is_refused_with_the_nearest(name: str, nearest: str) -> None:
    with pytest.raises(InvalidRequest, match=rf"no quantity is called '{name}'; .*\b{nearest}\b"):
        select_quantities(["bias", name])
