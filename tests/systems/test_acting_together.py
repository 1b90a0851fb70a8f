"""Actuators beside dry friction, limits, loops and free joints: mechanisms that declare them together are judged as one problem."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from catalogue import BUILT_IN
from support import cross_checked

from harness.crosscheck.assignment import Assignment, truth_of
from harness.crosscheck.settings import Settings
from harness.engines import Subject
from harness.errors import InvalidSystem
from harness.lagrange.derivation import load_mechanism
from harness.library import MODEL_SUFFIXES, Library
from harness.programs.states import States
from harness.truth.compare import compare
from harness.truth.sampling import generic_sample

_USES = ("from harness import TIME, ", "from harness import TIME, Actuator, ")
_GRAVITY = '        g: (9.81, "m/s^2"),\n'


@dataclass(frozen=True)
class Edited:
    """A mechanism of the catalogue with more in its system file and in its models: (text found there, text in its place) each."""

    name: str
    system: tuple[tuple[str, str], ...]
    mjcf: tuple[tuple[str, str], ...]
    urdf: tuple[tuple[str, str], ...] = ()


_SERVO = """
    actuators={
        "servo": Actuator(
            control=u, force=k_p * (u - theta), moments={theta: 1}, control_range=(u_low, u_high), force_range=(F_low, F_high)
        )
    },
    limits={theta: (lowest, highest)},
"""
_SERVO_SYMBOLS = """
k_p = sp.Symbol("k_p", positive=True)
u, u_low, u_high, F_low, F_high, lowest, highest = sp.symbols("u u_low u_high F_low F_high lowest highest", real=True)

SYSTEM"""
_SERVO_NUMBERS = """
        k_p: (20.0, "N m"),
        u_low: (-0.5, "rad"),
        u_high: (0.9, "rad"),
        F_low: (-12.0, "N m"),
        F_high: (15.0, "N m"),
        lowest: (0.0, "rad"),
        highest: (1.2, "rad"),
"""
_MOTOR = """    dry_friction={crank: tau_c},
    actuators={"motor": Actuator(control=u, force=u, moments={crank: n}, control_range=(u_low, u_high))},
    total_mass="""
_MOTOR_SYMBOLS = """
n, tau_c = sp.symbols("n tau_c", positive=True)
u, u_low, u_high = sp.symbols("u u_low u_high", real=True)

SYSTEM"""
_MOTOR_NUMBERS = """
        n: (3.0, ""),
        tau_c: (1.5, "N m"),
        u_low: (-2.0, "N m"),
        u_high: (3.0, "N m"),
"""
_WHEEL = """
        actuators={"motor": Actuator(control=u, force=k * (u - w.diff(TIME)), moments={w: 1})},
"""
_WHEEL_SYMBOLS = """
u = sp.Symbol("u", real=True)
k = sp.Symbol("k", positive=True)


