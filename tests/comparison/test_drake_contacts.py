"""Drake's discrete steps, with contacts in points, are held against the convex problem that Drake documents."""

from __future__ import annotations

import subprocess
import sys
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import flint
import numpy as np
import pytest
from catalogue import BUILT_IN
from comparison.robots import FILES, edited
from comparison.test_drake_steps import ENGINE, drake
from flint import arb, arb_mat

from harness.comparison.case import AskedEngine
from harness.comparison.robot_library import engine_of, robot_at
from harness.comparison.switched_on import judge_switched_on
from harness.crosscheck.solvers import _shares_of
from harness.engines.adapters.drake import step_law
from harness.engines.adapters.drake.step_law import STEP
from harness.engines.request import EngineAnswers, by_joint
from harness.explain import touching
from harness.explain.as_read import Folded
from harness.explain.documented import documented
from harness.explain.file_case import FileCase
from harness.explain.meant import meant
from harness.explain.switches import switches_of
from harness.explain.touching import Touching
from harness.files.contacts import FoundContact
from harness.files.equalities import Constraint
from harness.files.touching import ConeKind, PointCompliance
from harness.files.tree import WORLD
from harness.programs.states import States
from harness.results.switched_on import switched_on_text
from harness.trees import metric
from harness.trees.mechanism import mechanism_of
from harness.trees.robot import Robot
from harness.truth.compare import compare
from harness.truth.declared import DeclaredMechanism
from harness.truth.quantities.accelerations import AccelerationTruth
from harness.truth.reference import Reference
from harness.truth.stopping import share_of_rule
from harness.verdict import AGREEMENT

__all__ = ["drake"]

BALL = FILES / "ball.urdf"
MASSES, DAMPERS, INERTIA, RADIUS, GRAVITY = (0.25, 0.125, 0.5), (3.0, 0.0, 0.001), 0.004, 0.125, 9.81
# One that is nearly rigid in such a step, and one that gives by its own stiffness.
COMPLIANCES = {"rigid": PointCompliance(5e5, 0.2), "soft": PointCompliance(4096.0, 0.0625)}


# The step, by a way of its own.


