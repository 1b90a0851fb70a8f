"""Mechanisms with constraints have ways of their own, each is held against its own truth, and what engines get wrong can be reproduced."""

from __future__ import annotations

import ast
import functools
import math
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from studies import scene, silent

from harness.bench.costs import Effort, acceleration_costs
from harness.bench.methods import Method, Prepared, find_methods
from harness.bench.parts import BenchmarkSettings, _accelerations
from harness.bench.study import BenchmarkStudy
from harness.crosscheck.scene import Scene
from harness.engines import Unsupported
from harness.files.model_file import with_attributes
from harness.library import CONSTRAINED, MECHANISMS, Library
from harness.motion.integrators import kind_of
from harness.programs.states import States
from harness.results.benchmark import AccelerationCost, EngineFinding
from harness.study import run_study
from harness.truth.quantities.accelerations import AccelerationTruth
from harness.truth.sampling import generic_sample
from harness.verdict import AGREEMENT
from harness.workers import Workers

LIBRARY = Library.built_in()
COUNT = 24
METHODS = {method.name: method for method in find_methods(CONSTRAINED)}
# What none of these should be, by the sources that their modules name; all others agree.
WRONG = {
    "heyoka float32",
    "mujoco batch, PGS",
    "mujoco batch, impedance 0.9999",
    "mujoco batch, impedance 0.9999, diagexact",
    "pinocchio constraintDynamics, default settings",
    "pinocchio constraintDynamics, mu 1e-6, one iteration",
    "pinocchio lcaba, mu 1e-6",
    "pinocchio lcaba, mu 1e-10",
}


def measured(*methods: Method) -> tuple[list[AccelerationCost], list[EngineFinding]]:
    return acceleration_costs(scene("four_bar"), methods, Effort((COUNT,), COUNT, 3, 0.0), silent)


@functools.cache
def all_measured() -> tuple[dict[str, AccelerationCost], dict[str, EngineFinding]]:
    costs, found = measured(*find_methods(CONSTRAINED))
    return {cost.method: cost for cost in costs}, {one.method: one for one in found}


@pytest.mark.parametrize("name", [method.name for method in find_methods(CONSTRAINED)])
def test_accelerations_agree_with_their_own_truth_or_are_a_finding(name: str) -> None:
    costs, found = all_measured()
    cost = costs[name]
    assert not cost.failed and cost.seconds_per_state is not None
    is_right = cost.backward_error is not None and cost.backward_error <= AGREEMENT
    assert is_right == (name not in WRONG), cost
    assert (name in found) == (not is_right and not name.startswith("heyoka"))
    assert (cost.from_rigid is not None) == ("mujoco" in name or "declared" in name)


def test_the_nearer_the_impedance_to_one_the_nearer_to_rigid() -> None:
    costs, _ = all_measured()
    distance = {name: cost.from_rigid for name, cost in costs.items() if cost.from_rigid is not None}
    for exact in ("", ", diagexact"):
        assert distance[f"mujoco batch, impedance 0.9999{exact}"] < 5e-3 * distance[f"mujoco batch, impedance 0.9{exact}"]


# Runs a program where nothing of the harness can be imported, nor what only the harness needs.
ALONE = """
import sys
sys.modules |= dict.fromkeys(["harness", "sympy", "heyoka", "flint", "lxml", "msgspec", "bokeh"])
exec(sys.argv[1], {})
"""


def test_enough_findings_of_current_engines_are_listed() -> None:
    _, found = all_measured()
    assert len(found) >= 5 and {name.partition(" ")[0] for name in found} == {"mujoco", "pinocchio"}


@pytest.mark.ci
@pytest.mark.parametrize("name", sorted(WRONG - {"heyoka float32"}))
def test_a_finding_is_reproduced_with_the_engine_alone(name: str) -> None:
    finding = all_measured()[1][name]
    assert len(finding.reproducer.splitlines()) == 3 and "harness" not in finding.reproducer
    command = [sys.executable, "-I", "-c", ALONE, finding.reproducer]
    engine, certified = subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()
    answer, truth = np.array(eval(engine, {"nan": math.nan})), np.array(ast.literal_eval(certified))
    assert np.isfinite(truth).all()
    assert np.isfinite(answer).all() == (finding.backward_error is not None)
    assert not np.allclose(answer, truth, rtol=1e-12, atol=0.0)


