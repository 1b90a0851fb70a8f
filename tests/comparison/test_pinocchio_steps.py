"""Pinocchio's constraint solvers, with dry friction and limits over one step, are held against the problem that it documents."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import flint
import numpy as np
import pytest
from catalogue import BUILT_IN
from comparison.robots import FILES, edited
from flint import arb, arb_mat
from support import InThisProcess, call_engines_here, completed

from harness.comparison.robot_library import RobotLibrary, engine_of, robot_at, robot_subjects
from harness.comparison.switched_on import judge_switched_on
from harness.crosscheck.run import CrossCheck
from harness.crosscheck.settings import Settings
from harness.engines import subjects
from harness.engines.adapters.pinocchio import step_law, stepping
from harness.explain.documented import documented
from harness.explain.file_case import FileCase
from harness.explain.meant import meant
from harness.explain.switches import switches_of
from harness.files.equalities import Constraint, DryFriction
from harness.files.rules import ConstraintLaw
from harness.programs.evaluation import mass_matrix
from harness.programs.kernels import BallKernel
from harness.programs.program import right_hand_side
from harness.programs.states import States
from harness.results.switched_on import SwitchedOnRecord, switched_on_text
from harness.trees.mechanism import mechanism_of
from harness.trees.robot import Robot
from harness.truth.declared import DeclaredMechanism
from harness.truth.displaced import pressed, slowed
from harness.truth.reference import ReferenceKernel
from harness.truth.sampling import sample
from harness.verdict import AGREEMENT

SOLVERS = ("pinocchio_admm", "pinocchio_pgs")
RUBBING = ('damping="0.5"', 'damping="0.5" friction="1.5"')


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return edited(FILES / "arm.urdf", tmp_path, RUBBING)


def held_by(path: Path, engine: str) -> SwitchedOnRecord:
    return judge_switched_on(meant(robot_at(path), 64, seed=0), engine)


@pytest.mark.ci
@pytest.mark.parametrize("engine", SOLVERS)
def test_a_solver_stops_early_and_agrees_where_it_goes_on(engine: str, path: Path) -> None:
    record = held_by(path, engine)
    assert record.explained and record.to_the_end is not None and record.to_the_end <= AGREEMENT
    assert record.backward_error is not None and record.backward_error > 1e6
    # Both act, so that agreement is not that of the tree alone.
    assert record.together is not None and record.together > 1e-3
    assert [part.what for part in record.parts if not part.why_not] == ["dry friction"] * 2 + ["joint limits"] * 2
    assert "stops its solver" in switched_on_text(record) and "pin.PGSConstraintSolver" in record.remedy


def test_they_are_asked_by_name_alone() -> None:
    assert not {one.engine for one in subjects(RobotLibrary.without_files())} & set(SOLVERS)
    assert [str(one) for one in robot_subjects(SOLVERS)] == [f"{name}/urdf" for name in SOLVERS]


# Faults.

_law = step_law._law


def _with(change: Callable[[Constraint, ConstraintLaw], ConstraintLaw]) -> Callable[[Constraint, bool], ConstraintLaw | None]:
    def law(constraint: Constraint, is_convex: bool) -> ConstraintLaw | None:
        own = _law(constraint, is_convex)
        return None if own is None else change(constraint, own)

    return law


def _scaled(law: ConstraintLaw) -> ConstraintLaw:
    low, high = law.force_range
    return replace(law, force_range=((1 + 1e-9) * low, (1 + 1e-9) * high))


FAULTS: dict[str, Callable[[Constraint, ConstraintLaw], ConstraintLaw]] = {
    "bound of friction": lambda one, law: _scaled(law) if isinstance(one.says, DryFriction) else law,
    "step": lambda _, law: replace(law, damping=(1 + 1e-9) * law.damping),
    "distance to limits": lambda one, law: replace(law, stiffness_ahead=(1 + 1e-6) * law.stiffness_ahead) if law.stiffness_ahead else law,
    "compliance": lambda _, law: replace(law, least_regularisation=1e-9),
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_in_the_law_is_seen(name: str, path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    call_engines_here(monkeypatch)
    monkeypatch.setattr(step_law, "_law", _with(FAULTS[name]))
    assert_red(path, monkeypatch)


@pytest.mark.parametrize(
    "fault",
    [
        lambda patch: patch.setattr(stepping.pinocchio, "getConstraintsJacobian", _opposite(stepping.pinocchio.getConstraintsJacobian)),
        # It is 1 s unless it is set.
        lambda patch: patch.setattr(stepping.pinocchio.JointFrictionConstraintModel, "setTimeStep", lambda *_: None),
        lambda patch: patch.setattr(stepping, "STEP", (1 + 1e-9) * stepping.STEP),
        lambda patch: patch.setattr(stepping.pinocchio, "DelassusOperatorDense", _weaker(stepping.pinocchio.DelassusOperatorDense)),
        lambda patch: patch.setattr(stepping.pinocchio, "JointFrictionConstraintModel", _of_fewer("JointFrictionConstraintModel")),
        lambda patch: patch.setattr(stepping.pinocchio, "JointLimitConstraintModel", _of_fewer("JointLimitConstraintModel")),
    ],
    ids=["another sign", "time step not set", "another time step", "another Delassus matrix", "dropped friction", "dropped limits"],
)
def test_a_fault_of_the_engine_is_seen(fault: Callable[[pytest.MonkeyPatch], None], path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    call_engines_here(monkeypatch)
    fault(monkeypatch)
    assert_red(path, monkeypatch)


def _weaker(operator: Any) -> Callable[[Any], Any]:
    return lambda matrix: operator((1 + 1e-9) * matrix)


def _opposite(jacobian: Callable[..., Any]) -> Callable[..., Any]:
    return lambda *arguments: -jacobian(*arguments)


def _of_fewer(name: str) -> Callable[..., Any]:
    make = getattr(stepping.pinocchio, name)
    return lambda model, joints, *rest: make(model, joints[:-1], *rest)


def assert_red(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(FileCase, "left", lambda *_: ["nothing explains it"])
    record = held_by(path, "pinocchio_pgs")
    assert not record.explained and record.to_the_end is None and record.rest


@pytest.mark.parametrize("engine", SOLVERS)
@pytest.mark.parametrize("name", ["dry_pendulum", "limited_pendulum"])
def test_of_a_mechanism_it_is_asked_all_but_accelerations(name: str, engine: str) -> None:
    """The problem of a step is one of the numbers of a file, and no textbook has it."""
    settings = Settings(library=BUILT_IN, states=20, examples=None, names=[name], subjects=[f"{engine}/urdf"])
    found = {one.quantity: one for one in completed(CrossCheck(settings, ["accelerations", "mass_matrix"]), InThisProcess()).records}
    assert all(one.as_expected for one in found.values())
    assert {quantity: one.verdict for quantity, one in found.items()} == {"accelerations": "unsupported", "mass_matrix": "agrees"}
    assert "no textbook has" in found["accelerations"].expected_reason


# The truth, by a way of its own.


def every(robot: Robot) -> DeclaredMechanism:
    """The robot with its dry friction and limits, by the laws of a step."""
    engine = engine_of("pinocchio_pgs")
    chosen = [one for one in switches_of(robot, robot, engine) if one.group.what not in engine.why_off and not one.why_not]
    mechanism = documented(robot, engine, chosen)
    assert isinstance(mechanism, DeclaredMechanism)
    return mechanism


@dataclass(frozen=True)
class Way:
    """What a joint may do: v' and, of one that meets a limit, the sign of its force; with friction mu."""

    after: Any
    mu: Any
    slides: bool = False
    limit: int = 0

    def fits(self, force: Any, after: Any, reach: tuple[Any, Any]) -> bool:
        """Whether forces and v' are those of it; ``reach`` are the velocities that lead to the limits."""
        if self.slides:
            return bool(self.after * after > 0) and bool(after > reach[0]) and bool(after < reach[1])
        if not self.limit:
            return bool(abs(force) < self.mu)
        friction = -self.mu * (1 if self.after > 0 else -1) if self.after != 0 else self.limit * self.mu
        return bool(self.limit * (force - friction) > 0) and bool(self.after >= reach[0]) and bool(self.after <= reach[1])