@dataclass(frozen=True)
class Ground:
    """The ball on the ground in one state: the documented problem in balls, every number of the law written out."""

    q: Sequence[float]
    v: Sequence[float]
    tau: Sequence[float]
    friction: float
    compliance: PointCompliance

    def contact(self) -> FoundContact:
        """Hertz's point of two shapes alike, in the middle."""
        point, frame = (self.q[0], 0.0, self.q[1] / 2), (0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0)
        found = FoundContact((WORLD, "ball"), point, frame, self.q[1], 0.0, (self.friction, self.friction))
        return replace(found, compliance=self.compliance)

    def after(self) -> tuple[str, list[Any]]:
        """What the contact does, and the velocities after the step: the one way that fits."""
        h, mu, k, time = (arb(one) for one in (STEP, self.friction, self.compliance.stiffness, self.compliance.relaxation_time))
        cart, fork, ball = map(arb, MASSES)
        mass = [cart + fork + ball, fork + ball, arb(INERTIA)]
        matrix = [one + h * arb(damper) for one, damper in zip(mass, DAMPERS, strict=True)]
        force = [arb(applied) - arb(damper) * arb(v) for applied, damper, v in zip(self.tau, DAMPERS, self.v, strict=True)]
        force[1] -= (fork + ball) * arb(GRAVITY)
        free = [arb(v) + h * own / one for v, own, one in zip(self.v, force, matrix, strict=True)]
        # Of the ball against the ground, along the normal and along x; nothing moves along y.
        along = [arb(1), arb(0), arb(self.q[1]) / 2 - (arb(self.q[1]) + arb(RADIUS))]
        normal = [arb(0), arb(1), arb(0)]
        rows = [normal, along]
        block = [sum(a * b / one for a, b, one in zip(row, other, matrix, strict=True)) for row in rows for other in rows]
        scale = sum(one**2 for one in block).sqrt() / 3
        # Rounded as Drake's program rounds them.
        near_rigid, gives = arb(1.0 / (4 * np.pi * np.pi)) * scale, arb(1 / (STEP * float(k) * (STEP + float(time))))
        across, own = scale * arb(1e-3), near_rigid if near_rigid > gives else gives
        wanted = -arb(self.q[1]) * h * arb(1 / (STEP * (STEP + float(time))))
        fits = []
        for name, weights in self._ways(mu, own, across):
            full, right = arb_mat(3, 3), [one * v for one, v in zip(matrix, free, strict=True)]
            for i in range(3):
                full[i, i] += matrix[i]
                for a, row in enumerate(rows):
                    for b, other in enumerate(rows):
                        # The impulses are weights times R^-1 (v^ - J v).
                        right[i] += row[i] * weights[a][b] * (wanted if b == 0 else 0)
                        for j in range(3):
                            full[i, j] += row[i] * weights[a][b] * other[j]
            moved = full.solve(arb_mat([[one] for one in right])).entries()
            y = [(wanted - sum(a * v for a, v in zip(normal, moved, strict=True))) / own]
            y.append(-sum(a * v for a, v in zip(along, moved, strict=True)) / across)
            if self._is(name, mu, own, across, y):
                fits.append((name, list(moved)))
        (found,) = fits
        return found

    def _ways(self, mu: Any, own: Any, across: Any) -> Iterator[tuple[str, list[list[Any]]]]:
        """What the contact may do, with the matrix that takes v^ - J v to its impulses."""
        hat, tilde = mu * across / own, mu * mu * across / own
        yield "parts", [[arb(0)] * 2] * 2
        yield "sticks", [[1 / own, arb(0)], [arb(0), 1 / across]]
        for sign in (1, -1):
            along_normal = [1 / own / (1 + tilde), sign * hat / across / (1 + tilde)]
            yield f"slides {sign}", [along_normal, [sign * mu * one for one in along_normal]]

    def _is(self, name: str, mu: Any, own: Any, across: Any, y: Sequence[Any]) -> bool:
        hat, size = mu * across / own, abs(y[1])
        if name == "parts":
            return bool(y[0] < -hat * size)
        if name == "sticks":
            return bool(size < mu * y[0])
        return bool(-hat * size < y[0]) and bool(y[0] < size / mu) and bool(y[1] * int(name.split()[1]) > 0)

    def accelerations(self) -> list[Any]:
        return [(after - arb(before)) / arb(STEP) for after, before in zip(self.after()[1], self.v, strict=True)]


def grounds(compliance: PointCompliance, count: int = 24) -> list[Ground]:
    """States in all zones: bodies that part, stick, and slide both ways, fast and slow."""
    random = np.random.default_rng(7)
    found = []
    for number in range(count):
        q = [float(random.uniform(-0.25, 0.25)), -float(10 ** random.uniform(-4, -2)), float(random.uniform(-3, 3))]
        spin = float(random.uniform(-8, 8))
        # Some roll, some slip slowly and some fast; some leave the ground.
        slip = float(random.uniform(-1, 1)) * (0.0, 1e-3, 1.0, 8.0)[number % 4]
        rise = float(random.uniform(-0.02, 0.02)) * (1 + 200 * (number % 5 == 0))
        v = [spin * (RADIUS + q[1] / 2) + slip, rise, spin]
        found.append(Ground(q, v, random.uniform(-1, 1, 3).tolist(), 1 / 3, compliance))
    return found


def states_of(chosen: Sequence[Ground]) -> States:
    return States.at(*(np.array([getattr(one, name) for one in chosen]) for name in ("q", "v", "tau")))


def found_touching(robot: Robot, chosen: Sequence[Ground]) -> Touching:
    return Touching.of([[one.contact()] if one.q[1] <= 0 else [] for one in chosen], robot, ConeKind.ELLIPTIC)


