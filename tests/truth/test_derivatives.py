"""Certified derivatives of forward and inverse dynamics: against differences in many digits, against engines, and with mistakes."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import flint
import numpy as np
import pytest
from catalogue import BUILT_IN, TREES, is_misread

from harness.arrays import Array
from harness.crosscheck.expected import load_expectations
from harness.engines import EQUATIONS, InvalidAnswer, Model, NotOffered, Subject, Unsupported, load_model
from harness.engines.coordinates import rotations
from harness.files.model_file import parse_model, read_model
from harness.lagrange.derivation import load_mechanism
from harness.programs.kernels import BallKernel, solve_symmetric
from harness.programs.mechanisms.dynamics_derivatives import forward_dynamics_derivatives
from harness.programs.mechanisms.kernel import Charts
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.program import right_hand_side, upper_triangle
from harness.programs.states import States
from harness.trees.mechanism import mechanism_of
from harness.trees.robot import robot_of
from harness.truth.compare import Certified, compare
from harness.truth.quantities.derivatives import FORWARD, INVERSE, DerivativeTruth, Dynamics, coordinate_names
from harness.truth.sampling import generic_sample, sample

SEED, BITS = 7, 512
# Of a rate in the differences, whose error is its square.
STEP = 2.0**-120
DYNAMICS = [pytest.param(dynamics, id=dynamics.method) for dynamics in (FORWARD, INVERSE)]


def truth_of(name: str, dynamics: Dynamics, in_body: bool = False) -> DerivativeTruth:
    return DerivativeTruth(dynamics, load_mechanism(BUILT_IN, name), in_body)


def loaded(name: str, subject: Subject) -> Model:
    file = None if subject.format == EQUATIONS else read_model(BUILT_IN.model_path(name, subject.format), subject.format)
    return load_model(BUILT_IN, subject, load_mechanism(BUILT_IN, name), file)


# Differences of the equations, by exact motions along one velocity after the other: exponentials of rotations, and no derivative.


def moved(mechanism: Mechanism, in_body: bool, q: list[Any], column: int, step: Any) -> list[Any]:
    """Positions q, in balls, after the motion at the unit velocity ``column`` over the time ``step``."""
    q, place = list(q), 0
    for joint, (positions, velocities) in mechanism.joint_sizes.items():
        first = mechanism.joints.index(joint)
        if first <= column < first + velocities:
            axis = (column - first) % 3
            if positions == velocities:
                q[place + column - first] += step
            elif column - first < velocities - 3:
                # Along the body's axis, which is the image of the unit vector under the rotation.
                w, *r = q[place + 3 : place + 7]
                unit = [flint.arb(int(row == axis)) for row in range(3)]
                turned = product(product([w, *r], [flint.arb(0), *unit]), [w, *(-part for part in r)])
                length = w * w + sum(part * part for part in r)
                for row in range(3):
                    q[place + row] += step * (turned[1 + row] / length if in_body else unit[row])
            else:
                turn = [(step / 2).cos(), *(((step / 2).sin() if row == axis else flint.arb(0)) for row in range(3))]
                q[place + positions - 4 : place + positions] = product(q[place + positions - 4 : place + positions], turn)
        place += positions
    return q


def product(one: list[Any], other: list[Any]) -> list[Any]:
    """Of quaternions (w, x, y, z)."""
    a, b, c, d = one
    e, f, g, h = other
    return [a * e - b * f - c * g - d * h, a * f + b * e + c * h - d * g, a * g - b * h + c * e + d * f, a * h + b * g - c * f + d * e]


def result(mechanism: Mechanism, evaluate: Callable[..., tuple[Any, ...]], dynamics: Dynamics, q: Any, v: Any, third: Any) -> list[Any]:
    """The accelerations, or the forces, in balls."""
    nv = mechanism.nv
    found = iter(evaluate(*q, *v, *third, flint.arb(0)))
    outputs = {name: [next(found) for _ in places] for name, places in mechanism.program.outputs.items()}
    if not dynamics.is_inverse:
        return solve_symmetric(outputs["mass"], right_hand_side(outputs, third))
    entries = dict(zip(upper_triangle(nv), outputs["mass"], strict=True))
    rows = [[entries[min(i, j), max(i, j)] for j in range(nv)] for i in range(nv)]
    inertial = [sum((entry * a for entry, a in zip(row, third, strict=True)), flint.arb(0)) for row in rows]
    return [one - rest for one, rest in zip(inertial, right_hand_side(outputs), strict=True)]


# A joint behind four positions of three velocities, which is felt.
BALL_AND_HINGE = """<mujoco model="m"><worldbody>
<body name="arm"><joint name="ball" type="ball"/><inertial pos=".1 .2 .3" mass="2" diaginertia=".2 .3 .4"/>
<body name="hand" pos=".3 .1 0"><joint name="hinge" axis="0 .6 .8"/><inertial pos=".2 0 .1" mass="1" diaginertia=".1 .2 .25"/></body>
</body></worldbody></mujoco>"""


def mechanism_called(name: str) -> Mechanism:
    if name != "ball_and_hinge":
        return load_mechanism(BUILT_IN, name)
    return mechanism_of(robot_of(parse_model(Path("m.xml"), BALL_AND_HINGE, "mjcf"), 9.81))


@pytest.mark.parametrize("dynamics", DYNAMICS)
@pytest.mark.parametrize(
    ("name", "in_body"),
    [
        ("ball_and_hinge", False),
        ("arm_3r", False),
        ("collar", False),
        ("heavy_top", False),
        ("free_body", False),
        ("free_body", True),
        ("satellite_wheel", True),
    ],
)
def test_derivatives_are_the_limit_of_differences(name: str, in_body: bool, dynamics: Dynamics) -> None:
    mechanism = mechanism_called(name)
    truth = DerivativeTruth(dynamics, mechanism, in_body)
    states, nv = generic_sample(mechanism, 1, SEED), mechanism.nv
    certified = truth.evaluate(states)
    assert certified.certified.all()
    third = truth.third(states)[0].tolist()
    charts = Charts(mechanism.charts(in_body))
    program = charts.programs[charts.at(states.q[0])]
    with flint.ctx.workprec(BITS):
        evaluate = BallKernel(program, len(mechanism.parameters)).bind(mechanism.parameter_values)
        vectors = [[flint.arb(value) for value in part] for part in (states.q[0].tolist(), states.v[0].tolist(), third)]
        for block in range(3 * nv):
            part, column = divmod(block, nv)
            sides = []
            for step in (flint.arb(STEP), -flint.arb(STEP)):
                changed = [list(vector) for vector in vectors]
                if part == 0:
                    changed[0] = moved(mechanism, in_body, vectors[0], column, step)
                else:
                    changed[part][column] += step
                sides.append(result(mechanism, evaluate, dynamics, *changed))
            slopes = [(more - less) / (2 * flint.arb(STEP)) for more, less in zip(*sides, strict=True)]
            highs, lows = certified.high[0, block].tolist(), certified.low[0, block].tolist()
            errors = [float(abs(slope - high - low)) for slope, high, low in zip(slopes, highs, lows, strict=True)]
            assert max(errors) <= 2.0**-90 * (certified.sensitivity + certified.share)[0, block], truth.blocks[block]


def test_data_roundoff_is_that_of_the_second_derivatives() -> None:
    """By differences of the certified derivatives themselves, at inputs that are moved by themselves times a step."""
    mechanism = load_mechanism(BUILT_IN, "arm_2r")
    states, step = generic_sample(mechanism, 1, SEED), 2.0**-20
    truth = truth_of("arm_2r", FORWARD)
    certified = truth.evaluate(states)
    expected = np.zeros(len(truth.blocks))
    row = mechanism.inputs(states)[:, 0]
    for place, value in enumerate(row.tolist()):
        sides = []
        for sign in (1, -1):
            changed = row.copy()
            changed[place] = value * (1 + sign * step)
            sides.append(at_inputs(mechanism, changed))
        (more, less), width = sides, 2 * step
        expected += np.linalg.norm((more - less) / width @ certified.norm_factor[0].T, axis=1)
    np.testing.assert_allclose(certified.sensitivity[0], expected, rtol=1e-7)


def at_inputs(mechanism: Mechanism, row: Array) -> Array:
    """The blocks at one row of the program's inputs."""
    program = forward_dynamics_derivatives(mechanism, mechanism.program)
    return np.array([float(ball) for ball in BallKernel(program, 0).bind(())(*row.tolist())]).reshape(-1, mechanism.nv)


