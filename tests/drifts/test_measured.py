"""Measured logs: numbers that are planted in what was measured, what a log does not tell apart, and what is refused."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path

import mujoco
import numpy as np
import pytest
from drifting import ARM, HOPPER
from support import harness

import harness as api
from harness.drifts.log import DELAY, MeasuredSettings
from harness.drifts.measured import ExplainedLog
from harness.drifts.plan import MovingSide
from harness.drifts.study import explained_from, measured_from
from harness.engines.moving import Control
from harness.errors import InvalidRequest
from harness.results.cause import DriftCause
from harness.results.measured import MeasuredRecord

ARM_JOINTS = [f"joint{number}" for number in range(6)]
SENT = [f"servo{number}" for number in range(6)]
# A pendulum with a rotor: its log holds one moment of inertia about the axis, whoever has it.
PENDULUM = """<mujoco><option timestep="0.002"/><worldbody><body name="rod">
<joint name="pin" axis="0 1 0" damping="0.1" armature="0.02"/>
<inertial pos="0 0 -0.3" mass="0.5" diaginertia="0.004 0.004 0.001"/>
</body></worldbody>
<actuator><motor name="drive" joint="pin"/></actuator><keyframe><key qpos="1"/></keyframe></mujoco>"""

# Two joints, each with an actuator of its own.
ARM_OF_TWO = """<mujoco><option timestep="0.002"/><worldbody><body name="upper">
<joint name="shoulder" axis="0 1 0" damping="0.1" armature="0.02"/>
<inertial pos="0 0 -0.2" mass="0.8" diaginertia="0.01 0.01 0.002"/>
<body name="fore" pos="0 0 -0.4"><joint name="elbow" axis="0 1 0" damping="0.05" armature="0.01"/>
<inertial pos="0.02 0 -0.15" mass="0.5" diaginertia="0.004 0.004 0.001"/></body></body></worldbody>
<actuator><motor name="drive" joint="shoulder"/><position name="servo" joint="elbow" kp="5" kv="0.2"/></actuator>
<keyframe><key qpos="1 -0.5"/></keyframe></mujoco>"""
NOISE = 1e-4


def control_of(names: list[str], seconds: float) -> Control:
    times = np.arange(0.0, seconds, 0.002)
    return Control(tuple(names), times, np.column_stack([0.6 * np.sin(2 * times + number) for number in range(len(names))]))


def measure(path: Path, text: str, control: Control, seconds: float, delay: float = 0.0, noise: tuple[float, int] = (0.0, 0)) -> None:
    """A log of all joints each fifth step, of MuJoCo alone, with ``noise`` of a size and a seed."""
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    names = [mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_JOINT, number) for number in range(model.njnt)]
    rows, size, generator = [",".join(["time", *names])], noise[0], np.random.default_rng(noise[1])
    for step in range(round(seconds / model.opt.timestep) + 1):
        if step % 5 == 0:
            measured = data.qpos + size * generator.standard_normal(model.nq)
            rows.append(",".join(map(repr, [step * model.opt.timestep, *measured.tolist()])))
        data.ctrl[:] = control.held_at(np.array([max(step * model.opt.timestep - delay, 0.0)]))[0]
        mujoco.mj_step(model, data)
    path.write_text("\n".join(rows))


def explained(
    folder: Path, text: str, real: str, names: list[str], seconds: float = 1.0, disturbed: tuple[float, int] = (0.0, 0)
) -> ExplainedLog:
    """What is found in a log of ``real`` beside ``text``, ``disturbed`` by a delay and by noise of a seed, 0 for none."""
    (folder / "model.xml").write_text(text)
    control, (delay, seed) = control_of(names, seconds), disturbed
    measure(folder / "log.csv", real, control, seconds, delay, (NOISE if seed else 0.0, seed))
    return explained_from(MeasuredSettings(MovingSide(folder / "model.xml"), folder / "log.csv", control), here=True)


def found(folder: Path, text: str, real: str, names: list[str], delay: float = 0.0, seconds: float = 1.0) -> MeasuredRecord:
    assert text != real or delay
    return explained(folder, text, real, names, seconds, (delay, 0)).record


@pytest.mark.ci
@pytest.mark.parametrize(
    ("pattern", "planted", "what", "owner"),
    [
        (r'(name="joint2"[^>]*damping=)"0.4"', 1.1, "damping", "joint joint2"),
        (r'(name="joint1"[^>]*frictionloss=)"0.3"', 0.8, "frictionloss", "joint joint1"),
        (r'(name="joint0"[^>]*armature=)"0.05"', 0.2, "armature", "joint joint0"),
        (r'(name="servo1"[^>]*kv=)"5.13"', 1.0, "kv", "actuator servo1"),
        (r'(name="servo2"[^>]*gear=)"1"', 0.7, "gear", "actuator servo2"),
    ],
)
def test_a_number_that_the_robot_has_otherwise_explains_the_log(
    tmp_path: Path, pattern: str, planted: float, what: str, owner: str
) -> None:
    record = found(tmp_path, ARM, re.sub(pattern, rf'\g<1>"{planted}"', ARM, count=1), SENT)
    best = record.numbers[0]
    assert (best.what, best.owner) == (what, owner) or f"{what} of {owner}" in best.alike, record.sentence
    assert best.explained > 0.9 and record.joints == ARM_JOINTS
    if best.what == what:
        assert best.fitted == pytest.approx(planted, rel=0.15) and re.fullmatch(r"line \d+", best.place)
        assert f'"{best.value:g}"' in ARM.splitlines()[int(best.place.partition(" ")[2]) - 1]


@pytest.mark.ci
def test_a_delay_of_the_controls_explains_the_log(tmp_path: Path) -> None:
    record = found(tmp_path, ARM, ARM, SENT, delay=0.02)
    best = record.numbers[0]
    assert best.what == DELAY.what and best.fitted == pytest.approx(0.02, rel=0.15) and best.explained > 0.95


@pytest.mark.ci
def test_what_a_log_does_not_tell_apart_is_told_together(tmp_path: Path) -> None:
    """About its axis a pendulum has one moment of inertia, of the rotor and of the rod."""
    record = found(tmp_path, PENDULUM, PENDULUM.replace('armature="0.02"', 'armature="0.04"'), ["drive"])
    by_name = {one.name: one for one in record.numbers}
    rotor, rod = by_name["armature of joint pin"], by_name["moment of inertia y of body rod"]
    assert rod.name in rotor.alike and rotor.name in rod.alike
    assert rotor.fitted - rotor.value == pytest.approx(rod.fitted - rod.value, rel=0.02) == pytest.approx(0.02, rel=0.05)
    assert "The log does not tell it from" in record.sentence
    # Twice the armature is likelier than six times the moment of inertia.
    assert record.numbers[0] is rotor


# Numbers of two joints, each as the robot has it.
TWO = {"damping of joint shoulder": ('damping="0.1"', 'damping="0.3"', 0.3), "kp of actuator servo": ('kp="5"', 'kp="7"', 7.0)}


@pytest.mark.ci
@pytest.mark.parametrize("seed", [0, 1])
def test_two_numbers_of_two_joints_explain_the_log_at_once(tmp_path: Path, seed: int) -> None:
    real = ARM_OF_TWO
    for old, new, _ in TWO.values():
        assert real.count(old) == 1
        real = real.replace(old, new)
    log = explained(tmp_path, ARM_OF_TWO, real, ["drive", "servo"], 0.6, (0.0, seed))
    record = log.record
    assert {one.name for one in record.together} == TWO.keys(), record.sentence
    for one in record.together:
        assert abs(one.fitted - TWO[one.name][2]) <= (5 * one.error if seed else 1e-6), one
        assert one.error < 1e-3 * one.fitted and TWO[one.name][1] in f" {one.remedy}"
    first, second = record.together
    assert first.explained < 0.999 < second.explained and record.numbers[0].explained < second.explained
    assert f"explain 100 % of the gap together; the first alone {100 * first.explained:.0f} %." in record.sentence
    if seed == 0:
        # The changes are of the file: written into it, they end the gap.
        assert log.changes.keys() == {DriftCause.DAMPING, DriftCause.GAIN}
        for [(change, value)] in log.changes.values():
            assert change.start is not None and change.text(change.start) == (tmp_path / "model.xml").read_text()
            (tmp_path / "model.xml").write_text(change.text(value))
        after = measured_from(MeasuredSettings(MovingSide(tmp_path / "model.xml"), tmp_path / "log.csv", log.settings.control), here=True)
        # What is left is of the velocities at the start, which the first rows tell to second order.
        assert after.gap < 1e-3 * record.gap and after.together == ()


@pytest.mark.ci
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_noise_makes_no_cause(tmp_path: Path, seed: int) -> None:
    record = explained(tmp_path, PENDULUM, PENDULUM, ["drive"], disturbed=(0.0, seed)).record
    assert record.together == () and record.gap == pytest.approx(NOISE, rel=0.3)
    assert "No number of the file explains" in record.sentence and not any(one.alike for one in record.numbers)


@pytest.mark.ci
def test_a_mass_with_its_centre_is_not_identifiable_beside_the_rotor(tmp_path: Path) -> None:
    """Half of the mass at twice the distance weighs as much, and turns as with a larger rotor: three numbers, two combinations."""
    real = PENDULUM.replace('pos="0 0 -0.3" mass="0.5"', 'pos="0 0 -0.6" mass="0.25"')
    record = explained(tmp_path, PENDULUM, real, ["drive"], 0.6).record
    [one] = record.together
    assert one.name == "armature of joint pin" and one.alike == ("moment of inertia y of body rod",)
    # m z^2 grows from 0.045 to 0.09 kg m^2.
    assert one.fitted == pytest.approx(0.065, rel=1e-6) and one.explained > 0.999
    assert one.groups == (("mass of body rod", "centre of mass z of body rod"),)
    group = "armature of joint pin, mass of body rod and centre of mass z of body rod"
    assert f"Not identifiable together: {group}." in record.sentence
    assert "mass of body rod and centre of mass z of body rod" in str(record.joint_table)


@pytest.mark.ci
def test_a_log_and_its_controls_are_of_one_clock(tmp_path: Path) -> None:
    real = PENDULUM.replace('damping="0.1"', 'damping="0.3"')
    record = found(tmp_path, PENDULUM, real, ["drive"])
    header, *rows = (tmp_path / "log.csv").read_text().splitlines()
    later = [",".join([repr(float(time) + 8.0), position]) for time, position in (row.split(",") for row in rows)]
    (tmp_path / "later.csv").write_text("\n".join([header, *later]))
    control = control_of(["drive"], 1.0)
    control = Control(control.names, control.times + 8.0, control.values)
    other = measured_from(MeasuredSettings(MovingSide(tmp_path / "model.xml"), tmp_path / "later.csv", control), here=True)
    assert other.gap == pytest.approx(record.gap, rel=1e-6)
    assert [one.name for one in other.numbers[:2]] == [one.name for one in record.numbers[:2]]


@pytest.mark.ci
def test_a_log_of_some_joints_and_no_gap(tmp_path: Path) -> None:
    (tmp_path / "hopper.xml").write_text(HOPPER)
    model = mujoco.MjModel.from_xml_string(HOPPER)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    rows = ["time,rail"]
    for step in range(30):
        rows.append(f"{step * 0.002!r},{float(data.qpos[0])!r}")
        mujoco.mj_step(model, data)
    (tmp_path / "log.csv").write_text("\n".join(rows))
    record = measured_from(MeasuredSettings(MovingSide(tmp_path / "hopper.xml"), tmp_path / "log.csv"), here=True)
    assert record.joints == ["rail"] and record.gap < 1e-2 and record.seconds == pytest.approx(0.058)
    assert all(0.0 <= one.explained <= 1.0 and math.isfinite(one.fitted) for one in record.numbers)


@pytest.mark.ci
def test_a_log_in_python(tmp_path: Path) -> None:
    record = found(tmp_path, PENDULUM, PENDULUM.replace('damping="0.1"', 'damping="0.3"'), ["drive"], seconds=0.4)
    np.savez(tmp_path / "sent.npz", time=np.arange(0.0, 0.4, 0.002), drive=control_of(["drive"], 0.4).values[:, 0])
    for control in (tmp_path / "sent.npz", lambda t, q, v: [0.6 * math.sin(2 * t)]):
        again = api.drift_from_log(tmp_path / "model.xml", tmp_path / "log.csv", control=control)
        assert (again.numbers[0].what, again.joints) == ("damping", ["pin"]) and again.sentence in repr(again)
    assert record.numbers[0].fitted == pytest.approx(again.numbers[0].fitted, rel=1e-3)
    with pytest.raises(InvalidRequest, match=r"log\.csv is a table; a log is held against a model by harness\.drift_from_log"):
        api.drift(tmp_path / "model.xml", tmp_path / "log.csv")


@pytest.mark.ci
def test_the_way_of_a_log_is_from_its_first_row(tmp_path: Path) -> None:
    (tmp_path / "model.xml").write_text(PENDULUM)
    (tmp_path / "log.csv").write_text("time,pin\n0,1\n0.01,1.1\n")
    record = measured_from(MeasuredSettings(MovingSide(tmp_path / "model.xml"), tmp_path / "log.csv"), here=True)
    # One row beside the first determines the velocity at the start, and nothing else.
    assert record.gap < 1e-12 and record.numbers == ()
    assert record.sentence.endswith("No number of the file explains 5 % of that alone.")
    (tmp_path / "log.csv").write_text("time,pin\n0,1\n0.01,1\n0.2,1\n")
    still = measured_from(MeasuredSettings(MovingSide(tmp_path / "model.xml"), tmp_path / "log.csv"), here=True)
    assert still.sentence.startswith("log.csv stands still over 0.2 s, and the motion of model.xml does not. ")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("time,elbow\n0,0\n1,0\n", "has the column 'elbow', which is no hinge or slide of the model; expected pin"),
        ("time,pin\n0,0\n0.0001,0\n", "ends within one step of 0.002 s; expected several rows"),
        ("pin\n0\n", "has the columns pin; expected time and one for each joint"),
    ],
)
def test_a_log_of_something_else_is_refused(tmp_path: Path, text: str, said: str) -> None:
    (tmp_path / "model.xml").write_text(PENDULUM)
    (tmp_path / "log.csv").write_text(text)
    with pytest.raises(InvalidRequest, match=re.escape(said)):
        measured_from(MeasuredSettings(MovingSide(tmp_path / "model.xml"), tmp_path / "log.csv"), here=True)


@pytest.mark.ci
def test_a_user_reads_what_would_explain_the_log(tmp_path: Path) -> None:
    found(tmp_path, PENDULUM, PENDULUM.replace('damping="0.1"', 'damping="0.3"'), ["drive"], seconds=0.4)
    times = np.arange(0.0, 0.4, 0.002)
    rows = [f"{time!r},{0.6 * math.sin(2 * time)!r}" for time in times.tolist()]
    (tmp_path / "sent.csv").write_text("\n".join(["time,drive", *rows]))
    done = harness("drift", "model.xml", "log.csv", "--control", "sent.csv", "--json", "found.json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    first = done.stdout.splitlines()[0]
    assert re.match(
        r"log\.csv is 0\.\d+ of its way from the motion of model\.xml over 0\.4 s\. Damping of joint pin 0\.\d+ in place of 0\.1", first
    )
    document = json.loads((tmp_path / "found.json").read_text())
    assert document["summary"] == first and document["measured"][0]["numbers"][0]["what"] == "damping"
    refused = harness("drift", "model.xml", "log.csv", "--delay", "0", "0.1", cwd=tmp_path)
    assert refused.returncode == 2 and "a measured log has no engine" in refused.stderr
