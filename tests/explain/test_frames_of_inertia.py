"""An inertial frame that is nearly the body's own, which MuJoCo takes for it."""

from __future__ import annotations

from pathlib import Path

import pytest
from comparison.robots import record_of

from harness.explain.changes.readings import find_readings
from harness.verdict import AGREEMENT

NAME = "inertial frames near those of bodies"
ARM = """<mujoco><worldbody><body name="a" pos="0 0 1"><joint name="h" type="ball"/>{}
<body name="b" pos="0.1 0.2 1"><joint name="g" axis="0 1 0"/><inertial pos="0.1 0 0" mass="1" diaginertia="0.02 0.03 0.04"/></body></body>
</worldbody></mujoco>"""
INERTIAL = '<inertial pos="{}" quat="{}" mass="1.5" diaginertia="0.02 0.03 0.04"/>'
NEAR = {
    "position": INERTIAL.format("5e-7 0 0", "1 0 0 0"),
    "turn": INERTIAL.format("0.1 0 0", "1 5e-7 0 0"),
    "both": INERTIAL.format("5e-7 0 0", "-1 5e-7 0 0"),
    "shape": '<geom type="box" size="0.1 0.2 0.3" pos="0 -9e-7 0"/>',
}
APART = {
    "position": INERTIAL.format("5e-7 2e-6 0", "1 0 0 0"),
    "turned": INERTIAL.format("5e-7 0 0", "1 1 0 0"),
    "exact": INERTIAL.format("0.1 0 0", "1 0 0 0"),
    "products": '<inertial pos="5e-7 0 0" mass="1.5" fullinertia="0.02 0.03 0.04 0.001 0 0"/>',
}


@pytest.mark.parametrize("name", NEAR)
def test_a_frame_that_is_nearly_the_bodys_is_that(name: str, tmp_path: Path) -> None:
    path = tmp_path / "arm.xml"
    path.write_text(ARM.format(NEAR[name]))
    record = record_of(path, "mujoco", aided=False)
    assert record.explained and [one.name for one in record.readings] == [NAME]
    assert record.left is not None and record.left < AGREEMENT < (record.backward_error or 0.0)


@pytest.mark.parametrize("name", APART)
def test_a_frame_that_is_not_is_the_files(name: str, tmp_path: Path) -> None:
    path = tmp_path / "arm.xml"
    path.write_text(ARM.format(APART[name]))
    record = record_of(path, "mujoco", aided=False)
    assert record.verdict == "agrees" and not record.readings


def test_engines_with_its_reader_have_the_frame_of_the_file() -> None:
    assert NAME in {one.name for one in find_readings("mujoco", "mjcf")}
    assert NAME not in {one.name for one in find_readings("mjx", "mjcf", "mujoco")}
