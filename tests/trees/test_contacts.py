"""Contacts of which points, frames and numbers are given: the certified optimum against an evaluation of its own, and MuJoCo's answers."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import mpmath
import mujoco
import numpy as np
import pytest
from contact_optimum import DIGITS, MODEL, STEP, Point
from contact_optimum import optimum as documented_optimum
from mpmath import mpf

from harness.engines.adapters.mujoco import law
from harness.engines.adapters.mujoco.contacts import found_contacts
from harness.explain.changes.readings import element_at
from harness.explain.touching import Touching
from harness.files.contacts import FoundContact, contacts_of
from harness.files.equalities import Constraint
from harness.programs.mechanisms import cones
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.states import States
from harness.trees.mechanism import mechanism_of
from harness.trees.robot import Robot, read_robot
from harness.trees.shapes import ShapesInWorld
from harness.truth.compare import compare
from harness.truth.declared import DeclaredMechanism
from harness.truth.optimum import optimum
from harness.truth.reference import Reference, ReferenceKernel
from harness.verdict import AGREEMENT

SIZES = (0, 2, 3, 5)
CONES = ("pyramidal", "elliptic")
DEEP = (0.3, 0.9, 0.5, 0.375, 2.5)


class Touched:
    """A robot with contacts by the law that MuJoCo documents."""

    def __init__(self, robot: Robot) -> None:
        assert robot.tree.place is not None
        self.robot, self.place, self.root = robot, robot.tree.place, element_at(robot.tree.place)
        self.apart = mechanism_of(robot)

    def by(self, chosen: Sequence[Constraint]) -> Mechanism:
        laws = law.laws_in(self.root, chosen)
        return optimum(self.apart, self.robot, chosen, laws, law.fuses(self.root, self.robot.format))

    def pushing(self, found: Sequence[FoundContact]) -> list[Constraint]:
        return contacts_of(found, self.place, law.cone_of(self.root))

    def truth(self, found: Sequence[Sequence[FoundContact]], states: States) -> Reference:
        """At each state with contacts of its own."""
        return Touching([*map(self.pushing, found)], np.arange(len(states))).truth(states, self.by)


def state(q: Sequence[float], v: Sequence[float], tau: Sequence[float]) -> States:
    return States.at(*(np.array(own, dtype=np.float64) for own in (q, v, tau)))


# Against an evaluation of its own.


def drawn(random: np.random.Generator, size: int, solref: tuple[float, float], sliding: tuple[float, float]) -> FoundContact:
    """A contact of two bodies anywhere, with so many coefficients of friction."""
    axes, _ = np.linalg.qr(random.normal(size=(3, 3)))
    pairs = [("world", "ball"), ("ball", "arm"), ("arm", "world"), ("arm", "ball")]
    return FoundContact(
        bodies=pairs[random.integers(len(pairs))],
        point=tuple(random.normal(size=3).tolist()),
        frame=tuple(axes.T.ravel().tolist()),
        distance=float(random.uniform(-0.4, 0.1)),
        margin=0.125,
        friction=tuple(random.uniform(0.1, 1.5, size).tolist()),
        solref=solref,
        solimp=DEEP,
        sliding=sliding,
    )


def half_at_the_desk(*options: Sequence[object]) -> list[Any]:
    """Every choice of one of each; every second one stands at the desk, and with it every option."""
    choices = itertools.product(*map(enumerate, options))
    return [pytest.param(*(one for _, one in case), marks=pytest.mark.ci if sum(n for n, _ in case) % 2 else ()) for case in choices]


def point_of(found: FoundContact) -> Point:
    (_, most, *_), (time, ratio) = DEEP, found.solref
    with mpmath.workdps(DIGITS):
        if time > 0:
            time = max(mpf(time), 2 * mpf(STEP))
            spring, damper = 1 / (mpf(most) * time * mpf(ratio)) ** 2, 2 / (mpf(most) * time)
        else:
            spring, damper = -mpf(time) / mpf(most) ** 2, -mpf(ratio) / mpf(most)
        sliding = 2 / (mpf(most) * mpf(found.sliding[0])) if found.sliding[0] else damper
        return Point(
            found.bodies,
            found.point,
            np.reshape(found.frame, (3, 3)).tolist(),
            found.distance,
            found.margin,
            found.friction,
            DEEP,
            *(float(one) for one in (spring, damper, sliding)),
        )


def farthest(folder: Path, cone: str, ratio: float, states: int) -> float:
    """The largest distance from the evaluation of its own, of the length of that, relative to the energy norm."""
    path = folder / f"{cone}{ratio:g}.xml"
    path.write_text(MODEL.format(option=f'cone="{cone}" impratio="{ratio:g}"', flag=""))
    touched, random, worst = Touched(read_robot(path)), np.random.default_rng(int(ratio)), 0.0
    for number in range(states):
        solref = [(0.25, 1.0), (0.001, 0.5), (-64.0, -4.0)][number % 3]
        found = [
            drawn(random, SIZES[(number + more) % 4], solref, (0.5, 1.0) if number % 2 else (0.0, 0.0)) for more in range(1 + number % 3)
        ]
        quaternion = random.normal(size=4)
        q = np.r_[random.normal(size=3), quaternion / np.linalg.norm(quaternion), random.normal()]
        v, tau = random.normal(size=7) * 10 ** random.uniform(-2, 1), random.normal(size=7) * 10 ** random.uniform(0, 2)
        truth = touched.truth([found], state(q, v, tau))
        assert truth.certified.all()
        own = documented_optimum(q, v, tau, [point_of(one) for one in found], cone == "elliptic", ratio)
        with mpmath.workdps(DIGITS):
            pairs = zip(own, truth.high[0].tolist(), truth.low[0].tolist(), strict=True)
            apart = mpmath.norm([one - mpf(high) - mpf(low) for one, high, low in pairs])
            worst = max(worst, float(apart / mpmath.norm(own)))
    return worst


# What is left of y where a contact slides is squared; the quaternion is normalised in both.
_DIGITS = 1e-27


@pytest.mark.ci
@pytest.mark.parametrize(("cone", "ratio"), half_at_the_desk(CONES, (1.0, 10.0)))
def test_the_optimum_is_that_of_another_evaluation(cone: str, ratio: float, tmp_path: Path) -> None:
    assert farthest(tmp_path, cone, ratio, 8) < _DIGITS


@pytest.mark.nightly
@pytest.mark.parametrize(("cone", "ratio"), [*itertools.product(CONES, (1.0, 10.0, 0.25))])
def test_the_optimum_is_that_of_another_evaluation_at_many_states(cone: str, ratio: float, tmp_path: Path) -> None:
    assert farthest(tmp_path, cone, ratio, 400) < _DIGITS


@pytest.mark.ci
def test_bounds_of_double_double_prove_what_balls_do(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    stepped = Stepped(written(tmp_path, "elliptic", 10, 5))
    at, found = zip(*((one[0], one[1]) for _ in range(24) if len((one := stepped.answer())[1])), strict=True)
    states = States.concatenate(at)
    with monkeypatch.context() as without_balls:
        without_balls.setattr(cones.Cone, "zone_in_balls", None)
        fast = stepped.touched.truth(found, states)
    monkeypatch.setattr(cones.Cone, "are_shown", lambda self, found, *_: np.zeros(len(found), dtype=np.bool_))
    exact = stepped.touched.truth(found, states)
    assert fast.certified.all() and exact.certified.all()
    assert (fast.lengths((fast.high - exact.high) + (fast.low - exact.low)) <= fast.radius + exact.radius).all()
    np.testing.assert_allclose(fast.sensitivity, exact.sensitivity, rtol=1e-9)


# Against MuJoCo.

ON_PLANE = """<mujoco><option cone="{cone}" impratio="{ratio}" iterations="100" tolerance="0"><flag diagexact="{exact}"/></option>
<worldbody><geom type="plane" size="1 1 1" {friction}/>
<body name="ball"><freejoint/><geom type="sphere" size=".1" mass="1" margin="0.01" {friction}/>
<body name="arm" pos="0 0 .3"><joint name="hinge" axis="0 1 0"/>
<geom type="capsule" size=".05 .1" mass="1" margin="0.01" {friction}/></body>
</body></worldbody></mujoco>"""


def written(folder: Path, cone: str, ratio: float = 1, size: int = 2, exact: str = "disable") -> Path:
    """A ball that carries an arm, above a plane."""
    path = folder / f"{cone}{ratio:g}{size}{exact}.xml"
    friction = f'condim="{size + 1}" friction="0.7 0.03 0.02" solref="0.05 0.8" solimp="0.5 0.9 0.02"'
    path.write_text(ON_PLANE.format(cone=cone, ratio=ratio, friction=friction, exact=exact))
    return path


class Stepped:
    """MuJoCo at states in which bodies touch; the last axis of ``friction`` is changed so that no two directions are alike."""

    def __init__(self, path: Path) -> None:
        self.touched, self.model = Touched(read_robot(path)), mujoco.MjModel.from_xml_path(str(path))
        self.data, self.random = mujoco.MjData(self.model), np.random.default_rng(3)

    def answer(self) -> tuple[States, list[FoundContact], np.ndarray]:
        data, random = self.data, self.random
        tilt = random.normal(size=4)
        tilt[0] += 3
        data.qpos[:] = np.r_[
            random.uniform(-1, 1, 2), 0.1 + 0.01 * random.uniform(-1.5, 1), tilt / np.linalg.norm(tilt), random.uniform(-2, 2)
        ]
        data.qvel[:] = random.normal(size=7) * 10 ** random.uniform(-2, 0.5)
        data.qfrc_applied[:], data.qacc_warmstart[:] = random.normal(size=7) * 5, 0
        mujoco.mj_forward(self.model, data)
        return state(data.qpos, data.qvel, data.qfrc_applied), found_contacts(self.model, data.contact[: data.ncon]), data.qacc.copy()

    def error(self, states: int, change=lambda found: found) -> float:  # type: ignore[no-untyped-def]
        """The most data roundoffs between MuJoCo and the optimum, of contacts that ``change`` makes others, at so many further states."""
        at, found, answers = zip(*(self.answer() for _ in range(states)), strict=True)
        truth = self.touched.truth([*map(change, found)], States.concatenate(at))
        return float(compare(truth, np.array(answers), factorises=True).backward_error.max())

    def feels(self, change=lambda found: found) -> bool:  # type: ignore[no-untyped-def]
        """Whether one of some states is red."""
        return any(self.error(1, change) > AGREEMENT for _ in range(8))


@pytest.mark.parametrize(("cone", "ratio", "size", "exact"), half_at_the_desk(CONES, (1, 10), SIZES, ("disable", "enable")))
def test_mujoco_answers_as_it_documents(cone: str, ratio: float, size: int, exact: str, tmp_path: Path) -> None:
    stepped = Stepped(written(tmp_path, cone, ratio, size, exact))
    assert stepped.error(6) <= AGREEMENT


def with_friction(place: int):  # type: ignore[no-untyped-def]
    def changed(one: FoundContact) -> FoundContact:
        friction = [mu * (1 + 1e-9 * (number == place)) for number, mu in enumerate(one.friction)]
        return replace(one, friction=tuple(friction))

    return lambda found: [changed(one) for one in found]


def in_each(**fields):  # type: ignore[no-untyped-def]
    return lambda found: [replace(one, **{name: change(one) for name, change in fields.items()}) for one in found]


FAULTS = {
    "friction": with_friction(0),
    "friction of one direction": with_friction(1),
    "torsional friction": with_friction(2),
    "margin": in_each(margin=lambda one: one.margin + 1e-9),
    "solref": in_each(solref=lambda one: (one.solref[0] * (1 + 1e-9), one.solref[1])),
    "solimp": in_each(solimp=lambda one: (*one.solimp[:2], one.solimp[2] * (1 + 1e-9), *one.solimp[3:])),
    "sign of the normal": in_each(frame=lambda one: (*(-x for x in one.frame[:3]), *one.frame[3:])),
    "a contact dropped": lambda found: found[1:],
    "bodies swapped": in_each(bodies=lambda one: one.bodies[::-1]),
    "point": in_each(point=lambda one: (one.point[0] + 1e-9, *one.point[1:])),
}


@pytest.mark.parametrize(("cone", "fault"), half_at_the_desk(CONES, [*FAULTS]))
def test_a_contact_that_is_another_is_felt(cone: str, fault: str, tmp_path: Path) -> None:
    assert Stepped(written(tmp_path, cone, 10, 5)).feels(FAULTS[fault])


def test_friction_by_the_ratio_and_not_its_root_is_felt(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    stepped = Stepped(written(tmp_path, "elliptic", 10))
    monkeypatch.setattr(cones, "sqrt", lambda value: value)
    assert stepped.feels()


def test_states_of_each_zone_are_among_those_that_are_asked(tmp_path: Path) -> None:
    stepped, zones = Stepped(written(tmp_path, "elliptic", 1)), set[int]()
    for _ in range(40):
        stepped.answer()
        zones |= set(stepped.data.efc_state.tolist())
    kinds = mujoco.mjtConstraintState
    assert zones == {int(one) for one in (kinds.mjCNSTRSTATE_SATISFIED, kinds.mjCNSTRSTATE_QUADRATIC, kinds.mjCNSTRSTATE_CONE)}


def test_a_contact_beyond_its_margin_is_none(tmp_path: Path) -> None:
    stepped = Stepped(written(tmp_path, "elliptic"))
    found = next(own for _ in range(20) if (own := stepped.answer()[1]))
    beyond = stepped.touched.pushing([replace(one, distance=math.nextafter(one.margin, 1.0)) for one in found])
    assert stepped.touched.by(beyond).constraints is None


@pytest.mark.ci
def test_on_an_edge_of_a_zone_the_larger_side_counts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Between sticking and sliding the derivative jumps, and the answer does not."""
    stepped = Stepped(written(tmp_path, "elliptic"))
    known, found = next((own[0], own[1]) for _ in range(20) if len((own := stepped.answer())[1]) == 1)
    mechanism = stepped.touched.by(stepped.touched.pushing(found))
    assert isinstance(mechanism, DeclaredMechanism) and mechanism.zones is not None
    [cone] = mechanism.zones.cones

    def at(slip: float) -> States:
        v = np.zeros((1, 7))
        v[0, :3] = slip, 0, -2
        return replace(known, v=v, tau=np.zeros((1, 7)))

    def zone(slip: float) -> cones.Zone:
        [found] = cone.zones_at(mechanism.parameters_at(at(slip)))
        return cones.Zone(int(found))

    slow, fast = next(slip for slip in sorted(np.linspace(-50, 50, 201).tolist(), key=abs) if zone(slip) == cones.Zone.STICKS), 200.0
    assert zone(fast) == cones.Zone.SLIDES
    while (middle := (slow + fast) / 2) not in (slow, fast):
        slow, fast = (middle, fast) if zone(middle) == cones.Zone.STICKS else (slow, middle)
    both = [ReferenceKernel(mechanism).evaluate(at(slip)) for slip in (slow, fast)]
    assert all(one.certified.all() for one in both)
    np.testing.assert_allclose(both[0].high, both[1].high, rtol=1e-13)
    np.testing.assert_allclose(both[0].sensitivity, both[1].sensitivity, rtol=1e-9)
    monkeypatch.setattr(cones.Cone, "across", lambda self, found, *_: self.zones_at(found))
    alone = [float(ReferenceKernel(mechanism).evaluate(at(slip)).sensitivity[0]) for slip in (slow, fast)]
    assert abs(alone[0] / alone[1] - 1) > 1e-6


