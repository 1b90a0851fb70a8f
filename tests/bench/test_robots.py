"""Cost and error on a robot's file: every way gives the file's accelerations and motions, and what a file cannot give is named."""

from __future__ import annotations

import functools
import re
from pathlib import Path

import numpy as np
import pytest
from studies import silent
from support import InThisProcess, completed, harness

from harness.arrays import Array
from harness.bench.costs import Effort, acceleration_costs
from harness.bench.methods import find_methods
from harness.bench.motion_cost import motion_costs
from harness.bench.parts import BenchmarkSettings
from harness.bench.study import BenchmarkStudy
from harness.comparison.robot_library import RobotLibrary
from harness.crosscheck.scene import Scene
from harness.engines import Unsupported
from harness.engines.request import JointForces
from harness.errors import InvalidRequest
from harness.library import MECHANISMS, ROBOTS, Library, Stance
from harness.motion.integrators import integrators, select_integrators
from harness.results.benchmark import AccelerationCost
from harness.verdict import AGREEMENT

FILES = Path(__file__).parent.parent / "comparison" / "files"
ARM, MIMIC, LEG = FILES / "arm.urdf", FILES / "mimic.urdf", FILES / "massless_foot.urdf"
# A ball joint, and an angle in degrees at which a spring is relaxed.
BALL = """<mujoco><worldbody><body name="a">
  <joint name="ball" type="ball" damping="0.125"/><inertial pos="0 0 -0.25" mass="2" diaginertia="0.125 0.25 0.1875"/>
  <body name="b" pos="0 0 -0.5"><joint name="pin" axis="1 0 0" stiffness="2" springref="20"/>
    <inertial pos="0 0.125 -0.25" mass="1" diaginertia="0.03125 0.03125 0.03125"/></body>
</body></worldbody></mujoco>"""
COUNT = 24


@functools.cache
def scene(path: Path, stance: Stance = Stance.AIDED) -> Scene:
    return Scene.of(RobotLibrary.of([str(path)], stance=stance), str(path))


def costs(path: Path, stance: Stance = Stance.AIDED) -> dict[str, AccelerationCost]:
    found = acceleration_costs(scene(path, stance), find_methods(ROBOTS), Effort((COUNT,), COUNT, 3, 0.0), silent)[0]
    return {cost.method: cost for cost in found}


@pytest.mark.parametrize("stance", list(Stance))
@pytest.mark.parametrize("name", ["arm.urdf", "mimic.urdf", "ball.xml"])
def test_every_engine_gives_the_accelerations_of_what_it_reads(name: str, stance: Stance, tmp_path: Path) -> None:
    (tmp_path / "ball.xml").write_text(BALL)
    found = costs(tmp_path / name if name == "ball.xml" else FILES / name, stance)
    # The harness's own recursion is no engine.
    assert found.keys() == {"mujoco on the file", "pinocchio on the file"} and not any(cost.failed for cost in found.values())
    assert all(cost.states == COUNT and cost.backward_error is not None for cost in found.values())
    for cost in found.values():
        assert ("eliminated in Python" in cost.note) == (name == "mimic.urdf" and stance == Stance.AIDED)
        # A plain engine whose reader leaves something out moves another robot, to the last bits.
        is_read_otherwise = stance == Stance.PLAIN and ("pinocchio" in cost.method or name == "mimic.urdf")
        assert ((cost.backward_error or 0.0) > 1e6) == is_read_otherwise, cost
        assert bool(re.search(r"explained: .*; that leaves [\d.]+ data roundoffs", cost.note)) == is_read_otherwise


def test_an_engine_that_is_wrong_has_a_large_error(monkeypatch: pytest.MonkeyPatch) -> None:
    def none(forces: JointForces, v: Array) -> Array:
        return np.zeros_like(v)

    monkeypatch.setattr(JointForces, "of_dampers", none)
    found = costs(ARM)
    wrong = found.pop("pinocchio on the file")
    assert (wrong.backward_error or 0.0) > 1e9 and all((cost.backward_error or 0.0) < AGREEMENT for cost in found.values())


@pytest.mark.ci
def test_a_motion_of_the_file_is_that_of_the_engine_in_small_steps() -> None:
    chosen = select_integrators(["mujoco RK4", "equations RK4", "equations Taylor"], ROBOTS)
    truth, costs, orders = motion_costs(scene(LEG), chosen, (1e-2, 1e-3), 0.5, 10.0, silent)
    assert truth.error < 1e-15 and {order.integrator: order.verdict for order in orders} == dict.fromkeys(
        ("mujoco RK4", "equations RK4"), "as expected"
    )
    best = {cost.integrator: cost.state_error for cost in costs if cost.state_error is not None}
    assert best.keys() == {"mujoco RK4", "equations RK4", "equations Taylor"} and all(error < 1e-10 for error in best.values())
    assert all(cost.energy_error is None for cost in costs)


