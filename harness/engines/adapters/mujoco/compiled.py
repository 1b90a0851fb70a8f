"""The numbers of a compiled ``mujoco.MjModel`` that may bear on motion, by MuJoCo's own names, of any version.

Principal moments and the orientation of their axes stand together as ``body_inertia``, by its entries along the axes of the body, since
versions put the axes in other orders. What follows from other numbers, as ``dof_M0``, pictures, and places in memory are left out.

Source: MuJoCo documentation, API reference, mjModel; mjmodel.h of 3.3 to 4.0.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import mujoco
import numpy as np

from harness.arrays import Array
from harness.engines.coordinates import rotations
from harness.engines.interface import AXES, QUATERNION, CompiledNumber

# Arrays begin with these; what the objects of each are called.
_OBJECTS = {"body": "body", "jnt": "joint", "geom": "geom", "pair": "pair", "site": "site", "tendon": "tendon", "eq": "equality"}
_PREFIXES = (*_OBJECTS, "dof", "actuator", "opt", "qpos0", "qpos")
# Inverse weights follow from masses and inertias.
_FELT = {
    "body": "mass ipos inertia pos quat invweight0 gravcomp",
    "jnt": "type axis pos stiffness stiffnesspoly",
    "dof": "damping dampingpoly armature invweight0",
    "tendon": "stiffness stiffnesspoly damping dampingpoly armature lengthspring invweight0",
    "actuator": "damping dampingpoly armature",
    "qpos": "spring",
    "opt": "gravity",
}
# Where actuators drive: of those that do, and of what they drive.
_FELT_DRIVEN = {
    "actuator": "trntype gaintype biastype gainprm biasprm gear ctrllimited ctrlrange forcelimited forcerange actlimited",
    "jnt": "actfrclimited actfrcrange actgravcomp",
}
_LEFT_OUT = frozenset(
    "user rgba group aabb rbound sameframe simple castshadow width M0 subtreemass acc0 length0 length iquat".split()  # noqa: SIM905
)
_VECTORS = frozenset({"pos", "ipos", "axis", "gravity", "wind", "magnetic"})
_COUNTED = frozenset({"contype", "conaffinity", "condim", "dim", "priority"})
WORDS = {
    "jnt_type": ("mjtJoint", "mjJNT_"),
    "geom_type": ("mjtGeom", "mjGEOM_"),
    "eq_type": ("mjtEq", "mjEQ_"),
    "actuator_trntype": ("mjtTrn", "mjTRN_"),
    "actuator_dyntype": ("mjtDyn", "mjDYN_"),
    "actuator_gaintype": ("mjtGain", "mjGAIN_"),
    "actuator_biastype": ("mjtBias", "mjBIAS_"),
    "opt_integrator": ("mjtIntegrator", "mjINT_"),
    "opt_cone": ("mjtCone", "mjCONE_"),
    "opt_jacobian": ("mjtJacobian", "mjJAC_"),
    "opt_solver": ("mjtSolver", "mjSOL_"),
}
_SWITCHES = {"opt_disableflags": ("mjtDisableBit", "mjDSBL_"), "opt_enableflags": ("mjtEnableBit", "mjENBL_")}


def compiled(model: Any, driven: Sequence[int] = ()) -> Iterator[CompiledNumber]:
    """Every such number of a model, by the names of its arrays; ``driven`` are the numbers of the actuators that act."""
    for array in sorted(name for name in dir(model) if not name.startswith("_")):
        values, (prefix, _, name) = getattr(model, array), array.partition("_")
        if isinstance(values, np.ndarray) and prefix in _PREFIXES and name not in _LEFT_OUT:
            if array == "body_inertia":
                turns = rotations(model.body_iquat)
                values = (turns * values[:, None]) @ turns.transpose(0, 2, 1)
            if array in WORDS or values.dtype.kind != "i" or name in _COUNTED:
                yield from _of_objects(model, array, values, driven)
    for name in sorted(name for name in dir(model.opt) if not name.startswith("_")):
        setting = getattr(model.opt, name)
        if isinstance(setting, int | float | np.ndarray):
            yield _number(f"opt_{name}", "", np.atleast_1d(setting))


def _of_objects(model: Any, array: str, values: Array, driven: Sequence[int]) -> Iterator[CompiledNumber]:
    prefix, _, name = array.partition("_")
    may_drive = bool(driven) and name in _FELT_DRIVEN.get(prefix, "").split()
    # Of several inputs of an actuator there are more rows than actuators.
    acting = driven if prefix == "actuator" and len(values) == len(model.actuator_trntype) else range(len(values) * (prefix == "jnt"))
    owner = owners(model, prefix, len(values))
    for number, row in enumerate(values):
        is_passed_over = prefix == "geom" and not (model.geom_contype[number] or model.geom_conaffinity[number])
        # The world has neither mass nor place.
        if not is_passed_over and not (prefix == "body" and number == 0):
            found = _number(array, owner(number), np.atleast_1d(row))
            yield replace(found, felt=True) if may_drive and number in acting else found


def _number(quantity: str, owner: str, values: Array) -> CompiledNumber:
    prefix, _, name = quantity.partition("_")
    is_felt = name in _FELT.get(prefix, "").split() or quantity == "qpos0"
    if quantity in WORDS:
        return CompiledNumber(quantity, owner, tuple(_word(*WORDS[quantity], int(value)) for value in values), felt=is_felt)
    if quantity in _SWITCHES:
        return CompiledNumber(quantity, owner, (_switches(*_SWITCHES[quantity], int(values[0])),), felt=is_felt)
    if quantity == "body_inertia":
        return CompiledNumber.of_inertia(quantity, owner, values)
    parts = QUATERNION if name == "quat" else AXES if name in _VECTORS else ()
    return CompiledNumber(quantity, owner, tuple(values.astype(float).tolist()), parts, is_felt)


def owners(model: Any, prefix: str, count: int) -> Callable[[int], str]:
    """The name of the object that a row of an array of that prefix belongs to."""
    joints = [(model.joint(number).name or f"joint {number}", number) for number in range(model.njnt)]
    if prefix in ("dof", "qpos0", "qpos"):
        starts = list(model.jnt_dofadr if prefix == "dof" else model.jnt_qposadr)
        ends = [*starts[1:], count][: len(starts)]
        of_joints = [
            name if end - start == 1 else f"{name}[{place}]"
            for (name, _), start, end in zip(joints, starts, ends, strict=True)
            for place in range(end - start)
        ]
        return of_joints.__getitem__
    kind = getattr(mujoco.mjtObj, f"mjOBJ_{ {'jnt': 'joint', 'eq': 'equality'}.get(prefix, prefix) }".upper().replace("MJOBJ", "mjOBJ"))

    def named(number: int) -> str:
        # Of several inputs of an actuator there are more rows than objects.
        name = mujoco.mj_id2name(model, kind, number)
        of = f" of {model.body(model.geom_bodyid[number]).name}" if prefix == "geom" else ""
        return name or f"{_OBJECTS.get(prefix, prefix)} {number}{of}"

    return named


def _word(enumeration: str, prefix: str, value: int) -> str:
    members = getattr(mujoco, enumeration).__members__
    return next((name.removeprefix(prefix).lower() for name, member in members.items() if int(member) == value), str(value))


def _switches(enumeration: str, prefix: str, bits: int) -> str:
    members = getattr(mujoco, enumeration).__members__
    found = [name.removeprefix(prefix).lower() for name, member in members.items() if name.startswith(prefix) and bits & int(member)]
    return " ".join(sorted(found)) or "none"