def test_the_size_of_a_place_holds_all_lengths_that_are_added_for_it_and_no_angle(tmp_path: Path) -> None:
    """An anchor is added and taken away; of joints, positions that are lengths count, and neither angles nor quaternions."""
    path = tmp_path / "shapes.xml"
    path.write_text(
        """<mujoco><worldbody><geom type="sphere" size="0.25" pos="0 -32 0"/>
        <body name="trunk" pos="1 -2 0"><freejoint name="base"/><geom type="sphere" size="0.5" pos="0 0 4" mass="1"/>
        <body name="arm" pos="0 8 0"><joint name="turn" type="hinge" pos="0 0 -16"/><joint name="slide" type="slide"/>
        <geom type="sphere" size="0.125" mass="1"/></body></body></worldbody></mujoco>"""
    )
    robot = read_robot(path)
    assert robot.joints == ("base", "turn", "slide") and robot.shapes is not None
    shapes = ShapesInWorld(robot.tree, robot.joints, robot.shapes.shapes)
    at_zero, moved = ([one.size for one in shapes.at(q)] for q in ([0, 0, 0, 1, 0, 0, 0, 0, 0], [3, -5, 7, 0.6, 0, -0.8, 0, 2.5, -9]))
    assert at_zero[0] == 32.25 and [after - before for before, after in zip(at_zero, moved, strict=True)] == [0, 15, 24]
    # Whatever the pose of a body that floats counts, the arm has that and its own.
    assert at_zero[2] - at_zero[1] == (8 + 2 * 16 + 0.125) - (4 + 0.5)