def truth_of(robot: Robot, chosen: Sequence[Ground], has_limits: bool = False) -> Reference:
    engine = engine_of(ENGINE)
    on = [one for one in switches_of(robot, robot, engine) if one.group.what not in engine.why_off and not one.why_not]
    own = [one for one in on if one.group.what == "contacts" or has_limits]
    return found_touching(robot, chosen).truth(states_of(chosen), lambda contacts: documented(robot, engine, own, (), contacts))


def rounded(chosen: Sequence[Ground]) -> np.ndarray[Any, np.dtype[np.float64]]:
    return np.array([[float(one.mid()) for one in own.accelerations()] for own in chosen])


@pytest.fixture
def balls() -> Iterator[None]:
    with flint.ctx.workprec(256):
        yield


@pytest.mark.parametrize("name", COMPLIANCES)
@pytest.mark.usefixtures("balls")
def test_the_certified_step_is_that_of_the_documented_problem(name: str) -> None:
    robot, chosen = robot_at(BALL), grounds(COMPLIANCES[name])
    truth = truth_of(robot, chosen)
    assert truth.certified.all()
    ways = Counter(one.after()[0] for one in chosen)
    assert set(ways) == {"parts", "sticks", "slides 1", "slides -1"} and min(ways.values()) >= 2, ways
    for state, own in enumerate(chosen):
        pairs = zip(own.accelerations(), truth.high[state].tolist(), truth.low[state].tolist(), strict=True)
        off = np.array([float((one - arb(high) - arb(low)).mid()) for one, high, low in pairs])
        assert truth.lengths(np.tile(off, (len(chosen), 1)))[state] <= truth.radius[state] + 2.0**-90 * truth.sensitivity[state]


# Faults.

_touching, _constraints = step_law._touching, touching._constraints


def _with(**factors: float) -> Callable[..., Any]:
    """The law with some of its numbers times factors: of the compliance, of friction, of what it has of a step, or of itself."""

    def law(touch: Any, compliance: Any) -> Any:
        own = _touching(touch, replace(compliance, **{name: getattr(compliance, name) * by for name, by in of(compliance).items()}))
        step, cone = own.of_step, own.cone
        assert step is not None and cone is not None
        step = replace(step, **{name: getattr(step, name) * by for name, by in of(step).items()})
        friction = tuple(one * factors.get("friction", 1.0) for one in cone.friction)
        return replace(own, of_step=step, cone=replace(cone, friction=friction), damping=own.damping * factors.get("damping", 1.0))

    def of(one: Any) -> dict[str, float]:
        return {name: by for name, by in factors.items() if hasattr(one, name)}

    return law


def _found_as(change: Callable[[FoundContact], FoundContact]) -> Callable[..., list[Constraint]]:
    return lambda found, *rest: _constraints([change(one) for one in found], *rest)


def _turned(one: FoundContact) -> FoundContact:
    return replace(one, frame=(*(-x for x in one.frame[:3]), *one.frame[3:]))


