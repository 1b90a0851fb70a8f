"""A million states at which bodies push one another and nothing is wrong: small robots with contacts of each kind, MuJoCo as it is set.

Each state is where MuJoCo's own steps lead, at the rates there or at others, under random forces. An answer agrees, loses digits, or is
explained by a solver that stops early; none is wrong.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from harness.comparison.robot_library import RobotLibrary
from harness.crosscheck.assignment import Assignment, contact_source, load_audited
from harness.crosscheck.solvers import judged_to_the_end
from harness.engines import Subject
from harness.engines.adapters.mujoco import robot
from harness.explain.touching import put
from harness.files.contacts import FoundContact
from harness.programs.states import States
from harness.truth.sampling import generic_sample
from harness.verdict import Verdict

MUJOCO = Subject("mujoco", "mjcf")
SOUND = {Verdict.AGREES.value, Verdict.EXPLAINED.value, Verdict.UNSTABLE.value}
WORLD = """<mujoco><option cone="{cone}"/><default><geom condim="{condim}" friction="0.7 0.02 0.003"/></default><worldbody>
<geom name="floor" type="plane" size="5 5 1" euler="{slope} 0 0"/>{bodies}</worldbody></mujoco>"""
LEG = """<body name="leg{number}" pos="{x} {y} 0"><joint name="hip{number}" axis="0 1 0" damping="0.1"/>
<geom name="leg{number}" type="capsule" fromto="0 0 0 0 0 -.2" size=".03" mass=".4"/></body>"""
TRUNK = '<body name="trunk" pos="0 0 .3"><freejoint/><geom name="trunk" type="sphere" size=".08" mass="2"/>{legs}</body>'
BALL = '<body name="ball{number}" pos="{x} 0 {z}"><freejoint/><geom name="ball{number}" size=".1" mass="{mass}"/></body>'
BODIES = {
    "ball": BALL.format(number=0, x=0, z=0.15, mass=1),
    "balls": "".join(BALL.format(number=number, x=0.01 * number, z=0.12 + 0.22 * number, mass=10.0**number) for number in range(2)),
    "hopper": TRUNK.format(legs=LEG.format(number=0, x=0.15, y=0)),
    "walker": TRUNK.format(legs="".join(LEG.format(number=number, x=0.1, y=0.1 - 0.2 * number) for number in range(2))),
}
KINDS = list(itertools.product(BODIES, ("pyramidal", "elliptic"), (1, 3, 4, 6)))
# States of a batch, and batches of each kind.
STATES, BATCHES, NIGHTS = 2048, 18, 32
# Share of states at which bodies push, at least.
TOUCHING = 0.85
# Steps that lead to a state; rates at which they begin, of those of any state.
STEPS, SLOW = (80, 120, 160, 200, 240, 280, 320, 400), 0.05


def written(folder: Path, bodies: str, cone: str, condim: int) -> Assignment:
    path = folder / f"{bodies}.xml"
    path.write_text(WORLD.format(cone=cone, condim=condim, slope=5, bodies=BODIES[bodies]))
    library = replace(RobotLibrary.of([str(path)], acts=True, touches=True), calls_engines_here=True)
    return Assignment.of(library, str(path), MUJOCO)


def states_that_touch(assignment: Assignment, count: int, seed: int) -> tuple[States, Sequence[Sequence[FoundContact]]]:
    """States to which steps lead, half of them at other rates, under forces of all sizes, at which bodies push; and their contacts."""
    random, source = np.random.default_rng(seed), contact_source(assignment)
    states = generic_sample(assignment.mechanism, count, seed)
    q, v = source.settled(SLOW * states.v, [STEPS[number % len(STEPS)] for number in range(count)])
    found = put(states, np.arange(count), q, v)
    sizes = 10 ** random.uniform(-4, 0, (2, count, 1))
    found = replace(found, v=np.where(random.random((count, 1)) < 0.5, found.v, sizes[0] * states.v), tau=sizes[1] * states.tau)
    contacts = source.contacts(found)
    pushing = np.flatnonzero([any(one.pushes for one in own) for own in contacts])
    return found[pushing], [contacts[number] for number in pushing]


def verdicts_of(assignment: Assignment, states: States) -> set[str]:
    truth, model = assignment.truth, load_audited(assignment)
    certified = truth.evaluate(states)
    compared = truth.asked_and_judged(certified, states, model)
    compared, _ = judged_to_the_end(assignment, certified, model, states, compared)
    return set(compared.verdicts.tolist())


def test_they_are_a_million() -> None:
    assert len(KINDS) * BATCHES * STATES * TOUCHING >= 1_000_000


@pytest.mark.parametrize(("bodies", "cone", "condim"), KINDS[::5])
def test_a_few_sound_answers_are_none_that_is_wrong(bodies: str, cone: str, condim: int, tmp_path: Path) -> None:
    assignment = written(tmp_path, bodies, cone, condim)
    states, _ = states_that_touch(assignment, 24, 7)
    assert len(states) > 16
    assert verdicts_of(assignment, states) <= SOUND


@pytest.mark.nightly(nights=NIGHTS)
@pytest.mark.parametrize("seed", range(BATCHES))
@pytest.mark.parametrize(("bodies", "cone", "condim"), KINDS)
def test_sound_answers_are_none_that_is_wrong(bodies: str, cone: str, condim: int, seed: int, tmp_path: Path) -> None:
    assignment = written(tmp_path, bodies, cone, condim)
    states, _ = states_that_touch(assignment, STATES, 1000 + seed)
    assert len(states) >= TOUCHING * STATES
    assert verdicts_of(assignment, states) <= SOUND


@pytest.mark.ci
@pytest.mark.parametrize("fault", ["distance", "solref", "normal"])
def test_a_fault_is_an_alarm(fault: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assignment, found_contacts = written(tmp_path, "walker", "elliptic", 3), robot.found_contacts
    states, _ = states_that_touch(assignment, 24, 7)

    def wrong(model: object, contacts: object) -> list[FoundContact]:
        own = found_contacts(model, contacts)
        match fault:
            case "distance":
                return [replace(one, distance=one.distance * 1.001) for one in own]
            case "solref":
                return [replace(one, solref=(1.001 * one.solref[0], one.solref[1])) for one in own]
            case _:
                return [replace(one, frame=(*(-part for part in one.frame[:3]), *one.frame[3:])) for one in own]

    monkeypatch.setattr(robot, "found_contacts", wrong)
    assert Verdict.DISAGREES.value in verdicts_of(assignment, states)
