"""The steps of MuJoCo's integrators: what it documents of each, and what ``mj_step`` makes of states.

``Euler`` takes the dampers in joints implicitly, unless ``eulerdamp`` is disabled; ``implicit`` and ``implicitfast`` all dampers on
lengths too, and ``implicit`` all velocity terms, where ``implicitfast`` takes those of bodies that float alone. Both leave out what a
damper on a length does across branches of the tree. ``discrete`` takes dampers and springs in joints and on lengths. ``RK4`` is the
classical method.

Two things stand in the program alone: ``discrete`` takes the velocity terms of bodies that float alone too, and ``RK4`` works in the
coordinates of the exponential map.

Source: MuJoCo documentation, Computation, Numerical integration; release notes of 3.13.0, ``discrete``; MuJoCo 4.0, mj_step and
engine_metric.c (springs on lengths count by the first derivatives of these).
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Any

import numpy as np
from lxml import etree

from harness.arrays import Array
from harness.engines.adapters.mujoco.versions import require_declared_steps
from harness.engines.interface import NotOffered
from harness.files.mjcf.attributes import is_on
from harness.files.model_file import ModelFile, document_of
from harness.files.rules import ImplicitPart, StepRule

# Of an iteration, relative.
_TOLERANCE = 2.0**-53
# Of a file that does not say [s].
_TIMESTEP = 0.002
_HALF, _ONE, _NONE = Fraction(1, 2), Fraction(1), Fraction(0)
_STAGES = ((_HALF,), (_NONE, _HALF), (_NONE, _NONE, _ONE))
_WEIGHTS = (Fraction(1, 6), Fraction(1, 3), Fraction(1, 3), Fraction(1, 6))
_DAMPERS = frozenset({ImplicitPart.JOINT_DAMPERS, ImplicitPart.LINE_DAMPERS})
_SPRINGS = frozenset({ImplicitPart.JOINT_SPRINGS, ImplicitPart.LINE_SPRINGS})


def step_rules(file: ModelFile) -> tuple[StepRule, ...]:
    """The rules of all integrators at the step length of a file."""
    return rules_in(document_of(file).root)


def rules_in(root: etree._Element) -> tuple[StepRule, ...]:
    """The rules of all integrators by the options of a file with this root element."""
    written = [option.get("timestep") for option in root.iterfind("option[@timestep]")]
    length = float(written[-1]) if written else _TIMESTEP
    euler = frozenset({ImplicitPart.JOINT_DAMPERS} if is_on(root, "eulerdamp") else ())
    return (
        StepRule("Euler", length, euler),
        StepRule("RK4", length, stages=_STAGES, weights=_WEIGHTS),
        StepRule("implicit", length, _DAMPERS | {ImplicitPart.VELOCITY_TERMS}, along_branches=True),
        StepRule("implicitfast", length, _DAMPERS | {ImplicitPart.VELOCITY_TERMS_OF_FREE_BODIES}, along_branches=True),
        StepRule(
            "discrete",
            length,
            _DAMPERS | _SPRINGS | {ImplicitPart.VELOCITY_TERMS_OF_FREE_BODIES},
        ),
    )


def step(
    model: Any,
    addresses: tuple[Sequence[int], Sequence[int]],
    states: tuple[Array, Array, Array],
    length: float,
    integrator: str,
    steps: int,
) -> Array:
    """See ``harness.engines.interface``; ``addresses`` of positions and velocities in MuJoCo's own order. The model's options change.

    ``discrete`` solves with springs and dampers on lengths by iteration, here to rounding. By the default tolerance of 1e-8 it leaves
    velocities off by up to 20,000 data roundoffs (the governor at a step of 1e-5 s); by one of 0 it goes on until it divides zero by
    zero, and velocities are not finite at 1 % of the governor's states (MuJoCo 4.0).

    Raises:
        NotOffered: this version has no such integrator, or has rules of its own.
    """
    import mujoco

    require_declared_steps()

    (q, v, tau), (positions, velocities) = states, addresses
    number = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator.upper()}", None)
    if number is None:
        raise NotOffered(f"MuJoCo {mujoco.mj_versionString()} has no integrator {integrator}")
    model.opt.timestep, model.opt.integrator, model.opt.tolerance = length, number, _TOLERANCE
    data = mujoco.MjData(model)
    after: Array = np.empty((len(q), q.shape[1] + v.shape[1]))
    for state in range(len(q)):
        mujoco.mj_resetData(model, data)
        data.qpos[positions], data.qvel[velocities], data.qfrc_applied[velocities] = q[state], v[state], tau[state]
        mujoco.mj_step(model, data, nstep=steps)
        after[state] = [*data.qpos[positions], *data.qvel[velocities]]
    return after
