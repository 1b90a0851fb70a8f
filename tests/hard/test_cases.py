"""Hard cases: they are found by name, point at numbers that exist, and their models follow the knob."""

from __future__ import annotations

import dataclasses
import functools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from harness.engines import Subject, load_engine
from harness.errors import InvalidModel
from harness.files.model_file import read_model
from harness.files.text.scan import find_elements
from harness.hard.cases import POINTS, HardCase, decades, hard_cases, number_at
from harness.lagrange.derivation import load_mechanism
from harness.library import MODEL_SUFFIXES, Library
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.states import States
from harness.truth.compare import compare
from harness.truth.reference import ReferenceKernel
from harness.truth.sampling import generic_sample
from harness.verdict import Verdict

CASES = list(hard_cases().values())
# Derived and compiled in seconds.
QUICK = ["vanishing_cart", "massless_knee", "stiff_damper", "collapsed_spring", "mass_ratio_2"]


def test_there_are_enough_families_with_enough_points() -> None:
    assert len(CASES) >= 12
    assert {len(case.values) for case in CASES} == {POINTS}


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_every_case_says_what_theory_expects_and_what_to_do(case: HardCase) -> None:
    assert case.title and case.source and case.remedy and all(case.knob)
    assert set(case.theory) <= {"lagrange", "mujoco/mjcf", "pinocchio/urdf"}
    assert {theory.verdict for theory in case.theory.values()} <= {verdict.value for verdict in Verdict}
    assert list(case.values) == sorted(case.values) or case.values[-1] == 5e-324
    assert set(case.changes) in (set(), set(MODEL_SUFFIXES))
    assert set(case.subjects) <= {"lagrange", "mujoco/mjcf", "pinocchio/urdf"}


@pytest.mark.parametrize("case", [case for case in CASES if case.changes], ids=lambda case: case.name)
@pytest.mark.parametrize("model_format", sorted(MODEL_SUFFIXES))
def test_every_change_points_at_one_number(case: HardCase, model_format: str) -> None:
    model = read_model(case.library.model_path(case.system_at(case.values[0]), model_format), model_format)
    elements = find_elements(model.text, model.format)
    numbers = [number_at(elements, address) for address in case.changes[model_format]]
    assert len({number.start for number in numbers}) == len(numbers)


@pytest.mark.parametrize("address", ["body nobody/inertial@mass", "body cart/inertial@pos[3]", "joint pin@colour", "no address"])
def test_an_address_that_means_nothing_is_refused(address: str) -> None:
    model = read_model(Library.built_in().model_path("cart_pendulum", "mjcf"), "mjcf")
    with pytest.raises(ValueError, match="address" if address == "no address" else "no number"):
        number_at(find_elements(model.text, "mjcf"), address)


def test_a_body_is_not_mistaken_for_the_one_inside() -> None:
    model = read_model(Library.built_in().model_path("double_pendulum", "mjcf"), "mjcf")
    elements = find_elements(model.text, "mjcf")
    assert [number_at(elements, f"body mass_{i}/inertial@mass").value for i in (1, 2)] == [2.0, 1.25]


def test_a_parameter_the_mechanism_has_not_is_refused() -> None:
    case = dataclasses.replace(hard_cases()["vanishing_cart"], parameters=lambda mass: {"N": mass})
    with pytest.raises(ValueError, match="no parameter 'N'"):
        case.mechanism_at(1.0)


