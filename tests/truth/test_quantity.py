"""Certified values of other quantities than accelerations: their data roundoff, and the judgement of answers."""

from __future__ import annotations

from typing import Any

import flint
import numpy as np
import pytest
from catalogue import BUILT_IN, TREES, is_misread
from free_bodies import BoundFreeBodies, free_bodies

from harness.arrays import Array
from harness.engines import Call, Calls, InvalidAnswer, Model, NotOffered, Subject, load_engine, timed_answers_of
from harness.errors import InvalidModel
from harness.files.model_file import ModelFile, parse_model, read_model
from harness.lagrange.derivation import load_mechanism
from harness.programs.kernels import BallKernel
from harness.programs.numbers import UNIT_ROUNDOFF
from harness.programs.program import StraightLineProgram
from harness.programs.states import States
from harness.trees.robot import tree_of
from harness.truth.blocks import Between, QuantityKernel
from harness.truth.compare import Certified, compare
from harness.truth.quantities import TruthBasis, find_quantities
from harness.truth.quantities.reactions import ReactionTruth
from harness.truth.sampling import generic_sample, sample
from harness.verdict import AGREEMENT

BITS = 256
STEP = 2.0**-40
SEED = 5
# Subjects and what is turned to spoil them; a fault must be seen in nearly all states.
SPOILED = ("puma_560", "furuta_pendulum", "cart_double_pendulum")


def model_of(name: str, model_format: str) -> ModelFile:
    return read_model(BUILT_IN.model_path(name, model_format), model_format)


def truth_of(name: str, read: ModelFile | None = None, declared: ModelFile | None = None, in_body: bool = False) -> ReactionTruth:
    declared = declared or model_of(name, "mjcf")
    return ReactionTruth(TruthBasis(load_mechanism(BUILT_IN, name), declared, read or declared, in_body))


def loaded(name: str, engine: str, model: ModelFile) -> Model:
    mechanism = load_mechanism(BUILT_IN, name)
    return load_engine(BUILT_IN, engine).load(model, mechanism.joints, mechanism.gravity)


# A program of its own: the product of an input and a value between, and a difference that is zero whatever they are.
PRODUCT = StraightLineProgram(("x", "y"), (("input", 0), ("input", 1), ("mul", 0, 1), ("sub", 2, 2)), {"product": (2,), "nothing": (3,)})
SIZES = StraightLineProgram(("x", "y"), (("input", 0), ("input", 1), ("mul", 0, 1)), {"product": (2,), "nothing": (2,)})


def product(
    x: float, y: float, *, low: float = 0.0, radius: float = 0.0, slope: float = 0.0, sizes: StraightLineProgram | None = None
) -> Certified:
    """x (y + low) at y = y(x, w) with dy/dx = slope and dy/dw = 3, at w = 7."""
    between = Between(
        np.array([[y]]), np.array([[low]]), np.array([[radius]]), np.array([[7.0]]), np.array([[[slope, 0.0, 3.0]]]), np.zeros((1, 1, 1)),
        np.array([True]),
    )  # fmt: skip
    return QuantityKernel(PRODUCT, [[0], [1]], slice(1, 2), sizes).evaluate(np.array([[x, y]]), between)


def test_data_roundoff_goes_through_the_values_between() -> None:
    found = product(2.0, 5.0, slope=0.25)
    # By x directly and through y, by w through y; what y passes on by itself; and y rounded.
    assert found.sensitivity[0, 0] == pytest.approx((5.0 + 2.0 * 0.25) * 2.0 + 2.0 * 3.0 * 7.0 + 2.0 * (0.25 * 2.0 + 3.0 * 7.0) + 2.0 * 5.0)
    assert found.high[0].tolist() == [[10.0], [0.0]]
    assert found.certified.all()


def test_what_is_not_certified_before_is_not_certified_after() -> None:
    coarse, fine = (product(2.0, 5.0, radius=radius, sizes=SIZES) for radius in (1e-10, 1e-25))
    assert (coarse.certified.all(), fine.certified.all()) == (False, True)
    assert compare(coarse, coarse.high).verdicts.tolist() == ["undecided"]


def test_values_between_have_all_their_digits() -> None:
    found = product(2.0, 5.0, low=2.0**-60)
    assert (found.high[0, 0].tolist(), found.low[0, 0].tolist()) == ([10.0], [2.0**-59])


@pytest.mark.parametrize("longest", [1e-9, 1e-15])
def test_a_length_whose_roundings_are_as_large_is_not_certified(longest: float) -> None:
    """Equal parts of a block cancel in its length but for a share of them."""
    factor = np.array([[[1.0, -1.0], [0.0, longest]]])
    found = QuantityKernel(PRODUCT, [[0, 0]]).evaluate(np.array([[2.0, 5.0]]), norm_factor=factor)
    assert found.certified.tolist() == [longest == 1e-9]
    assert found.sensitivity[0, 0] == pytest.approx(2 * 10 * longest, rel=1e-6)


