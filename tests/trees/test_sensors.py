"""Sensors at sites: against closed forms, against the momenta of what they carry, in MuJoCo, and after mistakes."""

from __future__ import annotations

import json
from pathlib import Path

import mujoco
import numpy as np
import pytest
from robot_files import EVERYTHING
from support import harness

from harness.arrays import Array
from harness.engines import NotOffered
from harness.files.document.xml import parse_document
from harness.files.tree import SensorKind
from harness.programs.numbers import UNIT_ROUNDOFF
from harness.programs.states import States
from harness.trees.mechanism import mechanism_of
from harness.trees.robot import robot_in
from harness.truth.compare import compare
from harness.truth.quantities import TruthBasis, find_quantities
from harness.truth.quantities.of_files import FileTruth
from harness.truth.sampling import generic_sample
from harness.verdict import AGREEMENT

STATES, SEED, GRAVITY = 6, 3, 9.81
PENDULUM = f"""
<mujoco>
  <compiler autolimits="false"/>
  <option gravity="0 0 -{GRAVITY}"/>
  <worldbody>
    <body name="bar">
      <joint name="pin" axis="0 1 0"/>
      <inertial pos="0 0 -0.5" mass="2" diaginertia="0.3 0.2 0.1"/>
      <site name="bob" pos="0 0 -0.75"/>
    </body>
  </worldbody>
  <sensor>SENSORS</sensor>
</mujoco>
"""
AT_SITE = "".join(f'<{kind} name="{kind} of SITE" site="SITE"/>' for kind in ("accelerometer", "velocimeter", "gyro", "force", "torque"))
OF_FRAME = "".join(f'<{kind} name="{kind} of SITE" objtype="site" objname="SITE"/>' for kind in ("framelinacc", "frameangacc"))
# On each body, turned, and on the world; the spring between points pulls from outside and is left out.
SITES = {
    "base": '<site name="hip" pos="0.1 0.05 -0.2" euler="30 40 50"/>',
    "bracket": '<site name="corner" pos="0 0.1 0.3" zaxis="1 2 0.5"/>',
    "ring": '<site name="rim" pos="-0.2 0 0.1" quat="0.5 0.1 -0.7 0.2"/>',
}


def everything() -> str:
    text: str = EVERYTHING[: EVERYTHING.index("<tendon>")]
    for body, site in SITES.items():
        place = text.index(">", text.index(f'<body name="{body}"')) + 1
        text = text[:place] + site + text[place:]
    own = [(AT_SITE + OF_FRAME).replace("SITE", site) for site in ("hip", "corner", "rim", "end", "wall")]
    return f"{text}<sensor>{''.join(own)}</sensor></mujoco>"


def basis_of(text: str) -> TruthBasis:
    return TruthBasis(mechanism_of(robot_in(parse_document(Path("robot.xml"), text, "mujoco"))), None, None, False)


def truth_of(text: str, quantity: str = "sensors") -> FileTruth:
    found = find_quantities()[quantity].truth(basis_of(text))
    assert isinstance(found, FileTruth)
    return found


def states_of(text: str) -> States:
    return generic_sample(basis_of(text).mechanism, STATES, SEED)


def measured(text: str, states: States, accelerations: Array) -> Array:
    """By MuJoCo, (n, sensors, 3)."""
    model = mujoco.MjModel.from_xml_string(text)
    data, found = mujoco.MjData(model), []
    for q, v, qdd in zip(states.q, states.v, accelerations, strict=True):
        data.qpos[:], data.qvel[:], data.qacc[:] = q, v, qdd
        mujoco.mj_inverse(model, data)
        found.append(data.sensordata.reshape(-1, 3).copy())
    return np.array(found)


