"""The search of a robot's file has everything on with which answers are judged, and finds where a solver of constraints stops early."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from support import harness

ARM = """
<mujoco model="arm">
  <option {settings}/>
  <worldbody>
    <body name="upper">
      <joint name="shoulder" axis="0 1 0" range="-40 60" limited="true" frictionloss="0.3"/>
      <inertial pos="0 0 -.2" mass="1.5" diaginertia=".02 .03 .01"/>
      <body name="fore" pos="0 0 -.4">
        <joint name="elbow" axis="0 1 0" range="-10 80" limited="true" frictionloss="0.2"/>
        <inertial pos="0 0 -.1" mass=".7" diaginertia=".01 .01 .002"/>
        <body name="hand" pos="0 0 -.3">
          <joint name="wrist" axis="0 1 0" range="-5 5" limited="true"/>
          <inertial pos="0 0 -.05" mass=".2" diaginertia=".001 .001 .0005"/>
        </body>
      </body>
    </body>
  </worldbody>
  <actuator><motor name="drive" joint="elbow" gear="30" ctrlrange="-1 1"/></actuator>
</mujoco>
"""
STOPS_EARLY = 'solver="CG" iterations="3"'
TO_THE_END = 'solver="Newton" iterations="100" tolerance="0"'


def search(folder: Path, settings: str) -> tuple[str, dict[str, object]]:
    (folder / "arm.xml").write_text(ARM.format(settings=settings))
    done = harness("search", "arm.xml", "--subject", "mujoco/mjcf", "--budget", "120", "--json", "found.json", "--no-keep", cwd=folder)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout, json.loads((folder / "found.json").read_text())["search"]


@pytest.mark.ci
def test_a_solver_that_stops_early_is_found_with_what_to_set(tmp_path: Path) -> None:
    told, found = search(tmp_path, STOPS_EARLY)
    first = told.splitlines()[0]
    assert "MuJoCo stops its solver up to" in first and f"set <option {TO_THE_END}/>" in first
    assert first.endswith("1 actuator, dry friction in 2 places and 3 joint limits on.")
    case = next(case for case in found["found"] if case["found"]["term"] == "solver")  # type: ignore[attr-defined]
    assert case["found"]["verdict"] == "explained" and case["as_expected"]
    # Its state is that which was asked, its control with it.
    state = json.dumps(case["found"]["state"])
    assert "control" in case["found"]["state"]
    done = harness("check", "arm.xml", "--subject", "mujoco/mjcf", "--state", state, "--json", "again.json", cwd=tmp_path)
    (record,) = json.loads((tmp_path / "again.json").read_text())["records"]
    assert done.returncode == 0 and record["verdict"] == "explained"
    assert record["backward_error"] == pytest.approx(case["found"]["backward_error"], rel=1e-6)


@pytest.mark.ci
def test_a_solver_that_goes_to_the_end_is_not(tmp_path: Path) -> None:
    told, found = search(tmp_path, TO_THE_END)
    assert "stops its solver" not in told and max(found["worst"].values()) < 64  # type: ignore[attr-defined]