def test_a_residual_that_tells_nothing_is_said_to() -> None:
    _, found = all_measured()
    assert "where the answers are right" in found["pinocchio constraintDynamics, mu 1e-6, one iteration"].statement
    lost = found["pinocchio lcaba, mu 1e-10"].statement
    assert "the engine's own residual reads" in lost and "right" not in lost
    assert found["pinocchio constraintDynamics, default settings"].statement.startswith(f"{COUNT} of {COUNT} answers are not finite")


@pytest.mark.ci
def test_all_stages_leave_a_mechanism_without_gravity_as_it_is() -> None:
    methods = [METHODS[name] for name in ("mujoco batch", "mujoco batch, all stages on")]
    costs, found = acceleration_costs(scene("andrews_squeezer"), methods, Effort((COUNT,), COUNT, 3, 0.0), silent)
    assert found == [] and all(cost.backward_error is not None and cost.backward_error <= AGREEMENT for cost in costs)


def test_an_answer_to_another_problem_is_condemned() -> None:
    """MuJoCo's answers are right for the problem that the file declares, and for no other."""
    soft = METHODS["mujoco batch, impedance 0.9"]

    def held_against_rigid(scene: Scene, states: States) -> Prepared:
        return replace(soft.prepare(scene, states), truth=AccelerationTruth(scene.mechanism))

    (right, wrong), [found] = measured(soft, replace(soft, name="planted", prepare=held_against_rigid))
    assert right.backward_error is not None and right.backward_error <= AGREEMENT
    assert wrong.backward_error is not None and wrong.backward_error > 1e9 and found.method == "planted"


def test_what_is_of_trees_alone_is_not_asked_of_constraints() -> None:
    assert (kind_of(scene("four_bar")), kind_of(scene("arm_2r"))) == (CONSTRAINED, MECHANISMS)
    trees, tied = ({method.name for method in find_methods(kind)} for kind in (MECHANISMS, CONSTRAINED))
    assert {"pinocchio aba", "pinocchio abaInParallel", "lambdify, numpy batch"} <= trees - tied
    assert {"pinocchio lcaba, mu 1e-6", "reduced equations float64", "mujoco batch, CG"} <= tied - trees
    settings = BenchmarkSettings(library=LIBRARY, methods=["pinocchio aba", "pinocchio constraintDynamics, mu 1e-6"])
    asked = {name: _accelerations(settings, scene(name), silent).accelerations for name in ("arm_2r", "four_bar")}
    assert [cost.method for cost in asked["arm_2r"]] == ["pinocchio aba"]
    assert [cost.method for cost in asked["four_bar"]] == ["pinocchio constraintDynamics, mu 1e-6"]


@pytest.mark.ci
def test_a_method_that_is_not_for_the_system_is_told() -> None:
    study = BenchmarkStudy(BenchmarkSettings(library=LIBRARY, names=["four_bar"], methods=["pinocchio aba"]))
    with Workers(count=1) as workers:
        for _ in run_study(study, workers):
            pass
    assert study.result().problems == ["four_bar: 'pinocchio aba' is not for mechanisms with constraints; see harness list methods"]


def test_a_model_without_mjcf_is_refused_by_name() -> None:
    method = METHODS["mujoco batch, CG"]
    states = generic_sample(scene("four_bar").mechanism, 2, 0)
    with pytest.raises(Unsupported, match="four_bar has no MJCF model"):
        method.prepare(replace(scene("four_bar"), models={}), states)


def test_attributes_are_written_where_the_engine_reads_them() -> None:
    import mujoco

    file = scene("four_bar").models["mjcf"]
    set_there = {"option": {"solver": "CG"}, "option/flag": {"diagexact": "enable"}, "equality/*": {"solimp": "0.5 0.5"}}
    changed = with_attributes(file, set_there)
    before, after = (mujoco.MjModel.from_xml_string(one.text) for one in (file, changed))
    assert (before.opt.solver, after.opt.solver) == (mujoco.mjtSolver.mjSOL_NEWTON, mujoco.mjtSolver.mjSOL_CG)
    assert after.eq_solimp[0, :2].tolist() == [0.5, 0.5] and before.eq_solimp[0, 0] == 0.9
    assert after.opt.enableflags & ~before.opt.enableflags and after.opt.disableflags == before.opt.disableflags
