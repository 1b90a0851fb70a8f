"""Pinocchio's contacts in points, over one step, are held against the cone that it documents: by Coulomb's law, and the convex one."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import flint
import numpy as np
import pinocchio
import pytest
from catalogue import BUILT_IN
from comparison.robots import FILES, edited
from flint import arb, arb_mat
from support import call_engines_here

from harness.comparison.robot_library import engine_of, robot_at
from harness.comparison.switched_on import judge_switched_on
from harness.engines.adapters.pinocchio import step_law, stepping
from harness.engines.adapters.pinocchio import touching as found_by
from harness.engines.adapters.pinocchio.robot import model_of
from harness.engines.adapters.pinocchio.step_law import COMPLIANCE, STEP
from harness.engines.reading import elements_of
from harness.explain import touching
from harness.explain.documented import documented
from harness.explain.file_case import FileCase
from harness.explain.meant import meant, request_of
from harness.explain.switches import switches_of
from harness.explain.touching import Touching
from harness.files.contacts import FoundContact
from harness.files.equalities import Constraint
from harness.files.rules import ConstraintLaw
from harness.files.touching import ConeKind
from harness.files.tree import WORLD
from harness.library import Stance
from harness.programs.states import States
from harness.results.switched_on import SwitchedOnRecord, switched_on_text
from harness.trees.robot import Robot
from harness.truth.compare import compare
from harness.truth.reference import Reference
from harness.verdict import AGREEMENT

ENGINE, CONVEX, GAUSS_SEIDEL = "pinocchio_admm", "pinocchio_admm_convex", "pinocchio_pgs"
BALL = FILES / "ball.urdf"
MASSES, DAMPERS, INERTIA, RADIUS, GRAVITY = (0.25, 0.125, 0.5), (3.0, 0.0, 0.001), 0.004, 0.125, 9.81
# Mechanisms of the catalogue whose bodies touch, of fixed bodies, of one another, in several points, and one that floats.
TOUCHING = (
    "block_on_incline",
    "box_stack",
    "newtons_cradle",
    "painleve_rod",
    "rimless_wheel",
    "sphere_on_incline",
    "euler_disc",
    "tippe_top",
)


# The step, by a way of its own.


@dataclass(frozen=True)
class Ground:
    """The ball on the ground in one state: the documented problem in balls, every number of the law written out."""

    q: Sequence[float]
    v: Sequence[float]
    tau: Sequence[float]
    friction: float = 0.5
    is_convex: bool = True

    def contact(self) -> FoundContact:
        """Halfway between both surfaces."""
        point, frame = (self.q[0], 0.0, self.q[1] / 2), (0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0)
        return FoundContact((WORLD, "ball"), point, frame, self.q[1], 0.0, (self.friction, self.friction))

    def answer(self, more: float = 0.0) -> tuple[str, list[Any]]:
        """What the contact does, and the accelerations over the step: the one way that fits; with ``more`` along the normal [m/s^2]."""
        h, mu, compliance = arb(STEP), arb(self.friction), arb(COMPLIANCE)
        cart, fork, ball = map(arb, MASSES)
        matrix = [cart + fork + ball, fork + ball, arb(INERTIA)]
        force = [arb(applied) - arb(damper) * arb(v) for applied, damper, v in zip(self.tau, DAMPERS, self.v, strict=True)]
        force[1] -= (fork + ball) * arb(GRAVITY)
        rows = self.rows()
        wanted = [-sum(a * arb(v) for a, v in zip(row, self.v, strict=True)) / h for row in rows]
        wanted[0] += arb(more)
        fits = []
        for name, weights in self._ways(mu):
            # Forces are weights / R times (wanted - J a).
            full, right = arb_mat(3, 3), list(force)
            for i in range(3):
                full[i, i] += matrix[i]
                for a, row in enumerate(rows):
                    for b, other in enumerate(rows):
                        own = row[i] * weights[a][b] / compliance
                        right[i] += own * wanted[b]
                        for j in range(3):
                            full[i, j] += own * other[j]
            moved = list(full.solve(arb_mat([[one] for one in right])).entries())
            free = [one - sum(a * b for a, b in zip(row, moved, strict=True)) for one, row in zip(wanted, rows, strict=True)]
            if self._is(name, mu, free):
                fits.append((name, moved))
        (found,) = fits
        return found

    def rows(self) -> list[list[Any]]:
        """Of the ball against the ground, along the normal and along x; nothing moves along y."""
        return [[arb(0), arb(1), arb(0)], [arb(1), arb(0), arb(self.q[1]) / 2 - (arb(self.q[1]) + arb(RADIUS))]]

    def _ways(self, mu: Any) -> Iterator[tuple[str, list[list[Any]]]]:
        """What the contact may do, with the projection on its forces."""
        yield "parts", [[arb(0)] * 2] * 2
        yield "sticks", [[arb(1), arb(0)], [arb(0), arb(1)]]
        for sign in (1, -1):
            edge = [arb(1), sign * mu]
            # What slides parts in the convex problem alone.
            convex = [[a * b / (1 + mu * mu) for b in edge] for a in edge]
            yield f"slides {sign}", convex if self.is_convex else [[one, arb(0)] for one in edge]

    def _is(self, name: str, mu: Any, free: Sequence[Any]) -> bool:
        normal, size = free[0], abs(free[1])
        parting = mu * size + normal if self.is_convex else normal
        if name == "parts":
            return bool(parting < 0)
        if name == "sticks":
            return bool(size < mu * normal)
        return bool(size > mu * normal) and bool(parting > 0) and bool(free[1] * int(name.split()[1]) > 0)


def grounds(count: int = 24, engine: str = CONVEX) -> list[Ground]:
    """States in all zones: bodies that part, stick, and slide both ways."""
    random, found = np.random.default_rng(7), []
    for number in range(count):
        q = [float(random.uniform(-0.25, 0.25)), -float(10 ** random.uniform(-4, -2)), float(random.uniform(-3, 3))]
        spin = float(random.uniform(-8, 8))
        slip = float(random.uniform(-1, 1)) * (0.0, 1e-3, 1.0, 8.0)[number % 4]
        rise = float(random.uniform(-0.02, 0.02)) * (1 + 200 * (number % 5 == 0))
        v, tau = [spin * (RADIUS + q[1] / 2) + slip, rise, spin], random.uniform(-1, 1, 3).tolist()
        found.append(Ground(q, v, tau, is_convex=engine == CONVEX))
    return found


def truth_of(robot: Robot, chosen: Sequence[Ground]) -> Reference:
    engine = engine_of(CONVEX if chosen[0].is_convex else ENGINE)
    on = [one for one in switches_of(robot, robot, engine) if one.group.what == "contacts"]
    states = States.at(*(np.array([getattr(one, name) for one in chosen]) for name in ("q", "v", "tau")))
    found = Touching.of([[one.contact()] for one in chosen], robot, ConeKind.ELLIPTIC)
    return found.truth(states, lambda contacts: documented(robot, engine, on, (), contacts))


@pytest.fixture
def balls() -> Iterator[None]:
    with flint.ctx.workprec(256):
        yield


@pytest.mark.parametrize("engine", [CONVEX, ENGINE])
@pytest.mark.usefixtures("balls")
def test_the_certified_step_is_that_of_the_documented_problem(engine: str) -> None:
    chosen = grounds(engine=engine)
    truth = truth_of(robot_at(BALL), chosen)
    assert truth.certified.all()
    ways = Counter(one.answer()[0] for one in chosen)
    assert set(ways) == {"parts", "sticks", "slides 1", "slides -1"} and min(ways.values()) >= 2, ways
    for state, own in enumerate(chosen):
        pairs = zip(own.answer()[1], truth.high[state].tolist(), truth.low[state].tolist(), strict=True)
        off = np.array([float((one - arb(high) - arb(low)).mid()) for one, high, low in pairs])
        assert truth.lengths(np.tile(off, (len(chosen), 1)))[state] <= truth.radius[state] + 2.0**-90 * truth.sensitivity[state]


# Faults of the law.

_law, _giving, _constraints = step_law._law, step_law._giving, touching._constraints
_ODD = 1 + 1e-8


def _law_with(change: Callable[[ConstraintLaw], ConstraintLaw]) -> Callable[[pytest.MonkeyPatch], None]:
    return lambda patch: patch.setattr(step_law, "_giving", lambda law: change(_giving(law)))


def _rubbing(law: ConstraintLaw) -> ConstraintLaw:
    assert law.cone is not None
    return replace(law, cone=replace(law.cone, friction=tuple(_ODD * one for one in law.cone.friction)))


def _found_as(change: Callable[[FoundContact], FoundContact]) -> Callable[[pytest.MonkeyPatch], None]:
    def constraints(found: Sequence[FoundContact], *rest: Any) -> list[Constraint]:
        return _constraints([change(one) for one in found], *rest)

    return lambda patch: patch.setattr(touching, "_constraints", constraints)


def _turned(one: FoundContact) -> FoundContact:
    return replace(one, frame=(*(-x for x in one.frame[:3]), *one.frame[3:]))


FAULTS: dict[str, Callable[[pytest.MonkeyPatch], None]] = {
    "friction": _law_with(_rubbing),
    "compliance": _law_with(lambda law: replace(law, least_regularisation=_ODD * law.least_regularisation)),
    "step": _law_with(lambda law: replace(law, damping=_ODD * law.damping)),
    "a normal's sign": _found_as(_turned),
    "bodies": _found_as(lambda one: replace(one, bodies=one.bodies[::-1])),
    "point": _found_as(lambda one: replace(one, point=(*one.point[:2], one.point[2] + 1e-9))),
    "a contact left out": lambda patch: patch.setattr(touching, "_constraints", lambda *_: []),
}


def _of_the_other_problem(patch: pytest.MonkeyPatch) -> None:
    own = step_law._law
    patch.setattr(step_law, "_law", lambda constraint, is_convex: own(constraint, not is_convex))


FAULTS["the other problem"] = _of_the_other_problem


@pytest.mark.parametrize("engine", [CONVEX, ENGINE])
@pytest.mark.parametrize("name", [None, *FAULTS])
@pytest.mark.usefixtures("balls")
def test_a_fault_in_the_law_is_seen(engine: str, name: str | None, monkeypatch: pytest.MonkeyPatch) -> None:
    robot, chosen = robot_at(BALL), grounds(12, engine)
    answers = np.array([[float(one.mid()) for one in own.answer()[1]] for own in chosen])
    if name is not None:
        FAULTS[name](monkeypatch)
    assert (compare(truth_of(robot, chosen), answers, factorises=True).backward_error.max() > AGREEMENT) == (name is not None)


def test_distance_is_felt_by_no_contact() -> None:
    """Both points of a constraint are one."""
    chosen = grounds(4)
    off = Touching.of([[replace(one.contact(), distance=3 * one.q[1])] for one in chosen], robot_at(BALL), ConeKind.ELLIPTIC)
    assert [one.says.distance for own in off.contacts for one in own] == [3 * one.q[1] for one in chosen]


# Pinocchio itself.


def held_by(name: str = "", engine: str = ENGINE, states: int = 40, seed: int = 0) -> SwitchedOnRecord:
    path = BUILT_IN.model_path(name, "urdf") if name else BALL
    return judge_switched_on(meant(robot_at(path), states, seed), engine)


@pytest.mark.ci
@pytest.mark.parametrize("engine", [CONVEX, ENGINE])
def test_the_solver_stops_early_and_agrees_where_it_goes_on(engine: str) -> None:
    record = held_by(engine=engine)
    assert record.explained and record.to_the_end is not None and record.to_the_end <= AGREEMENT
    assert record.backward_error is not None and record.backward_error > 1e6 and record.touching >= 15
    assert [part.what for part in record.parts if not part.why_not].count("contacts") == 3
    assert "stops its solver" in switched_on_text(record) and "ADMMUpdateRule.CONSTANT" in record.remedy


def _when(name: str, engine: str) -> pytest.MarkDecorator | tuple[()]:
    """Boxes on one another always, and of Coulomb's law in CI what moves in space alone; the night has all at more states."""
    is_short = engine == CONVEX or name in ("euler_disc", "sphere_on_incline")
    return () if name == "box_stack" else pytest.mark.ci if is_short else pytest.mark.nightly