_ODD = 1 + 1e-8
FAULTS: dict[str, Callable[[pytest.MonkeyPatch], None]] = {
    "friction": lambda patch: patch.setattr(step_law, "_touching", _with(friction=_ODD)),
    "relaxation time": lambda patch: patch.setattr(step_law, "_touching", _with(relaxation_time=_ODD)),
    "stiffness": lambda patch: patch.setattr(step_law, "_touching", _with(stiffness=_ODD)),
    "near-rigid threshold": lambda patch: patch.setattr(step_law, "_touching", _with(near_rigid=1 + 1e-6)),
    "regularisation of friction": lambda patch: patch.setattr(step_law, "_touching", _with(sliding=1 + 1e-6)),
    "step": lambda patch: patch.setattr(step_law, "_touching", _with(damping=_ODD)),
    "a normal's sign": lambda patch: patch.setattr(touching, "_constraints", _found_as(_turned)),
    "bodies": lambda patch: patch.setattr(touching, "_constraints", _found_as(lambda one: replace(one, bodies=one.bodies[::-1]))),
    "depth": lambda patch: patch.setattr(touching, "_constraints", _found_as(lambda one: replace(one, distance=one.distance * _ODD))),
    "point": lambda patch: patch.setattr(
        touching, "_constraints", _found_as(lambda one: replace(one, point=(*one.point[:2], one.point[2] + 1e-9)))
    ),
    "a contact left out": lambda patch: patch.setattr(touching, "_constraints", lambda *_: []),
    "dampers in the metric": lambda patch: patch.setattr(metric, "JOINT_DAMPING", "joint stiffness"),
}
# Mechanisms of the catalogue whose bodies touch, on joints of one axis.
TOUCHING = ("block_on_incline", "bouncing_ball", "box_stack", "newtons_cradle", "painleve_rod", "rimless_wheel", "sphere_on_incline")
# Of one compliance alone; all others are of both.
OF_ONE = {"stiffness": "soft", "near-rigid threshold": "rigid"}


@pytest.mark.parametrize("compliance", COMPLIANCES)
@pytest.mark.parametrize("name", [None, *FAULTS])
@pytest.mark.usefixtures("balls")
def test_a_fault_is_seen(name: str | None, compliance: str, monkeypatch: pytest.MonkeyPatch) -> None:
    robot, chosen = robot_at(BALL), grounds(COMPLIANCES[compliance], 12)
    answers = rounded(chosen)
    if name is not None:
        FAULTS[name](monkeypatch)
    is_felt = name is not None and OF_ONE.get(name, compliance) == compliance
    assert (compare(truth_of(robot, chosen), answers, factorises=True).backward_error.max() > AGREEMENT) == is_felt


def test_a_step_without_contacts_is_one_with_dampers_in_its_metric() -> None:
    """Half an ulp of the velocities is felt through the length of the step."""
    robot, engine = robot_at(BALL), engine_of(ENGINE)
    on = [one for one in switches_of(robot, robot, engine) if one.group.what == "contacts"]
    states = States.at([[0.1, 0.01, 0.3]], [[64.0, 0.0, 0.0]], [[5.0, 0.0, 0.0]])
    truth = Touching.nowhere(1).truth(states, lambda contacts: documented(robot, engine, on, (), contacts))
    moving = sum(MASSES)
    assert truth.high[0] == pytest.approx([(5.0 - 3.0 * 64.0) / (moving + STEP * 3.0), -9.81, 0.0], rel=1e-12, abs=1e-12)
    # Of a velocity, in the norm of the metric.
    assert truth.data_roundoff[0] > 0.9 * 2.0**-53 * 64.0 / STEP * np.sqrt(moving)


# Where the solver stops.


def case_of(chosen: Sequence[Ground]) -> FileCase:
    original, engine = meant(robot_at(BALL), len(chosen), seed=0), engine_of(ENGINE)
    on = [one for one in switches_of(original.robot, original.robot, engine) if one.group.what == "contacts"]
    at = replace(original, states=states_of(chosen))
    return FileCase(
        original, engine, Folded(original.robot, ()), at, on, found_touching(original.robot, chosen), np.ones(len(chosen), bool)
    )


def left_by(own: Ground, answer: Sequence[float]) -> float:
    """The momentum that an answer leaves along the spin, as a share of what Drake documents, of a state that parts."""
    h, matrix = STEP, [sum(MASSES) + STEP * DAMPERS[0], sum(MASSES[1:]), INERTIA + STEP * DAMPERS[2]]
    best = [float(one.mid()) for one in own.accelerations()]
    scales = [1 / np.sqrt(one) for one in matrix]
    left = [scale * one * h * (found - wanted) for scale, one, found, wanted in zip(scales, matrix, answer, best, strict=True)]
    whole = [scale * one * (v + h * found) for scale, one, v, found in zip(scales, matrix, own.v, answer, strict=True)]
    return float(np.linalg.norm(left) / (1e-14 + 1e-6 * np.linalg.norm(whole)))