def by_enumeration(robot: Robot, q: list[float], v: list[float], tau: list[float]) -> list[Any]:
    """Accelerations by trying each way in which joints slide, stick, or meet a limit, until one fits.

    A joint at velocity v' after the step slides under friction against v', sticks at 0 under a force up to friction, or is held at the
    v' that leads to a limit, 0 if that is passed, by a force that pushes alone besides friction.
    """
    plain, step = mechanism_of(robot), arb(step_law.STEP)
    evaluate = BallKernel(plain.program, len(plain.parameters)).bind(plain.parameter_values)
    flat, found = list(evaluate(*q, *v, *tau, 0.0)), {}
    for name, places in plain.program.outputs.items():
        found[name], flat = flat[: len(places)], flat[len(places) :]
    mass, force = mass_matrix(found["mass"], plain.nv), right_hand_side(found, [arb(one) for one in tau])
    reaches, ways = [], []
    for place, joint in enumerate(robot.joint(name) for name in robot.joints):
        mu, (low, high) = arb(float(joint.friction_loss)), [arb(float(bound)) - arb(q[place]) for bound in joint.limits]
        reaches.append((low / step if low < 0 else arb(0), high / step if high > 0 else arb(0)))
        limits = [Way(after, mu, limit=sign) for after, sign in zip(reaches[-1], (1, -1), strict=True)]
        ways.append([*(Way(arb(sign), mu, slides=True) for sign in (1, -1)), Way(arb(0), mu), *limits])
    for chosen in itertools.product(*ways):
        moving = [place for place, way in enumerate(chosen) if way.slides]
        a = [(way.after - arb(one)) / step for way, one in zip(chosen, v, strict=True)]
        known = [
            force[i] - chosen[i].after * chosen[i].mu - sum((mass[i, j] * a[j] for j in range(plain.nv) if j not in moving), arb(0))
            for i in moving
        ]
        if moving:
            solved = arb_mat([[mass[i, j] for j in moving] for i in moving]).solve(arb_mat([[one] for one in known])).entries()
            for place, one in zip(moving, solved, strict=True):
                a[place] = one
        forces = [sum((mass[i, j] * a[j] for j in range(plain.nv)), arb(0)) - force[i] for i in range(plain.nv)]
        after = [arb(one) + step * own for one, own in zip(v, a, strict=True)]
        if all(way.fits(*rest) for way, *rest in zip(chosen, forces, after, reaches, strict=True)):
            return a
    raise AssertionError("no way fits")


