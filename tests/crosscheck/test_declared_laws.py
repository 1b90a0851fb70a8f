"""Numbers of a law by which constraints give are felt by a check, by a diagnosis and by the search for superfluous parts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from harness.crosscheck.assignment import Assignment, acceleration_truth_of
from harness.crosscheck.superfluous import find_superfluous
from harness.engines import Subject, gaps_of, load_engine
from harness.explain.columns import diagnostic_states, watch
from harness.explain.model_side import diagnose
from harness.files.model_file import ModelFile, parse_model
from harness.library import Library
from harness.truth.declared import DeclaredMechanism
from harness.truth.displaced import opened
from harness.truth.manifold import closes
from harness.truth.quantities.accelerations import beside_gaps
from harness.truth.sampling import sample
from harness.verdict import Verdict

LIBRARY, MUJOCO = Library.built_in(), Subject("mujoco", "mjcf")
OWN = 'solref="0.05 1" solimp="0.9 0.95 0.001 0.5 2"'
NAMES = ["four_bar", "slider_crank", "delta_robot"]


def with_law(name: str, law: str = OWN) -> Assignment:
    """MuJoCo on a mechanism whose constraints have this law, in its declared truth as in its file."""
    asked = Assignment.of(LIBRARY, name, MUJOCO)
    assert asked.model is not None
    return replace(asked, model=written(asked.model, law))


def written(file: ModelFile, law: str) -> ModelFile:
    text = file.text.replace("<connect ", f"<connect {law} ")
    return parse_model(file.path, text, file.format)


def verdicts(asked: Assignment, file: ModelFile, on_manifold: bool = False) -> set[str]:
    """Those on an engine that loads another file, by the declared truth of the one that it was given."""
    truth, states = acceleration_truth_of(asked), sample(asked.mechanism, 64, seed=0)
    states = states if on_manifold else truth.asked_at(states)
    model = load_engine(LIBRARY, "mujoco").load(file, asked.mechanism.joints, asked.mechanism.gravity)
    return set(truth.judge(truth.evaluate(states), states, truth.answers(model, states), model).verdicts.tolist())


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize(
    "planted",
    [
        'solref="5 0.1" solimp="0.9 0.95 0.001 0.5 2"',
        'solref="0.05 1.00001" solimp="0.9 0.95 0.001 0.5 2"',
        'solref="0.05 1" solimp="0.900001 0.95 0.001 0.5 2"',
        'solref="0.05 1" solimp="0.9 0.950001 0.001 0.5 2"',
        'solref="0.05 1" solimp="0.9 0.95 0.00100001 0.5 2"',
        'solref="0.05 1" solimp="0.9 0.95 0.001 0.50001 2"',
        'solref="0.05 1" solimp="0.9 0.95 0.001 0.5 2.00001"',
    ],
)
def test_every_number_of_a_law_that_an_engine_takes_for_another_is_red(name: str, planted: str) -> None:
    asked = with_law(name)
    assert asked.model is not None
    assert verdicts(asked, asked.model) == {Verdict.AGREES.value}
    other = written(Assignment.of(LIBRARY, name, MUJOCO).model, planted)  # type: ignore[arg-type]
    assert Verdict.DISAGREES.value in verdicts(asked, other)


def test_on_the_manifold_nothing_brings_constraints_back() -> None:
    asked = with_law("four_bar")
    other = written(Assignment.of(LIBRARY, "four_bar", MUJOCO).model, 'solref="5 0.1" solimp="0.9 0.95 0.001 0.5 2"')  # type: ignore[arg-type]
    assert verdicts(asked, other, on_manifold=True) == {Verdict.AGREES.value}


@pytest.mark.ci
@pytest.mark.parametrize(("planted", "attribute", "index"), [("0.04 1", "solref", 0), ("0.9 0.95 0.002 0.5 2", "solimp", 2)])
def test_a_diagnosis_names_the_number_of_a_law_with_its_line(planted: str, attribute: str, index: int) -> None:
    asked = with_law("four_bar")
    own = {"solref": "0.05 1", "solimp": "0.9 0.95 0.001 0.5 2"}
    assert asked.model is not None
    text = asked.model.text.replace(f'{attribute}="{own[attribute]}"', f'{attribute}="{planted}"')
    wrong, truth = parse_model(asked.model.path, text, "mjcf"), acceleration_truth_of(asked)
    states = truth.asked_at(diagnostic_states(asked.mechanism, 0))
    watched = watch(load_engine(LIBRARY, "mujoco"), asked.mechanism, wrong, states)
    loaded = load_engine(LIBRARY, "mujoco").load(wrong, asked.mechanism.joints, asked.mechanism.gravity)
    found = diagnose(watched, beside_gaps(truth.evaluate(states), asked.mechanism, states, gaps_of(loaded, states)))
    line = 1 + text[: text.index("<connect")].count("\n")
    assert found.first is not None
    assert (found.first.place.line, found.first.place.attribute, found.first.place.index) == (line, attribute, index)


@pytest.mark.parametrize("name", NAMES)
def test_no_number_of_a_law_is_superfluous(name: str) -> None:
    """The default law written out is felt all the same: another one would be."""
    for law in (OWN, 'solref="-400 -40" solimp="0.8 0.9 0.01 0.25 3"'):
        assert [part for part in find_superfluous(with_law(name, law)) if part.element == "connect"] == []


def test_a_state_is_opened_alike_alone_and_among_others_and_once() -> None:
    asked = with_law("four_bar")
    mechanism = acceleration_truth_of(asked).mechanism
    assert isinstance(mechanism, DeclaredMechanism)
    states = sample(mechanism, 64, seed=0)
    found = opened(mechanism, states, 0.5)
    alone = [opened(mechanism, states[[index]], 0.5) for index in range(len(states))]
    np.testing.assert_array_equal(found.q, np.concatenate([one.q for one in alone]))
    np.testing.assert_array_equal(found.v, np.concatenate([one.v for one in alone]))
    again = opened(mechanism, found, 0.5)
    np.testing.assert_array_equal(found.q, again.q)
    moved = ~closes(asked.mechanism, found)
    assert 16 < moved.sum() < 48
    away = np.abs(found.q - states.q).max(axis=1)[moved]
    assert away.min() < 1e-5 and away.max() > 1e-3