@pytest.mark.usefixtures("balls")
def test_what_is_left_is_a_share_of_the_documented_tolerance() -> None:
    chosen = [one for one in grounds(COMPLIANCES["soft"]) if one.after()[0] == "parts"]
    case, best = case_of(chosen), rounded(chosen)
    for by, is_within in ((1e-7, True), (1e-3, False)):
        moved = best + by * np.array([1.0, -2.0, 3.0])
        answers = EngineAnswers(by_joint(case.at.joints, moved))
        compared = compare(case.computed, moved, factorises=True)
        assert (compared.verdicts == "disagrees").all()
        wanted = max(left_by(own, answer) for own, answer in zip(chosen, moved.tolist(), strict=True))
        share = case.stops_as_documented(answers, compared)
        assert (wanted <= 1.0) == is_within and share == (pytest.approx(wanted, rel=1e-3) if is_within else None)


@pytest.mark.usefixtures("balls")
def test_where_no_row_is_in_the_problem_nothing_is_left() -> None:
    """No solver goes there, however little an answer is wrong by."""
    chosen = [replace(one, q=(one.q[0], 0.01, one.q[2])) for one in grounds(COMPLIANCES["soft"], 4)]
    case = case_of(chosen)
    assert not case.touching.is_any.any()
    moved = case.computed.high + 1e-7
    compared = compare(case.computed, moved, factorises=True)
    assert case.stops_as_documented(EngineAnswers(by_joint(case.at.joints, moved)), compared) is None


@pytest.mark.parametrize("way", ["sticks", "slides 1"])
@pytest.mark.usefixtures("balls")
def test_a_contact_of_another_friction_is_beyond_the_documented_tolerance(way: str) -> None:
    chosen = [one for one in grounds(COMPLIANCES["soft"], 40) if one.after()[0] == way]
    odd = [replace(one, friction=1.01 * one.friction) for one in chosen]
    case, moved = case_of(chosen), rounded(odd)
    answers = EngineAnswers(by_joint(case.at.joints, moved))
    share = case.stops_as_documented(answers, compare(case.computed, moved, factorises=True))
    # What sticks feels no friction.
    assert (share is None) == (way == "slides 1")


@pytest.mark.usefixtures("balls")
def test_a_check_takes_the_same_share() -> None:
    """Of the truth that an engine's reading gives, and of one of no step none."""
    chosen = grounds(COMPLIANCES["soft"], 8)
    case, rule = case_of(chosen), engine_of(ENGINE).stops
    assert rule is not None
    moved = rounded(chosen) * (1 + 1e-9)
    for mechanism, numbers, among in case.touching.by_structure(
        lambda contacts: documented(case.at.robot, case.caller, case.judged, (), contacts)
    ):
        assert isinstance(mechanism, DeclaredMechanism)
        alone = replace(mechanism, parameters=tuple(
            (name, float(value), unit) for (name, _, unit), value in zip(mechanism.parameters, numbers[0], strict=True)
        ))  # fmt: skip
        first, answers = states_of(chosen)[among[:1]], moved[among[:1]]
        [share] = _shares_of(AccelerationTruth(alone), first, answers, rule)
        assert 0 < share < 1 and share == share_of_rule(mechanism, first, numbers[:1], answers, rule)[0]
    plain = AccelerationTruth(mechanism_of(case.at.robot))
    assert _shares_of(plain, states_of(chosen), moved, rule).tolist() == [np.inf] * len(chosen)


# Drake itself.


