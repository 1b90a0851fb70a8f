"""Sensors with all on that a file's reader takes: in MuJoCo, against forces along joints, and with faults planted in MuJoCo's copy."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support import harness
from trees.test_actuators import BODIES, COMPENSATED, EACH, written
from trees.test_robots_of_others import robots

from harness.arrays import Array
from harness.comparison.robot_library import RobotLibrary
from harness.crosscheck.assignment import Assignment, load_audited
from harness.engines import Subject
from harness.files.tree import SensorKind
from harness.programs.numbers import UNIT_ROUNDOFF
from harness.programs.states import States
from harness.truth.quantities.reactions import SensorTruth
from harness.truth.sampling import sample
from harness.verdict import AGREEMENT

STATES, SEED = 24, 5
# A loop of three hinges and a slide that a connect closes, with servos, a tendon, dry friction and limits; a wrist that is fixed to a link.
ARM = """<mujoco>
  <compiler angle="radian"/>
  <worldbody>
    <body name="upper" pos="0 0 1">
      <joint name="shoulder" axis="0 1 0" actuatorfrcrange="-9 7"/>
      <inertial pos="0.2 0 0.1" mass="1.3" diaginertia="0.1 0.2 0.25"/>
      <site name="in shoulder"/>
      <body name="lower" pos="0.4 0 0">
        <joint name="elbow" axis="0 1 0"FRICTION/>
        <inertial pos="0.3 0.1 0" mass="0.9" diaginertia="0.1 0.2 0.25"/>
        <site name="in elbow"/>
        <body name="wrist" pos="0.5 0 0" euler="0.3 0.2 0.1">
          <inertial pos="0.1 0 0.05" mass="0.3" diaginertia="0.01 0.02 0.025"/>
          <site name="tip" pos="0.1 0.2 0.3" euler="0.5 -0.3 0.7"/>
        </body>
      </body>
    </body>
    <body name="cart" pos="0.9 0 1">
      <joint name="rail" type="slide" axis="1 0 0"/>
      <inertial pos="0 0 0.1" mass="2" diaginertia="0.1 0.2 0.25"/>
      <site name="in rail"/>
    </body>
  </worldbody>
  <tendon><fixed name="both"TENDON><joint joint="shoulder" coef="1.5"/><joint joint="elbow" coef="-2"/></fixed></tendon>
  <equality><connect site1="tip" site2="in rail"/></equality>
  <actuator>
    <motor name="push" joint="rail" gear="3" ctrlrange="-1 1"/>
    <position name="servo" joint="shoulder" kp="24" kv="1.5" forcerange="-5 5"/>
    <velocity name="brake" joint="shoulder" kv="2"/>
    <motor name="pull" tendon="both" gear="2"/>
  </actuator>
  <sensor>SENSORS</sensor>
</mujoco>
"""
KINDS = ("accelerometer", "velocimeter", "gyro", "force", "torque")
SITES = ("in shoulder", "in elbow", "tip", "in rail")
SENSORS = "".join(f'<{kind} name="{kind} {site}" site="{site}"/>' for site in SITES for kind in KINDS)
SENSORS += "".join(f'<{kind} name="{kind} tip" objtype="site" objname="tip"/>' for kind in ("framelinacc", "frameangacc"))
SENSORS += "".join(f'<actuatorfrc name="of {name}" actuator="{name}"/>' for name in ("push", "servo", "brake", "pull"))
SENSORS += "".join(f'<jointactuatorfrc name="at {name}" joint="{name}"/>' for name in ("shoulder", "elbow", "rail"))
SENSORS += "".join(f'<{kind} name="{kind} {name}" joint="{name}"/>' for kind in ("jointpos", "jointvel") for name in ("elbow", "rail"))
FREE = ARM.replace("SENSORS", SENSORS).replace("FRICTION", "").replace("TENDON", "")
RUBBING = (
    ARM.replace("SENSORS", SENSORS)
    .replace("FRICTION", ' frictionloss="0.4" range="-1 1.2" margin="0.1"')
    .replace("TENDON", ' frictionloss="0.3" range="-0.5 0.5" limited="true"')
)


class Asked:
    """The truth of the sensors of a text, at states, and MuJoCo's answers with that text or another one."""

    def __init__(self, path: Path, text: str = "", states: int = STATES) -> None:
        self.path, self.text = path, text
        if text:
            path.write_text(text)
        library = RobotLibrary.of([str(path)], anywhere=True, acts=True)
        plain = Assignment.of(library, str(path), Subject("mujoco", "mjcf"))
        self.assignment = plain.about("sensors")
        truth = self.assignment.truth
        assert isinstance(truth, SensorTruth)
        self.truth, self.states = truth, truth.asked_at(sample(plain.mechanism, states, SEED))
        self.certified = truth.evaluate(self.states)

    def answers(self) -> Array:
        return self.truth.answers(load_audited(self.assignment), self.states)

    def red(self, answers: Array) -> set[str]:
        """The sensors that are beyond what data roundoff explains somewhere."""
        error = self.certified.lengths(self.certified.errors(answers))
        beyond = (error > AGREEMENT * self.certified.roundoff_with_share).any(axis=0)
        return {name for name, is_beyond in zip(self.truth.blocks, beyond, strict=True) if is_beyond}

    def of(self, name: str) -> Array:
        """(n, 3)"""
        return self.certified.high[:, self.truth.blocks.index(name)]