@pytest.mark.parametrize("name", QUICK)
@pytest.mark.parametrize("subject", [Subject("mujoco", "mjcf"), Subject("pinocchio", "urdf")], ids=str)
def test_models_follow_the_knob_and_a_forgotten_change_is_seen(name: str, subject: Subject) -> None:
    """At an easy point away from the model's own, the subject agrees; not so when any one change is left out."""
    case, value = hard_cases()[name], 0.37
    if name == "mass_ratio_2":
        # The case leaves lengths alone; its changes follow them all the same.
        case = dataclasses.replace(case, parameters=lambda value: {"m1": 1.3, "m2": value, "L1": 0.4, "L2": 0.7})
    mechanism = case.mechanism_at(value)
    states = case.states(mechanism, value, 0)
    reference = ReferenceKernel(mechanism).evaluate(states)

    def verdicts(changed: HardCase) -> set[str]:
        try:
            source = changed.model_at(value, subject.format)
        except InvalidModel:
            return {"no model"}
        loaded = load_engine(Library.built_in(), subject.engine).load(source, mechanism.joints, mechanism.gravity)
        return set(compare(reference, loaded.forward_dynamics(states.q, states.v, states.tau)).verdicts.tolist())

    assert verdicts(case) == {"agrees"}
    for address in case.changes[subject.format]:
        # About its own length no bar of a plane chain turns, nor does the first one's other moment of inertia matter.
        if "diaginertia[0]" in address or "diaginertia[2]" in address or "@ixx" in address:
            continue
        rest = {other: rule for other, rule in case.changes[subject.format].items() if other != address}
        assert verdicts(dataclasses.replace(case, changes={**case.changes, subject.format: rest})) != {"agrees"}, address


@pytest.mark.parametrize("name", ["cart_pendulum", "heavy_top"])
@given(data=st.data())
@settings(max_examples=6, deadline=None)
def test_parameters_per_state_equal_a_mechanism_with_those_values(name: str, data: st.DataObject) -> None:
    """Along a knob the truth is that of the changed mechanism, digit for digit, whatever stands beside it in the batch."""
    kernel, mechanism = _kernel(name)
    factors = data.draw(
        st.lists(
            st.lists(st.floats(0.01, 100.0), min_size=len(mechanism.parameters), max_size=len(mechanism.parameters)), min_size=1, max_size=4
        )
    )
    parameters = np.array(mechanism.parameter_values) * np.array(factors)
    states = generic_sample(mechanism, len(factors), data.draw(st.integers(0, 99)))
    together = kernel.evaluate(states, parameters)
    for index, row in enumerate(parameters.tolist()):
        named = tuple((symbol, value, unit) for (symbol, _, unit), value in zip(mechanism.parameters, row, strict=True))
        alone = ReferenceKernel(dataclasses.replace(mechanism, parameters=named))
        expected = alone.evaluate(states[index : index + 1])
        for field in dataclasses.fields(expected):
            ours, theirs = getattr(together, field.name)[index], getattr(expected, field.name)[0]
            if field.name in ("sensitivity", "instability"):
                # Their sums run in another order in a batch of another length.
                np.testing.assert_allclose(ours, theirs, rtol=1e-12)
            else:
                np.testing.assert_array_equal(ours, theirs)


def test_parameters_of_another_shape_are_refused() -> None:
    kernel, mechanism = _kernel("cart_pendulum")
    with pytest.raises(ValueError, match=r"expected \(2, 6\)"):
        kernel.evaluate(generic_sample(mechanism, 2, 0), np.ones((2, 5)))


def test_norms_keep_their_digits_where_the_mass_matrix_is_singular_in_float64() -> None:
    """kappa_s of a bar chain whose middle bar shrinks to L is c / L^2 far beyond 1/u, and data roundoff stays known."""
    case = hard_cases()["zero_length_link"]
    mechanism = case.unchanged_at(1.0)
    lengths = (1e-5, 1e-8, 1e-11)
    state = generic_sample(mechanism, 1, 3)
    states = States.concatenate([state] * len(lengths))
    reference = ReferenceKernel(mechanism).evaluate(states, np.array([case.mechanism_at(length).parameter_values for length in lengths]))
    assert reference.certified.all()
    conditions = reference.condition
    assert conditions[-1] > 1e20
    np.testing.assert_allclose(conditions[1:] / conditions[:-1], 1e6, rtol=1e-3)


def test_decades_end_where_they_say() -> None:
    values = decades(-12, 12)
    assert (len(values), values[0], values[-1]) == (POINTS, 1e-12, 1e12)


@functools.cache
def _kernel(name: str) -> tuple[ReferenceKernel, Mechanism]:
    mechanism = load_mechanism(Library.built_in(), name)
    return ReferenceKernel(mechanism), mechanism
