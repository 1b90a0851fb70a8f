"""Drake's discrete steps, with limits of joints, are held against the convex problem that Drake documents."""

from __future__ import annotations

import functools
import itertools
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import flint
import numpy as np
import pytest
from catalogue import BUILT_IN
from comparison.robots import FILES, edited
from flint import arb, arb_mat

from harness.comparison.robot_library import RobotLibrary, engine_of, robot_at, robot_subjects
from harness.comparison.switched_on import judge_switched_on, pose, with_verdict
from harness.engines import Unsupported, load_engine, subjects
from harness.engines.adapters.drake import step_law
from harness.engines.adapters.drake.step_law import STEP
from harness.explain.changes.departures import departures_of
from harness.explain.documented import documented
from harness.explain.meant import meant
from harness.explain.switches import switches_of
from harness.files.model_file import read_model
from harness.files.rules import ConstraintLaw
from harness.programs.evaluation import mass_matrix
from harness.programs.kernels import BallKernel
from harness.programs.program import right_hand_side
from harness.programs.states import States
from harness.trees import metric
from harness.trees.mechanism import RobotMechanism, mechanism_of
from harness.trees.robot import Robot
from harness.truth.compare import compare
from harness.truth.declared import DeclaredMechanism
from harness.truth.displaced import pressed
from harness.truth.reference import ReferenceKernel
from harness.truth.sampling import sample
from harness.verdict import AGREEMENT

ENGINE = "drake_step"
ARM = FILES / "arm.urdf"
# A heavy cart on a slide before the arm, which no limit holds nearly rigid: it gives by the stiffness.
HEAVY = (
    ('<link name="ground"/>', """<link name="world"/><joint name="slide" type="prismatic"><parent link="world"/><child link="ground"/>
    <axis xyz="1 0 0"/><limit lower="-0.5" upper="0.5" effort="1" velocity="1"/><dynamics damping="8"/></joint>
    <link name="ground"><inertial><mass value="4096"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>"""),
)  # fmt: skip


# The shoulder is thrown back from beyond its limit, and the elbow with it against its own, before which it is at rest.
THROWN = States.at(np.array([-2.1, 0.499]), np.zeros(2), np.zeros(2))


def limited(robot: Robot, *departures: str) -> DeclaredMechanism:
    """The robot with its limits, by the law of a step, and departures from it."""
    engine = engine_of(ENGINE)
    chosen = [one for one in switches_of(robot, robot, engine) if one.group.what not in engine.why_off and not one.why_not]
    mechanism = documented(robot, engine, chosen, [one for one in departures_of(ENGINE, "drake") if one.name in departures])
    assert isinstance(mechanism, DeclaredMechanism)
    return mechanism


def beyond_limits(mechanism: DeclaredMechanism, count: int) -> States:
    return pressed(mechanism, sample(mechanism, count, 3))


# The step, by a way of its own.


@functools.cache
def equations_of(robot: Robot) -> tuple[RobotMechanism, Callable[..., Any]]:
    plain = mechanism_of(robot)
    return plain, BallKernel(plain.program, len(plain.parameters)).bind(plain.parameter_values)


class Problem:
    """1/2 |v - v*|_A^2 and the costs of all limits, in balls, with every number of the law written out."""

    def __init__(self, robot: Robot, q: list[float], v: list[float], tau: list[float]) -> None:
        (plain, evaluate), h = equations_of(robot), arb(STEP)
        flat, found = list(evaluate(*q, *v, *tau, 0.0)), {}
        for name, places in plain.program.outputs.items():
            found[name], flat = flat[: len(places)], flat[len(places) :]
        self.metric, self.nv = mass_matrix(found["mass"], plain.nv), plain.nv
        for place, joint in enumerate(map(robot.joint, robot.joints)):
            self.metric[place, place] += h * arb(float(joint.damping))
        force = right_hand_side(found, [arb(one) for one in tau])
        self.before = [arb(one) for one in v]
        moved = arb_mat(self.metric.nrows(), self.nv, self.metric.entries()).solve(arb_mat([[h * one] for one in force])).entries()
        self.free = [one + change for one, change in zip(self.before, moved, strict=True)]
        # Of each limit: the joint, its sign, its distance and R.
        self.limits = []
        for place, joint in enumerate(map(robot.joint, robot.joints)):
            assert joint.limits is not None
            # Rounded as Drake's program rounds them.
            near_rigid, gives = arb(0.1 * 0.1 / (4 * np.pi * np.pi)) / self.metric[place, place], arb(1 / (STEP * 1e12 * 2 * STEP))
            regular = near_rigid if near_rigid > gives else gives
            low, high = (arb(float(bound)) for bound in joint.limits)
            self.limits += [(place, 1, arb(q[place]) - low, regular), (place, -1, high - arb(q[place]), regular)]

    def within(self, window: float) -> None:
        """Leave out limits that are so many times farther than v and v* lead in a step."""
        fast = [max(abs(one), abs(other)) for one, other in zip(self.before, self.free, strict=True)]
        self.limits = [one for one in self.limits if one[2] <= window * STEP * fast[one[0]]]

    def after(self) -> list[Any]:
        """Velocities after the step, by trying all sets of limits that push until one fits."""
        for chosen in itertools.product((False, True), repeat=len(self.limits)):
            pushing = [place for (place, *_), pushes in zip(self.limits, chosen, strict=True) if pushes]
            if len(set(pushing)) < len(pushing):
                # Both ends of one range.
                continue
            matrix = arb_mat(self.nv, self.nv, self.metric.entries())
            right = (matrix * arb_mat([[one] for one in self.free])).entries()
            for (place, sign, distance, regular), pushes in zip(self.limits, chosen, strict=True):
                if pushes:
                    matrix[place, place] += 1 / regular
                    right[place] -= sign * distance / (2 * STEP) / regular
            after = matrix.solve(arb_mat([[one] for one in right])).entries()
            left = (-distance / (2 * STEP) - sign * after[place] for place, sign, distance, _ in self.limits)
            if all(bool(one > 0) if pushes else bool(one <= 0) for one, pushes in zip(left, chosen, strict=True)):
                return list(after)
        raise AssertionError("no set fits")


