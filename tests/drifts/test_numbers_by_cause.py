"""Numbers of a compiled model by cause: none is forgotten, and those of another file make this one move as that."""

from __future__ import annotations

import copy
from pathlib import Path

import mujoco
import numpy as np
import pytest
from catalogue import BUILT_IN
from drifting import ROBOTS, SCALED, planted

from harness.engines.adapters.mujoco.causes import lay_over, numbers_by_cause
from harness.results.cause import DriftCause

# Arrays that follow from others, that place rows in memory, or that bear on no motion.
DERIVED = (
    "sameframe simple subtreemass invweight0 M0 acc0 length0 length lengthrange user group rgba castshadow matid dataid plugin plasticadr "
    "parentid rootid weldid treeid bodyid jntid trnid actuatorid mocapid jntnum jntadr dofnum dofadr qposadr geomnum geomadr bvhadr bvhnum "
    "Madr simplenum obj1id obj2id objtype adr num treenum signature geom1 geom2 actadr actnum ctrladr ctrlnum ctrlspec outadr outnum "
    "history historyadr width type objid"
)


def is_array(value: object) -> bool:
    return isinstance(value, np.ndarray) and bool(value.size)


@pytest.mark.parametrize("robot", ROBOTS)
def test_every_array_has_a_cause_or_follows_from_others(robot: str) -> None:
    model = mujoco.MjModel.from_xml_string(ROBOTS[robot])
    known = {name.partition(":")[0] for numbers in numbers_by_cause(model).values() for name, _ in numbers}
    prefixes = {name.partition("_")[0] for name in known} - {"opt", "flag"}
    arrays = [name for name in dir(model) if name.partition("_")[0] in prefixes and is_array(getattr(model, name))]
    assert [name for name in arrays if name not in known and name.partition("_")[2] not in DERIVED.split()] == []


def test_every_setting_has_a_cause() -> None:
    model = mujoco.MjModel.from_xml_string(ROBOTS["cart"])
    held = numbers_by_cause(model)
    names = {name for numbers in held.values() for name, _ in numbers if name.startswith(("opt_", "flag_"))}
    assert len(names) > 30
    assert ("opt_timestep", "") in held[DriftCause.STEP] and ("flag_eulerdamp", "") in held[DriftCause.INTEGRATOR]


@pytest.mark.parametrize("robot", ROBOTS)
def test_all_numbers_of_another_file_make_it_that_file(robot: str) -> None:
    one, other = (mujoco.MjModel.from_xml_string(text) for text in (ROBOTS[robot], planted(robot, [], SCALED)))
    held = [{key: value for numbers in numbers_by_cause(model).values() for key, value in numbers.items()} for model in (one, other)]
    lay_over(one, {key: value for key, value in held[1].items() if not np.array_equal(value, held[0][key])})
    flags = one.opt.disableflags & ~int(mujoco.mjtDisableBit.mjDSBL_MIDPHASE)
    assert flags == other.opt.disableflags
    for name in ("dof_invweight0", "body_invweight0", "dof_M0", "actuator_acc0", "dof_armature", "geom_solref", "actuator_biasprm"):
        assert np.array_equal(getattr(one, name), getattr(other, name)), name
    data = [mujoco.MjData(model) for model in (one, other)]
    for model, state in zip((one, other), data, strict=True):
        mujoco.mj_resetDataKeyframe(model, state, 0)
        mujoco.mj_step(model, state, nstep=50)
    assert np.array_equal(data[0].qpos, data[1].qpos)


def test_what_follows_from_other_numbers_is_computed_anew() -> None:
    """Without it a joint keeps the inverse weight of its own armature, by which its limits and friction push."""
    one, other = (mujoco.MjModel.from_xml_string(text) for text in (ROBOTS["arm"], planted("arm", [DriftCause.ARMATURE])))
    before = one.dof_invweight0.copy()
    lay_over(one, numbers_by_cause(other)[DriftCause.ARMATURE])
    assert np.array_equal(one.dof_invweight0, other.dof_invweight0)
    assert not np.array_equal(one.dof_invweight0, before)


@pytest.mark.parametrize("name", ["double_pendulum", "four_bar", "tendon_finger", "free_body"])
def test_a_compiled_model_is_left_as_it_is(name: str) -> None:
    path: Path = BUILT_IN.model_path(name, "mjcf")
    model = mujoco.MjModel.from_xml_path(str(path))
    same = copy.copy(model)
    lay_over(same, numbers_by_cause(model)[DriftCause.ARMATURE])
    for array in ("dof_invweight0", "body_invweight0", "eq_data", "tendon_length0", "actuator_acc0"):
        assert np.array_equal(getattr(model, array), getattr(same, array)), array
