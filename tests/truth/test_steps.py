"""MuJoCo's integrators against the rules that it declares of them, and mistakes in a step."""

from __future__ import annotations

import copy
from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from catalogue import BUILT_IN, CALLED_HERE, TREES
from lxml import etree

from harness.arrays import Array
from harness.crosscheck.expected import load_expectations
from harness.engines import Model, NotOffered, load_engine
from harness.engines.coordinates import multiplied
from harness.errors import InvalidModel, InvalidRequest
from harness.files.model_file import ModelFile, parse_model, read_model
from harness.files.rules import ImplicitPart, StepRule
from harness.lagrange.derivation import load_mechanism
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.states import States
from harness.trees.mechanism import mechanism_of
from harness.trees.robot import robot_of
from harness.truth.compare import compare, farthest_block
from harness.truth.quantities import TruthBasis
from harness.truth.quantities.steps import CONVENTIONS, StepTruth
from harness.truth.sampling import generic_sample, sample
from harness.verdict import AGREEMENT

SEED, STATES = 3, 16
MUJOCO = load_engine(CALLED_HERE, "mujoco")
DAMPING = "0.3"
# Chains, branches, rotations with and without translation, springs and dampers in joints and on lengths.
TEN = [
    "arm_3r", "biped_five_link", "collar", "coupled_oscillators", "double_pendulum",
    "flyball_governor", "free_body", "heavy_top", "quadrotor", "satellite_wheel",
]  # fmt: skip


def model_of(name: str) -> ModelFile:
    return read_model(BUILT_IN.model_path(name, "mjcf"), "mjcf")


def damped(model: ModelFile, damping: str | None) -> ModelFile:
    """The model with so much damping in each joint; with none anywhere for None."""
    root = etree.fromstring(model.text.encode())
    for flag in root.iter("flag"):
        if damping is not None:
            flag.attrib.pop("damper", None)
    for element in root.iter("joint", "spatial", "fixed"):
        if damping is None:
            element.attrib.pop("damping", None)
        elif element.tag == "joint" and element.getparent().tag == "body":
            element.set("damping", damping)
    return parse_model(model.path, etree.tostring(root).decode(), "mjcf")


def between_branches() -> ModelFile:
    """Two sliders on the world, with a spring and damper between them, and dampers of their own."""
    file = damped(model_of("coupled_oscillators"), DAMPING)
    return parse_model(file.path, file.text.replace("<spatial", '<spatial damping="2"'), "mjcf")


class Setting:
    """A file as its own mechanism, its truth by MuJoCo's rules, and MuJoCo's model of it."""

    def __init__(self, file: ModelFile, rules: Callable[[StepRule], StepRule] = lambda rule: rule) -> None:
        self.mechanism: Mechanism = mechanism_of(robot_of(file, 9.81))
        self.truth = StepTruth(TruthBasis(self.mechanism, file, file, False, step_rules=tuple(map(rules, MUJOCO.step_rules(file)))))
        self.model = MUJOCO.load(file, self.mechanism.joints, 9.81)

    def judged(self, states: States | None = None) -> tuple[set[str], float, str]:
        """Verdicts, the largest backward error, and the block that is farthest off."""
        states = generic_sample(self.mechanism, STATES, SEED) if states is None else states
        certified, answers = self.truth.evaluate(states), self.truth.answers(self.model, states)
        found = compare(certified, answers)
        return set(found.verdicts.tolist()), float(found.backward_error.max()), self.truth.blocks[farthest_block(certified, answers)]


@pytest.mark.parametrize("damping", [None, DAMPING], ids=["undamped", "damped"])
@pytest.mark.parametrize("name", TEN)
def test_integrators_follow_their_rules_with_and_without_damping(name: str, damping: str | None) -> None:
    setting = Setting(damped(model_of(name), damping))
    assert len(setting.truth.blocks) == 10
    verdicts, worst, block = setting.judged(states=sample(setting.mechanism, STATES, SEED))
    assert verdicts == {"agrees"}, (worst, block)


@pytest.mark.parametrize("modelled_name", TREES)
def test_integrators_follow_their_rules_on_every_tree(modelled_name: str) -> None:
    mechanism, file = load_mechanism(BUILT_IN, modelled_name), model_of(modelled_name)
    truth = StepTruth(TruthBasis(mechanism, file, file, False, step_rules=MUJOCO.step_rules(file)))
    model, states = MUJOCO.load(file, mechanism.joints, mechanism.gravity), sample(mechanism, STATES, SEED)
    found = compare(truth.evaluate(states), truth.answers(model, states))
    known = load_expectations(BUILT_IN, "steps").entries.get((modelled_name, "mujoco/mjcf"))
    assert set(found.verdicts.tolist()) <= {"agrees"} | ({known.verdict} if known else set()), found.backward_error.max()
    assert found.backward_error.max() <= (known.backward_error if known else AGREEMENT)