def test_a_pendulum_has_the_sensors_of_the_textbook() -> None:
    text = PENDULUM.replace("SENSORS", (AT_SITE + OF_FRAME).replace("SITE", "bob"))
    own, states = truth_of(text), states_of(text)
    kinds = ("accelerometer", "velocimeter", "gyro", "force", "torque", "framelinacc", "frameangacc")
    assert own.blocks == tuple(f"{kind} '{kind} of bob'" for kind in kinds)
    assert set(kinds) == {kind for kind in SensorKind if not (kind.is_of_actuators or kind.is_of_joints)}
    (q, v), a, zero = (one[:, 0] for one in (states.q, states.v)), own._accelerations(states)[:, 0], np.zeros(STATES)
    length, centre, mass, inertia = 0.75, 0.5, 2.0, 0.2
    sine, cosine = np.sin(q), np.cos(q)

    def along(at: float) -> tuple[Array, Array]:
        """Acceleration less gravity of a point of the bar, across and along it, by its own axes x and z."""
        return -at * a + GRAVITY * -sine, at * v**2 + GRAVITY * cosine

    across, upwards = along(length)
    of_centre = mass * np.array(along(centre))
    # The bar gets the moment about the pin that the rest of the tree transmits: none but what its joint's own equation asks for.
    about_bob = inertia * a + (length - centre) * of_centre[0]
    expected = [
        [across, zero, upwards],
        [-length * v, zero, zero],
        [zero, v, zero],
        [of_centre[0], zero, of_centre[1]],
        [zero, about_bob, zero],
        [cosine * across + sine * upwards, zero, cosine * upwards - sine * across],
        [zero, a, zero],
    ]
    np.testing.assert_allclose(own.evaluate(states).high, np.array(expected).transpose(2, 0, 1), rtol=0, atol=1e-13 * 200)


@pytest.mark.ci
def test_what_a_trunk_gets_is_what_the_momenta_of_all_gain() -> None:
    """Force and moment on the first body, by differences of the momenta of the whole tree along the motion."""
    text, step = everything(), 1e-6
    own, momentum, states = truth_of(text), truth_of(text, "momentum"), states_of(text)
    rates = own._accelerations(states)
    model = mujoco.MjModel.from_xml_string(text)
    found = own.evaluate(states).high
    for state in range(STATES):
        ends = []
        for by in (step, -step):
            q = states.q[state].copy()
            mujoco.mj_integratePos(model, q, states.v[state] + by / 2 * rates[state], by)
            v = states.v[state] + by * rates[state]
            ends.append(momentum.evaluate(States.at(q[None], v[None], np.zeros((1, model.nv)))).high[0])
        gain = (ends[0] - ends[1]) / (2 * step)
        data = mujoco.MjData(model)
        data.qpos[:] = states.q[state]
        mujoco.mj_forward(model, data)
        site, axes = data.site("hip").xpos, data.site("hip").xmat.reshape(3, 3)
        weight = model.body_subtreemass[0] * model.opt.gravity
        force = gain[0] - weight
        moment = gain[1] - np.cross(data.subtree_com[0], weight) - np.cross(site, force)
        np.testing.assert_allclose(axes @ found[state, 3], force, rtol=1e-6, atol=1e-6 * np.abs(force).max())
        np.testing.assert_allclose(axes @ found[state, 4], moment, rtol=1e-6, atol=1e-6 * np.abs(moment).max())


@pytest.mark.ci
def test_mujoco_measures_it() -> None:
    text = everything()
    own, states = truth_of(text), states_of(text)
    found = measured(text, states, own._accelerations(states))
    comparison = compare(own.evaluate(states), found)
    assert len(own.blocks) == found.shape[1] == 5 * 7
    assert set(comparison.verdicts) == {"agrees"} and comparison.backward_error.max() < AGREEMENT / 2


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('<site name="end" pos="0.05 0 0.1"/>', '<site name="end" pos="0.050000001 0 0.1"/>'),
        ('zaxis="1 2 0.5"', 'zaxis="1 2 0.5000001"'),
        ('gravity="1 -2 -9.5"', 'gravity="1 -2 -9.500000001"'),
        ('mass="0.4"', 'mass="0.40000001"'),
        ("<force name=", "<torque name="),
        ('velocimeter name="velocimeter of rim" site="rim"', 'velocimeter name="velocimeter of rim" site="end"'),
    ],
)
def test_what_another_file_says_is_red(old: str, new: str) -> None:
    text = everything()
    assert old in text
    own, states = truth_of(text), states_of(text)
    found = measured(text.replace(old, new, 1), states, own._accelerations(states))
    assert set(compare(own.evaluate(states), found).verdicts) == {"disagrees"}