@pytest.mark.ci
@pytest.mark.parametrize("change", [(RUBBING,), (RUBBING, ('friction="0.125"', "")), ()], ids=["both rub", "one rubs", "as it is"])
def test_the_certified_step_is_that_of_the_documented_problem(change: tuple[tuple[str, str], ...], tmp_path: Path) -> None:
    robot = robot_at(edited(FILES / "arm.urdf", tmp_path, *change))
    mechanism = every(robot)
    states = sample(mechanism, 60, 3)
    states = States.concatenate(
        [pressed(mechanism, states[:20]), slowed(mechanism, states[20:40]), slowed(mechanism, pressed(mechanism, states[40:]))]
    )
    truth = ReferenceKernel(mechanism).evaluate(states)
    assert truth.certified.all()
    with flint.ctx.workprec(256):
        for state in range(len(states)):
            found = by_enumeration(robot, *(part[state].tolist() for part in (states.q, states.v, states.tau)))
            off = [
                one - arb(high) - arb(low)
                for one, high, low in zip(found, truth.high[state].tolist(), truth.low[state].tolist(), strict=True)
            ]
            length = truth.lengths(np.array([[float(one.mid()) for one in off]] * len(states)))[state]
            assert length <= truth.radius[state] + 2.0**-95 * truth.sensitivity[state]
