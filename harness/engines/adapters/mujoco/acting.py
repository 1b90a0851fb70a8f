"""Equalities, actuators, dry friction, limits and settings of the solver, of a compiled model: those that are asked for act, and no other.

Source: MuJoCo documentation, API reference, ``mjModel`` and ``mjOption``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import mujoco

from harness.engines.request import Held, SolverSettings

# Tags of a file by the names of MuJoCo's types of equality, where they are others.
_TYPES = {"mimic": "joint"}
_METHODS = {"Newton": mujoco.mjtSolver.mjSOL_NEWTON, "CG": mujoco.mjtSolver.mjSOL_CG, "PGS": mujoco.mjtSolver.mjSOL_PGS}


def let_act(model: Any, places: Mapping[str, Any], held: Held) -> None:
    """Let act what is ``held``; ``places`` are the joints of the file in the model, by name.

    Raises:
        ValueError: the compiled model has other equalities than the file.
    """
    _switch_on(model, held.kinds, held.switched_on)
    drive(model, held.actuators)
    _rub_and_limit(model, places, held)
    if held.solver is not None:
        _solve_by(model, held.solver)


def _switch_on(model: Any, kinds: Sequence[str], numbers: Sequence[int]) -> None:
    """``kinds`` are the tags of all equalities that the file holds."""
    model.eq_active0[:] = 0
    if not numbers:
        return
    found = [mujoco.mjtEq(int(one)).name.removeprefix("mjEQ_").lower() for one in model.eq_type]
    wanted = [_TYPES.get(kind, kind) for kind in kinds]
    if found != wanted:
        raise ValueError(f"MuJoCo makes the equalities {', '.join(found) or 'none'} of the file's {', '.join(wanted)}")
    model.eq_active0[list(numbers)] = 1


def drive(model: Any, numbers: Sequence[int]) -> None:
    """Let the actuators of these numbers act and no other, as two groups of which one is disabled."""
    model.actuator_group[:] = 1
    model.actuator_group[list(numbers)] = 0
    model.opt.disableactuator = 1 << 1


def _rub_and_limit(model: Any, places: Mapping[str, Any], held: Held) -> None:
    own = {joint.id: f"joint {name}" for name, joint in places.items()}
    tendons = [f"tendon {model.tendon(number).name or f'(tendon {number + 1})'}" for number in range(model.ntendon)]
    model.dof_frictionloss[[own.get(joint) not in held.rubbing for joint in model.dof_jntid]] = 0.0
    model.jnt_limited[[own.get(joint) not in held.limited for joint in range(model.njnt)]] = 0
    model.tendon_frictionloss[[one not in held.rubbing for one in tendons]] = 0.0
    model.tendon_limited[[one not in held.limited for one in tendons]] = 0


def _solve_by(model: Any, solver: SolverSettings) -> None:
    model.opt.solver = _METHODS[solver.method]
    model.opt.iterations, model.opt.tolerance = solver.iterations, solver.tolerance
