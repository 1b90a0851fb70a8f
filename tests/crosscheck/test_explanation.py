"""Lost digits are told from a wrong number, on chains whose M is as ill-conditioned as that of a real arm stretched out."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from catalogue import BUILT_IN
from support import cross_checked

from harness.crosscheck.assignment import Assignment, reference_kernel_of
from harness.crosscheck.expected import load_expectations
from harness.crosscheck.explanation import explain_lost_digits, written_columns
from harness.crosscheck.settings import Settings
from harness.engines import EQUATIONS, Subject, engine_files, load_engine
from harness.explain.columns import ChangeColumn, Whitening, diagnostic_states, watch
from harness.explain.fit import Projection, explaining_directions
from harness.explain.model_side import diagnose
from harness.explain.result import Finding
from harness.explain.search import Limits
from harness.files.model_file import parse_model
from harness.files.text.scan import Watch
from harness.programs.states import States
from harness.truth.compare import compare
from harness.truth.reference import Reference
from harness.verdict import AGREEMENT, Verdict

SEED = 3
# Every pair of the library that is expected to lose digits, of the engines that everybody has.
LOSING = sorted(
    (system, subject)
    for (system, subject), entry in load_expectations(BUILT_IN).entries.items()
    if entry.verdict == Verdict.UNSTABLE and subject != "lagrange" and not engine_files(BUILT_IN)[subject.partition("/")[0]].optional
)


@cache
def measured(system: str, subject: str) -> tuple[Watch, States, Reference, list[ChangeColumn]]:
    assignment = Assignment.of(BUILT_IN, system, Subject(*subject.split("/")))
    assert assignment.model is not None
    states = diagnostic_states(assignment.mechanism, SEED)
    watched = watch(load_engine(BUILT_IN, assignment.subject.engine), assignment.mechanism, assignment.model, states)
    reference = reference_kernel_of(assignment).evaluate(states)
    return watched, states, reference, written_columns(watched, reference)


@pytest.mark.parametrize(
    ("system", "subject"),
    [pytest.param(*pair, marks=[pytest.mark.nightly] if number % 3 < 2 else []) for number, pair in enumerate(LOSING)],
)
def test_any_number_ten_times_beyond_what_its_roundoff_can_show_is_no_lost_digit(system: str, subject: str) -> None:
    watched, _, reference, columns = measured(system, subject)
    unstable = 0
    for column in columns:
        assert column.change.start is not None
        # The least change that moves some answer by as much as agrees; ten times that.
        change = float(10 * AGREEMENT / np.linalg.norm(column.values, axis=1).max())
        # Of a flat body physics forbids one direction.
        either = (watched.accelerations(column.change.text(column.change.start + sign * change)) for sign in (1, -1))
        answers = next((one for one in either if one is not None), None)
        assert answers is not None, column.change.place
        verdicts = set(compare(reference, answers, factorises=True).verdicts)
        unstable += Verdict.UNSTABLE in verdicts and Verdict.DISAGREES not in verdicts
        residual = Whitening(reference).residual(answers)
        found = explaining_directions([Projection.of(reference, residual, [one.values for one in columns])])
        assert Verdict.DISAGREES in verdicts or found, column.change.place
    # Without the directions most of them would pass for lost digits, where those of M's condition are so many.
    assert unstable > 0.5 * len(columns) or reference.condition.max() < 100


@pytest.mark.parametrize(("system", "subject"), [*LOSING[-1:], ("chain_6", "mujoco/mjcf")])
def test_lost_digits_have_no_direction(system: str, subject: str) -> None:
    watched, _, reference, columns = measured(system, subject)
    residual = Whitening(reference).residual(watched.healthy)
    assert explaining_directions([Projection.of(reference, residual, [one.values for one in columns])]) == []


@pytest.mark.parametrize(
    ("system", "mass"),
    [
        ("chain_6", "1.5000000000015"),
        pytest.param("chain_12", "1.50000000015", marks=pytest.mark.nightly),
        ("chain_12", "1.500000000015"),
    ],
)
def test_a_wrong_mass_of_an_ill_conditioned_chain_is_red_and_named(tmp_path: Path, system: str, mass: str) -> None:
    """On twelve bars 1e-10 made 91 % of the states unstable instead of 7 %, and 1e-11 nothing that was told."""
    path = BUILT_IN.model_path(system, "mjcf")
    model = Assignment.of(BUILT_IN, system, Subject("mujoco", "mjcf")).model
    assert model is not None
    changed = tmp_path / path.name
    changed.write_text(model.text.replace('mass="1.5"', f'mass="{mass}"', 1))
    settings = Settings(library=BUILT_IN, names=[system], states=200, subjects=["mujoco/mjcf"], stand_ins={"mjcf": changed})
    [record], _ = cross_checked(settings)
    assert record.verdict == "disagrees"
    assert not record.as_expected
    assert f'line 9 <inertial mass="{mass}"> is too large by 1.5' in record.message


WRONG_ENGINE = """
from harness.crosscheck.scene import with_parameters
from harness.engines.adapters.lagrange import LagrangeModel

