"""The diagnosis of other quantities than accelerations: who, which block, since when, and which number of the file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from catalogue import BUILT_IN
from comparison.robots import edited, line_of
from support import InThisProcess, make_library

import harness
from harness.errors import InvalidRequest
from harness.explain.terms import AT_REST, LOADED, MOVING, wrong_blocks

SUBJECTS = ["mujoco/mjcf", "mujoco/urdf", "pinocchio/mjcf", "pinocchio/urdf"]
TURNED_ENGINE = """
from harness.engines.adapters.mujoco import MujocoEngine


class Engine(MujocoEngine):
    formats = ("mjcf",)

    def load(self, source, joints, gravity):
        loaded = super().load(source, joints, gravity)
        {method} = loaded.{method}
        loaded.{method} = lambda {arguments}: {method}({arguments}) {change}
        return loaded


ENGINE = Engine()
"""


@pytest.fixture(autouse=True)
def in_this_process(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("harness.workers.Workers", InThisProcess)


def test_blocks_are_told_by_the_state_that_shows_them_first() -> None:
    kinds = np.repeat([AT_REST, MOVING, LOADED], 2)
    errors = np.array([[1, 1, 1, 1e3], [2, 1, 1, 1e3], [1e4, 1, 1, 1e3], [3, 1, 1, 1e3], [1e5, 1, np.nan, 1e3], [1, 64, np.nan, 1e3]])
    assert list(wrong_blocks("abcd", errors, kinds)) == [
        "d is wrong at every state; 1e+03 data roundoffs",
        "a is wrong at some states, once it moves; 1e+05 data roundoffs",
        "c is wrong wherever forces or accelerations are given; not finite",
    ]


@pytest.mark.ci
@pytest.mark.parametrize(
    ("method", "arguments", "change", "quantity", "said"),
    [
        ("bias", "q, v", "+ 1e-9 * v", "bias", "bias force on joint 'elbow', bias force on joint 'shoulder' are wrong wherever it moves"),
        ("mass_matrix", "q", "* [[1, 1], [1 + 1e-9, 1]]", "mass_matrix", "entry of M for joint 'elbow' and joint 'shoulder' is wrong"),
        ("jacobians", "q", "[..., ::-1].copy()", "jacobian", "are wrong at every state"),
    ],
)
def test_a_fault_of_an_engine_is_named_with_its_block(
    tmp_path: Path, method: str, arguments: str, change: str, quantity: str, said: str
) -> None:
    text = TURNED_ENGINE.format(method=method, arguments=arguments, change=change)
    root = make_library(tmp_path / "library", ["arm_2r"], {"turned": text})
    subjects = ["turned/mjcf", "mujoco/mjcf", "pinocchio/mjcf"]
    [cause] = harness.diagnose("arm_2r", library=root, quantity=quantity, subjects=subjects, states=20)
    assert cause.subject == "turned/mjcf" and "turned is at fault" in cause.inference
    assert any(said in sentence for sentence in cause.terms), cause.terms
    assert cause.first_line.endswith("no single number explains it")


@pytest.mark.ci
def test_a_number_of_a_file_is_named_with_its_line(tmp_path: Path) -> None:
    new = 'mass value="2.0000001"'
    path = edited(BUILT_IN.model_path("arm_2r", "urdf"), tmp_path, ('mass value="2"', new))
    causes = harness.diagnose("arm_2r", urdf=path, quantity="gravity", subjects=SUBJECTS, states=20)
    assert [cause.subject for cause in causes] == ["mujoco/urdf", "pinocchio/urdf"]
    for cause in causes:
        assert "the urdf model is at fault" in cause.inference
        assert f"line {line_of(path, new)}: 2.0 in the place of 2.0000001 in" in cause.first_line
        assert all("at every state" in sentence for sentence in cause.terms)
    assert harness.diagnose("arm_2r", quantity="gravity", subjects=SUBJECTS[:2], states=20) == []


@pytest.mark.ci
@pytest.mark.parametrize(
    ("name", "old", "new", "joint"),
    [
        ("furuta_pendulum", 'pos="0.15 0 0" mass', 'pos="0.15 0 1e-7" mass', "arm"),
        ("cart_pendulum", 'pos="0 0 0" mass="10"', 'pos="1e-5 0 0" mass="10"', "slide"),
    ],
)
def test_a_number_that_no_acceleration_feels_is_named_by_a_reaction(tmp_path: Path, name: str, old: str, new: str, joint: str) -> None:
    path = edited(BUILT_IN.model_path(name, "mjcf"), tmp_path, (old, new))
    assert harness.diagnose(name, mjcf=path, subjects=SUBJECTS, states=20) == []
    causes = harness.diagnose(name, mjcf=path, quantity="reactions", subjects=SUBJECTS, states=20)
    assert [cause.subject for cause in causes] == ["mujoco/mjcf", "pinocchio/mjcf"]
    for cause in causes:
        assert "the mjcf model is at fault" in cause.inference
        assert f"line {line_of(path, new)}: 0.0 in the place of" in cause.first_line
        assert any(f"moment of joint {joint!r} is wrong" in sentence for sentence in cause.terms)


def test_quantities_of_robots_are_refused() -> None:
    with pytest.raises(InvalidRequest, match="bias: of mechanisms here"):
        harness.diagnose(str(BUILT_IN.model_path("arm_2r", "urdf")), quantity="bias")