@pytest.fixture(scope="module")
def rubbing(tmp_path_factory: pytest.TempPathFactory) -> Asked:
    return Asked(tmp_path_factory.mktemp("rubbing") / "arm.xml", RUBBING)


@pytest.mark.ci
def test_mujoco_measures_it_with_all_on(rubbing: Asked) -> None:
    assert rubbing.certified.certified.all()
    assert {name.partition(" ")[0] for name in rubbing.truth.blocks} == set(SensorKind)
    assert rubbing.red(rubbing.answers()) == set()


def test_joints_are_measured_where_they_are(rubbing: Asked) -> None:
    """Another joint's position, or a velocity in its place, is red."""
    places = {name: rubbing.assignment.mechanism.joints.index(name) for name in ("elbow", "rail")}
    for name, place in places.items():
        np.testing.assert_array_equal(rubbing.of(f"jointpos 'jointpos {name}'")[:, 0], rubbing.states.q[:, place])
        np.testing.assert_array_equal(rubbing.of(f"jointvel 'jointvel {name}'")[:, 0], rubbing.states.v[:, place])
    answers = rubbing.answers()
    exchanged = answers.copy()
    own, other = (rubbing.truth.blocks.index(f"jointpos 'jointpos {name}'") for name in ("elbow", "rail"))
    exchanged[:, [own, other]] = answers[:, [other, own]]
    assert rubbing.red(exchanged) == {"jointpos 'jointpos elbow'", "jointpos 'jointpos rail'"}
    exchanged = answers.copy()
    exchanged[:, own, 0] *= 1 + 1e-13
    assert rubbing.red(exchanged) == {"jointpos 'jointpos elbow'"}


@pytest.mark.ci
def test_a_weld_acts_on_bodies_too(tmp_path: Path) -> None:
    asked = Asked(tmp_path / "arm.xml", RUBBING.replace("<connect", "<weld"))
    assert asked.certified.certified.all() and asked.red(asked.answers()) == set()


@pytest.mark.ci
@pytest.mark.parametrize("bodies", [BODIES, COMPENSATED], ids=["pulled", "compensated"])
def test_actuators_of_every_kind_have_the_forces_that_mujoco_measures(bodies: str, tmp_path: Path) -> None:
    """With activations, on ball and free joints, at sites and along tendons; and where joints give what they carry to actuators."""
    named = [one.replace(" ", f' name="{number}" ', 1) for number, one in enumerate(EACH)]
    path = written(tmp_path, *named, bodies=bodies)
    own = "".join(f'<actuatorfrc actuator="{number}"/>' for number in range(len(EACH)))
    text = path.read_text().replace(
        "</mujoco>", f'<sensor>{own}<jointactuatorfrc joint="a"/><jointactuatorfrc joint="b"/></sensor></mujoco>'
    )
    asked = Asked(path, text)
    assert len(asked.truth.blocks) == len(EACH) + 2
    assert asked.certified.certified.all() and asked.red(asked.answers()) == set()