# Where springs and dampers outweigh M, and where a body turns by a radian.
@pytest.mark.parametrize(("name", "length"), [("quarter_car", 0.05), ("flyball_governor", 1e-3), ("free_body", 0.05)])
def test_a_step_of_any_length_is_an_input(name: str, length: float) -> None:
    setting = Setting(model_of(name), lambda rule: replace(rule, length=length))
    verdicts, worst, block = setting.judged()
    assert verdicts == {"agrees"}, (worst, block)


def test_a_solver_that_stops_early_is_told_with_what_to_set() -> None:
    """By the file's own tolerance, where lengths bear most of the springs; to the end, the step is that of the rule."""
    setting = Setting(model_of("flyball_governor"), lambda rule: replace(rule, length=1e-5))
    verdicts, worst, _ = setting.judged()
    assert "disagrees" in verdicts and worst > 1e3
    states = sample(setting.mechanism, STATES, SEED)
    certified, found = setting.truth.evaluate(states), setting.truth.answers(setting.model, states)
    told = setting.truth.describe(certified, states, found, setting.model)
    assert "the engine stops its solver early: with <option iterations=" in told
    ended, _ = setting.model.to_the_end(2.0**-53)  # type: ignore[attr-defined]
    assert set(compare(certified, setting.truth.answers(ended, states)).verdicts.tolist()) == {"agrees"}


def test_what_is_solved_by_iteration_ends_finite() -> None:
    """With a tolerance of 0 MuJoCo's ``discrete`` divides zero by zero at some of these states."""
    mechanism, file = load_mechanism(BUILT_IN, "flyball_governor"), model_of("flyball_governor")
    states = sample(mechanism, 400, 0)
    model, rule = MUJOCO.load(file, mechanism.joints, mechanism.gravity), MUJOCO.step_rules(file)[-1]
    assert np.isfinite(model.step(states.q, states.v, states.tau, rule.length, rule.name)).all()  # type: ignore[attr-defined]


def test_a_turn_that_is_too_large_for_a_step_is_undecided() -> None:
    setting = Setting(model_of("free_body"), lambda rule: replace(rule, length=0.2))
    states = generic_sample(setting.mechanism, 2, SEED)
    states.v[0], states.v[1, 3:], states.tau[:] = 0.0, 20.0, 0.0
    assert setting.truth.evaluate(states).certified.tolist() == [True, False]


def test_a_version_without_an_integrator_does_not_offer_it(monkeypatch: pytest.MonkeyPatch) -> None:
    import mujoco

    setting = Setting(model_of("double_pendulum"))
    monkeypatch.delattr(mujoco.mjtIntegrator, "mjINT_DISCRETE")
    with pytest.raises(NotOffered, match=r"MuJoCo \S+ has no integrator discrete"):
        setting.truth.answers(setting.model, generic_sample(setting.mechanism, 1, SEED))


def test_a_version_of_other_rules_offers_no_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    import mujoco

    setting = Setting(model_of("double_pendulum"))
    monkeypatch.setattr(mujoco, "mj_versionString", lambda: "3.13.0")
    with pytest.raises(NotOffered, match="no rules of integrators are declared for MuJoCo"):
        setting.truth.answers(setting.model, generic_sample(setting.mechanism, 1, SEED))


def test_a_step_from_rest_is_certified() -> None:
    """Where nothing turns, the exponential of a rotation divides zero by zero in closed form."""
    setting = Setting(model_of("free_body"))
    states = generic_sample(setting.mechanism, 4, SEED)
    still = replace(states, v=np.zeros_like(states.v), tau=np.zeros_like(states.tau))
    assert setting.judged(states=still)[0] == {"agrees"}


def test_a_difference_of_positions_is_as_long_as_the_velocities_that_make_it_in_a_second() -> None:
    setting = Setting(model_of("free_body"))
    states = generic_sample(setting.mechanism, 4, SEED)
    certified, velocities = setting.truth.evaluate(states), np.random.default_rng(SEED).normal(size=(4, 6))
    quaternion = certified.high[:, 1, 6 + 3 :]
    rates = np.hstack([velocities[:, :3], multiplied(quaternion, np.hstack([np.zeros((4, 1)), velocities[:, 3:]])) / 2])
    vectors = np.zeros_like(certified.high)
    vectors[:, 0, :6], vectors[:, 1, 6:] = velocities, rates
    lengths = certified.lengths(vectors)
    np.testing.assert_allclose(lengths[:, 1], lengths[:, 0], rtol=1e-12)


