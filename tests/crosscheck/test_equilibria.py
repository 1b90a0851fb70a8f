"""Answers at equilibria, where the exact accelerations are zero: what an engine leaves of terms that cancel is no fault of it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from catalogue import BUILT_IN
from support import harness, records_of

from harness.arrays import Array
from harness.crosscheck.assignment import Assignment
from harness.crosscheck.stages import Answers, compare_all
from harness.engines import Subject
from harness.library import MODEL_SUFFIXES
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.states import States
from harness.truth.compare import compare
from harness.truth.manifold import closed
from harness.truth.reference import ReferenceKernel
from harness.truth.sampling import generic_sample

STARTS, STEPS = 20, 40
# Of the difference quotients of Newton's method, and its longest step [rad or m].
FORWARD, LONGEST = 1e-6, 0.5
# Newton's method has ended there [rad/s^2 or m/s^2], and beside a quarter turn that near it [rad].
AT_REST, NEAR = 1e-6, 1e-6
PLANTED = 1e-9


def resting(mechanism: Mechanism, q: Array) -> States:
    """States at rest and without applied forces near the positions q, of unit quaternions and closed constraints."""
    q = q.copy()
    for earlier, place in enumerate(mechanism.attitudes):
        own = slice(place + earlier, place + earlier + 4)
        q[:, own] /= np.linalg.norm(q[:, own], axis=1, keepdims=True)
    still = np.zeros((len(q), mechanism.nv))
    states = States.at(q, still, still)
    return states if mechanism.constraints is None else closed(mechanism, states)


def equilibria(mechanism: Mechanism) -> States:
    """The equilibria in the ranges of a mechanism that Newton's method finds from a sample, and the exact quarter turns beside them."""
    kernel, determined = ReferenceKernel(mechanism), () if mechanism.constraints is None else mechanism.constraints.positions
    q = resting(mechanism, generic_sample(mechanism, STARTS, seed=0).q).q
    free = [place for place in range(mechanism.nq) if place not in determined]
    for _ in range(STEPS):
        beside = [q, *(q + FORWARD * np.eye(mechanism.nq)[place] for place in free)]
        found = kernel.evaluate(resting(mechanism, np.concatenate(beside))).high.reshape(len(beside), len(q), mechanism.nv)
        slopes = np.moveaxis((found[1:] - found[0]) / FORWARD, 0, -1)
        known = np.flatnonzero(np.isfinite(slopes).all(axis=(1, 2)))
        moves = np.stack([np.linalg.lstsq(slopes[index], -found[0, index], rcond=1e-8)[0] for index in known])
        q[np.ix_(known, free)] += moves / np.maximum(1.0, np.abs(moves).max(axis=1, keepdims=True) / LONGEST)
        q = resting(mechanism, q).q
    reached = kernel.evaluate(resting(mechanism, q))
    q = q[reached.certified & (np.abs(reached.high).max(axis=1) < AT_REST)]
    if mechanism.nq == mechanism.nv:
        ranges = [(-np.inf, np.inf) if one is None else one for one in mechanism.position_ranges]
        low, high = np.array(ranges, dtype=np.float64).T
        q = q[((low <= q) & (q <= high)).all(axis=1)]
    quarters = np.round(q / (np.pi / 2)) * (np.pi / 2)
    return resting(mechanism, np.concatenate([q, np.where(np.abs(q - quarters) < NEAR, quarters, q)]))


def answers_at(name: str, states: States) -> dict[str, Answers]:
    subjects = [Subject(engine, form) for engine in ("mujoco", "pinocchio") for form in MODEL_SUFFIXES]
    return compare_all([Assignment.of(BUILT_IN, name, subject) for subject in subjects], states, lambda note: None)[2]


def test_no_sound_engine_is_accused_at_an_equilibrium(modelled_name: str, modelled_mechanism: Mechanism) -> None:
    states = equilibria(modelled_mechanism)
    for title, answers in answers_at(modelled_name, states).items() if len(states) else ():
        assert answers.comparison is not None or answers.unsupported, (title, answers.failure)
        if answers.comparison is not None:
            assert "disagrees" not in answers.comparison.verdicts, (title, answers.comparison.backward_error.max())


def test_what_is_planted_at_an_equilibrium_is_red(modelled_name: str, modelled_mechanism: Mechanism) -> None:
    """On each coordinate in turn, a billionth of the largest force that gravity can have on it, g sqrt(m M_ii)."""
    states = equilibria(modelled_mechanism)
    if not len(states) or not modelled_mechanism.gravity or modelled_mechanism.constraints is not None:
        return
    reference = ReferenceKernel(modelled_mechanism).evaluate(states)
    mass = np.einsum("nki,nkj->nij", reference.norm_factor, reference.norm_factor)
    for place in range(modelled_mechanism.nv):
        force = np.zeros((len(states), modelled_mechanism.nv, 1))
        force[:, place, 0] = PLANTED * modelled_mechanism.gravity * np.sqrt(modelled_mechanism.total_mass * mass[:, place, place])
        planted = np.linalg.solve(mass, force)[:, :, 0]
        assert set(compare(reference, reference.high + (planted + reference.low)).verdicts.tolist()) == {"disagrees"}