def in_angles"""


def _driven(*actuators: str) -> str:
    return f"  </worldbody>\n  <actuator>{' '.join(actuators)}</actuator>"


SYSTEMS = {
    # A servo with both ranges, dry friction and stops at one pin.
    "servo": Edited(
        "dry_pendulum",
        (
            _USES,
            ("\nSYSTEM", _SERVO_SYMBOLS),
            ("    dry_friction={theta: tau_c},\n", f"    dry_friction={{theta: tau_c}},{_SERVO}"),
            (_GRAVITY, f"{_GRAVITY}{_SERVO_NUMBERS}"),
            ("    gravity=g,\n", "    gravity=g,\n    ranges={theta: (0.0, 1.1)},\n"),
        ),
        (
            (' actuation="disable"', ""),
            ('frictionloss="6.5"', 'frictionloss="6.5" range="0 1.2"'),
            ("  </worldbody>", _driven('<position name="servo" joint="pin" kp="20" ctrlrange="-.5 .9" forcerange="-12 15"/>')),
        ),
        (("<limit effort", '<limit lower="0" upper="1.2" effort'),),
    ),
    # A motor behind a gear and dry friction at the crank of a closed loop.
    "loop": Edited(
        "four_bar",
        (_USES, ("\nSYSTEM", _MOTOR_SYMBOLS), ("    total_mass=", _MOTOR), (_GRAVITY, f"{_GRAVITY}{_MOTOR_NUMBERS}")),
        (
            (' actuation="disable"', ""),
            ('gravity="0 0 -9.81"', 'gravity="0 0 -9.81" tolerance="0"'),
            ('<joint name="crank" type="hinge" axis="0 -1 0"/>', '<joint name="crank" type="hinge" axis="0 -1 0" frictionloss="1.5"/>'),
            ("  </worldbody>", _driven('<motor name="motor" joint="crank" gear="3" ctrlrange="-2 3"/>')),
        ),
        (
            (
                '<child link="crank"/>\n    <axis xyz="0 -1 0"/>\n    <limit effort="0" velocity="0"/>',
                '<child link="crank"/>\n    <axis xyz="0 -1 0"/>\n    <limit effort="0" velocity="0"/>\n    <dynamics friction="1.5"/>',
            ),
        ),
    ),
    # A motor that holds the rate of the wheel of a body that floats, whose equations have two charts.
    "floating": Edited(
        "satellite_wheel",
        (
            _USES,
            ("\n\n\ndef in_angles", _WHEEL_SYMBOLS),
            ("        potential=sp.S.Zero,\n", f"        potential=sp.S.Zero,{_WHEEL}"),
            ('            S: (0.5, "kg m^2"),\n', '            S: (0.5, "kg m^2"),\n            k: (0.125, "N m s"),\n'),
        ),
        ((' actuation="disable"', ""), ("  </worldbody>", _driven('<velocity name="motor" joint="wheel" kv="0.125"/>'))),
    ),
}


def library_of(root: Path, edited: Edited) -> Library:
    """A library of the edited mechanism alone."""
    files = {"systems": (BUILT_IN.system_path(edited.name), edited.system)}
    files |= {name: (BUILT_IN.model_path(edited.name, name), getattr(edited, name)) for name in MODEL_SUFFIXES}
    for folder, (path, changes) in files.items():
        text = path.read_text()
        for old, new in changes:
            assert text.count(old) == 1, (path, old)
            text = text.replace(old, new)
        (root / folder).mkdir(parents=True)
        (root / folder / path.name).write_text(text)
    return Library.at(root)


@pytest.mark.ci
@pytest.mark.parametrize("name", SYSTEMS)
def test_what_acts_together_is_judged_together(name: str, tmp_path: Path) -> None:
    edited = SYSTEMS[name]
    records, _ = cross_checked(Settings(library=library_of(tmp_path, edited), names=[edited.name], states=24, examples=None))
    verdicts = {record.subject: record.verdict for record in records}
    assert verdicts["lagrange"] == verdicts["mujoco/mjcf"] == "agrees", [record.message for record in records]
    assert all(record.as_expected for record in records)
    # Neither applies what the other format, or the engine, has no law of.
    for subject in ("mujoco/urdf", "pinocchio/mjcf", "pinocchio/urdf"):
        [record] = [one for one in records if one.subject == subject]
        told = {reading.name for reading in record.readings}
        assert record.verdict == "explained" and "actuators" in told
        assert ("dry friction" in told) == (name != "floating" and subject != "mujoco/urdf")


FAULTS = {
    "servo": ("servo", 'kp="20"', 'kp="20.002"'),
    "friction beside a servo": ("servo", 'frictionloss="6.5"', 'frictionloss="6.5006"'),
    "gear in a loop": ("loop", 'gear="3"', 'gear="3.0003"'),
    "friction in a loop": ("loop", 'frictionloss="1.5"', 'frictionloss="1.50015"'),
    "servo of a wheel": ("floating", 'kv="0.125"', 'kv="0.12501"'),
}


@pytest.mark.ci
@pytest.mark.parametrize("name", FAULTS)
def test_a_wrong_number_is_red(name: str, tmp_path: Path) -> None:
    own, old, new = FAULTS[name]
    library, edited = library_of(tmp_path, SYSTEMS[own]), SYSTEMS[own].name
    path = library.model_path(edited, "mjcf")
    sound = path.read_text()
    assert sound.count(old) == 1
    (tmp_path / "planted.xml").write_text(sound.replace(old, new))
    settings = Settings(
        library=library, names=[edited], states=24, examples=None, subjects=["mujoco/mjcf"], stand_ins={"mjcf": tmp_path / "planted.xml"}
    )
    [record], _ = cross_checked(settings)
    assert record.verdict == "disagrees"


@pytest.mark.ci
def test_the_rigid_truth_of_a_loop_that_rubs_is_that_without_friction_at_a_force_of_its_bound(tmp_path: Path) -> None:
    """What slides bears its bound against its rate, which is a force as one that is applied."""
    edited = SYSTEMS["loop"]
    library = library_of(tmp_path, edited)
    rubbing = Assignment.of(library, edited.name, Subject("lagrange", "equations"))
    states = generic_sample(rubbing.mechanism, 12, 3)
    found = truth_of(rubbing).evaluate(states)
    control = np.clip(states.control[:, 0], -2.0, 3.0)
    tau = states.tau.copy()
    tau[:, 0] += 3.0 * control - 1.5 * np.sign(states.v[:, 0])
    assert (control != states.control[:, 0]).any()
    own = truth_of(Assignment.of(BUILT_IN, edited.name, Subject("lagrange", "equations")))
    compared = compare(found, own.evaluate(States.at(states.q, states.v, tau)).high)
    assert compared.backward_error.max() <= 4


def test_an_actuator_that_turns_a_ball_or_free_joint_is_refused(tmp_path: Path) -> None:
    edited = SYSTEMS["floating"]
    library = library_of(tmp_path, edited)
    path = library.system_path(edited.name)
    path.write_text(path.read_text().replace("moments={w: 1}", "moments={w: 1, x: 1}"))
    with pytest.raises(InvalidSystem, match=r"actuator 'motor' feels or moves x\(t\) of a ball or free joint; expected hinges and slides"):
        load_mechanism(library, edited.name)
