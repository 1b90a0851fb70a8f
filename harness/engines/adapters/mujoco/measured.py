"""The numbers of a compiled ``mujoco.MjModel`` that the author of a file measures, each with all that the model holds of it.

Source: MuJoCo documentation, API reference, mjModel; XML reference, actuator shortcuts.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import mujoco
import numpy as np

from harness.arrays import Array
from harness.engines.adapters.mujoco.compiled import owners
from harness.engines.moving import NamedNumber
from harness.results.cause import DriftCause

# Of joints: array, what files call it, and its cause; none is below 0.
_OF_JOINTS = (
    ("dof_damping", "damping", DriftCause.DAMPING),
    ("dof_frictionloss", "frictionloss", DriftCause.FRICTION),
    ("dof_armature", "armature", DriftCause.ARMATURE),
    ("jnt_stiffness", "stiffness", DriftCause.SPRINGS),
)
_AXES = "xyz"
# A share of a mass or a moment that is not 0 yet, and a length [m].
_LEAST_SHARE, _LENGTH = 1e-3, 1e-3


def named_numbers(model: Any) -> tuple[NamedNumber, ...]:
    """The numbers of joints, actuators and bodies that move."""
    return (*_of_joints(model), *_of_actuators(model), *_of_bodies(model))


def servos_of(model: Any) -> dict[str, str]:
    """Each joint whose position one actuator alone is given, without a gear, and that actuator."""
    on_joint, joint, actuator = int(mujoco.mjtTrn.mjTRN_JOINT), owners(model, "jnt", model.njnt), owners(model, "actuator", model.nu)
    found: dict[str, list[str]] = {}
    for row in range(model.nu):
        if model.actuator_trntype[row] == on_joint:
            is_servo = model.actuator_gainprm[row, 0] == -model.actuator_biasprm[row, 1] != 0 and model.actuator_gear[row, 0] == 1
            found.setdefault(joint(int(model.actuator_trnid[row, 0])), []).append(actuator(row) if is_servo else "")
    return {name: own[0] for name, own in found.items() if len(own) == 1 and own[0]}


def _unit(size: int, place: int, sign: float = 1.0) -> Array:
    found = np.zeros(size)
    found[place] = sign
    return found


def _of_joints(model: Any) -> Iterator[NamedNumber]:
    for array, what, cause in _OF_JOINTS:
        values = getattr(model, array)
        owner = owners(model, array.partition("_")[0], len(values))
        for row, value in enumerate(values):
            key = array, owner(row)
            yield NamedNumber(cause, f"joint {owner(row)}", what, float(value), key, {key: np.ones(1)}, least=0.0)


def _of_actuators(model: Any) -> Iterator[NamedNumber]:
    owner = owners(model, "actuator", model.nu)
    for row in range(model.nu):
        name, named = owner(row), _called(owner(row), "actuator")
        gain, bias = model.actuator_gainprm[row], model.actuator_biasprm[row]
        gains, others, velocity = ("actuator_gainprm", name), ("actuator_biasprm", name), ("actuator_biasprm:2", name)
        if gain[0] and bias[1] == -gain[0]:
            # A servo of positions, whose gain acts on its control and on the position.
            parts = {gains: _unit(len(gain), 0), others: _unit(len(bias) - 1, 1, -1.0)}
            yield NamedNumber(DriftCause.GAIN, named, "kp", float(gain[0]), gains, parts, least=0.0)
            yield NamedNumber(DriftCause.DERIVATIVE_GAIN, named, "kv", float(0.0 - bias[2]), velocity, {velocity: -np.ones(1)}, least=0.0)
        elif gain[0] and bias[2] == -gain[0]:
            parts = {gains: _unit(len(gain), 0), velocity: -np.ones(1)}
            yield NamedNumber(DriftCause.DERIVATIVE_GAIN, named, "kv", float(gain[0]), gains, parts, least=0.0)
        gear, force_range = ("actuator_gear", name), ("actuator_forcerange", name)
        yield NamedNumber(DriftCause.GEAR, named, "gear", float(model.actuator_gear[row, 0]), gear, {gear: _unit(6, 0)})
        lower, upper = model.actuator_forcerange[row]
        if model.actuator_forcelimited[row] and lower == -upper:
            parts = {force_range: np.array([-1.0, 1.0])}
            yield NamedNumber(DriftCause.FORCE_RANGE, named, "forcerange", float(upper), force_range, parts, least=0.0)


def _of_bodies(model: Any) -> Iterator[NamedNumber]:
    owner = owners(model, "body", model.nbody)
    for row in range(1, model.nbody):
        name, mass = owner(row), float(model.body_mass[row])
        if not mass or model.body_weldid[row] == 0:
            continue
        named, key = _called(name, "body"), ("body_mass", name)
        yield NamedNumber(DriftCause.TREE, named, "mass", mass, key, {key: np.ones(1)}, least=_LEAST_SHARE * mass)
        for array, what, values in (
            ("body_ipos", "centre of mass", model.body_ipos),
            ("body_inertia", "moment of inertia", model.body_inertia),
        ):
            key, is_moment = (array, name), array == "body_inertia"
            for axis, value in enumerate(values[row].tolist()):
                least = _LEAST_SHARE * value if is_moment else -np.inf
                yield NamedNumber(DriftCause.TREE, named, f"{what} {_AXES[axis]}", value, key, {key: _unit(3, axis)}, least, _LENGTH)


def _called(owner: str, section: str) -> str:
    return owner if owner.startswith(f"{section} ") else f"{section} {owner}"