def accelerations(robot: Robot, states: States, window: float | None = None) -> list[list[Any]]:
    found = []
    for state in range(len(states)):
        problem = Problem(robot, *(part[state].tolist() for part in (states.q, states.v, states.tau)))
        if window is not None:
            problem.within(window)
        found.append([(after - before) / STEP for after, before in zip(problem.after(), problem.before, strict=True)])
    return found


@pytest.fixture
def balls() -> Iterator[None]:
    with flint.ctx.workprec(256):
        yield


@pytest.mark.parametrize(("changes", "window"), [((), None), ((), 2.0), (HEAVY, None)], ids=["arm", "with the window", "heavy"])
@pytest.mark.usefixtures("balls")
def test_the_certified_step_is_that_of_the_documented_problem(
    changes: tuple[tuple[str, str], ...], window: float | None, tmp_path: Path
) -> None:
    robot = robot_at(edited(ARM, tmp_path, *changes))
    mechanism = limited(robot, *(() if window is None else ("limits beyond a window",)))
    states = beyond_limits(mechanism, 16)
    truth = ReferenceKernel(mechanism).evaluate(states)
    assert truth.certified.all() and mechanism.reaches_limits(states).any()
    for state, own in enumerate(accelerations(robot, states, window)):
        pairs = zip(own, truth.high[state].tolist(), truth.low[state].tolist(), strict=True)
        off = np.array([float((one - arb(high) - arb(low)).mid()) for one, high, low in pairs])
        assert truth.lengths(np.tile(off, (len(states), 1)))[state] <= truth.radius[state] + 2.0**-90 * truth.sensitivity[state]


# Faults.

_limit = step_law.limit


def _with(**factors: float) -> Callable[[], ConstraintLaw]:
    def law() -> ConstraintLaw:
        own = _limit()
        assert own.of_step is not None
        scaled = {name: getattr(own.of_step, name) * factor for name, factor in factors.items() if hasattr(own.of_step, name)}
        others = {name: getattr(own, name) * factor for name, factor in factors.items() if hasattr(own, name)}
        return replace(own, of_step=replace(own.of_step, **scaled), **others)

    return law


_ODD = 1 + 1e-9
LAW_FAULTS: dict[str, Callable[[pytest.MonkeyPatch], None]] = {
    "dissipation": lambda patch: patch.setattr(step_law, "limit", _with(stiffness=_ODD)),
    "step": lambda patch: patch.setattr(step_law, "limit", _with(damping=_ODD)),
    "near-rigid threshold": lambda patch: patch.setattr(step_law, "limit", _with(near_rigid=1 + 1e-6)),
    "stiffness": lambda patch: patch.setattr(step_law, "limit", _with(least=_ODD)),
    "dampers in the metric": lambda patch: patch.setattr(metric, "JOINT_DAMPING", "joint stiffness"),
}


def error(robot: Robot, states: States, *departures: str, window: float | None = None) -> float:
    """Data roundoffs from the certified step, of answers that are rounded to float64."""
    answers = np.array([[float(one.mid()) for one in own] for own in accelerations(robot, states, window)])
    return float(compare(ReferenceKernel(limited(robot, *departures)).evaluate(states), answers, factorises=True).backward_error.max())