# What makes the steps of another integrator.
MADE_BY = {
    "velocity terms explicit in implicit": ("implicit", "implicitfast"),
    "springs explicit in discrete": ("discrete", "implicitfast"),
}


class Spoiled:
    """MuJoCo's steps after a mistake."""

    def __init__(self, model: Model, mistake: str) -> None:
        self._model, self._mistake = model, mistake

    def step(self, q: Array, v: Array, tau: Array, length: float, integrator: str) -> Array:
        import mujoco

        model = copy.copy(self._model)
        if self._mistake == "dampers explicit in Euler" and integrator == "Euler":
            model.model = copy.copy(model.model)  # type: ignore[attr-defined]
            model.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_EULERDAMP  # type: ignore[attr-defined]
        takes = {
            "velocity terms explicit in implicit": ("implicit", "implicitfast"),
            "springs explicit in discrete": ("discrete", "implicitfast"),
        }
        asked, made = takes.get(self._mistake, ("", ""))
        after: Array = model.step(q, v, tau, length, made if integrator == asked else integrator)  # type: ignore[attr-defined]
        if self._mistake == "positions by the old velocities" and integrator == "Euler":
            after[:, : q.shape[1]] = q + length * v
        elif self._mistake == "velocities not advanced" and integrator == "Euler":
            after[:, q.shape[1] :] = v
        elif self._mistake in TURNED and integrator == "implicit":
            place = TURNED[self._mistake]
            after[:, place] = multiplied(multiplied(conjugate(q[:, place]), after[:, place]), q[:, place])
        elif self._mistake == "scalar last" and integrator == "RK4":
            after[:, :4] = after[:, [1, 2, 3, 0]]
        elif self._mistake == "a rounding too many" and integrator == "discrete":
            after *= 1 + 1e-13
        return after


def conjugate(q: Array) -> Array:
    return q * [1.0, -1.0, -1.0, -1.0]


