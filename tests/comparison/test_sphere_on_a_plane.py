"""A sphere on a slope with contacts of every kind: MuJoCo is at the optimum that it documents where it parts, sticks and slides."""

from __future__ import annotations

import itertools
from pathlib import Path

import mujoco
import numpy as np
import pytest

from harness.arrays import Array
from harness.comparison.geometry import hold_shapes
from harness.comparison.robot_library import engine_of
from harness.engines.adapters.mujoco.contacts import found_contacts, shapes_that_touch
from harness.explain import touching
from harness.explain.changes.readings import element_at
from harness.explain.documented import documented
from harness.explain.switches import switches_of
from harness.explain.touching import Touching
from harness.files.contacts import FoundContact
from harness.files.findings import CONTACTS
from harness.programs.states import States
from harness.trees.mechanism import mechanism_of
from harness.trees.robot import Robot, read_robot
from harness.truth.compare import compare
from harness.truth.sampling import generic_sample
from harness.verdict import AGREEMENT

KINDS = list(itertools.product((1, 3, 4, 6), ("pyramidal", "elliptic"), (1, 10)))
FILE = """<mujoco><option cone="{cone}" impratio="{impratio}" tolerance="0" iterations="100"/><worldbody>
<geom name="slope" type="plane" size="1 1 1" euler="10 20 0" condim="{condim}"/>
<body name="ball"><freejoint/><inertial pos="0.01 0 0" mass="1.3" diaginertia="0.01 0.012 0.015"/>
<geom name="ball" size="0.1" friction="0.7 0.02 0.003" condim="{condim}" margin="0.002"/></body></worldbody></mujoco>"""
# States of contacts of elliptic cones, by MuJoCo's own words.
_STATES = mujoco.mjtConstraintState
PARTS, STICKS, SLIDES = map(int, (_STATES.mjCNSTRSTATE_SATISFIED, _STATES.mjCNSTRSTATE_QUADRATIC, _STATES.mjCNSTRSTATE_CONE))


def placed(path: Path, count: int, seed: int) -> tuple[States, Array, list[list[FoundContact]], set[int]]:
    """States near the surface, from gentle to fast; MuJoCo's accelerations, its contacts, and what these do."""
    robot, random = read_robot(path), np.random.default_rng(seed)
    states = generic_sample(mechanism_of(robot), count, seed=seed)
    model = mujoco.MjModel.from_xml_path(str(path))
    data, answers, found, doing = mujoco.MjData(model), np.zeros((count, 6)), list[list[FoundContact]](), set[int]()
    mujoco.mj_forward(model, data)
    normal = data.geom_xmat[0].reshape(3, 3)[:, 2].copy()
    for state in range(count):
        depth, beside = 10.0 ** random.uniform(-6, -2) * random.choice([1.0, -0.1]), random.normal(size=3)
        data.qpos[:3] = beside - normal * (normal @ beside) + normal * (0.1 - depth)
        data.qpos[3:] = states.q[state, 3:]
        data.qvel[:] = random.normal(size=6) * 10 ** random.uniform(-3, 1)
        data.qfrc_applied[:] = random.normal(size=6) * 10 ** random.uniform(-1, 1.5)
        if state % 3 == 0:
            # Nearly at rest, where it sticks: the slope is less than friction.
            data.qvel[:] *= 1e-4
            data.qfrc_applied[:] = 0.0
        data.qacc_warmstart[:] = 0.0
        mujoco.mj_forward(model, data)
        states.q[state], states.v[state], states.tau[state], answers[state] = data.qpos, data.qvel, data.qfrc_applied, data.qacc
        found.append(found_contacts(model, data.contact[: data.ncon]))
        doing |= {int(one) for one in data.efc_state}
    return states, answers, found, doing


def of_kind(folder: Path, condim: int, cone: str, impratio: int) -> tuple[Path, Robot]:
    path = folder / f"sphere_{condim}_{cone}_{impratio}.xml"
    path.write_text(FILE.format(condim=condim, cone=cone, impratio=impratio))
    return path, read_robot(path)


@pytest.mark.parametrize("count", [60, pytest.param(6250, marks=pytest.mark.nightly)])
@pytest.mark.parametrize(("condim", "cone", "impratio"), KINDS)
def test_mujoco_is_at_the_optimum(
    condim: int, cone: str, impratio: int, count: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In the night at 100,000 states."""
    monkeypatch.setattr(touching, "MOST_WORK", 10**12)
    path, robot = of_kind(tmp_path, condim, cone, impratio)
    states, answers, found, doing = placed(path, count, condim + impratio)
    caller = engine_of("mujoco")
    switches = [one for one in switches_of(robot, robot, caller) if one.group.what == CONTACTS]
    assert caller.contacts is not None
    kind, _ = caller.contacts(element_at(robot.tree.place), robot.format)
    own = Touching.of(found, robot, kind)
    assert own.is_any.all() and len(own.states) == count
    truth = own.truth(states, lambda contacts: documented(robot, caller, switches, (), contacts))
    assert compare(truth, answers, factorises=True).known("backward_error").max() <= AGREEMENT
    # Pyramids and rays have no force that slides by itself; few states leave some cone alone, or hold still in it.
    assert (SLIDES in doing) == (cone == "elliptic" and condim > 1)
    assert {PARTS, STICKS} <= doing or count < 1000
    shapes = hold_shapes(robot, states.q, found, shapes_that_touch(mujoco.MjModel.from_xml_path(str(path))))
    assert shapes is not None and shapes.rest == []


@pytest.mark.parametrize("wrong", ["impratio", "condim", "cone"])
def test_another_kind_of_contact_is_red(wrong: str, tmp_path: Path) -> None:
    """The answers of another file."""
    kinds: dict[str, tuple[int, str, int]] = {"impratio": (3, "elliptic", 10), "condim": (4, "elliptic", 1), "cone": (3, "pyramidal", 1)}
    _, robot = of_kind(tmp_path, 3, "elliptic", 1)
    other, _ = of_kind(tmp_path, *kinds[wrong])
    states, answers, found, _ = placed(other, 20, 4)
    caller = engine_of("mujoco")
    switches = [one for one in switches_of(robot, robot, caller) if one.group.what == CONTACTS]
    assert caller.contacts is not None
    kind, _ = caller.contacts(element_at(robot.tree.place), robot.format)
    given = [[FoundContact(**{**vars(one), "friction": one.friction[:2]}) for one in own] for own in found]
    own = Touching.of(given, robot, kind)
    truth = own.truth(states[own.states], lambda contacts: documented(robot, caller, switches, (), contacts))
    assert compare(truth, answers[own.states], factorises=True).known("backward_error").max() > 1e6
