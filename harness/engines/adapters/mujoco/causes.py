"""The numbers of a compiled ``mujoco.MjModel`` by the causes of a drift, and numbers of another model laid over them.

What follows from other numbers is computed anew by ``mj_setConst``, which leaves a model that is as compiled unchanged to the bit.

Source: MuJoCo documentation, API reference, mjModel, mjOption and ``mj_setConst``; XML reference.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import mujoco
import numpy as np

from harness.engines.adapters.mujoco.compiled import WORDS, owners
from harness.engines.moving import NumberKey, Numbers
from harness.results.cause import DriftCause

# The third coefficient of an affine bias is that of the velocity.
_VELOCITY = 2
_GAINS = f"actuator_biasprm:{_VELOCITY}"
_FIELDS = {
    DriftCause.TREE: "body_pos body_quat body_ipos body_iquat body_mass body_inertia body_gravcomp jnt_type jnt_axis jnt_pos qpos0 "
    "site_pos site_quat wrap_prm actuator_trntype actuator_cranklength geom_fluid",
    DriftCause.SPRINGS: "jnt_stiffness jnt_stiffnesspoly jnt_springyield qpos_spring tendon_stiffness tendon_stiffnesspoly "
    "tendon_lengthspring tendon_springyield",
    DriftCause.DAMPING: "dof_damping dof_dampingpoly tendon_damping tendon_dampingpoly actuator_damping actuator_dampingpoly",
    DriftCause.ARMATURE: "dof_armature tendon_armature actuator_armature",
    DriftCause.FRICTION: "dof_frictionloss dof_solref dof_solimp tendon_frictionloss tendon_solref_fri tendon_solimp_fri",
    DriftCause.LIMITS: "jnt_limited jnt_range jnt_margin jnt_solref jnt_solimp tendon_limited tendon_range tendon_margin tendon_solref_lim "
    "tendon_solimp_lim",
    DriftCause.EQUALITIES: "eq_type eq_active0 eq_data eq_solref eq_solimp",
    DriftCause.GAIN: "actuator_gaintype actuator_biastype actuator_gainprm actuator_biasprm jnt_actgravcomp",
    DriftCause.DERIVATIVE_GAIN: _GAINS,
    DriftCause.GEAR: "actuator_gear",
    DriftCause.ACTIVATION: "actuator_dyntype actuator_dynprm actuator_actlimited actuator_actrange actuator_actearly actuator_delay",
    DriftCause.CONTROL_RANGE: "actuator_ctrllimited actuator_ctrlrange",
    DriftCause.FORCE_RANGE: "actuator_forcelimited actuator_forcerange jnt_actfrclimited jnt_actfrcrange tendon_actfrclimited "
    "tendon_actfrcrange",
    DriftCause.CONTACT_GEOMETRY: "geom_type geom_size geom_pos geom_quat geom_margin geom_gap geom_contype geom_conaffinity geom_rbound "
    "geom_aabb body_margin body_contype body_conaffinity pair_margin pair_gap",
    DriftCause.CONTACT_LAW: "geom_friction geom_solref geom_solimp geom_solmix geom_condim geom_priority geom_adhesion geom_surfacevel "
    "pair_friction pair_solref pair_solreffriction pair_solimp pair_dim pair_adhesion",
}
# What bears on nothing where a number of the same owner is 0.
_IDLE = {
    "jnt_limited": "jnt_range jnt_margin jnt_solref jnt_solimp",
    "tendon_limited": "tendon_range tendon_margin tendon_solref_lim tendon_solimp_lim",
    "dof_frictionloss": "dof_solref dof_solimp",
    "tendon_frictionloss": "tendon_solref_fri tendon_solimp_fri",
    "actuator_ctrllimited": "actuator_ctrlrange",
    "actuator_forcelimited": "actuator_forcerange",
    "jnt_actfrclimited": "jnt_actfrcrange",
    "tendon_actfrclimited": "tendon_actfrcrange",
}
# Settings that are not of the solver.
_OPTIONS = {
    "timestep": DriftCause.STEP,
    "integrator": DriftCause.INTEGRATOR,
    **dict.fromkeys(("gravity", "density", "viscosity", "wind", "magnetic"), DriftCause.TREE),
    **dict.fromkeys(("cone", "impratio", "o_margin", "o_solref", "o_solimp", "o_friction"), DriftCause.CONTACT_LAW),
    "disableactuator": DriftCause.GAIN,
}
# Flags that are not of the solver, by their names.
_SWITCHES = {
    "gravity": DriftCause.TREE,
    "spring": DriftCause.SPRINGS,
    "damper": DriftCause.DAMPING,
    "passive": DriftCause.DAMPING,
    "frictionloss": DriftCause.FRICTION,
    "limit": DriftCause.LIMITS,
    "equality": DriftCause.EQUALITIES,
    "actuation": DriftCause.GAIN,
    "clampctrl": DriftCause.CONTROL_RANGE,
    **dict.fromkeys(("contact", "filterparent", "midphase", "nativeccd", "multiccd", "speculative"), DriftCause.CONTACT_GEOMETRY),
    **dict.fromkeys(("refsafe", "override", "ipc"), DriftCause.CONTACT_LAW),
    **dict.fromkeys(("eulerdamp", "invdiscrete"), DriftCause.INTEGRATOR),
}
# They bear on no motion.
_NO_SWITCHES = ("sensor", "energy", "fwdinv")
_FLAGS = {"disableflags": ("mjtDisableBit", "mjDSBL_"), "enableflags": ("mjtEnableBit", "mjENBL_")}
# Shortcuts by which a row may be compared with its like after another compilation.
_SAME_FRAME = {"body": ("body_sameframe",), "geom": ("geom_sameframe",), "site": ("site_sameframe",)}


def numbers_by_cause(model: Any) -> dict[DriftCause, Numbers]:
    """Every number that bears on motion, by its cause."""
    found: dict[DriftCause, dict[NumberKey, Any]] = {cause: {} for cause in DriftCause}
    for cause, fields in _FIELDS.items():
        for name in fields.split():
            array, _, column = name.partition(":")
            values = getattr(model, array, None)
            if values is None:
                continue
            owner = _owners(model, array, len(values))
            for row, value in enumerate(values):
                taken = np.atleast_1d(np.array(value, dtype=np.float64))
                if array == "actuator_biasprm":
                    taken = taken[[int(column)]] if column else np.delete(taken, _VELOCITY)
                # A servo of velocities has one gain, by which both its control and the velocity count.
                is_of_velocity = array == "actuator_gainprm" and _drives_velocity(model, row)
                found[DriftCause.DERIVATIVE_GAIN if is_of_velocity else cause][name, owner[row]] = taken
    for name, value in _options(model):
        found[_OPTIONS.get(name, DriftCause.SOLVER)][f"opt_{name}", ""] = np.atleast_1d(np.array(value, dtype=np.float64))
    for flags, switch, bit in _switches():
        on = bool(getattr(model.opt, flags) & bit) != (flags == "disableflags")
        found[_SWITCHES.get(switch, DriftCause.SOLVER)][f"flag_{switch}", ""] = np.array([float(on)])
    return dict(found)


def idle_numbers(model: Any) -> frozenset[NumberKey]:
    """Those that bear on nothing because another number of their owner is 0, as a range that does not limit."""
    found = set[NumberKey]()
    for switch, arrays in _IDLE.items():
        values = getattr(model, switch, ())
        owner = _owners(model, switch, len(values))
        found |= {(array, owner[row]) for row, value in enumerate(values) if not np.any(value) for array in arrays.split()}
    owner, ends = _owners(model, "qpos_spring", model.nq), [*model.jnt_qposadr[1:], model.nq][: model.njnt]
    stiffnesses = np.hstack([np.atleast_2d(model.jnt_stiffness).T, getattr(model, "jnt_stiffnesspoly", np.zeros((model.njnt, 0)))])
    for start, end, stiffness in zip(model.jnt_qposadr, ends, stiffnesses, strict=True):
        found |= {("qpos_spring", owner[row]) for row in range(start, end) if not stiffness.any()}
    return frozenset(found)


def _drives_velocity(model: Any, row: int) -> bool:
    gain, bias = model.actuator_gainprm[row, 0], model.actuator_biasprm[row]
    return bool(gain and not bias[:_VELOCITY].any() and bias[_VELOCITY] == -gain)


def lay_over(model: Any, numbers: Numbers) -> None:
    """Put numbers of another model into this one, and compute what follows from them; of owners that it does not have none are taken."""
    if not numbers:
        return
    bits = {f"flag_{switch}": (flags, bit) for flags, switch, bit in _switches()}
    places: dict[str, dict[str, int]] = {}
    for (name, owner), values in numbers.items():
        if name in bits:
            flags, bit = bits[name]
            sets = bool(values[0]) != (flags == "disableflags")
            setattr(model.opt, flags, getattr(model.opt, flags) | bit if sets else getattr(model.opt, flags) & ~bit)
        elif name.startswith("opt_"):
            option = name.removeprefix("opt_")
            held = getattr(model.opt, option, None)
            if held is not None:
                setattr(model.opt, option, values if isinstance(held, np.ndarray) else type(held)(values[0]))
        else:
            _lay_row(model, places, name, owner, values)
    if any(name.startswith("geom_") for name, _ in numbers):
        # The volumes by which pairs are passed over are those of the geoms that were compiled.
        model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_MIDPHASE)
    mujoco.mj_setConst(model, mujoco.MjData(model))


def _lay_row(model: Any, places: dict[str, dict[str, int]], name: str, owner: str, values: Any) -> None:
    array, _, column = name.partition(":")
    held = getattr(model, array, None)
    if held is None:
        return
    if array not in places:
        places[array] = {one: row for row, one in enumerate(_owners(model, array, len(held)))}
    if owner not in places[array]:
        return
    row = places[array][owner]
    if array == "actuator_biasprm":
        columns = [int(column)] if column else np.delete(np.arange(held.shape[1]), _VELOCITY)
        held[row, columns] = values
    else:
        held[row] = values.reshape(held[row].shape) if held.ndim > 1 else values[0]
    prefix = array.partition("_")[0]
    for shortcut in _SAME_FRAME.get(prefix, ()) if array.endswith(("pos", "quat")) else ():
        getattr(model, shortcut)[row] = 0


def switches_of(model: Any) -> dict[DriftCause, NumberKey]:
    """The switch of each cause that acts in a model."""
    acting = {
        DriftCause.FRICTION: ("frictionloss", np.any(model.dof_frictionloss) or np.any(model.tendon_frictionloss)),
        DriftCause.LIMITS: ("limit", np.any(model.jnt_limited) or np.any(model.tendon_limited)),
        DriftCause.EQUALITIES: ("equality", np.any(model.eq_active0)),
        DriftCause.GAIN: ("actuation", model.nu > 0),
        DriftCause.CONTACT_GEOMETRY: ("contact", np.any(model.geom_contype) or model.npair > 0),
        DriftCause.DAMPING: ("damper", np.any(model.dof_damping) or np.any(model.tendon_damping)),
        DriftCause.SPRINGS: ("spring", np.any(model.jnt_stiffness) or np.any(model.tendon_stiffness)),
    }
    known = {switch for _, switch, _ in _switches()}
    return {cause: (f"flag_{switch}", "") for cause, (switch, acts) in acting.items() if acts and switch in known}


def rules() -> dict[str, Numbers]:
    """The numbers of rules that users write by accelerations: Euler's, whose dampers are explicit, and RK4."""
    number = {word: place for place, word in words()["opt_integrator"].items()}
    chosen = {name: np.array([float(number[name])]) for name in ("Euler", "RK4")}
    return {name: {("opt_integrator", ""): value, ("flag_eulerdamp", ""): np.zeros(1)} for name, value in chosen.items()}