SYSTEM = '''"""Uniform rod hanging from the rim of a turntable, with a damper in each joint.

Zero: rod hanging, its pin at +x. z up; phi turns the table about +z, theta > 0 swings the rod outwards.
Source: Lagrange's equations of the second kind, a classroom exercise.
"""

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from harness import TIME, System

phi, theta = dynamicsymbols("phi theta")
m, L, R, J, b, c, g = sp.symbols("m L R J b c g", positive=True)
radius, height = R + L / 2 * sp.sin(theta), -L / 2 * sp.cos(theta)
turn, swing = phi.diff(TIME), theta.diff(TIME)
of_centre = radius.diff(TIME) ** 2 + height.diff(TIME) ** 2 + (radius * turn) ** 2

SYSTEM = System(
    coordinates={phi: "table", theta: "pin"},
    kinetic=J * turn**2 / 2 + m * of_centre / 2 + m * L**2 / 24 * (swing**2 + (turn * sp.sin(theta)) ** 2),
    potential=m * g * height,
    generalised_forces={phi: -b * turn, theta: -c * swing},
    parameters={
        m: (4, "kg"), L: (0.75, "m"), R: (0.5, "m"), J: (2, "kg m^2"), b: (0.3, "N m s"), c: (0.1, "N m s"), g: (9.81, "m/s^2"),
    },
    total_mass=m,
    gravity=g,
)
'''
MJCF = """<mujoco model="turntable_rod">
  <compiler angle="radian"/>
  <option gravity="0 0 -9.81">
    <flag constraint="disable" contact="disable" actuation="disable" sensor="disable" spring="disable"/>
  </option>
  <worldbody>
    <body name="disc">
      <joint name="table" type="hinge" axis="0 0 1" damping="0.3"/>
      <inertial pos="0 0 0" mass="1e-15" diaginertia="1 1 2"/>
      <body name="rod" pos="0.5 0 0">
        <joint name="pin" type="hinge" axis="0 -1 0" damping="0.1"/>
        <inertial pos="0 0 -0.375" mass="4" diaginertia="0.1875 0.1875 1e-15"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""
URDF = """<robot name="turntable_rod">
  <link name="world"/>
  <link name="disc">
    <inertial><mass value="1e-15"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="2"/></inertial>
  </link>
  <link name="rod">
    <inertial>
      <origin xyz="0 0 -0.375"/>
      <mass value="4"/>
      <inertia ixx="0.1875" ixy="0" ixz="0" iyy="0.1875" iyz="0" izz="0"/>
    </inertial>
  </link>
  <joint name="table" type="revolute">
    <parent link="world"/>
    <child link="disc"/>
    <axis xyz="0 0 1"/>
    <limit effort="0" velocity="0"/>
    <dynamics damping="0.3"/>
  </joint>
  <joint name="pin" type="revolute">
    <parent link="disc"/>
    <child link="rod"/>
    <origin xyz="0.5 0 0"/>
    <axis xyz="0 -1 0"/>
    <limit effort="0" velocity="0"/>
    <dynamics damping="0.1"/>
  </joint>
</robot>
"""
FILES = {"systems/turntable_rod.py": SYSTEM, "mjcf/turntable_rod.xml": MJCF, "urdf/turntable_rod.urdf": URDF}
HANGING = '{"q": [-1.8838562282653914e-06, 0.0], "v": [0.0, 0.0], "tau": [0.0, 0.0]}'


@pytest.fixture
def library(tmp_path: Path) -> Path:
    folder = tmp_path / "library"
    for place, text in FILES.items():
        (folder / place).parent.mkdir(parents=True)
        (folder / place).write_text(text)
    return folder


@pytest.mark.ci
def test_a_rod_that_hangs_from_a_turntable_agrees(library: Path, tmp_path: Path) -> None:
    json = tmp_path / "records.json"
    done = harness("check", "turntable_rod", "--library", str(library), "--states", "500", "--json", str(json))
    assert done.returncode == 0, done.stdout
    assert {record["verdict"] for record in records_of(json)} == {"agrees"}
    assert "at fault" not in done.stdout


def test_what_is_left_of_zero_is_said(library: Path, tmp_path: Path) -> None:
    replay = ["check", "turntable_rod", "--library", str(library), "--subject", "mujoco/mjcf", "--state", HANGING]
    done = harness(*replay, "--json", str(tmp_path / "records.json"))
    [record] = records_of(tmp_path / "records.json")
    assert (done.returncode, record["verdict"], record["componentwise_error"]) == (0, "agrees", None)
    assert "Zero by cancellation at 1 state: the exact answer is 0, and the largest component of the engine's is " in record["message"]
    assert record["message"] in done.stdout


@pytest.mark.ci
def test_gravity_that_is_tilted_by_a_billionth_is_red_there(library: Path) -> None:
    model = library / "mjcf" / "turntable_rod.xml"
    model.write_text(MJCF.replace('"0 0 -9.81"', '"9.81e-9 0 -9.81"'))
    done = harness("check", "turntable_rod", "--library", str(library), "--subject", "mujoco/mjcf", "--state", HANGING)
    assert done.returncode == 1, done.stdout
    assert "disagrees" in done.stdout