from harness.engines import Engine

class Engine(Engine):
    requires = ("heyoka", "heyoka")
    formats = ("equations",)
    factorises_mass_matrix = True

    def load(self, source, joints, gravity):
        name, value, unit = source.parameters[1]
        return LagrangeModel(with_parameters(source, {name: value * (1 + 1e-12)}))

ENGINE = Engine()
"""


@pytest.mark.ci
def test_a_parameter_of_the_equations_is_named(tmp_path: Path) -> None:
    sound = Assignment.of(BUILT_IN, "chain_6", Subject("lagrange", EQUATIONS))
    assert explain_lost_digits(sound, SEED, diagnostic_states(sound.mechanism, SEED, 1)) is None
    (tmp_path / "wrong.py").write_text(WRONG_ENGINE)
    wrong = replace(sound, library=replace(BUILT_IN, engines=tmp_path), subject=Subject("wrong", EQUATIONS))
    assert "unstable" in wrong.judge(diagnostic_states(sound.mechanism, SEED)).verdicts
    found = explain_lost_digits(wrong, SEED, diagnostic_states(wrong.mechanism, SEED, 1))
    assert found is not None
    name, value, unit = sound.mechanism.parameters[1]
    assert found.number == f"{name} = {value!r} {unit}"
    assert found.change == pytest.approx(1e-12 * value, rel=1e-2)


def test_an_engine_that_declares_no_factorisation_has_none_to_blame(tmp_path: Path) -> None:
    sound = Assignment.of(BUILT_IN, "chain_6", Subject("pinocchio", "mjcf"))
    assert sound.model is not None
    model = parse_model(sound.model.path, sound.model.text.replace('mass="1.5"', 'mass="1.5000000015"', 1), "mjcf")
    wrong = replace(sound, model=model)
    states = diagnostic_states(sound.mechanism, SEED)
    loaded = load_engine(BUILT_IN, "pinocchio").load(model, sound.mechanism.joints, sound.mechanism.gravity)
    answers = loaded.forward_dynamics(states.q, states.v, states.tau)
    assert set(compare(reference_kernel_of(wrong).evaluate(states), answers).verdicts) <= {"agrees", "disagrees"}


@pytest.mark.ci
def test_a_wrong_number_among_lost_digits_is_diagnosed() -> None:
    """By its direction: what is left without it are lost digits, which are more than agrees."""
    sound = Assignment.of(BUILT_IN, "chain_12", Subject("mujoco", "mjcf"))
    assert sound.model is not None
    model = parse_model(sound.model.path, sound.model.text.replace('mass="1.5"', 'mass="1.5000000015"', 1), "mjcf")
    states = diagnostic_states(sound.mechanism, SEED)
    watched = watch(load_engine(BUILT_IN, "mujoco"), sound.mechanism, model, states)
    found = diagnose(watched, reference_kernel_of(sound).evaluate(states), Limits(factorises=True))
    assert found.finding == Finding.EXPLAINED
    [mass, *_] = found.explaining
    assert (
        (mass.place.attribute, mass.place.line) == ("mass", 9) and mass.value == pytest.approx(1.5, rel=1e-11) and mass.residual > AGREEMENT
    )