def words() -> dict[str, Mapping[int, str]]:
    """Values of settings that are enumerations, by their numbers, as files write them."""
    found: dict[str, Mapping[int, str]] = {}
    for name, (enumeration, prefix) in WORDS.items():
        members = getattr(mujoco, enumeration).__members__
        found[name] = {int(one): _written(word.removeprefix(prefix)) for word, one in members.items() if word.startswith(prefix)}
    return found


def _written(word: str) -> str:
    names = ("Euler", "RK4", "Newton", "PGS", "CG")
    return next((name for name in names if name.upper() == word), word.lower())


def _owners(model: Any, array: str, count: int) -> list[str]:
    if not count:
        return []
    if array.startswith("wrap"):
        return [f"part {row} of tendons" for row in range(count)]
    owner = owners(model, array.partition("_")[0], count)
    return [owner(row) for row in range(count)]


def _options(model: Any) -> Iterator[tuple[str, Any]]:
    for name in dir(model.opt):
        value = getattr(model.opt, name)
        if not name.startswith("_") and name not in _FLAGS and isinstance(value, int | float | np.ndarray):
            yield name, value


def _switches() -> Iterator[tuple[str, str, int]]:
    """The setting, the name and the bit of each flag that bears on motion."""
    for flags, (enumeration, prefix) in _FLAGS.items():
        for name, member in getattr(mujoco, enumeration).__members__.items():
            switch = name.removeprefix(prefix).lower()
            # All constraints together are each of their kinds.
            if name.startswith(prefix) and switch not in _NO_SWITCHES:
                yield flags, switch, int(member)