# Engines.

# Every subject here has what a quantity asks of it, or refuses it by name.
SUBJECTS = [Subject("lagrange", EQUATIONS), *(Subject("pinocchio", model_format) for model_format in ("urdf", "mjcf"))]


@pytest.mark.parametrize("dynamics", DYNAMICS)
@pytest.mark.parametrize("modelled_name", TREES)
def test_engines_agree_or_are_expected_not_to(modelled_name: str, dynamics: Dynamics) -> None:
    mechanism, expected = load_mechanism(BUILT_IN, modelled_name), load_expectations(BUILT_IN, dynamics.method).entries
    states, truths = sample(mechanism, 16, SEED), dict[bool, tuple[DerivativeTruth, Certified]]()
    for subject in SUBJECTS:
        if is_misread(subject, mechanism):
            continue
        in_body = subject.engine == "pinocchio" and bool(mechanism.charts_in_body)
        if in_body not in truths:
            truth = truth_of(modelled_name, dynamics, in_body)
            truths[in_body] = truth, truth.evaluate(states)
        truth, certified = truths[in_body]
        try:
            found = compare(certified, truth.answers(loaded(modelled_name, subject), states))
        except Unsupported:
            assert subject.format == "mjcf"
            continue
        entry = expected.get((modelled_name, str(subject)))
        assert certified.certified.all()
        assert entry is not None or set(found.verdicts.tolist()) == {"agrees"}, (str(subject), found.backward_error.max())


def test_loops_have_none_and_say_why() -> None:
    for dynamics in (FORWARD, INVERSE):
        with pytest.raises(NotOffered, match="constraints tie the joints"):
            truth_of("four_bar", dynamics)


