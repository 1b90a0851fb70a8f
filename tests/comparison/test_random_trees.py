"""Random trees whose bodies touch, with both ways in which MuJoCo stores the Jacobian of constraints."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from comparison.robots import meant_by

from harness.comparison.case import AskedEngine
from harness.comparison.robot_library import engine_of
from harness.comparison.switched_on import judge_switched_on
from harness.explain.meant import Meant, worst
from harness.results.switched_on import SwitchedOnRecord, switched_on_text
from harness.truth.compare import compare
from harness.verdict import AGREEMENT, Verdict

BRANCHES = """<mujoco>
  <option jacobian="{jacobian}"/>
  <worldbody>
    <geom type="plane" size="1 1 1"/>
    <body>
      <freejoint/>
      <geom size="0.1"/>
      <body pos="0 0.3 0"><joint axis="1 0 0"/><geom size="0.1"/></body>
      <body pos="0.1 0.3 -0.1">
        <joint axis="1 0 0"/>
        <geom size="0.1"/>
        <body pos="0.3 0 -0.1"><joint axis="1 0 0"/><geom size="0.1"/></body>
      </body>
      <body pos="-0.1 0.2 0"><joint axis="1 0 0"/><geom size="0.1"/></body>
    </body>
  </worldbody>
</mujoco>
"""
# Of the parents of a new body: so many of the last ones.
NEAREST = 6
# MuJoCo factorises M, so that trees with kappa_s of 1e5 take up to 160 data roundoffs of it where nothing touches, and as many of it where
# something does. These are the largest of a few states each, which differ by the roundings of a processor.
SPREAD = 4


def meant_in(folder: Path, text: str) -> Meant:
    path = folder / "tree.xml"
    path.write_text(text)
    return meant_by(path)


def held_by(folder: Path, text: str) -> SwitchedOnRecord:
    return judge_switched_on(meant_in(folder, text), "mujoco")


def lost_by_factors(meant: Meant) -> float:
    """The largest backward error of MuJoCo with nothing that touches."""
    answers = AskedEngine(meant, engine_of("mujoco")).with_those([])
    lost = worst(compare(meant.truth, answers.of(meant.robot.joints), factorises=True))
    assert lost is not None
    return lost


def random_tree(bodies: int, seed: int, jacobian: str, beside: float = 0.05) -> str:
    """Spheres on hinges, slides and ball joints above a plane, in trees of which most are free; they overlap each other and the plane.

    Joints are so far ``beside`` the centres [m]. A body that no joint moves has no weight, so that a contact there is all but rigid.
    """
    random = np.random.default_rng(seed)
    inner: list[list[int]] = [[] for _ in range(bodies + 1)]
    for number in range(1, bodies + 1):
        inner[int(random.integers(max(0, number - NEAREST), number))].append(number)

    def text(values: np.ndarray) -> str:
        return " ".join(f"{value:.3f}" for value in values)

    def written(number: int, is_root: bool) -> str:
        place = 0.15 * random.normal(size=3) + is_root * random.uniform((-2, -2, 0.02), (2, 2, 0.12))
        kind = random.choice(["hinge", "slide", "ball"], p=[0.7, 0.2, 0.1])
        pivot = f'pos="{text(beside * random.normal(size=3))}"'
        joint = f'<joint type="{kind}" {pivot} axis="{text(random.normal(size=3))}"/>'
        joint = "<freejoint/>" if is_root and random.random() < 0.7 else joint
        geom = f'<geom size="{random.uniform(0.05, 0.12):.3f}" mass="{random.uniform(0.2, 2):.3f}"/>'
        return f'<body pos="{text(place)}">{joint}{geom}{"".join(written(one, False) for one in inner[number])}</body>'

    trees = "".join(written(one, True) for one in inner[0])
    plane = '<geom type="plane" size="5 5 1"/>'
    return f'<mujoco><option jacobian="{jacobian}"/><worldbody>{plane}{trees}</worldbody></mujoco>'


@pytest.mark.ci
def test_a_wrong_factor_of_the_solver_is_told_with_what_to_set(tmp_path: Path) -> None:
    """See docs/issues/mujoco-sparse-newton.md."""
    record = held_by(tmp_path, BRANCHES.format(jacobian="sparse"))
    assert record.explained and record.touching
    if mujoco.__version__ == "4.0.0":
        assert record.backward_error is not None and record.backward_error > 1e6
        assert record.to_the_end is not None and record.to_the_end <= AGREEMENT
        assert "factorises a wrong Hessian" in record.fault and 'jacobian="dense"' in switched_on_text(record)
    else:
        assert not record.fault


# Each night a small tree and a large one.
@pytest.mark.nightly(nights=3)
@pytest.mark.parametrize(("bodies", "seed"), [(10, 1), (12, 50), (20, 4), (40, 2), (80, 3), (150, 5)])
def test_random_trees_touch_as_documented(bodies: int, seed: int, tmp_path: Path) -> None:
    """Both ways of storing are held against one truth, which takes nearly all of the time and knows nothing of them."""
    dense, path = meant_in(tmp_path, random_tree(bodies, seed, "dense")), tmp_path / "sparse.xml"
    path.write_text(random_tree(bodies, seed, "sparse"))
    for jacobian, meant in (("dense", dense), ("sparse", replace(dense, robot=replace(dense.robot, path=path)))):
        record = judge_switched_on(meant, "mujoco")
        assert record.explained and record.touching, switched_on_text(record)
        if not record.fault:
            assert record.verdict in {Verdict.AGREES, Verdict.UNSTABLE} and record.backward_error is not None
            assert record.backward_error <= max(AGREEMENT, SPREAD * lost_by_factors(meant))
        assert not record.fault or (jacobian, mujoco.__version__) == ("sparse", "4.0.0")