@pytest.mark.parametrize(("roundoffs", "verdict"), [(63.5, "agrees"), (64.5, "disagrees")])
def test_sixty_four_data_roundoffs_are_allowed(roundoffs: float, verdict: str) -> None:
    found = product(2.0, 5.0)
    answers = found.high + np.array([[roundoffs * UNIT_ROUNDOFF * found.sensitivity[0, 0]], [0.0]])
    assert compare(found, answers).verdicts.tolist() == [verdict]


def test_an_error_is_counted_in_data_roundoffs_of_the_worst_block() -> None:
    found = product(2.0, 5.0, slope=0.25)
    answers = found.high.copy()
    answers[0, 0, 0] += 40 * UNIT_ROUNDOFF * found.sensitivity[0, 0]
    assert compare(found, answers).backward_error[0] == pytest.approx(40, rel=0.2)
    answers[0, 0, 0] += 40 * UNIT_ROUNDOFF * found.sensitivity[0, 0]
    assert compare(found, answers).verdicts.tolist() == ["disagrees"]
    assert compare(found, np.full_like(answers, np.nan)).verdicts.tolist() == ["error"]


def test_what_cancels_is_granted_where_its_size_is_known_and_never_without() -> None:
    answers = np.array([[[10.0], [1e-15]]])
    assert compare(product(2.0, 5.0), answers).verdicts.tolist() == ["disagrees"]
    comparison = compare(product(2.0, 5.0, sizes=SIZES), answers)
    assert comparison.verdicts.tolist() == ["agrees"] and comparison.granted.all()
    assert compare(product(2.0, 5.0, sizes=SIZES), answers * 1.0001).verdicts.tolist() == ["disagrees"]


class Differences:
    """Reactions and accelerations of one file in balls, at inputs and numbers that need be no float64."""

    def __init__(self, name: str) -> None:
        mechanism, self.truth = load_mechanism(BUILT_IN, name), truth_of(name)
        self.equations = free_bodies(tree_of(model_of(name, "mjcf"), mechanism.gravity), mechanism.joints)
        self.joints = [self.equations.joints.index(joint) for joint in self.truth._transmitting]
        self.numbers = [flint.arb(float(value)) for value in self.equations.parameters]
        self._free = BallKernel(self.equations.program, 0).bind(())
        self._second = self.truth._written.in_balls()

    def both(self, inputs: list[flint.arb], numbers: list[flint.arb]) -> tuple[Any, Any]:
        """Reactions in the order of the certified ones, and accelerations, by the free bodies."""
        found = BoundFreeBodies(self.equations, lambda *others: self._free(*others, *numbers)).solve([*inputs, flint.arb(0)])
        blocks = np.array([found["forces"], found["moments"]]).reshape(2, -1, 3)
        return blocks[:, self.joints].reshape(-1), np.array(found["accelerations"])

    def passed_on(self, positions_and_rates: list[flint.arb], accelerations: Any, change: Any) -> Any:
        """What a change of the accelerations does to the reactions, which are linear in them."""
        moved, still = (
            np.array(self._second(*positions_and_rates, *a, flint.arb(0))["values"]) for a in (accelerations + change, accelerations)
        )
        return moved - still


@pytest.mark.parametrize("name", ["furuta_pendulum", "collar", "arm_3r"])
def test_data_roundoff_is_that_of_both_steps_and_of_the_second_alone(name: str) -> None:
    """By differences of the free bodies, which have no derivative, and accelerations not before reactions but beside them."""

    def lengths(change: Any) -> Array:
        return np.asarray(np.linalg.norm(change.astype(np.float64).reshape(-1, 3), axis=1))

    states = generic_sample(load_mechanism(BUILT_IN, name), 1, SEED)
    with flint.ctx.workprec(BITS):
        differences = Differences(name)
        inputs = [flint.arb(value) for value in (*states.q[0].tolist(), *states.v[0].tolist(), *states.tau[0].tolist())]
        moving, values = inputs[: -states.v.shape[1]], [*inputs, *differences.numbers]
        _, accelerations = differences.both(inputs, differences.numbers)
        expected = np.zeros(2 * len(differences.joints))
        for which in range(len(values)):
            sides = []
            for step in (STEP, -STEP):
                changed = [value * (1 + step * (place == which)) for place, value in enumerate(values)]
                sides.append(differences.both(changed[: len(inputs)], changed[len(inputs) :]))
            reaction, acceleration = ((more - less) / flint.arb(2 * STEP) for more, less in zip(*sides, strict=True))
            expected += lengths(reaction) + lengths(differences.passed_on(moving, accelerations, acceleration))
        for place, value in enumerate(accelerations):
            rounded = np.array([value * (place == other) for other in range(len(accelerations))])
            expected += lengths(differences.passed_on(moving, accelerations, rounded))
    np.testing.assert_allclose(differences.truth.evaluate(states).sensitivity[0], expected, rtol=1e-9)


