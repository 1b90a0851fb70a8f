"""MuJoCo's own integrators on the MJCF model, in its C code: ``mj_step`` with as many steps as lie between kept states.

Euler is semi-implicit: the velocity goes first, the position with the new velocity. Unless ``eulerdamp`` is
disabled it, and ``implicit`` and ``implicitfast`` always, solve (M - h dF/dv) (v1 - v0) = h F, F with the dampers and
for ``implicit`` also with the velocity terms. ``discrete`` solves with M + h D + h^2 K, D of the dampers and K of the
springs in joints and tendons: the linearly implicit Euler method. All of them are of first order. Automatic reset is
off, or a motion that breaks down would start anew in silence.

Constraints give by numbers of the file, so that motions under them converge to another than the rigid one.

A robot is integrated on its own file, URDF too.

Source: MuJoCo documentation, Computation, Numerical integration; MuJoCo 3.13.0 release notes, ``discrete``.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from harness.arrays import Array
from harness.crosscheck.scene import Scene
from harness.motion.integrators import KINDS, Advance, Integrator, keep
from harness.motion.taylor import Path
from harness.motion.trajectories import Start

RUNGE_KUTTA_STAGES = 4
# Differences of two motions below it, relative to the motion, are rounding.
ROUNDING = 1e-11
COMPARED_STEPS = 200


def prepare(integrator: str, scene: Scene, evaluations_per_step: int = 1, disable: str = "") -> Advance:
    """``Integrator.prepare`` of ``mjINT_<integrator>``, with ``mjDSBL_<disable>`` if given."""
    import mujoco

    loaded = scene.load("mujoco", "mjcf")
    model = loaded.model
    model.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator}")
    if disable:
        model.opt.disableflags |= getattr(mujoco.mjtDisableBit, f"mjDSBL_{disable}")
    data = mujoco.MjData(model)
    positions, velocities = loaded.addresses

    def advance(start: Start, step: float, steps: int, every: int) -> Path:
        mujoco.mj_resetData(model, data)
        model.opt.timestep = step
        data.qpos[positions], data.qvel[velocities] = start.q, start.v

        def go(count: int) -> tuple[Array, Array]:
            mujoco.mj_step(model, data, nstep=count)
            return np.asarray(data.qpos[positions]), np.asarray(data.qvel[velocities])

        return keep(start, step, steps, every, evaluations_per_step, go)

    return advance


def explain_softness(scene: Scene, start: Start, step: float) -> str:
    """The reason why no integrator of MuJoCo comes to the true motion under constraints; "" without constraints."""
    if scene.mechanism.constraints is None:
        return ""
    return "MuJoCo's constraints give as the model file declares: its motions converge, but not to the rigid one"


def explain_euler(scene: Scene, start: Start, step: float) -> str:
    """The reason why Euler is not the method of that name, "" if it is: its motion beside that of the equations by Euler-Cromer."""
    if softness := explain_softness(scene, start, step):
        return softness
    from harness.motion.integrators.equations import EULER_CROMER
    from harness.motion.trajectories import Metric

    expected = EULER_CROMER.prepare(scene)(start, step, COMPARED_STEPS, 1)
    metric = Metric(scene.mechanism)

    def difference(disable: str = "") -> float:
        found = prepare("EULER", scene, disable=disable)(start, step, COMPARED_STEPS, 1)
        return float(metric.errors(expected, found.q, found.v).max())

    damped, undamped = difference(), difference("EULERDAMP")
    if damped <= ROUNDING:
        return ""
    if undamped <= ROUNDING:
        return (
            f"MuJoCo's Euler takes joint damping implicitly (eulerdamp): over {COMPARED_STEPS} steps of {step:g} s it differs from "
            f"Euler-Cromer by {damped:.1e}, and by {undamped:.1e} with eulerdamp disabled"
        )
    return (
        f"over {COMPARED_STEPS} steps of {step:g} s MuJoCo's Euler differs from Euler-Cromer by {damped:.1e}, and by {undamped:.1e} "
        "with eulerdamp disabled: joint damping is not the reason"
    )


# Every mechanism takes MuJoCo as long as one of a few degrees of freedom, and each of these a tenth of a microsecond.
_MUJOCO = partial(Integrator, format="mjcf", of=KINDS, nominal_seconds=lambda mechanism: 1e-6 + 1.5e-7 * mechanism.nv)
EULER = _MUJOCO(name="mujoco Euler", order=1, prepare=partial(prepare, "EULER"), explain=explain_euler)
RUNGE_KUTTA = _MUJOCO(
    name="mujoco RK4",
    order=4,
    prepare=partial(prepare, "RK4", evaluations_per_step=RUNGE_KUTTA_STAGES),
    long_run="secular",
    explain=explain_softness,
)
IMPLICIT, IMPLICIT_FAST, DISCRETE = (
    _MUJOCO(name=f"mujoco {name}", order=1, prepare=partial(prepare, name.upper()), explain=explain_softness)
    for name in ("implicit", "implicitfast", "discrete")
)
