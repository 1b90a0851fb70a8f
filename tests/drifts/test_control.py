"""Controls of a drift: tables, functions, and when a control acts, held against MuJoCo stepped by hand."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from drifting import CART

from harness.drifts.control import read_control
from harness.engines.adapters.mujoco.moving import moved
from harness.engines.moving import Control, MotionsRequest, MovedFile, SimulatedFile, Timing
from harness.errors import InvalidRequest

LENGTH, JOINTS = 0.004, ("rail", "pin", "swivel")
ROWS = "time,drive,twist\n0,1,0.5\n0.02,-1,0\n0.05,2,1\n"


@pytest.fixture
def cart(tmp_path: Path) -> Path:
    path = tmp_path / "cart.xml"
    path.write_text(CART)
    return path


def table(folder: Path, text: str = ROWS) -> Control:
    path = folder / "control.csv"
    path.write_text(text)
    return read_control(path)


def test_a_row_is_held_until_the_next(tmp_path: Path) -> None:
    control = table(tmp_path)
    times = np.array([0.0, 0.0199, 5 * LENGTH, 0.0499, 0.05, 3.0])
    assert control.names == ("drive", "twist")
    assert control.held_at(times)[:, 0].tolist() == [1, 1, -1, -1, 2, 2]


def test_an_npz_is_the_same_table(tmp_path: Path) -> None:
    np.savez(tmp_path / "control.npz", time=[0, 0.02, 0.05], drive=[1, -1, 2], twist=[0.5, 0, 1])
    found, other = read_control(tmp_path / "control.npz"), table(tmp_path)
    assert found.names == other.names and np.array_equal(found.values, other.values) and np.array_equal(found.times, other.times)


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("c.csv", "t,drive\n0,1\n", "has the columns t, drive; expected time and one for each actuator"),
        ("c.csv", "time,drive\n0,1\n0,2\n", "the time of row 2 is not later than that before it; sort the rows"),
        ("c.csv", "time,drive\n0,1,2\n", "a row has another number of cells than the header, which has 2"),
        ("c.csv", "time,drive\n0,nan\n", "holds a number that is not finite"),
        ("c.csv", "time,drive\n0,fast\n", "cannot be read as a table of numbers"),
        ("c.csv", "", "has the columns none"),
        ("c.txt", "", "expected a table of controls, .csv, .npz, .parquet"),
    ],
)
def test_what_is_no_table_is_refused(tmp_path: Path, name: str, text: str, said: str) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(InvalidRequest, match=said.replace(".", r"\.")):
        read_control(tmp_path / name)


def test_a_table_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidRequest, match="there is no such table of controls"):
        read_control(tmp_path / "none.csv")


def test_parquet_is_read_or_says_what_to_install(tmp_path: Path) -> None:
    path = tmp_path / "control.parquet"
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError:
        with pytest.raises(InvalidRequest, match="pyarrow, which is not installed; install it, or write a CSV"):
            read_control(path)
    else:
        pyarrow.parquet.write_table(pyarrow.table({"time": [0.0, 0.02], "drive": [1.0, -1.0]}), path)
        assert read_control(path).values.tolist() == [[1.0], [-1.0]]


def moved_by(cart: Path, control: Control, timing: Timing, steps: int = 30) -> Any:
    motion = SimulatedFile(MovedFile(cart, "mjcf"), {}, timing, tuple(range(1, steps + 1)))
    model = mujoco.MjModel.from_xml_path(str(cart))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    return moved(MotionsRequest([motion], JOINTS, data.qpos.copy(), data.qvel.copy(), control))


def by_hand(cart: Path, control_at: Callable[[int, Any], Any], steps: int = 30) -> Any:
    """Positions after each step of the file, whose controls before a step are given."""
    model = mujoco.MjModel.from_xml_path(str(cart))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    found = []
    for step in range(steps):
        data.ctrl[:] = control_at(step, data)
        mujoco.mj_step(model, data)
        found.append(data.qpos.copy())
    return np.array(found)


def row(time: float) -> list[float]:
    return [2, 1] if time > 0.0499999 else [-1, 0] if time > 0.0199999 else [1, 0.5]


@pytest.mark.parametrize(("decimation", "late"), [(1, 0), (1, 3), (4, 0), (4, 3), (5, 5)])
def test_a_table_acts_late_and_at_each_period(cart: Path, tmp_path: Path, decimation: int, late: int) -> None:
    timing = Timing(decimation * LENGTH if decimation > 1 else 0.0, late * LENGTH)
    found = moved_by(cart, table(tmp_path), timing)
    expected = by_hand(cart, lambda step, data: row(max(step - late, 0) // decimation * decimation * LENGTH))
    assert np.array_equal(found.q[0], expected)


@pytest.mark.parametrize(("decimation", "late"), [(1, 0), (1, 3), (4, 0), (4, 3)])
def test_a_function_sees_the_state_when_it_is_asked(cart: Path, decimation: int, late: int) -> None:
    timing = Timing(decimation * LENGTH if decimation > 1 else 0.0, late * LENGTH)
    found = moved_by(cart, Control.calling(lambda t, q, v: {"drive": -3 * q[0] - v[0], "twist": t}, ("drive", "twist")), timing)
    asked: dict[int, list[float]] = {}

    def control(step: int, data: Any) -> list[float]:
        if step % decimation == 0:
            asked[step] = [-3 * data.qpos[0] - data.qvel[0], step * LENGTH]
        return asked[max(step - late, 0) // decimation * decimation]

    assert np.allclose(found.q[0], by_hand(cart, control), rtol=0, atol=1e-14)


def test_a_function_that_returns_no_controls_is_refused(cart: Path) -> None:
    for answer, said in (({"rudder": 1.0}, "'rudder', which no actuator is called"), ([1.0], "expected 2 finite numbers")):
        control = Control.calling(lambda t, q, v, answer=answer: answer, ("drive", "twist"))
        with pytest.raises(ValueError, match=said):
            moved_by(cart, control, Timing())
