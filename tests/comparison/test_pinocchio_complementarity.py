"""Steps of contacts by Coulomb's law, which no cost has, against a solution in impulses in 60 digits, and their proofs."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest
from comparison.test_pinocchio_contacts import BALL, CONVEX, ENGINE, GAUSS_SEIDEL, STEP, balls, grounds, held_by
from flint import arb, arb_mat
from mpmath import mpf
from support import harness

from harness.arrays import Array
from harness.comparison.robot_library import engine_of, robot_at
from harness.engines.adapters.pinocchio.step_law import COMPLIANCE
from harness.explain.documented import documented
from harness.explain.switches import switches_of
from harness.explain.touching import Touching
from harness.files.contacts import FoundContact
from harness.files.equalities import Constraint
from harness.files.touching import ConeKind
from harness.files.tree import WORLD
from harness.programs.mechanisms.cones import Zone
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.states import States
from harness.truth import complementarity
from harness.truth.compare import compare
from harness.truth.complementarity import Modes, Solution, StateProblem
from harness.truth.reference import Reference
from harness.truth.slip_share import slip_share
from harness.verdict import AGREEMENT, Verdict

__all__ = ["balls"]
DIGITS = 60
MASS, MOMENTS, GRAVITY = 0.5, (0.002, 0.003, 0.0045), 9.81
BLOCK = f"""<robot name="block">
<link name="world"><collision><origin xyz="0 0 -1"/><geometry><box size="9 9 2"/></geometry></collision></link>
<link name="block"><inertial><mass value="{MASS}"/>
<inertia ixx="{MOMENTS[0]}" ixy="0" ixz="0" iyy="{MOMENTS[1]}" iyz="0" izz="{MOMENTS[2]}"/></inertial>
<collision><geometry><box size="0.2 0.1 0.1"/></geometry></collision></link>
<joint name="free" type="floating"><parent link="world"/><child link="block"/></joint></robot>"""
# Where each touches the ground, from its centre.
BODIES = {
    "a ball": [(0.01, -0.02, -0.05)],
    "a sliding block": [(x, y, -0.05) for x in (-0.1, 0.1) for y in (-0.05, 0.05)],
    "two contacts": [(0.1, 0.05, -0.05), (-0.1, 0.02, -0.05)],
}


@dataclass(frozen=True)
class Placed:
    """The block at a turn, without a spin: so its velocities are the same in all frames, and no velocity turns."""

    turn: Sequence[float]
    v: Sequence[float]
    tau: Sequence[float]
    points: Sequence[Sequence[float]]
    friction: Sequence[float]

    @property
    def q(self) -> list[float]:
        return [0.3, -0.2, 0.05, *self.turn]

    def contacts(self) -> list[FoundContact]:
        frame = (0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0)
        places = [tuple(own + one for own, one in zip(self.q[:3], point, strict=True)) for point in self.points]
        return [
            FoundContact((WORLD, "block"), place, frame, -0.001, 0.0, (mu, mu)) for place, mu in zip(places, self.friction, strict=True)
        ]

    def terms(self) -> tuple[Any, Any, Any, Any]:
        """M, M a0, J and J v, of the rows normal, along x and along y of each contact."""
        length = mpmath.norm([mpf(one) for one in self.turn])
        w, x, y, z = (mpf(one) / length for one in self.turn)
        into = mpmath.matrix(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)],
                [2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)],
                [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)],
            ]
        )
        mass, rows = mpmath.diag([mpf(MASS)] * 3 + [mpf(one) for one in MOMENTS]), []
        for contact in self.contacts():
            arm = [mpf(one) - mpf(own) for one, own in zip(contact.point, self.q, strict=False)]
            moments = [arm[1], -arm[0], 0], [0, arm[2], -arm[1]], [-arm[2], 0, arm[0]]
            for axis, moment in zip((2, 0, 1), moments, strict=True):
                rows.append([mpf(int(axis == k)) for k in range(3)] + list(into * mpmath.matrix(moment)))
        jacobian, force = mpmath.matrix(rows), mpmath.matrix([mpf(one) for one in self.tau])
        force[2] -= mpf(MASS) * mpf(GRAVITY)
        return mass, force, jacobian, jacobian * mpmath.matrix([mpf(one) for one in self.v])

    def accelerations(self) -> list[Any]:
        """By Newton's method on the forces, projected on their sets, after many plain projections."""
        with mpmath.workdps(DIGITS):
            mass, force, jacobian, rate = self.terms()
            inverse = mass**-1
            delassus = jacobian * inverse * jacobian.T + mpf(COMPLIANCE) * mpmath.eye(jacobian.rows)
            free = jacobian * inverse * force + rate / mpf(STEP)
            start = self._projected_often(np.array(delassus.tolist(), float), np.array(free.tolist(), float).ravel())
            forces = mpmath.matrix([mpf(one) for one in start])
            little = mpf(10) ** (-DIGITS // 2)
            for _ in range(40):
                left = self.left(delassus, free, forces)
                if mpmath.norm(left) < mpf(10) ** -50 * (1 + mpmath.norm(forces)):
                    return list(inverse * (force + jacobian.T * forces))
                slopes = mpmath.matrix(forces.rows, forces.rows)
                for k in range(forces.rows):
                    moved = forces.copy()
                    moved[k] += little
                    slopes[:, k] = (self.left(delassus, free, moved) - left) / little
                forces = forces - mpmath.lu_solve(slopes, left)
        raise AssertionError("Newton's method does not end")

    def left(self, delassus: Any, free: Any, forces: Any) -> Any:
        """What forces are beside their projection along minus the velocities after the step over its length."""
        away = forces - (delassus * forces + free)
        return forces - mpmath.matrix(_projected(list(away), self.friction, mpmath.sqrt))

    def _projected_often(self, delassus: Array, free: Array) -> list[float]:
        share, forces = 0.5 / np.linalg.norm(delassus, 2), np.zeros(len(free))
        for _ in range(3000):
            forces = np.array(_projected((forces - share * (delassus @ forces + free)).tolist(), self.friction, np.sqrt))
        return [*map(float, forces)]


def _projected(away: Sequence[Any], friction: Sequence[float], root: Callable[[Any], Any]) -> list[Any]:
    """Normal forces above 0, and those across in a disc of so many times that, which is no projection on the cone."""
    found: list[Any] = []
    for place, mu in enumerate(friction):
        normal, *across = away[3 * place : 3 * place + 3]
        normal = max(normal, 0 * normal)
        size, most = root(across[0] ** 2 + across[1] ** 2), mu * normal
        found += [normal, *(one * most / size if size > most else one for one in across)]
    return found


def placed(points: Sequence[Sequence[float]], count: int) -> list[Placed]:
    """States that part, stick and slide in any direction."""
    random, found = np.random.default_rng(len(points)), list[Placed]()
    for number in range(count):
        turn = random.normal(size=4)
        slip, rise = random.uniform(-1, 1, 2) * (0.0, 0.01, 1.0)[number % 3], random.uniform(-0.02, 0.02)
        v = [*slip, rise, 0.0, 0.0, 0.0]
        tau = [*random.uniform(-3, 3, 3), *random.uniform(-0.2, 0.2, 3)]
        mus = random.uniform(0.2, 0.8, len(points)).tolist()
        found.append(Placed((turn / np.linalg.norm(turn)).tolist(), [*map(float, v)], [*map(float, tau)], points, mus))
    return found


@dataclass(frozen=True)
class Case:
    """States of a file, with the contacts there."""

    path: Path
    chosen: Sequence[Any]

    @property
    def states(self) -> States:
        return States.at(*(np.array([getattr(one, name) for one in self.chosen]) for name in ("q", "v", "tau")))

    @property
    def touching(self) -> Touching:
        contacts = [one.contacts() if isinstance(one, Placed) else [one.contact()] for one in self.chosen]
        return Touching.of(contacts, robot_at(self.path), ConeKind.ELLIPTIC)

    def documented(self, contacts: Sequence[Constraint]) -> Mechanism:
        robot, engine = robot_at(self.path), engine_of(ENGINE)
        on = [one for one in switches_of(robot, robot, engine) if one.group.what == "contacts"]
        return documented(robot, engine, on, (), contacts)

    def truth(self, near: Array | None = None) -> Reference:
        return self.touching.truth(self.states, self.documented, near=near)


@pytest.fixture
def block(tmp_path: Path) -> Path:
    path = tmp_path / "block.urdf"
    path.write_text(BLOCK)
    return path


@pytest.fixture
def solutions(monkeypatch: pytest.MonkeyPatch) -> list[list[Solution]]:
    """Those that are found of each state."""
    found, own = list[list[Solution]](), complementarity.distinct

    def kept(solutions: Any) -> Any:
        found.append(own(solutions))
        return found[-1]

    monkeypatch.setattr(complementarity, "distinct", kept)
    return found


def zones_of(solutions: Sequence[Sequence[Solution]]) -> Counter[Zone]:
    return Counter(zone for own in solutions for one in own for zone in one.modes.zones)


@pytest.mark.ci
@pytest.mark.parametrize("name", BODIES)
def test_certified_steps_are_those_of_a_solution_in_impulses(name: str, block: Path, solutions: list[list[Solution]]) -> None:
    chosen = placed(BODIES[name], 9)
    truth = Case(block, chosen).truth()
    zones = zones_of(solutions)
    assert truth.certified.all() and min(zones[zone] for zone in Zone) >= 2, zones
    for state, own in enumerate(chosen):
        with mpmath.workdps(DIGITS):
            pairs = zip(own.accelerations(), truth.high[state].tolist(), truth.low[state].tolist(), strict=True)
            off = np.array([float(one - mpf(high) - mpf(low)) for one, high, low in pairs])
        assert truth.lengths(np.tile(off, (len(chosen), 1)))[state] <= truth.radius[state] + 2.0**-90 * truth.sensitivity[state]


def rods(count: int = 24) -> list[Placed]:
    """States of Painleve's kind: pressed on the ground, what slides is pressed more than it is held."""
    random = np.random.default_rng(3)
    given = zip(random.uniform(-1, 1, count).tolist(), random.uniform(-0.02, 0.02, count).tolist(), strict=True)
    return [Placed((1.0, 0.0, 0.0, 0.0), (slip, 0.0, rise, 0.0, 0.0, 0.0), (0.0,) * 6, [(0.05, 0.0, -0.1)], (4.0,)) for slip, rise in given]


@pytest.mark.ci
def test_any_of_several_solutions_is_right(block: Path, solutions: list[list[Solution]]) -> None:
    case = Case(block, rods())
    alone = case.truth()
    several = [state for state, own in enumerate(solutions) if len(own) > 1]
    assert len(several) >= 3 and alone.certified.tolist() == [len(own) == 1 for own in solutions]
    ways = {tuple(one.modes.zones) for state in several for one in solutions[state]}
    assert ways == {(zone,) for zone in Zone}
    for state in several:
        own = solutions[state][:]
        for one in own:
            answer = np.array([[float(part.mid()) for part in one.accelerations]])
            truth = Case(block, [case.chosen[state]]).truth(answer)
            assert compare(truth, answer).verdicts.tolist() == [Verdict.AGREES.value]
            assert _is_solved(case.chosen[state], truth) and compare(truth, answer + 1e-9).backward_error[0] > AGREEMENT


def _is_solved(one: Placed, truth: Reference) -> bool:
    """True where forces that give the accelerations are their own projections."""
    with mpmath.workdps(DIGITS):
        mass, force, jacobian, rate = one.terms()
        found = mpmath.matrix([mpf(high) + mpf(low) for high, low in zip(truth.high[0].tolist(), truth.low[0].tolist(), strict=True)])
        pulled, inverse = mass * found - force, mass**-1
        forces = mpmath.lu_solve(jacobian * jacobian.T, jacobian * pulled)
        assert mpmath.norm(jacobian.T * forces - pulled) < mpf(10) ** -20 * (1 + mpmath.norm(pulled))
        delassus = jacobian * inverse * jacobian.T + mpf(COMPLIANCE) * mpmath.eye(3)
        left = one.left(delassus, jacobian * inverse * force + rate / mpf(STEP), forces)
        return bool(mpmath.norm(left) < mpf(10) ** -20 * (1 + mpmath.norm(forces)))


def test_a_state_without_a_proof_is_undecided(block: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    case = Case(block, placed(BODIES["a ball"], 3))
    answers = case.truth().high
    monkeypatch.setattr(StateProblem, "proved", lambda *_: None)
    undecided = case.truth()
    assert not undecided.certified.any()
    assert set(compare(undecided, answers).verdicts.tolist()) == {Verdict.UNDECIDED.value}
    assert "on which side of its range a force lies" in next(iter(undecided.why_undecided()))


# Proofs of one contact, at the origin of a mass of 1, whose rows are its coordinates.


def of_one_contact(pull: Sequence[float], friction: float = 0.5, weight: float = 8.0) -> StateProblem:
    unit = arb_mat(3, 3, [1, 0, 0, 0, 1, 0, 0, 0, 1])
    columns = [arb_mat([[arb(one)] for one in own]) for own in (pull, (0.0, 0.0, 0.0))]
    return StateProblem(unit, columns[0], unit, columns[1], [arb(weight)] * 3, [], [(0, [arb(friction)] * 2)])


@pytest.mark.usefixtures("balls")
@pytest.mark.parametrize(("pull", "zone"), [((1, 5, 2), "PARTS"), ((-9, 1, 1), "STICKS"), ((-9, 6, 8), "SLIDES"), ((0, 0, 0), "PARTS")])
def test_a_contact_alone_has_a_closed_form(pull: Sequence[float], zone: str) -> None:
    """Of weight w: the normal part is 1 / (1 + w) of the pull, and friction takes mu w of that off what slides along it."""
    found = of_one_contact(pull).proved(np.array(pull) / 3)
    assert found is not None and found.modes == Modes([], [Zone[zone]])
    normal, *across = (arb(one) for one in pull)
    slip = (across[0] ** 2 + across[1] ** 2).sqrt()
    share = {"PARTS": arb(1), "STICKS": 1 / arb(9), "SLIDES": 1 + arb(0.5) * 8 * (normal / 9) / slip}[zone]
    wanted = [normal if zone == "PARTS" else normal / 9, *(share * one for one in across)]
    assert all(one.overlaps(other) for one, other in zip(found.accelerations, wanted, strict=True))
    assert max(float(one.rad()) for one in found.accelerations) < 2.0**-150


@pytest.mark.usefixtures("balls")
def test_no_proof_where_zones_do_not_fit(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = of_one_contact((-9, 6, 8))
    for zone in (Zone.PARTS, Zone.STICKS):
        with monkeypatch.context() as patch:
            patch.setattr(StateProblem, "_modes", lambda *_, own=zone: Modes([], [own]))
            assert problem.proved(np.array([-1.0, 3.0, 4.0])) is None
    assert problem.proved(np.array([-1.0, 3.0, 4.0])) is not None


def _wrong_slide(self: StateProblem, rows: range, friction: Any, left: Any, found: tuple[Any, Any]) -> None:
    _slide(self, rows, friction, left, found)
    for row in rows[1:]:
        found[1][row, row] = 2 * found[1][row, row]


_slide = StateProblem._slide


@pytest.mark.usefixtures("balls")
def test_equations_with_wrong_derivatives_do_not_have_the_solution(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = of_one_contact((-9, 6, 8))
    found = problem.proved(np.array([-1.0, 3.0, 4.0]))
    assert found is not None
    whole = [float(one) for one in found.left]
    rounded = [arb(one) + arb(float((own - one).mid())) for one, own in zip(whole, found.left, strict=True)]
    assert problem.has(found, rounded) and not problem.has(found, [*map(arb, whole)])
    monkeypatch.setattr(StateProblem, "_slide", _wrong_slide)
    assert not problem.has(found, rounded)


@pytest.mark.usefixtures("balls")
def test_the_share_is_what_the_correction_of_a_slide_may_lose() -> None:
    """By differences of the law written out: only what slides has one."""
    case, little = Case(BALL, grounds(12, ENGINE)), 2.0**-60
    truth, states = case.truth(), case.states
    slides = 0
    for mechanism, values, numbers in case.touching.by_structure(case.documented):
        inputs = mechanism.inputs(states[numbers], mechanism.parameters_at(states[numbers], values))
        shares = slip_share(mechanism, inputs, truth.high[numbers], truth.norm_factor[numbers])  # type: ignore[arg-type]
        for state, share in zip(numbers.tolist(), shares.tolist(), strict=True):
            own = case.chosen[state]
            (way, found), (_, moved) = own.answer(), own.answer(little)
            slip = sum(row * (arb(v) / arb(STEP) + a) for row, v, a in zip(own.rows()[1], own.v, found, strict=True))
            change = np.array([float((other - one).mid()) / little for one, other in zip(found, moved, strict=True)])
            expected = truth.lengths(np.tile(change, (len(states), 1)))[state] * own.friction * abs(float(slip))
            assert share == pytest.approx(expected * way.startswith("slides"), rel=1e-9)
            slides += way.startswith("slides")
    assert 2 <= slides < len(states)


@pytest.mark.ci
def test_a_fast_slide_that_lightly_touches_agrees() -> None:
    """At one state De Saxce's correction is 10^5 times the normal velocity, whose last digits are lost in it."""
    record = held_by("painleve_rod", ENGINE, 48, seed=1)
    assert record.explained and record.to_the_end is not None and record.to_the_end <= AGREEMENT


def test_an_answer_of_what_sticks_chooses_a_truth_too(block: Path) -> None:
    """Its slip is none, which has no direction."""
    case = Case(block, [Placed((1.0, 0.0, 0.0, 0.0), (0.0,) * 6, (0.0,) * 6, [(0.0, 0.0, -0.05)], (0.5,))])
    truth = case.truth()
    near = case.truth(truth.high)
    assert truth.certified.all() and near.certified.all() and np.array_equal(near.high, truth.high)


@pytest.mark.ci
def test_a_check_holds_each_problem_against_its_own_law(tmp_path: Path) -> None:
    """Equations without contacts are the same of all, and so is what touches."""
    subjects = [part for engine in (CONVEX, ENGINE, GAUSS_SEIDEL) for part in ("--subject", f"{engine}/urdf")]
    path = tmp_path / "found.json"
    done = harness("check", str(BALL), "--contacts", "--states", "16", *subjects, "--json", str(path))
    found = {one["subject"]: one["verdict"] for one in json.loads(path.read_text())["records"]}
    assert found == dict.fromkeys(subjects[1::2], Verdict.EXPLAINED.value), done.stdout