# The quaternion in q; other positions stand before and behind the second one.
TURNED = {"turned about the world's axes": slice(0, 4), "turned about the world's axes, with a wheel": slice(3, 7)}
# Each on a mechanism that feels it, with the block that is then farthest off, and what is said of it.
MISTAKES = {
    "dampers explicit in Euler": ("double_pendulum", "velocities", "Euler", "it takes joint dampers explicitly, which are implicit"),
    "velocity terms explicit in implicit": (
        "double_pendulum",
        "velocities",
        "implicit",
        "the step is that by Euler and implicitfast and discrete",
    ),
    "springs explicit in discrete": (
        "coupled_oscillators",
        "velocities",
        "discrete",
        "the step is that by Euler and implicit and implicitfast",
    ),
    "positions by the old velocities": ("arm_3r", "positions", "Euler", "positions follow with the velocities before the step"),
    "velocities not advanced": ("arm_3r", "velocities", "Euler", ""),
    "turned about the world's axes": ("heavy_top", "positions", "implicit", "rotations turn about the world's axes"),
    "turned about the world's axes, with a wheel": ("satellite_wheel", "positions", "implicit", "rotations turn about the world's axes"),
    "scalar last": ("heavy_top", "positions", "RK4", "quaternions have their scalar last"),
    "a rounding too many": ("arm_3r", "positions", "discrete", ""),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_in_a_step_disagrees_and_is_named(mistake: str) -> None:
    name, what, integrator, sentence = MISTAKES[mistake]
    setting = Setting(damped(model_of(name), DAMPING))
    states = generic_sample(setting.mechanism, STATES, SEED)
    certified = setting.truth.evaluate(states)
    spoiled: Any = Spoiled(setting.model, mistake)
    answers = setting.truth.answers(spoiled, states)
    found = compare(certified, answers)
    assert set(found.verdicts.tolist()) == {"disagrees"} and found.backward_error.max() > 2 * AGREEMENT
    expected = "; ".join(filter(None, [f"Farthest off are the {what} after a step by {integrator}", sentence]))
    assert setting.truth.describe(certified, states, answers, spoiled) == expected


PARTS = {
    ImplicitPart.JOINT_DAMPERS: "double_pendulum",
    ImplicitPart.LINE_DAMPERS: "coupled_oscillators",
    ImplicitPart.VELOCITY_TERMS: "double_pendulum",
    ImplicitPart.VELOCITY_TERMS_OF_FREE_BODIES: "free_body",
    ImplicitPart.JOINT_SPRINGS: "quarter_car",
    ImplicitPart.LINE_SPRINGS: "coupled_oscillators",
}


@pytest.mark.parametrize("part", PARTS)
def test_every_part_of_a_rule_is_felt(part: ImplicitPart) -> None:
    """A rule without it is another map, of which MuJoCo is far off."""
    file = between_branches() if part is ImplicitPart.LINE_DAMPERS else damped(model_of(PARTS[part]), DAMPING)
    assert Setting(file).judged()[0] == {"agrees"}
    verdicts, worst, block = Setting(file, lambda rule: replace(rule, implicit=rule.implicit - {part})).judged()
    assert "disagrees" in verdicts and worst > 1e3 * AGREEMENT and block.startswith("velocities")


def test_dampers_across_branches_are_explicit_in_implicitfast() -> None:
    file = between_branches()
    assert Setting(file).judged()[0] == {"agrees"}
    verdicts, _, block = Setting(file, lambda rule: replace(rule, along_branches=False)).judged()
    assert verdicts == {"disagrees"} and block in {f"velocities after a step by {name}" for name in ("implicit", "implicitfast")}


def test_the_flag_eulerdamp_and_the_step_length_are_those_of_the_file() -> None:
    plain = damped(model_of("double_pendulum"), DAMPING)
    file = parse_model(plain.path, plain.text.replace("<flag", '<flag eulerdamp="disable"', 1), "mjcf")
    assert {rule.name: rule for rule in MUJOCO.step_rules(file)}["Euler"].implicit == frozenset()
    assert Setting(file).judged()[0] == {"agrees"}
    loop = model_of("four_bar")
    text = loop.text.replace("<option", '<option timestep="0.01"', 1)
    assert {rule.length for rule in MUJOCO.step_rules(parse_model(loop.path, text, "mjcf"))} == {0.01}


def test_numbers_that_do_not_move_as_the_energies_say_are_no_truth() -> None:
    declared = model_of("arm_2r")
    wrong = parse_model(declared.path, declared.text.replace('mass="3"', 'mass="3.0000001"'), "mjcf")
    mechanism = load_mechanism(BUILT_IN, "arm_2r")
    truth = StepTruth(TruthBasis(mechanism, wrong, wrong, False, step_rules=MUJOCO.step_rules(wrong)))
    with pytest.raises(InvalidModel, match=r"arm_2r.xml.*data roundoffs from those of the energies, expected up to 64"):
        truth.evaluate(generic_sample(mechanism, 5, SEED))


def test_what_has_no_declared_map_is_not_offered() -> None:
    loop, floating = load_mechanism(BUILT_IN, "four_bar"), load_mechanism(BUILT_IN, "free_body")
    rules = MUJOCO.step_rules(model_of("four_bar"))
    cases = {
        "compared by harness compare --steps": TruthBasis(floating, None, None, False),
        "documents no integrator": TruthBasis(floating, model_of("free_body"), model_of("free_body"), False),
        "under constraints": TruthBasis(loop, model_of("four_bar"), model_of("four_bar"), False, step_rules=rules),
        "in the body's frame": TruthBasis(floating, model_of("free_body"), model_of("free_body"), True, step_rules=rules),
    }
    for reason, question in cases.items():
        with pytest.raises(NotOffered, match=reason):
            StepTruth(question)


def test_a_rule_with_stages_has_a_weight_for_each_and_nothing_implicit() -> None:
    half = Fraction(1, 2)
    assert StepRule("midpoint", 0.1, stages=((half,),), weights=(Fraction(0), Fraction(1)))
    for wrong in ({"weights": (Fraction(1),)}, {"implicit": frozenset({ImplicitPart.JOINT_DAMPERS})}, {"with_old_velocities": True}):
        with pytest.raises(InvalidRequest, match="'wrong' has stages; expected a weight for each and the start, and nothing else"):
            StepRule("wrong", 0.1, **{"stages": ((half,),), "weights": (Fraction(0), Fraction(1)), **wrong})  # type: ignore[arg-type]


def test_a_quaternion_of_another_convention_is_turned_back() -> None:
    before, after = np.array([[0.8, 0.6, 0.0, 0.0]]), np.array([[0.5, -0.1, 0.7, 0.5]])
    made = {
        "quaternions have their scalar last": after[:, [1, 2, 3, 0]],
        "quaternions are those of the inverse rotations": np.array([[0.5, 0.1, -0.7, -0.5]]),
        # The turn from before to after is about the body's axes, and was taken for one about the world's.
        "rotations turn about the world's axes": multiplied(multiplied(before * [1, -1, -1, -1], after), before),
    }
    assert made.keys() == CONVENTIONS.keys()
    for name, wrong in made.items():
        np.testing.assert_allclose(CONVENTIONS[name](wrong, before), after, atol=1e-15, err_msg=name)