def test_mujoco_has_differences_alone() -> None:
    states = generic_sample(load_mechanism(BUILT_IN, "arm_2r"), 2, SEED)
    for dynamics, name in ((FORWARD, "mjd_transitionFD"), (INVERSE, "mjd_inverseFD")):
        with pytest.raises(NotOffered, match=name):
            truth_of("arm_2r", dynamics).answers(loaded("arm_2r", Subject("mujoco", "mjcf")), states)


def test_answers_of_another_shape_are_refused() -> None:
    class Flat:
        def forward_dynamics_derivatives(self, q: Array, v: Array, tau: Array) -> Array:
            return np.zeros((len(q), 2, 6))

    with pytest.raises(InvalidAnswer, match=r"expected an array of shape \(3, 3, 2, 2\)"):
        truth_of("arm_2r", FORWARD).answers(Flat(), generic_sample(load_mechanism(BUILT_IN, "arm_2r"), 3, SEED))  # type: ignore[arg-type]


def test_a_singular_state_is_undecided() -> None:
    """Where the bob of a spherical pendulum is on the vertical axis, M has no inverse."""
    mechanism = load_mechanism(BUILT_IN, "spherical_pendulum")
    states = generic_sample(mechanism, 2, SEED)
    q = states.q.copy()
    q[1] = 0.0
    found = truth_of("spherical_pendulum", FORWARD).evaluate(States(q, states.v, states.tau, states.time))
    assert found.certified.tolist() == [True, False]


# Mistakes.

ARM, BALL = "arm_3r", "heavy_top"


def terms_of(truth: DerivativeTruth, states: States, name: str) -> Array:
    nv = truth.mechanism.nv
    return truth.of_terms(states)[name].reshape(len(states), 3, nv, nv)


def planted(mistake: str, truth: DerivativeTruth, states: States, matrices: Array) -> Array:
    """Answers by columns and rows, (n, 3, nv, nv), with a mistake."""
    changed = matrices.copy()
    if mistake == "a sign in a Coriolis force, by a position":
        changed[:, 0, 1] -= 2 * terms_of(truth, states, "velocity terms")[:, 0, 1]
    elif mistake == "a sign in a Coriolis force, by a velocity":
        changed[:, 1, 1] -= 2 * terms_of(truth, states, "velocity terms")[:, 1, 1]
    elif mistake == "gravity is missing":
        changed -= terms_of(truth, states, "gravity terms")
    elif mistake == "a transposed block":
        changed[:, 1] = changed[:, 1].transpose(0, 2, 1)
    elif mistake == "a sign of a block":
        changed[:, 0] *= -1
    elif mistake == "turned about axes of the parent":
        changed[:, 0] = rotations(states.q) @ changed[:, 0]
    else:
        changed[:, 0, 0, -1] *= 1 + 1e-9
    return changed


MISTAKES = [
    (
        ARM,
        "a sign in a Coriolis force, by a position",
        "In the column of d({})/d(q) for joint 'elbow' the derivative of the velocity terms has the other sign",
    ),
    # Without dampers there is nothing else in it.
    (ARM, "a sign in a Coriolis force, by a velocity", "The column of d({})/d(v) for joint 'elbow' has the other sign"),
    (ARM, "gravity is missing", "In d({})/d(q) the derivative of the gravity terms is missing"),
    (ARM, "a transposed block", "d({})/d(v) is transposed"),
    (ARM, "a sign of a block", "d({})/d(q) has the other sign"),
    (BALL, "turned about axes of the parent", "d({})/d(q) turns joint 'pivot' about the axes of its parent"),
    (ARM, "a number", "column of d({})/d(q) for joint 'shoulder', in the row of joint 'wrist'"),
]


@pytest.mark.parametrize("dynamics", DYNAMICS)
@pytest.mark.parametrize(("name", "mistake", "said"), MISTAKES, ids=[mistake for _, mistake, _ in MISTAKES])
def test_a_mistake_is_seen_and_named(name: str, mistake: str, said: str, dynamics: Dynamics) -> None:
    truth, mechanism = truth_of(name, dynamics), load_mechanism(BUILT_IN, name)
    states, nv = generic_sample(mechanism, 6, SEED), mechanism.nv
    model = loaded(name, Subject("lagrange", EQUATIONS))
    certified, answers = truth.evaluate(states), truth.answers(model, states)
    assert set(compare(certified, answers).verdicts.tolist()) == {"agrees"}
    wrong = planted(mistake, truth, states, answers.reshape(-1, 3, nv, nv)).reshape(answers.shape)
    assert set(compare(certified, wrong).verdicts.tolist()) == {"disagrees"}
    assert said.format(dynamics.result) in truth.describe(certified, states, wrong, model)


def test_velocities_of_a_joint_that_has_several_are_numbered() -> None:
    mechanism = cast(Mechanism, SimpleNamespace(joints=("slide", "ball", "ball", "plane", "plane", "plane")))
    first, *others = coordinate_names(mechanism)
    assert first == "joint 'slide'"
    assert others == [f"joint {name!r}, velocity {number}" for name, count in (("ball", 2), ("plane", 3)) for number in range(1, count + 1)]
