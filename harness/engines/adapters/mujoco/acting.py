"""Equalities, actuators, dry friction, limits and settings of the solver, of a compiled model: those that are asked for act, and no other.

Source: MuJoCo documentation, API reference, ``mjModel`` and ``mjOption``.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any

import mujoco
import numpy as np

from harness.arrays import Array
from harness.engines.adapters.mujoco.versions import inputs_of
from harness.engines.request import Held, SolverSettings

# Tags of a file by the names of MuJoCo's types of equality, where they are others.
_TYPES = {"mimic": "joint"}
_METHODS = {"Newton": mujoco.mjtSolver.mjSOL_NEWTON, "CG": mujoco.mjtSolver.mjSOL_CG, "PGS": mujoco.mjtSolver.mjSOL_PGS}
_JACOBIANS = {"dense": mujoco.mjtJacobian.mjJAC_DENSE, "sparse": mujoco.mjtJacobian.mjJAC_SPARSE}


def let_act(model: Any, places: Mapping[str, Any], held: Held) -> None:
    """Let act what is ``held``; ``places`` are the joints of the file in the model, by name.

    Raises:
        ValueError: the compiled model has other equalities than the file.
    """
    switch_on(model, held.kinds, held.switched_on)
    drive(model, held.actuators)
    rub_and_limit(model, places, held.rubbing, held.limited)
    if held.solver is not None:
        _solve_by(model, held.solver)


def switch_on(model: Any, kinds: Sequence[str], numbers: Sequence[int]) -> None:
    """``kinds`` are the tags of all equalities that the file holds; those of one kind are in its order, if kinds may be sorted."""
    model.eq_active0[:] = 0
    if not numbers:
        return
    found = [mujoco.mjtEq(int(one)).name.removeprefix("mjEQ_").lower() for one in model.eq_type]
    wanted = [_TYPES.get(kind, kind) for kind in kinds]
    if sorted(found) != sorted(wanted):
        raise ValueError(f"MuJoCo makes the equalities {', '.join(found) or 'none'} of the file's {', '.join(wanted)}")
    places = {kind: [place for place, one in enumerate(found) if one == kind] for kind in wanted}
    model.eq_active0[[places[wanted[number]][wanted[:number].count(wanted[number])] for number in numbers]] = 1


def actuators_of(model: Any, names: Sequence[str]) -> list[int]:
    """The numbers of the actuators of these names.

    Raises:
        ValueError: the model has no such actuator.
    """
    known = {model.actuator(number).name: number for number in range(len(model.actuator_group))}
    if lacking := [name for name in names if name not in known]:
        raise ValueError(f"has no actuator {lacking[0]!r}")
    return [known[name] for name in names]


def placed_controls(model: Any, driven: Sequence[int], count: int, control: Array) -> Array:
    """(count, nu) controls in MuJoCo's places, of those of the actuators ``driven``, (count, some of these); 0 for all others."""
    found, places = np.zeros((count, model.nu)), inputs_of(model, model.nu)[0][list(driven)]
    given = control[:, : len(places)]
    found[:, places[: given.shape[1]]] = given
    return found


def drive(model: Any, numbers: Sequence[int]) -> None:
    """Let the actuators of these numbers act and no other, as two groups of which one is disabled."""
    model.actuator_group[:] = 1
    model.actuator_group[list(numbers)] = 0
    model.opt.disableactuator = 1 << 1


def stages_of(acting: Collection[str]) -> set[str]:
    """The stages of MuJoCo's constraints that dry friction and limits of these names need, as of ``harness.files.equalities``."""
    return {"frictionloss" if name.startswith("dry friction") else "limit" for name in acting}


def rub_and_limit_alone(model: Any, joints: Collection[str], acting: Collection[str]) -> None:
    """The same of joints, by the names of what acts, as "dry friction of joint elbow"."""
    held = held_of(acting)
    rub_and_limit(model, {name: model.joint(name) for name in joints}, held.rubbing, held.limited)


def held_of(acting: Collection[str]) -> Held:
    """Dry friction and limits of these names alone."""
    owners = {
        stage: tuple(name.partition(" of ")[2] for name in acting if stages_of([name]) == {stage}) for stage in ("frictionloss", "limit")
    }
    return Held((), (), rubbing=owners["frictionloss"], limited=owners["limit"])


def rub_and_limit(model: Any, places: Mapping[str, Any], rubbing: Collection[str], limited: Collection[str]) -> None:
    """Let rub and limit those alone that are named, as "joint elbow" or "tendon left"."""
    own = {joint.id: f"joint {name}" for name, joint in places.items()}
    tendons = [f"tendon {model.tendon(number).name or f'(tendon {number + 1})'}" for number in range(model.ntendon)]
    model.dof_frictionloss[[own.get(joint) not in rubbing for joint in model.dof_jntid]] = 0.0
    model.jnt_limited[[own.get(joint) not in limited for joint in range(model.njnt)]] = 0
    model.tendon_frictionloss[[one not in rubbing for one in tendons]] = 0.0
    model.tendon_limited[[one not in limited for one in tendons]] = 0


def _solve_by(model: Any, solver: SolverSettings) -> None:
    model.opt.solver = _METHODS[solver.method]
    if solver.jacobian:
        model.opt.jacobian = _JACOBIANS[solver.jacobian]
    if solver.iterations is not None:
        model.opt.iterations = solver.iterations
    if solver.tolerance is not None:
        model.opt.tolerance = solver.tolerance
    if solver.line_search is not None:
        model.opt.ls_iterations = solver.line_search