@pytest.mark.ci
def test_joints_transmit_along_their_axes_what_acts_along_their_velocities(tmp_path: Path) -> None:
    """Whatever the loop bears, which acts on bodies, and by whichever law."""
    asked = Asked(tmp_path / "arm.xml", FREE)
    names = ("shoulder", "elbow", "rail")
    for joint, (kind, axis) in zip(names, (("torque", 1), ("torque", 1), ("force", 0)), strict=True):
        column = asked.assignment.mechanism.joints.index(joint)
        applied = asked.states.tau[:, column] + asked.of(f"jointactuatorfrc 'at {joint}'")[:, 0]
        transmitted = asked.of(f"{kind} '{kind} in {joint}'")[:, axis]
        np.testing.assert_allclose(transmitted, applied, rtol=0, atol=1e-12 * np.abs(asked.certified.high).max())


def test_forces_of_actuators_are_those_of_the_textbook(rubbing: Asked) -> None:
    states, (shoulder, elbow, rail) = rubbing.states, (0, 1, 2)
    push, servo, brake, pull = rubbing.states.control.T
    forces = {
        "push": np.clip(push, -1, 1),
        "servo": np.clip(24 * (servo - states.q[:, shoulder]) - 1.5 * states.v[:, shoulder], -5, 5),
        "brake": 2 * (brake - states.v[:, shoulder]),
        "pull": pull,
    }
    at = {
        "shoulder": np.clip(forces["servo"] + forces["brake"] + 2 * 1.5 * pull, -9, 7),
        "elbow": -2 * 2 * pull,
        "rail": 3 * forces["push"],
    }
    assert rubbing.assignment.mechanism.joints == ("shoulder", "elbow", "rail") and (shoulder, elbow, rail) == (0, 1, 2)
    for kind, word, found in (("actuatorfrc", "of", forces), ("jointactuatorfrc", "at", at)):
        for name, expected in found.items():
            measured = rubbing.of(f"{kind} '{word} {name}'")
            np.testing.assert_allclose(measured[:, 0], expected, rtol=0, atol=1e-13 * 300)
            assert not measured[:, 1:].any()
    # Each range is reached, and is not.
    for name, bounds in (("servo", (-5, 5)), ("push", (-1, 1))):
        is_held = np.isin(forces[name], bounds)
        assert is_held.any() and not is_held.all()


AT_TIP = {f"{kind} '{kind} tip'" for kind in ("accelerometer", "velocimeter", "torque", "framelinacc")}


@pytest.mark.parametrize(
    ("old", "new", "felt", "not_felt"),
    [
        ('pos="0.1 0.2 0.3"', 'pos="0.1 0.2 0.30000001"', AT_TIP, {"gyro 'gyro tip'"}),
        ('kp="24"', 'kp="24.001"', {"actuatorfrc 'of servo'", "accelerometer 'accelerometer tip'"}, {"actuatorfrc 'of brake'"}),
        ('forcerange="-5 5"', 'forcerange="-5 5.000001"', {"actuatorfrc 'of servo'"}, {"actuatorfrc 'of brake'", "actuatorfrc 'of push'"}),
        ('actuatorfrcrange="-9 7"', 'actuatorfrcrange="-9.000001 7"', {"jointactuatorfrc 'at shoulder'"}, {"actuatorfrc 'of servo'"}),
        (
            'gear="3"',
            'gear="3.0001"',
            {"jointactuatorfrc 'at rail'", "accelerometer 'accelerometer in rail'"},
            {"actuatorfrc 'of push'"},
        ),
        ('frictionloss="0.4"', 'frictionloss="0.4001"', {"accelerometer 'accelerometer tip'", "force 'force tip'"}, {"gyro 'gyro tip'"}),
        ('range="-0.5 0.5"', 'range="-0.5 0.50001"', {"accelerometer 'accelerometer tip'"}, {"actuatorfrc 'of pull'"}),
        ('name="force tip" site="tip"', 'name="force tip" site="in elbow"', {"force 'force tip'"}, {"torque 'torque tip'"}),
    ],
)
def test_a_fault_in_the_engine_s_copy_is_red_where_it_is_felt(
    old: str, new: str, felt: set[str], not_felt: set[str], rubbing: Asked, tmp_path: Path
) -> None:
    assert RUBBING.count(old) == 1
    path = tmp_path / "arm.xml"
    path.write_text(RUBBING.replace(old, new))
    mechanism = rubbing.assignment.mechanism
    faulty = replace(rubbing.assignment, mechanism=replace(mechanism, digest=new, request=replace(mechanism.request, path=path)))
    red = rubbing.red(rubbing.truth.answers(load_audited(faulty), rubbing.states))
    assert felt <= red and not not_felt & red