def test_springs_that_the_reader_passes_over_are_part_of_the_engine_s_motion(tmp_path: Path) -> None:
    spring = '<gazebo reference="hip"><springStiffness>2</springStiffness><springReference>0</springReference></gazebo></robot>'
    (tmp_path / "sprung.urdf").write_text(LEG.read_text().replace("</robot>", spring))
    own = select_integrators(["mujoco RK4"], ROBOTS)
    _, costs, orders = motion_costs(scene(tmp_path / "sprung.urdf"), own, (1e-2, 1e-3), 0.5, 10.0, silent)
    assert [order.verdict for order in orders] == ["as expected"]
    assert min(cost.state_error for cost in costs if cost.state_error is not None) < 1e-8


def test_what_an_engine_s_own_steps_do_not_feel_is_not_integrated(tmp_path: Path) -> None:
    [own] = select_integrators(["mujoco RK4"], ROBOTS)
    with pytest.raises(Unsupported, match="mimic"):
        own.prepare(scene(MIMIC))
    inertial = '<inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>'
    joint = '<joint name="free" type="floating"><parent link="ground"/><child link="body"/><origin xyz="1 0 0"/></joint>'
    away = f'<robot name="away"><link name="ground"/><link name="body">{inertial}</link>{joint}</robot>'
    (tmp_path / "away.urdf").write_text(away)
    with pytest.raises(Unsupported, match="measured in a frame of the file"):
        own.prepare(scene(tmp_path / "away.urdf"))
    (tmp_path / "at_the_origin.urdf").write_text(away.replace("1 0 0", "0 0 0"))
    own.prepare(scene(tmp_path / "at_the_origin.urdf"))


def test_parts_that_need_energies_are_left_out_and_named() -> None:
    library = RobotLibrary.of([str(ARM)])
    study = BenchmarkStudy(BenchmarkSettings(library=library, names=[str(ARM)], motion=True))
    assert study.left_out == ["long runs", "stationary action"] and study.steps == 1 + 2
    assert BenchmarkStudy(BenchmarkSettings(library=library, names=[str(ARM)])).left_out == []
    assert BenchmarkStudy(BenchmarkSettings(library=Library.built_in(), names=["collar"], motion=True)).left_out == []


def test_a_motion_that_would_take_hours_to_certify_is_refused_with_its_size(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("harness.bench.parts.MOST_INSTRUCTIONS_OF_MOTION", 10)
    settings = BenchmarkSettings(library=RobotLibrary.of([str(LEG)]), names=[str(LEG)], motion=True, methods=["equations RK4"])
    found = completed(BenchmarkStudy(settings), InThisProcess())
    (problem,) = found.problems
    assert "massless_foot.urdf" in problem and "expected at most 10" in problem and not found.truths


def test_each_way_says_what_it_is_of() -> None:
    assert {"lambdify, numpy batch", "mujoco batch"}.isdisjoint(method.name for method in find_methods(ROBOTS))
    assert {"mujoco on the file"}.isdisjoint(method.name for method in find_methods(MECHANISMS))
    assert {"pinocchio RK4"}.isdisjoint(one.name for one in integrators(ROBOTS))
    with pytest.raises(InvalidRequest, match="is for mechanisms"):
        BenchmarkStudy(BenchmarkSettings(library=RobotLibrary.of([str(ARM)]), names=[str(ARM)], methods=["mujoco batch"]))
    with pytest.raises(InvalidRequest, match="is for robots"):
        BenchmarkStudy(BenchmarkSettings(library=Library.built_in(), names=["collar"], methods=["mujoco on the file"]))


def test_the_command_prints_a_table_and_leaves_the_report(tmp_path: Path) -> None:
    (tmp_path / "leg.urdf").write_text(LEG.read_text())
    done = harness("bench", "leg.urdf", "--methods", "mujoco on the file", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "leg.urdf  mujoco on the file" in done.stdout and not (tmp_path / "reports" / "index.html").exists()


def test_quantities_are_measured_on_mechanisms_alone() -> None:
    with pytest.raises(InvalidRequest, match=r"bias is measured on mechanisms, and .*arm.urdf is none"):
        BenchmarkStudy(BenchmarkSettings(library=RobotLibrary.of([str(ARM)]), quantities=("bias",)))
