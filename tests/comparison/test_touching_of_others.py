"""MuJoCo with contacts on, on every MJCF of dm_control that it loads alone: certified where its own steps lead, or refused by name."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import mujoco
import pytest
from comparison.robots import meant_by

from harness.comparison.switched_on import judge_switched_on
from harness.files.findings import CONTACTS, SWITCHED_OFF

pytestmark = [pytest.mark.nightly(nights=7), pytest.mark.robots]

WALKERS = "locomotion/walkers/assets"
TOUCHING = (
    f"{WALKERS}/build_fruitfly/assets/drosophila_fused.xml", f"{WALKERS}/humanoid_CMU_V2019.xml", f"{WALKERS}/humanoid_CMU_V2020.xml",
    f"{WALKERS}/rodent.xml", "mjcf/test_assets/robot_arm.xml", "mujoco/testing/assets/arm.xml", "mujoco/testing/assets/humanoid.xml",
    "mujoco/testing/assets/model_with_ball_joints.xml", "suite/ball_in_cup.xml", "suite/cheetah.xml", "suite/hopper.xml",
    "suite/humanoid.xml", "suite/humanoid_CMU.xml", "suite/manipulator.xml", "suite/quadruped.xml", "suite/stacker.xml",
    "suite/walker.xml", "third_party/ant/ant.xml", "third_party/kinova/jaco_arm.xml",
)  # fmt: skip
# What they could touch is nowhere near.
UNTOUCHED = (
    "locomotion/soccer/assets/boxhead/boxhead.xml", f"{WALKERS}/jumping_ball/jumping_ball_with_head.xml",
    "mujoco/testing/assets/cartpole.xml", "mujoco/testing/assets/cartpole_no_names.xml",
    "mujoco/testing/assets/model_with_third_order_actuators.xml", "suite/finger.xml", "third_party/kinova/jaco_hand.xml",
)  # fmt: skip
# They switch contacts off themselves.
WITHOUT = tuple(f"suite/{name}.xml" for name in ("acrobot", "cartpole", "fish", "pendulum", "point_mass", "reacher", "swimmer"))
REFUSED = dict.fromkeys(
    (f"{WALKERS}/dog_v2/dog.xml", f"{WALKERS}/fruitfly_v2/floor.xml", f"{WALKERS}/fruitfly_v2/fruitfly.xml", "suite/dog.xml"),
    "goes through noslip iterations, which solve no problem that is documented",
)


def root() -> Path:
    found = importlib.util.find_spec("dm_control")
    assert found is not None and found.origin is not None, "install the extra: pip install 'rigid-body-harness[robots]'"
    return Path(found.origin).parent


def moves(path: Path) -> bool:
    try:
        return bool(mujoco.MjModel.from_xml_path(str(path)).nv)
    except ValueError:
        return False


def test_they_are_all_that_move() -> None:
    texts = [path for path in root().rglob("*.xml") if "<mujoco" in path.read_text(errors="replace")]
    found = {path.relative_to(root()).as_posix() for path in texts if moves(path)}
    assert found == {*TOUCHING, *UNTOUCHED, *WITHOUT, *REFUSED}
    assert len(found) == 37 and len(REFUSED) == 4


@pytest.mark.parametrize("name", [*TOUCHING, *UNTOUCHED, *WITHOUT, *REFUSED])
def test_mujoco_touches_as_it_documents_or_is_refused_by_name(name: str) -> None:
    record = judge_switched_on(meant_by(root() / name), "mujoco")
    assert (record.explained, record.message, record.rest) == (True, "", [])
    assert (record.touching > 0) == (name in TOUCHING)
    assert {part.why_not for part in record.parts if part.what == CONTACTS and part.why_not} == (
        {REFUSED[name]} if name in REFUSED else {SWITCHED_OFF} if name in WITHOUT else set()
    )
