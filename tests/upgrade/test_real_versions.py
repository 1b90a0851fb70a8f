"""Upgrades of MuJoCo whose changes are known, with the wheels of both versions."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from engines.test_compiled_numbers import URDF
from support import BUILT_IN, Done, cache_with_mechanisms, harness, harness_in_a_process

from harness.engines import describe_engines
from harness.environments import find_environments
from harness.workers import Workers

TURNED = URDF.replace('<origin xyz="0.1 0 0.05"/>', '<origin xyz="0.1 0 0.05" rpy="0.4 -0.3 0.9"/>')
FULL = """<mujoco><worldbody><body name="bar"><joint name="pin" axis="0 1 0"/>
  <inertial pos="0.1 0.2 0.05" mass="2" fullinertia="0.1 0.2 0.25 0.01 0.02 -0.03"/></body></worldbody></mujoco>
"""
SERVO = """<mujoco><worldbody><body><joint name="shoulder" axis="0 1 0"/><inertial pos="0 0 0.2" mass="2" diaginertia="0.09 0.08 0.02"/>
  <body pos="0 0 0.4"><joint name="elbow" axis="0 1 0" range="-140 30" frictionloss="0.1"/>
    <inertial pos="0 0 0.3" mass="3" diaginertia="0.02 0.02 0.01"/></body>
</body></worldbody>
<actuator><position name="servo" joint="shoulder" kp="100" dampratio="1"/></actuator></mujoco>
"""
pytestmark = pytest.mark.nightly


@pytest.fixture(scope="module", autouse=True)
def cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("HARNESS_CACHE", str(cache_with_mechanisms(tmp_path_factory.mktemp("environments") / "cache")))
        yield
    describe_engines(BUILT_IN, Workers)


def upgraded(folder: Path, before: str, now: str, name: str, text: str, *options: str) -> Done:
    for version in (before, now):
        if version not in [one.version for one in find_environments("mujoco")]:
            assert harness("engines", "add", f"mujoco=={version}").returncode == 0
    (folder / name).write_text(text)
    done = harness_in_a_process("upgrade", "mujoco", before, now, name, "--states", "60", *options, cwd=folder)
    return Done(done.returncode, done.stdout, done.stderr)


def test_the_rotation_of_an_inertial_origin_is_read_from_3_14_on(tmp_path: Path) -> None:
    done = upgraded(tmp_path, "3.13.0", "3.14.0", "turned.urdf", TURNED, "--allow-uncompared")
    assert done.returncode == 0, done.stdout + done.stderr
    assert re.match(
        r"Yes, for the better: MuJoCo 3\.14\.0 changes turned\.urdf against 3\.13\.0: accelerations by up to \S+ %", done.stdout
    )
    assert "no longer: MuJoCo before 3.14 ignores the rpy of a link's <inertial><origin>: 1 link" in done.stdout
    assert "body_inertia" in done.stdout


def test_a_full_inertia_keeps_its_digits_from_3_14_on(tmp_path: Path) -> None:
    done = upgraded(tmp_path, "3.13.0", "3.14.0", "full.xml", FULL)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "no longer: MuJoCo before 3.14 drops products of inertia" in done.stdout


def test_a_damping_ratio_means_something_else_from_3_15_on(tmp_path: Path) -> None:
    done = upgraded(tmp_path, "3.14.0", "3.15.0", "servo.xml", SERVO)
    assert done.returncode == 0, done.stdout + done.stderr
    better = r"Yes, for the better: MuJoCo 3\.15\.0 changes servo\.xml against 3\.14\.0, with 1 actuator on: "
    assert re.match(rf"{better}accelerations by up to \S+ % and compiled", done.stdout)
    assert "no longer: MuJoCo before 3.15 takes sum M_jj / J_j^2 for the inertia of dampratio" in done.stdout
    assert "1 actuator, line 5; " in done.stdout and "not compared" not in done.stdout


def test_a_drift_between_versions_is_due_to_the_law_of_an_actuator(tmp_path: Path) -> None:
    for version in ("3.14.0", "3.15.0"):
        if version not in [one.version for one in find_environments("mujoco")]:
            assert harness("engines", "add", f"mujoco=={version}").returncode == 0
    (tmp_path / "servo.xml").write_text(SERVO)
    by = ["--by", "mujoco@3.14.0", "--by", "mujoco@3.15.0", "--start", '{"shoulder": [0.5, 0]}', "--seconds", "0.5"]
    done = harness("drift", "servo.xml", *by, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    law = r"mujoco@3\.15\.0 has another derivative gain than mujoco@3\.14\.0: 100 % of the gap over 0\.5 s"
    assert re.match(rf"{law} \(mujoco@3\.15\.0 line 5: dampratio 1, compiled as ", done.stdout)


def test_a_bisection_names_the_version_and_the_line_of_a_damping_ratio(tmp_path: Path) -> None:
    (tmp_path / "servo.xml").write_text(SERVO)
    done = harness_in_a_process("upgrade", "mujoco", "--bisect", "3.13.0..4.0.0", "servo.xml", "--states", "60", cwd=tmp_path)
    assert done.stdout.startswith("MuJoCo 3.15.0 is the first version that changes anything, and 3.14.0 is as 3.13.0"), done.stderr
    assert "MuJoCo before 3.15 takes sum M_jj / J_j^2 for the inertia of dampratio" in done.stdout and "1 actuator, line 5" in done.stdout


def test_two_versions_that_do_alike(tmp_path: Path) -> None:
    done = upgraded(tmp_path, "3.15.0", "4.0.0", "full.xml", FULL)
    assert done.returncode == 0, done.stdout + done.stderr
    same = "accelerations and compiled numbers are the same to rounding"
    assert done.stdout == f"No: MuJoCo 4.0.0 does not change full.xml against 3.15.0; {same}\n"
