"""Controls of a drift: tables, functions, and when a control acts, held against MuJoCo stepped by hand."""

from __future__ import annotations

import pickle
import re
import sys
from collections.abc import Callable
from dataclasses import replace
from importlib.machinery import ModuleSpec
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import mujoco
import numpy as np
import pytest
from drifting import ARM, CART

import harness
from harness.drifts.control import read_control
from harness.engines.adapters.mujoco.moving import held_numbers, moved
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
        ("c.csv", "time,drive\n", "has no row; expected one for each time"),
        ("c.csv", "time;drive\n0;1\n", "the header has no comma, but ';'; expected columns apart by commas"),
        ("c.csv", "time,drive,drive\n0,1,2\n", "two columns are called 'drive'; leave out one"),
        ("c.npz", "", "cannot be read as a table of numbers"),
        ("c.txt", "", "expected a table of controls, .csv, .npz, .parquet, or a policy, .onnx"),
    ],
)
def test_what_is_no_table_is_refused(tmp_path: Path, name: str, text: str, said: str) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(InvalidRequest, match=said.replace(".", r"\.")):
        read_control(tmp_path / name)


def test_complex_numbers_are_no_controls(tmp_path: Path) -> None:
    np.savez(tmp_path / "c.npz", time=[0.0, 1.0], drive=[1j, 2.0])
    with pytest.raises(InvalidRequest, match="column 'drive' holds complex numbers"):
        read_control(tmp_path / "c.npz")


def test_a_table_as_spreadsheets_write_it_begins_with_a_mark(tmp_path: Path) -> None:
    (tmp_path / "c.csv").write_bytes(b"\xef\xbb\xbf" + ROWS.encode())
    assert read_control(tmp_path / "c.csv").names == ("drive", "twist")


@pytest.mark.ci
def test_a_table_that_begins_behind_the_motion_is_refused(cart: Path, tmp_path: Path) -> None:
    """As one by the clock of a robot, whose first row would hold all the time."""
    (tmp_path / "c.csv").write_text("time,drive\n1700000000,1\n1700000001,2\n")
    with pytest.raises(InvalidRequest, match=r"the control begins at 1\.7e\+09 s, behind the end of the motion at 0\.1 s"):
        harness.drift(cart, by=("mujoco/Euler", "mujoco/RK4"), control=tmp_path / "c.csv", seconds=0.1)


@pytest.mark.ci
def test_actuators_that_a_table_leaves_out_are_told(cart: Path, tmp_path: Path) -> None:
    (tmp_path / "c.csv").write_text("time,drive\n0,1\n")
    found = harness.drift(cart, by=("mujoco/Euler", "mujoco/RK4"), control=tmp_path / "c.csv", seconds=0.1)
    assert found.uncontrolled == ("twist",) and "Actuators without a column in the control are given 0: twist." in repr(found)
    assert harness.drift(cart, by=("mujoco/Euler", "mujoco/RK4"), seconds=0.1).uncontrolled == ()


@pytest.mark.ci
@pytest.mark.parametrize("name", ["delay", "decimation", "seconds", "by"])
def test_timing_that_is_none_is_refused(cart: Path, name: str) -> None:
    for wrong in {
        "delay": [(0.0, np.nan), (-1.0, 0.0), (0.0, np.inf), (0.0,)],
        "decimation": [(0, 1), (1, 1.5)],
        "seconds": [np.nan, -1.0, 0.0, np.inf],
        "by": [(), ("mujoco",) * 3],
    }[name]:
        with pytest.raises(InvalidRequest, match="expected"):
            harness.drift(cart, **{name: wrong})  # type: ignore[arg-type]


def test_an_argument_that_is_none_is_refused(cart: Path) -> None:
    with pytest.raises(TypeError, match="drift has no argument 'second_s'; expected some of seconds, start"):
        harness.drift(cart, second_s=1.0)  # type: ignore[call-arg]


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


class Session:
    """As ``onnxruntime.InferenceSession``: a file holds its inputs, and the only output is the drive for a sum of all that is given."""

    def __init__(self, path: str, options: Any, providers: list[str]) -> None:
        self.inputs = dict(word.split("=") for word in Path(path).read_text().split())

    def get_inputs(self) -> list[SimpleNamespace]:
        return [SimpleNamespace(name=name, type=f"tensor({kind})") for name, kind in self.inputs.items()]

    def run(self, outputs: None, given: dict[str, Any]) -> list[Any]:
        kinds = {"float": np.float32, "double": np.float64}
        assert {name: value.dtype for name, value in given.items()} == {name: kinds[kind] for name, kind in self.inputs.items()}
        assert all(value.ndim == 2 and len(value) == 1 for value in given.values())
        return [np.array([[sum(value.sum() for value in given.values()), 0.5]], dtype=np.float32)]


@pytest.fixture
def onnxruntime(monkeypatch: pytest.MonkeyPatch) -> None:
    module = ModuleType("onnxruntime")
    module.InferenceSession, module.SessionOptions = Session, SimpleNamespace  # type: ignore[attr-defined]
    module.__spec__ = ModuleSpec("onnxruntime", None)
    monkeypatch.setitem(sys.modules, "onnxruntime", module)


