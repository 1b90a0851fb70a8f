"""Solvers of constraints over their iterations: the optimum is reached by each in its own time, and what is left before that is told."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import pytest
from studies import silent
from support import harness

from harness.bench import solvers
from harness.bench.parts import BenchmarkSettings
from harness.bench.study import BenchmarkStudy
from harness.errors import InvalidRequest
from harness.library import Library
from harness.results.benchmark import SolverCost

# An arm that rubs, meets its limits, and lays its hand on the ground; its file stops the solver early.
ARM = """<mujoco>
  <option solver="PGS" iterations="4" tolerance="0"/>
  <worldbody>
    <geom type="plane" size="1 1 1"/>
    <body pos="0 0 0.5">
      <joint name="shoulder" axis="0 1 0" range="-60 100" frictionloss="0.3"/>
      <geom type="capsule" fromto="0 0 0 0.4 0 0" size="0.03" mass="1" contype="0" conaffinity="0"/>
      <body pos="0.4 0 0">
        <joint name="elbow" axis="0 1 0" range="-100 100" frictionloss="0.1"/>
        <geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.03" mass="0.5" contype="0" conaffinity="0"/>
        <geom type="sphere" pos="0.3 0 0" size="0.08" mass="0.3"/>
      </body>
    </body>
  </worldbody>
</mujoco>"""
FREE = '<mujoco><worldbody><body><joint name="a"/><geom size="0.1" mass="1"/></body></worldbody></mujoco>'


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("solvers") / "arm.xml"
    path.write_text(ARM)
    return path


@pytest.fixture(scope="module")
def costs(arm: Path) -> list[SolverCost]:
    return list(solvers.solver_costs(arm, "mujoco", 32, 0, silent))


@pytest.mark.ci
def test_each_method_is_given_iterations_until_it_is_right(costs: list[SolverCost]) -> None:
    methods = ("Newton", "CG", "PGS")
    of_file, others = costs[0], costs[1 + len(methods) :]
    at_first = ["as the file says", *(f"{method}, as the file says" for method in methods)]
    assert [cost.solver for cost in costs[: 1 + len(methods)]] == at_first
    assert tuple(dict.fromkeys(cost.method for cost in others)) == methods
    for method in methods:
        own = [cost for cost in others if cost.method == method]
        assert [cost.iterations for cost in own] == list(solvers.ITERATIONS[: len(own)])
        assert own[-1].is_right and not any(cost.is_right for cost in own[:-1])
        assert own[-1].relative_error is not None and own[-1].relative_error < 1e-11
    assert all(cost.states == of_file.states and cost.touching == of_file.touching > 0 for cost in costs)
    assert all(cost.seconds_per_state is not None and cost.seconds_per_state > 0 for cost in costs)


def test_newton_s_method_needs_the_fewest_iterations_and_all_come_nearer_with_more(costs: list[SolverCost]) -> None:
    needed = {cost.method: cost.iterations for cost in costs if cost.is_right and cost.iterations}
    assert needed["Newton"] < min(needed["CG"], needed["PGS"])
    for one, other in pairwise([cost for cost in costs if cost.method == "PGS" and cost.iterations]):
        assert one.relative_error is not None and other.relative_error is not None
        assert other.relative_error <= one.relative_error and other.right >= one.right


def test_the_file_s_own_iterations_are_those_that_it_says(costs: list[SolverCost]) -> None:
    errors = {(cost.method, cost.iterations): cost.relative_error for cost in costs}
    assert costs[0].relative_error == errors["PGS", None] == errors["PGS", 4] and costs[0].relative_error > 1e-9
    # Each other one has the file's tolerance and iterations too.
    assert all(errors[method, None] == errors[method, 4] for method in ("Newton", "CG"))


@pytest.mark.ci
def test_each_solver_at_defaults_ends_by_its_tolerance(arm: Path, tmp_path: Path) -> None:
    """Iterations and tolerance are MuJoCo's 100 and 1e-8 where a file gives none: more of these, or a smaller one, come nearer."""
    (path := tmp_path / "arm.xml").write_text(ARM.replace('<option solver="PGS" iterations="4" tolerance="0"/>', ""))
    costs = list(solvers.solver_costs(path, "mujoco", 32, 0, silent))
    at_defaults = {cost.method: cost.relative_error for cost in costs if cost.iterations is None}
    assert at_defaults[""] == at_defaults["Newton"]
    assert all(at_defaults[method] > min(cost.relative_error for cost in costs if cost.method == method) for method in ("CG", "PGS"))


@pytest.mark.ci
def test_a_solver_that_never_reaches_the_optimum_is_told(arm: Path, tmp_path: Path) -> None:
    """See docs/issues/mujoco-pgs-elliptic-cones.md."""
    path = tmp_path / "arm.xml"
    path.write_text(ARM.replace('iterations="4"', 'iterations="4" cone="elliptic"'))
    ends = {cost.method: cost for cost in solvers.solver_costs(path, "mujoco", 64, 0, silent) if cost.iterations}
    assert ends["Newton"].is_right and ends["CG"].is_right
    left = ends["PGS"]
    assert left.iterations == solvers.ITERATIONS[-1] and left.states - 4 < left.right < left.states
    assert left.relative_error is not None and left.relative_error > 0.5


def test_a_file_that_leaves_nothing_to_a_solver_says_so(tmp_path: Path) -> None:
    path = tmp_path / "free.xml"
    path.write_text(FREE)
    [cost] = solvers.solver_costs(path, "mujoco", 8, 0, silent)
    assert "nothing is left to a solver" in cost.note and not cost.states and cost.seconds_per_state is None


@pytest.mark.ci
def test_the_command_says_how_far_the_file_goes_and_what_each_method_needs(arm: Path) -> None:
    done = harness("bench", str(arm), "--solvers", "--methods", "mujoco", "--workers", "1")
    assert done.returncode == 0, done.output
    first = done.stdout.splitlines()[0]
    assert first.startswith("arm.xml: as the file sets it mujoco's solver is up to ")
    assert "of the acceleration off the optimum that it documents, whose last digit is reached by Newton within" in first
    assert "as the file says" in done.stdout and "--all shows" in done.stdout


def test_solvers_are_measured_on_files_of_robots() -> None:
    with pytest.raises(InvalidRequest, match="solvers are measured on a robot's file"):
        BenchmarkStudy(BenchmarkSettings(library=Library.built_in(), names=("arm_2r",), solvers=True))