@pytest.mark.nightly
@pytest.mark.usefixtures("drake")
def test_a_check_with_contacts_tells_where_the_solver_stops() -> None:
    words = ["check", str(BALL), "--contacts", "--subject", f"{ENGINE}/urdf", "--states", "60"]
    done = subprocess.run([sys.executable, "-m", "harness", *words], check=False, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "of the tolerance that it documents" in done.stdout and "contacts on" in done.stdout


@pytest.mark.nightly
@pytest.mark.usefixtures("drake")
def test_drake_is_at_the_documented_optimum_or_stops_as_it_documents() -> None:
    record = judge_switched_on(meant(robot_at(BALL), 400, seed=0), ENGINE)
    assert record.explained and record.touching >= 100 and [part.what for part in record.parts].count("contacts") == 3
    assert record.left is not None and 0 < record.left <= 1
    assert "of the tolerance that it documents" in switched_on_text(record)


@pytest.mark.nightly
@pytest.mark.usefixtures("drake")
@pytest.mark.parametrize("name", ["friction", "relaxation time", "stiffness", "a normal's sign"])
def test_another_law_is_red(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    one_percent = {"friction": "friction", "relaxation time": "relaxation_time", "stiffness": "stiffness"}
    if name in one_percent:
        monkeypatch.setattr(step_law, "_touching", _with(**{one_percent[name]: 1.01}))
    else:
        FAULTS[name](monkeypatch)
    record = judge_switched_on(meant(robot_at(BALL), 100, seed=0), ENGINE)
    assert record.verdict == "disagrees" and not record.explained and record.left is None


@pytest.mark.nightly
@pytest.mark.usefixtures("drake")
@pytest.mark.parametrize(
    "change",
    [
        ('<drake:mu_dynamic value="0.25"/>', '<drake:mu_dynamic value="0.26"/>'),
        ('<drake:relaxation_time value="0.0625"/>', '<drake:relaxation_time value="0.07"/>'),
        ('<drake:point_contact_stiffness value="8192"/>', '<drake:point_contact_stiffness value="8000"/>'),
    ],
)
def test_each_number_of_a_shape_is_felt(change: tuple[str, str], tmp_path: Path) -> None:
    """So that agreement on one file is agreement on these."""
    robot = meant(robot_at(BALL), 64, seed=0)
    on = [one for one in switches_of(robot.robot, robot.robot, engine_of(ENGINE)) if one.group.what == "contacts"]
    own, other = (
        AskedEngine(robot, engine_of(ENGINE), path).with_those(on).of(robot.robot.joints) for path in (None, edited(BALL, tmp_path, change))
    )
    assert not np.array_equal(own, other)


@pytest.mark.nightly
@pytest.mark.usefixtures("drake")
def test_a_motion_that_grows_without_bound_leads_to_no_state() -> None:
    """Drake ends it with an error, and the other states are judged."""
    record = judge_switched_on(meant(robot_at(BUILT_IN.model_path("euler_disc", "urdf")), 200, seed=2), ENGINE)
    assert record.explained and record.touching >= 50


@pytest.mark.nightly
@pytest.mark.usefixtures("drake")
def test_a_file_whose_shapes_are_refused_has_its_limits_all_the_same(tmp_path: Path) -> None:
    mesh = ('<box size="2000 2000 2"/>', '<mesh filename="package://nowhere/ground.obj"/>')
    record = judge_switched_on(meant(robot_at(edited(BALL, tmp_path, mesh)), 64, seed=0), ENGINE)
    assert record.verdict == "agrees" and set(record.judged) == {"joint limits"}
    assert all("is refused" in part.why_not and "nowhere" in part.why_not for part in record.parts if part.what == "contacts")


@pytest.mark.nightly
@pytest.mark.usefixtures("drake")
@pytest.mark.parametrize("name", TOUCHING)
def test_mechanisms_that_touch_are_held(name: str) -> None:
    record = judge_switched_on(meant(robot_at(BUILT_IN.model_path(name, "urdf")), 64, seed=0), ENGINE)
    assert record.explained and record.touching >= 8