def test_a_sign_of_gravity_and_the_other_body_s_force_are_red() -> None:
    text = everything()
    own, states = truth_of(text), states_of(text)
    certified = own.evaluate(states)
    for block, wrong in ((0, -certified.high[:, 0]), (3, -certified.high[:, 3])):
        answers = certified.high.copy()
        answers[:, block] = wrong
        assert set(compare(certified, answers).verdicts) == {"disagrees"}
    nearly = certified.high * (1 + 4 * UNIT_ROUNDOFF)
    assert set(compare(certified, nearly).verdicts) == {"agrees"}


@pytest.mark.parametrize(
    ("sensors", "said"),
    [
        ('<jointlimitpos joint="pin"/>', "the file has no sensor that the motion of its bodies or its actuators decide"),
        ('<gyro site="bob" cutoff="3"/>', "<gyro> has a cutoff, which hides what is beyond"),
        ('<framelinacc objtype="body" objname="bar"/>', "is about a body; name a site in its place to have it judged"),
        ('<gyro site="bob"/></sensor><option><flag sensor="disable"/></option><sensor>', "is switched off in the file"),
    ],
)
def test_what_is_not_judged_says_why(sensors: str, said: str) -> None:
    with pytest.raises(NotOffered) as told:
        truth_of(PENDULUM.replace("SENSORS", sensors))
    assert said in str(told.value)


def test_what_springs_pull_from_outside_transmits_nothing_that_is_judged() -> None:
    sensors = AT_SITE.replace("SITE", "end")
    pulled = EVERYTHING.replace("</mujoco>", f"<sensor>{sensors}</sensor></mujoco>")
    assert truth_of(pulled).blocks == tuple(f"{kind} '{kind} of end'" for kind in ("accelerometer", "velocimeter", "gyro"))


@pytest.mark.parametrize(
    ("elements", "pulling"),
    [
        ('<actuator><general site="bob"/></actuator>', "actuators at sites push"),
        (
            '<tendon><spatial name="rope"><site site="wall"/><site site="bob"/></spatial></tendon>'
            '<equality><tendon tendon1="rope"/></equality>',
            "tendons through sites pull",
        ),
    ],
)
def test_what_acts_at_sites_is_named_where_it_hides_what_bodies_transmit(elements: str, pulling: str) -> None:
    text = PENDULUM.replace("SENSORS", '<force site="bob"/>').replace("<worldbody>", '<worldbody><site name="wall" pos="1 0 0"/>')
    with pytest.raises(NotOffered, match=f"is of what bodies transmit, where {pulling} them from outside"):
        truth_of(text.replace("</mujoco>", f"{elements}</mujoco>"))


def test_a_check_of_a_file_compares_its_sensors_and_other_engines_offer_none(tmp_path: Path) -> None:
    (tmp_path / "robot.xml").write_text(PENDULUM.replace("SENSORS", AT_SITE.replace("SITE", "bob")))
    done = harness("check", "robot.xml", "--quantity", "sensors", "--states", "40", "--json", "out.json", cwd=tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    verdicts = {record["subject"]: record["verdict"] for record in json.loads((tmp_path / "out.json").read_text())["records"]}
    assert verdicts == {"mujoco/mjcf": "agrees", "pinocchio/mjcf": "unsupported"}