# Under constraints engines go by laws of their own: tests/truth/test_reactions_tied.py.
@pytest.mark.parametrize("modelled_name", TREES)
def test_engines_and_formats_agree_on_what_joints_transmit(modelled_name: str) -> None:
    mechanism = load_mechanism(BUILT_IN, modelled_name)
    states = sample(mechanism, 64, SEED)
    for engine, in_body in (("mujoco", False), ("pinocchio", bool(mechanism.charts_in_body))):
        for model_format in ("mjcf", "urdf"):
            read = model_of(modelled_name, model_format)
            if is_misread(Subject(engine, model_format), mechanism):
                continue
            try:
                truth = truth_of(modelled_name, read, in_body=in_body)
                model = loaded(modelled_name, engine, read)
            except NotOffered:
                assert len(set(mechanism.joints)) == 1
                continue
            except Exception as error:
                assert type(error).__name__ == "Unsupported", error
                continue
            comparison = compare(truth.evaluate(states), truth.answers(model, states))
            assert set(comparison.verdicts.tolist()) == {"agrees"}, (engine, model_format, comparison.backward_error.max())


class Spoiled:
    """An engine's reactions after a mistake."""

    def __init__(self, model: Model, mistake: str) -> None:
        self._model, self._mistake = model, mistake

    def reactions(self, q: Array, v: Array, tau: Array) -> Array:
        found: Array = self._model.reactions(q, v, tau)  # type: ignore[attr-defined]
        if self._mistake == "sign of the moments":
            found[:, :, 3:] *= -1
        elif self._mistake == "child on parent":
            found *= -1
        elif self._mistake == "last joint turned":
            angle = q[:, -1]
            turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]).transpose(2, 0, 1)
            for first in (0, 3):
                plane = found[:, -1, [first, first + 2]]
                found[:, -1, [first, first + 2]] = np.einsum("nij,nj->ni", turn, plane)
        else:
            found *= 1 + 1e-13
        return found


@pytest.mark.parametrize("mistake", ["sign of the moments", "child on parent", "last joint turned"])
@pytest.mark.parametrize("name", SPOILED)
def test_a_wrong_convention_disagrees(name: str, mistake: str) -> None:
    truth, states = truth_of(name), generic_sample(load_mechanism(BUILT_IN, name), 20, SEED)
    certified = truth.evaluate(states)
    for engine in ("mujoco", "pinocchio"):
        model = loaded(name, engine, model_of(name, "mjcf"))
        assert set(compare(certified, truth.answers(model, states)).verdicts.tolist()) == {"agrees"}
        spoiled = compare(certified, truth.answers(Spoiled(model, mistake), states))  # type: ignore[arg-type]
        assert set(spoiled.verdicts.tolist()) == {"disagrees"}
        assert (spoiled.backward_error > 1e6 * AGREEMENT).all()


# What no acceleration feels, with what it is replaced by.
UNFELT = {
    "the arm's centre of mass along its vertical axis": ("furuta_pendulum", 'pos="0.15 0 0" mass', 'pos="0.15 0 1e-9" mass'),
    # MuJoCo leaves out what is nearer to the origin than 1e-6 m.
    "the cart's centre of mass": ("cart_pendulum", 'pos="0 0 0" mass="10"', 'pos="1e-5 0 0" mass="10"'),
    "mass at an elbow, from one link to the other": (
        "arm_2r",
        ('pos="0.22 0 0" mass="3" diaginertia="1e-15 0.07 0.07"', 'pos="0.18 0 0" mass="2" diaginertia="1e-15 0.04 0.04"'),
        (
            'pos="0.24153846153846154 0 0" mass="3.25" diaginertia="1e-15 0.08809230769230769 0.08809230769230769"',
            'pos="0.2057142857142857 0 0" mass="1.75" diaginertia="1e-15 0.03074285714285714 0.03074285714285714"',
        ),
    ),
}


@pytest.mark.parametrize("fault", UNFELT)
def test_what_no_acceleration_feels_is_felt_by_a_reaction(fault: str) -> None:
    name, old, new = UNFELT[fault]
    declared = model_of(name, "mjcf")
    text = declared.text
    for one, other in zip([old] if isinstance(old, str) else old, [new] if isinstance(new, str) else new, strict=True):
        assert one in text
        text = text.replace(one, other)
    read = parse_model(declared.path, text, "mjcf")
    states = generic_sample(load_mechanism(BUILT_IN, name), 20, SEED)
    # The file that the engine reads is as true to the energies as the declared one.
    truth_of(name, declared=read).evaluate(states)
    truth = truth_of(name, read)
    for engine in ("mujoco", "pinocchio"):
        found = compare(truth.evaluate(states), truth.answers(loaded(name, engine, read), states))
        assert set(found.verdicts.tolist()) == {"disagrees"}, found.backward_error