@pytest.mark.parametrize("inputs", ["obs=float", "q=float v=float", "v=double q=float"])
def test_a_policy_is_the_control_that_its_network_makes(cart: Path, tmp_path: Path, onnxruntime: None, inputs: str) -> None:
    (tmp_path / "policy.onnx").write_text(inputs)
    policy = read_control(tmp_path / "policy.onnx").function
    assert policy is not None
    again = pickle.loads(pickle.dumps(policy))
    q, v = np.array([0.25, 0.5]), np.array([-1.0, 2.0])
    assert again(0.1, q, v).tolist() == policy(0.1, q, v).tolist() == [1.75, 0.5]
    other = tmp_path / "other.xml"
    other.write_text(CART.replace('gear="1.5"', 'gear="1.4"'))

    def function(t: float, q: Any, v: Any) -> list[float]:
        return [float(np.float32(np.concatenate([q, v]).astype(np.float32).sum())), 0.5]

    found = harness.drift(cart, other, control=policy, seconds=0.05)
    if inputs == "obs=float":
        assert found == harness.drift(cart, other, control=function, seconds=0.05)
    assert found.ranked[0].name == "gear"


@pytest.mark.parametrize(
    ("inputs", "said"),
    [
        ("image=float state=float", "takes image: tensor(float), state: tensor(float); expected inputs among time, q and v"),
        ("q=int64", "takes q: tensor(int64); expected"),
        ("nothing", "onnxruntime reads no network there"),
    ],
)
def test_a_policy_of_something_else_is_refused(tmp_path: Path, onnxruntime: None, inputs: str, said: str) -> None:
    (tmp_path / "policy.onnx").write_text(inputs)
    with pytest.raises(InvalidRequest, match=re.escape(said)):
        read_control(tmp_path / "policy.onnx")


def test_what_reads_a_policy_is_named_where_it_is_missing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "onnxruntime", None)
    with pytest.raises(InvalidRequest, match=r"is a policy: .*onnxruntime.*pip install 'rigid-body-harness\[policy\]'"):
        read_control(tmp_path / "policy.onnx")


def test_a_control_that_ends_in_the_middle_ends_the_motion(cart: Path) -> None:
    """A network in float32 has no answer to a state that has become huge."""

    def function(t: float, q: Any, v: Any) -> list[float]:
        return [1.0, np.nan if t > 0.049 else 0.0]

    request = MotionsRequest(
        [SimulatedFile(MovedFile(cart, "mjcf"), {}, Timing(), (5, 10, 15, 20))],
        JOINTS,
        np.array([0.0, 0.3, 1.0, 0.0, 0.0, 0.0]),
        np.zeros(5),
        Control.calling(function, ("drive", "twist")),
    )
    [track] = moved(request).q
    assert np.isfinite(track).all(axis=1).tolist() == [True, True, False, False]
    with pytest.raises(ValueError, match="the control returns"):
        moved(replace(request, control=Control.calling(lambda t, q, v: [np.nan, 0.0], ("drive", "twist"))))


def test_a_control_of_a_robot_without_actuators_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "pole.xml"
    path.write_text(re.sub("<actuator>.*</actuator>", "", CART, flags=re.DOTALL).replace(' ctrl="0.8 1.5"', ""))
    with pytest.raises(InvalidRequest, match="no actuator is in both sides, so that a control moves nothing"):
        harness.drift(path, by=("mujoco/Euler", "mujoco/RK4"), control=lambda t, q, v: [])


@pytest.mark.ci
def test_a_log_of_joints_is_what_their_servos_track(tmp_path: Path) -> None:
    first, second = tmp_path / "a.xml", tmp_path / "b.xml"
    first.write_text(ARM)
    second.write_text(ARM.replace('kp="60"', 'kp="50"'))
    rows = "\n".join(f"{0.01 * row!r},{0.02 * row!r},{-0.01 * row!r}" for row in range(6))
    found = []
    for names in ("joint1,servo2", "servo1,servo2"):
        (tmp_path / "c.csv").write_text(f"time,{names}\n{rows}\n")
        found.append(harness.drift(first, second, control=tmp_path / "c.csv", seconds=0.05))
    assert found[0] == found[1] and any(found[0].of_positions)
    for names, said in (
        ("joint1,servo1", "two columns control actuator 'servo1', one by the name of its joint"),
        ("elbow,servo1", "no actuator of both sides is called 'elbow', which is controlled, nor has a joint of that name one servo"),
    ):
        (tmp_path / "c.csv").write_text(f"time,{names}\n{rows}\n")
        with pytest.raises(InvalidRequest, match=said):
            harness.drift(first, second, control=tmp_path / "c.csv", seconds=0.05)


def test_a_geared_servo_and_a_motor_track_no_joint(tmp_path: Path) -> None:
    geared, driven = ARM.replace('gear="1"', 'gear="2"'), re.sub(r'<position (name="servo1"[^>]*?) kp="60" kv="5.13"', r"<motor \1", ARM)
    for text, expected in ((geared, {}), (driven, {f"joint{number}": f"servo{number}" for number in (0, 2, 3, 4, 5)})):
        assert text != ARM
        (tmp_path / "a.xml").write_text(text)
        assert held_numbers(MovedFile(tmp_path / "a.xml", "mjcf")).servos == expected