@pytest.mark.parametrize(
    ("name", "engine"), [pytest.param(name, engine, marks=_when(name, engine)) for engine in (CONVEX, ENGINE) for name in TOUCHING]
)
def test_mechanisms_that_touch_are_held(name: str, engine: str) -> None:
    record = held_by(name, engine)
    # Of the balls of the cradle the outer ones alone may touch: a joint connects each with the next. The solver is soon done with one row.
    is_cradle = name == "newtons_cradle"
    assert record.explained and record.touching >= (5 if is_cradle else 8)
    assert (record.verdict == "agrees") == is_cradle and (record.to_the_end is None) == is_cradle


# Seeds of 48 states of each file: 10^4 states, of which most touch.
SEEDS = range(24)


# The other solver of Coulomb's law is asked at a quarter of these.
ASKED = [(engine, seed) for engine, seeds in ((CONVEX, SEEDS), (ENGINE, SEEDS), (GAUSS_SEIDEL, SEEDS[::4])) for seed in seeds]


@pytest.mark.nightly
@pytest.mark.parametrize(("engine", "seed"), ASKED)
@pytest.mark.parametrize("name", ["", *TOUCHING])
def test_no_state_is_red(engine: str, name: str, seed: int) -> None:
    record = held_by(name, engine, 48, seed)
    assert (record.explained, record.message, record.rest) == (True, "", [])


