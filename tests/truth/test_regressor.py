"""The certified regressor: against differences of inverse dynamics by numbers of the file, against Pinocchio, and with mistakes."""

from __future__ import annotations

import numpy as np
import pytest
from catalogue import BUILT_IN, CALLED_HERE, TREES, is_misread

from harness.arrays import Array
from harness.crosscheck.expected import load_expectations
from harness.engines import Model, NotOffered, Subject, Unsupported, load_model
from harness.files.model_file import read_model
from harness.lagrange.derivation import load_mechanism
from harness.programs.states import States
from harness.trees.quantities.forces import PARAMETERS
from harness.truth.compare import compare
from harness.truth.quantities import Truth, TruthBasis, find_quantities
from harness.truth.sampling import generic_sample, sample

SEED = 5


def truth_of(name: str, model_format: str) -> Truth:
    mechanism, file = load_mechanism(BUILT_IN, name), read_model(BUILT_IN.model_path(name, model_format), model_format)
    return find_quantities()["regressor"].truth(TruthBasis(mechanism, file, file, bool(mechanism.charts_in_body)))


def pinocchio_model(name: str, model_format: str) -> Model:
    file = read_model(BUILT_IN.model_path(name, model_format), model_format)
    return load_model(CALLED_HERE, Subject("pinocchio", model_format), load_mechanism(BUILT_IN, name), file)


@pytest.mark.parametrize("modelled_name", TREES)
def test_pinocchio_agrees_with_both_files(modelled_name: str) -> None:
    mechanism = load_mechanism(BUILT_IN, modelled_name)
    states = sample(mechanism, 16, SEED)
    for model_format in ("urdf", "mjcf"):
        if is_misread(Subject("pinocchio", model_format), mechanism):
            continue
        expected = load_expectations(BUILT_IN, "regressor").entries.get((modelled_name, f"pinocchio/{model_format}"))
        try:
            truth, model = truth_of(modelled_name, model_format), pinocchio_model(modelled_name, model_format)
        except Unsupported:
            assert model_format == "mjcf"
            continue
        certified = truth.evaluate(states)
        assert certified.certified.all()
        found = compare(certified, truth.answers(model, states))
        assert expected is not None or set(found.verdicts.tolist()) == {"agrees"}, found.backward_error.max()


@pytest.mark.parametrize("name", ["arm_3r", "rotating_hoop", "heavy_top", "free_body"])
def test_times_the_parameters_it_is_inverse_dynamics(name: str) -> None:
    """Pinocchio's own, of the inertias that it holds; the file of these systems has no spring, damper or reflected inertia."""
    mechanism = load_mechanism(BUILT_IN, name)
    truth, loaded = truth_of(name, "urdf"), pinocchio_model(name, "urdf")
    states = generic_sample(mechanism, 8, SEED)
    certified = truth.evaluate(states)
    joints = len(dict.fromkeys(mechanism.joints))
    columns = certified.high.reshape(len(states), joints, len(PARAMETERS), mechanism.nv)
    places = [loaded.force_elements.places[joint].joint for joint in dict.fromkeys(mechanism.joints)]  # type: ignore[attr-defined]
    inertias = np.array([loaded.model.inertias[place].toDynamicParameters() for place in places])  # type: ignore[attr-defined]
    forces = np.einsum("njpv,jp->nv", columns, inertias)
    accelerations = truth._accelerations(states)  # type: ignore[attr-defined]
    expected = loaded.inverse_dynamics(states.q, states.v, accelerations)  # type: ignore[attr-defined]
    np.testing.assert_allclose(forces, expected, rtol=0, atol=1e-11 * np.abs(expected).max())


MISTAKES = {
    "parameters of the next body": lambda found: np.roll(found, 1, axis=2),
    "products of inertia in another order": lambda found: found[..., [0, 1, 2, 3, 4, 5, 7, 6, 8, 9]],
    "moments about the centre of mass": lambda found: np.concatenate([found[..., :1], 0.5 * found[..., 1:4], found[..., 4:]], axis=3),
    "a number": lambda found: found * (1 + 1e-12),
}


@pytest.mark.ci
@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_is_seen(mistake: str) -> None:
    truth, loaded = truth_of("arm_7r", "urdf"), pinocchio_model("arm_7r", "urdf")
    states = generic_sample(load_mechanism(BUILT_IN, "arm_7r"), 4, SEED)

    class Spoiled:
        def regressor(self, q: Array, v: Array, qdd: Array) -> Array:
            return np.ascontiguousarray(MISTAKES[mistake](loaded.regressor(q, v, qdd)))  # type: ignore[attr-defined]

    certified = truth.evaluate(states)
    assert set(compare(certified, truth.answers(loaded, states)).verdicts.tolist()) == {"agrees"}
    assert set(compare(certified, truth.answers(Spoiled(), states)).verdicts.tolist()) == {"disagrees"}  # type: ignore[arg-type]


def test_loops_have_none() -> None:
    mechanism, file = load_mechanism(BUILT_IN, "four_bar"), read_model(BUILT_IN.model_path("four_bar", "mjcf"), "mjcf")
    with pytest.raises(NotOffered, match="under constraints"):
        find_quantities()["regressor"].truth(TruthBasis(mechanism, file, file, False))


def test_what_is_zero_by_geometry_is_certified_at_rest() -> None:
    """About the last axis of the arm alone, across which the moments of its hand have no share that one unit roundoff would change."""
    states = States.at([2.0, -0.0013, 1.111263540325, 0.0, -1.52521185, 0.0], [0.0] * 6, [0.0] * 5 + [0.03])
    assert truth_of("stanford_arm", "mjcf").evaluate(states).certified.all()