@pytest.mark.parametrize(("near", "far"), [(0.03, 0.02), (0.02 + 1e-10, 0.03)], ids=["moved", "added"])
def test_mass_on_an_axis_is_felt_where_bodies_are_fixed_to_one_another(near: float, far: float) -> None:
    """Points of mass on a level axis turn without being felt by the motion, and bear on the pin by weight and arm."""
    plain, point = model_of("bar_pendulum", "mjcf"), '<inertial pos="0 0 0" mass="{}" diaginertia="0 0 0"/>'
    fixed = '<body name="{}" pos="0 {} 0">' + point + "</body>"
    place = plain.text.index("</body>")

    def with_masses(*masses: float) -> ModelFile:
        bodies = [fixed.format(*one) for one in zip(("near", "far"), (0.1, 0.2), masses, strict=True)]
        return parse_model(plain.path, plain.text[:place] + "".join(bodies) + plain.text[place:], "mjcf")

    declared, states = with_masses(0.02, 0.03), generic_sample(load_mechanism(BUILT_IN, "bar_pendulum"), 20, SEED)
    for read, verdict in ((declared, "agrees"), (with_masses(near, far), "disagrees")):
        truth = truth_of("bar_pendulum", read, declared)
        for engine in ("mujoco", "pinocchio"):
            found = compare(truth.evaluate(states), truth.answers(loaded("bar_pendulum", engine, read), states))
            assert set(found.verdicts.tolist()) == {verdict}, engine


def test_points_elsewhere_on_an_axis_are_no_difference() -> None:
    """The moment about another point is another one, and each reader is asked about the points of its file."""
    declared = model_of("arm_2r", "mjcf")
    read = parse_model(declared.path, declared.text.replace('<joint name="elbow"', '<joint pos="0 0.25 0" name="elbow"'), "mjcf")
    states = generic_sample(load_mechanism(BUILT_IN, "arm_2r"), 20, SEED)
    for engine in ("mujoco", "pinocchio"):
        answers = truth_of("arm_2r", read).answers(loaded("arm_2r", engine, read), states)
        assert set(compare(truth_of("arm_2r", read).evaluate(states), answers).verdicts.tolist()) == {"agrees"}
        assert set(compare(truth_of("arm_2r").evaluate(states), answers).verdicts.tolist()) == {"disagrees"}


def test_numbers_that_do_not_move_as_the_energies_say_are_no_truth() -> None:
    declared = model_of("arm_2r", "mjcf")
    wrong = parse_model(declared.path, declared.text.replace('mass="3"', 'mass="3.0000001"'), "mjcf")
    states = generic_sample(load_mechanism(BUILT_IN, "arm_2r"), 5, SEED)
    with pytest.raises(InvalidModel, match=r"arm_2r.xml.*data roundoffs from those of the energies, expected up to 64"):
        truth_of("arm_2r", declared=wrong).evaluate(states)


def test_mechanisms_that_only_float_have_no_reactions() -> None:
    with pytest.raises(NotOffered, match="all are free"):
        truth_of("free_body")


def test_answers_of_another_shape_are_refused() -> None:
    mechanism = load_mechanism(BUILT_IN, "arm_2r")
    states = generic_sample(mechanism, 3, SEED)

    class Short:
        def reactions(self, q: Array, v: Array, tau: Array) -> Array:
            return np.zeros((len(q), 2, 3))

    asked = [Calls((Call("reactions", (states.q, states.v, states.tau), (3, 2, 6)),))]
    with pytest.raises(InvalidAnswer, match=r"an array of shape \(3, 2, 3\) of float64; expected an array of shape \(3, 2, 6\)"):
        timed_answers_of(Short(), asked)  # type: ignore[arg-type]
    with pytest.raises(NotOffered, match="offers no reactions"):
        timed_answers_of(object(), asked)  # type: ignore[arg-type]


def test_every_quantity_is_found_by_its_name() -> None:
    found = find_quantities()
    assert all(quantity.name == name for name, quantity in found.items())
    assert {"reactions", "mass_matrix", "inverse_dynamics", "energy", "jacobian"} <= set(found)


def test_a_state_that_is_not_finite_is_undecided() -> None:
    mechanism = load_mechanism(BUILT_IN, "arm_2r")
    states = generic_sample(mechanism, 2, SEED)
    tau = states.tau.copy()
    tau[1, 0] = np.inf
    found = truth_of("arm_2r").evaluate(States.at(states.q, states.v, tau))
    assert found.certified.tolist() == [True, False]