@pytest.mark.ci
@pytest.mark.parametrize("path", [BUILT_IN.model_path("tippe_top", "urdf"), FILES / "puck.urdf"], ids=["free", "planar"])
def test_velocities_are_along_the_axes_of_the_body(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    robot = meant(robot_at(path), 32, seed=0)
    right = judge_switched_on(robot, ENGINE)
    assert right.explained and right.touching >= 8
    _law_with(lambda law: replace(law, in_body=False))(monkeypatch)
    monkeypatch.setattr(FileCase, "left", lambda *_: ["nothing explains it"])
    wrong = judge_switched_on(robot, ENGINE)
    assert wrong.verdict == "disagrees" and not wrong.explained and wrong.rest


@pytest.mark.ci
@pytest.mark.parametrize("name", ["", "euler_disc"])
def test_gauss_seidel_does_not_converge_where_tangents_weigh_unlike(name: str) -> None:
    """On a planar robot they do: the solver of the other method ends at the solution. On a disc it ends there by itself."""
    record = held_by(name, GAUSS_SEIDEL, 16)
    assert record.explained and record.touching >= 6 and record.to_the_end is not None and record.to_the_end <= AGREEMENT
    assert ("does not converge" in record.fault) == (not name) == ("does not converge" in switched_on_text(record))
    assert ("ADMM" in record.remedy) == (not name)


_Shapes = found_by.TouchingShapes
_at, _axes, _make = _Shapes.at, found_by._axes, stepping.pinocchio.PointContactConstraintModel


def _one_percent_more(patch: pytest.MonkeyPatch) -> None:
    own = stepping.pinocchio.PointContactConstraintModel.setFriction
    patch.setattr(stepping.pinocchio.PointContactConstraintModel, "setFriction", lambda model, mu: own(model, 1.01 * mu))


def _dropped(patch: pytest.MonkeyPatch) -> None:
    """Those of the ground are told, and are constraints of the world against itself."""

    def models(shapes: Any, q: Any) -> Iterator[tuple[FoundContact, Any]]:
        for found, model in _at(shapes, q):
            still = _make(shapes._model, 0, 0)
            yield found, still if found.bodies[0] == WORLD else model

    patch.setattr(_Shapes, "at", models)


def _opposite(patch: pytest.MonkeyPatch) -> None:
    def models(shapes: Any, q: Any) -> Iterator[tuple[FoundContact, Any]]:
        for found, model in _at(shapes, q):
            yield _turned(found), model

    patch.setattr(_Shapes, "at", models)


def _of_other_settings(patch: pytest.MonkeyPatch) -> None:
    """Whoever asks for one of both problems has settings of the other."""
    settings = stepping.pinocchio.ADMMSolverSettings

    class Other(settings):  # type: ignore[misc,valid-type]
        def __setattr__(self, name: str, value: Any) -> None:
            super().__setattr__(name, not value if name == "solve_ncp" else value)

    patch.setattr(stepping.pinocchio, "ADMMSolverSettings", Other)


def _rigid(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(stepping, "COMPLIANCE", 1.01 * COMPLIANCE)


NAMED = {
    _one_percent_more: "it is what contacts with 1.01 times the friction give",
    _opposite: "it is what contacts give whose normals point the other way",
    _dropped: f"it is what there is without the contacts of {WORLD} and sphere",
}


@pytest.mark.ci
@pytest.mark.parametrize("engine", [CONVEX, ENGINE])
@pytest.mark.parametrize("plant", [_one_percent_more, _dropped, _opposite, _of_other_settings, _rigid])
def test_a_fault_of_the_engine_is_seen_and_named(
    plant: Callable[[pytest.MonkeyPatch], None], engine: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    call_engines_here(monkeypatch)
    plant(monkeypatch)
    # Limits give where there is a contact alone.
    record = held_by("sphere_on_incline" if plant is _dropped else "", engine, 40 if engine == CONVEX else 16)
    assert record.verdict == "disagrees" and not record.explained
    first, *others, last = record.rest
    assert re.match(r"what its solver leaves is not the cause: \S+ data roundoffs remain if you use pin\.", last)
    assert first == "it is only at states where bodies touch that it is not what its documentation gives"
    assert (others[:1] == [NAMED[plant]]) if plant in NAMED else not others


GROUND, SKIN = (
    ('<link name="world">', '<link name="world"><contact><lateral_friction value="0.25"/></contact>'),
    (
        '<link name="ball">',
        '<link name="ball"><contact><lateral_friction value="0.75"/></contact>',
    ),
)


@pytest.mark.parametrize(("said", "friction"), [((), 0.5), ((SKIN,), 0.75), ((GROUND, SKIN), 0.1875)], ids=["nothing", "one", "both"])
def test_friction_is_what_links_say(said: Sequence[tuple[str, str]], friction: float, tmp_path: Path) -> None:
    """The default of Pinocchio's constraint model where nobody says any, and the product of both."""
    asked = request_of(robot_at(edited(BALL, tmp_path, *said)), Stance.PLAIN)
    shapes = found_by.TouchingShapes(model_of(asked), asked.path, elements_of(asked))
    q = pinocchio.neutral(shapes._model)
    q[1] = -0.01
    [(found, model)] = shapes.at(q)
    assert found.friction == (friction, friction) and model.getFriction() == friction
    assert (found.bodies, found.frame[:3]) == ((WORLD, "ball"), (0.0, 0.0, 1.0)) and found.distance == pytest.approx(-0.01)