def test_what_an_equality_does_is_no_part_of_what_a_wrist_transmits(rubbing: Asked) -> None:
    """Without it, force and torque are far off, and what needs accelerations alone is right."""
    truth = rubbing.truth
    found = SensorTruth(replace(truth._basis, ties=()), truth._places, truth._count).evaluate(rubbing.states)
    far = np.linalg.norm(found.high - rubbing.certified.high, axis=2).max(axis=0)
    off = {name for name, distance in zip(rubbing.truth.blocks, far, strict=True) if distance > 1e6 * UNIT_ROUNDOFF}
    # The wrist hangs on the lower link, and that on the upper one; the cart is at the other end.
    assert off == {f"{kind} '{kind} {site}'" for kind in ("force", "torque") for site in SITES} - {
        "torque 'torque tip'",
        "torque 'torque in rail'",
    }


@pytest.mark.ci
def test_a_check_of_a_file_compares_them(tmp_path: Path) -> None:
    (tmp_path / "robot.xml").write_text(RUBBING)
    done = harness("check", "robot.xml", "--quantity", "sensors", "--states", "16", "--json", "out.json", cwd=tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    verdicts = {record["subject"]: record["verdict"] for record in json.loads((tmp_path / "out.json").read_text())["records"]}
    assert verdicts == {"mujoco/mjcf": "agrees", "pinocchio/mjcf": "unsupported"}


@pytest.mark.ci
def test_data_roundoff_has_what_each_input_does(rubbing: Asked) -> None:
    """By difference quotients along the state, the controls, and the numbers of the file, of the law and of ranges."""
    few, step = rubbing.states[:3], 1e-6
    truth, parameters = rubbing.truth, rubbing.truth._reference.mechanism.parameters_at(few)
    healthy, found = truth._at(few, parameters), np.zeros((3, len(truth.blocks)))
    changed = []
    for name in ("q", "v", "tau"):
        for column in range(3):
            moved = getattr(few, name).copy()
            moved[:, column] *= 1 + step
            changed.append((replace(few, **{name: moved}), parameters))
    for column in range(parameters.shape[1]):
        moved = parameters.copy()
        moved[:, column] *= 1 + step
        changed.append((few, moved))
    for states, numbers in changed:
        found += np.linalg.norm(truth._at(states, numbers).high - healthy.high, axis=2) / step
    felt = found > 0
    ratio = healthy.sensitivity[felt] / found[felt]
    # Accelerations and multipliers are rounded on the way, and poses of sites are numbers too.
    assert ratio.min() > 1 - 1e-3 and ratio.max() < 5
    forces = [place for place, name in enumerate(truth.blocks) if name.startswith("force")]
    assert (healthy.sensitivity[:, forces] > 1.9 * found[:, forces]).all()


@pytest.mark.ci
def test_what_departs_from_the_documented_law_is_explained(tmp_path: Path) -> None:
    """A cart whose centre of mass is at its origin has another weight in MuJoCo's program than by its documentation."""
    (tmp_path / "robot.xml").write_text(RUBBING.replace('pos="0 0 0.1" mass="2"', 'pos="0 0 0" mass="2"'))
    done = harness("check", "robot.xml", "--quantity", "sensors", "--subject", "mujoco", "--states", "16", cwd=tmp_path)
    assert done.returncode == 0 and "explained" in done.stdout, done.stdout + done.stderr
    assert "slide" in done.stdout


@pytest.mark.nightly
@pytest.mark.robots
@pytest.mark.parametrize("name", ["quadruped", "humanoid", "fish"])
def test_mujoco_measures_on_a_robot_of_others_what_it_documents(name: str) -> None:
    paths = [path for path in robots() if path.name == f"{name}.xml"]
    assert paths, "no robots are installed; install the extra: pip install 'rigid-body-harness[robots]'"
    asked = Asked(paths[0], states=8)
    assert asked.certified.certified.all() and asked.red(asked.answers()) == set()


def test_states_are_asked_alike_alone_and_among_others(rubbing: Asked) -> None:
    sampled = sample(rubbing.assignment.mechanism, STATES, SEED)
    alone = States.concatenate([rubbing.truth.asked_at(sampled[[state]]) for state in range(4)])
    np.testing.assert_array_equal(alone.q, rubbing.states.q[:4])