@pytest.mark.parametrize("name", [None, *LAW_FAULTS])
@pytest.mark.usefixtures("balls")
def test_a_fault_in_the_law_is_seen(name: str | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    robot = robot_at(edited(ARM, tmp_path, *HEAVY))
    states = beyond_limits(limited(robot), 6)
    if name is not None:
        LAW_FAULTS[name](monkeypatch)
    assert (error(robot, states) <= AGREEMENT) == (name is None)


@pytest.mark.usefixtures("balls")
def test_another_limit_and_another_sign_are_seen(tmp_path: Path) -> None:
    robot = robot_at(ARM)
    states = beyond_limits(limited(robot), 6)
    for old, new in (('upper="0.5"', 'upper="0.500000001"'), ('lower="-2.5" upper="0.5"', 'lower="-0.5" upper="2.5"')):
        answers = accelerations(robot_at(edited(ARM, tmp_path, (old, new))), states)
        rounded = np.array([[float(one.mid()) for one in own] for own in answers])
        assert compare(ReferenceKernel(limited(robot)).evaluate(states), rounded, factorises=True).backward_error.max() > AGREEMENT


@pytest.mark.usefixtures("balls")
def test_limits_beyond_the_window_depart_from_the_documentation() -> None:
    robot = robot_at(ARM)
    assert error(robot, THROWN, window=2.0) > 1e6
    assert error(robot, THROWN, "limits beyond a window", window=2.0) <= AGREEMENT


def test_it_is_asked_by_name_alone() -> None:
    assert ENGINE not in {one.engine for one in subjects(RobotLibrary.without_files())}
    assert [str(one) for one in robot_subjects([ENGINE])] == [f"{ENGINE}/urdf"]


def test_limits_of_a_mechanism_are_refused() -> None:
    """Its metric is that of no textbook."""
    model = replace(read_model(BUILT_IN.model_path("limited_pendulum", "urdf"), "urdf"), acting=("lower limit of joint pin",))
    with pytest.raises(Unsupported, match="limits of users' files alone"):
        load_engine(BUILT_IN, ENGINE).refuse(model)


# Drake itself.


@pytest.fixture(scope="module")
def drake(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """An environment with Drake, in the cache that ``HARNESS_TEST_CACHE`` names where it is set."""
    cache = os.environ.get("HARNESS_TEST_CACHE") or str(tmp_path_factory.getbasetemp() / "environments")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("HARNESS_CACHE", cache)
        for engine in (ENGINE, "drake"):
            if not any((Path(cache) / "environments").glob(f"{engine}@*/environment.json")):
                subprocess.run([sys.executable, "-m", "harness", "engines", "add", engine], check=True)
        yield


@pytest.mark.nightly
@pytest.mark.usefixtures("drake")
def test_drake_is_at_the_documented_optimum() -> None:
    record = judge_switched_on(meant(robot_at(ARM), 64, seed=0), ENGINE)
    assert record.verdict == "agrees" and record.backward_error is not None and 0 < record.backward_error < 8
    assert record.together is not None and record.together > 1e-3
    assert [part.what for part in record.parts if not part.why_not] == ["joint limits"] * 2


@pytest.mark.nightly
@pytest.mark.usefixtures("drake")
def test_drake_leaves_out_a_limit_beyond_the_window() -> None:
    robot = robot_at(ARM)
    _, posed = pose(meant(robot, 64, seed=0), ENGINE)
    assert posed is not None
    answers = posed.asked.with_those(posed.case.judged, replace(posed.case.at, states=THROWN)).of(robot.joints)
    documented, as_is = (ReferenceKernel(limited(robot, *names)).evaluate(THROWN) for names in ((), ("limits beyond a window",)))
    assert compare(documented, answers, factorises=True).backward_error.max() > 1e6
    assert compare(as_is, answers, factorises=True).backward_error.max() <= AGREEMENT


@pytest.mark.nightly
@pytest.mark.usefixtures("drake")
@pytest.mark.parametrize(
    "change", [('upper="0.5"', 'upper="0.50001"'), ('damping="0.5"', 'damping="0.50001"'), ('lower="-2.5" upper="0.5"', "")]
)
def test_another_file_is_seen(change: tuple[str, str], tmp_path: Path) -> None:
    """A limit elsewhere or left out, and a damper in the metric."""
    robot = meant(robot_at(ARM), 64, seed=0)
    record, posed = pose(robot, ENGINE)
    assert posed is not None
    answers = replace(posed.asked, path=edited(ARM, tmp_path, change)).with_those(posed.case.judged, posed.case.at)
    record = with_verdict(record, posed.case, posed.asked, answers, names=False)
    assert record.verdict == "disagrees" and not record.explained


@pytest.mark.nightly
@pytest.mark.usefixtures("drake")
@pytest.mark.parametrize(("bound", "status"), [("0", 0), ("1e-9", 1)])
def test_steps_of_a_mechanism_have_its_limits(bound: str, status: int, tmp_path: Path) -> None:
    model = edited(BUILT_IN.model_path("limited_pendulum", "urdf"), tmp_path, ('lower="0"', f'lower="{bound}"'))
    words = ["limited_pendulum", "--quantity", "steps", "--states", "64", "--subject", "drake/urdf", "--urdf", str(model)]
    assert subprocess.run([sys.executable, "-m", "harness", "check", *words], check=False).returncode == status
