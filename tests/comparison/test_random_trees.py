"""Random trees whose bodies touch, with both ways in which MuJoCo stores the Jacobian of constraints."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest
from comparison.robots import meant_by

from harness.comparison.switched_on import judge_switched_on
from harness.results.switched_on import SwitchedOnRecord, switched_on_text
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


def held_by(folder: Path, text: str) -> SwitchedOnRecord:
    path = folder / "tree.xml"
    path.write_text(text)
    return judge_switched_on(meant_by(path), "mujoco")


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


@pytest.mark.nightly
@pytest.mark.parametrize("jacobian", ["dense", "sparse"])
@pytest.mark.parametrize(("bodies", "seed"), [(10, 1), (12, 50), (20, 4), (40, 2), (80, 3), (150, 5)])
def test_random_trees_touch_as_documented(bodies: int, seed: int, jacobian: str, tmp_path: Path) -> None:
    record = held_by(tmp_path, random_tree(bodies, seed, jacobian))
    assert record.explained and record.touching, switched_on_text(record)
    assert record.verdict == Verdict.AGREES or record.fault
    assert not record.fault or (jacobian, mujoco.__version__) == ("sparse", "4.0.0")
