"""Ways of computing derivatives by q and v: analytic and automatic ones, and finite differences, which have a step.

A difference of engines' answers has two errors: truncation, which falls with the step, and rounding, which grows as the step falls.
MuJoCo's differences are of its own step in time, or of inverse dynamics; the matrices of ``mjd_inverseFD`` stand transposed. That of the
step is taken over one second by explicit Euler, so that what changes the velocity is the acceleration and nothing else.

Sources: Pinocchio documentation, ``computeABADerivatives``; MuJoCo documentation, API reference, ``mjd_transitionFD`` and
``mjd_inverseFD``; ``harness.engines`` of Drake and MJX; Press et al., Numerical Recipes, 3rd ed., section 5.7 (numerical derivatives).
"""

from __future__ import annotations

import copy
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from harness.arrays import Array
from harness.bench.methods import DERIVATIVES, Method
from harness.crosscheck.scene import Scene
from harness.engines import EQUATIONS, Subject, Unsupported, installed_version, load_engine
from harness.programs.states import States

if TYPE_CHECKING:
    from harness.engines.adapters.mujoco.model import MujocoModel
    from harness.engines.adapters.pinocchio.model import PinocchioModel

Compute = Callable[[], Array]
# By q and by v, at the state that an engine's data hold.
Both = Callable[[], tuple[Array, Array]]
# From where truncation hides everything to where rounding does.
STEPS = tuple(10.0**-exponent for exponent in range(1, 13))


def _compiled(is_inverse: bool, scene: Scene, states: States, third: Array, step: float) -> Compute:
    kernel = scene.mechanism.float64()
    evaluate = kernel.inverse_derivatives if is_inverse else kernel.forward_derivatives
    return lambda: evaluate(states.q, states.v, third, states.time)[:, :2]


def _of_engine(subject: Subject, is_inverse: bool, scene: Scene, states: States, third: Array, step: float) -> Compute:
    """Derivatives that an engine gives itself; the time of one in an environment of its own includes the way there and back."""
    if installed_version(load_engine(scene.library, subject.engine)) is None:
        raise Unsupported(f"{subject.engine} is not installed: harness engines add {subject.engine}")
    model = scene.load(subject.engine, subject.format)
    evaluate = model.inverse_dynamics_derivatives if is_inverse else model.forward_dynamics_derivatives
    return lambda: evaluate(states.q, states.v, third)[:, :2]


def _differences_of_pinocchio(is_inverse: bool, scene: Scene, states: States, third: Array, step: float) -> Compute:
    import pinocchio

    loaded: PinocchioModel = scene.load("pinocchio", "urdf")
    model, data, elements = loaded.model, loaded.model.createData(), loaded.force_elements
    if loaded.constraints is not None:
        raise Unsupported("differences of aba and rnea are of trees")
    columns, velocities = loaded.columns(states.q, states.v, third), loaded.addresses[1]
    changes = step * np.eye(model.nv)

    def answer(q: Array, v: Array, given: Array) -> Array:
        forces = elements.at(q, v)
        if is_inverse:
            return np.asarray(pinocchio.rnea(model, data, q, v, given)) - forces
        return np.array(pinocchio.aba(model, data, q, v, given + forces))

    def compute() -> Array:
        found = np.empty((len(states), 2, model.nv, model.nv))
        for state, (q, v, given) in enumerate(zip(*(part.T for part in columns), strict=True)):
            for column, change in enumerate(changes):
                ahead, behind = (answer(pinocchio.integrate(model, q, one), v, given) for one in (change, -change))
                found[state, 0, :, column] = (ahead - behind) / (2 * step)
                found[state, 1, :, column] = (answer(q, v + change, given) - answer(q, v - change, given)) / (2 * step)
        return np.ascontiguousarray(found[:, :, velocities][:, :, :, velocities])

    return compute


def _of_mujoco(
    make: Callable[..., Callable[[], tuple[Array, Array]]], name: str, scene: Scene, states: States, third: Array, step: float
) -> Compute:
    """Derivatives at one state after the other, whose third vector is the data's ``name``; ``make`` of (model, data, step)."""
    import mujoco

    loaded: MujocoModel = scene.load("mujoco", "mjcf")
    model, (positions, velocities) = copy.copy(loaded.model), loaded.addresses
    model.opt.integrator, model.opt.timestep = mujoco.mjtIntegrator.mjINT_EULER, 1.0
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_EULERDAMP
    data = mujoco.MjData(model)
    derivatives, rows = make(model, data, step), list(zip(states.q, states.v, third, strict=True))
    found = np.empty((len(rows), 2, model.nv, model.nv))

    def compute() -> Array:
        for state, (q, v, row) in enumerate(rows):
            data.qpos[positions], data.qvel[velocities], getattr(data, name)[velocities] = q, v, row
            found[state] = derivatives()
        return np.ascontiguousarray(found[:, :, velocities][:, :, :, velocities])

    return compute


def _transition(is_centred: bool, model: Any, data: Any, step: float) -> Both:
    import mujoco

    nv = model.nv
    matrix = np.zeros((2 * nv, 2 * nv))

    def derivatives() -> tuple[Array, Array]:
        mujoco.mjd_transitionFD(model, data, step, is_centred, matrix, None, None, None)
        return matrix[nv:, :nv].copy(), matrix[nv:, nv:] - np.eye(nv)

    return derivatives


def _inverse(model: Any, data: Any, step: float) -> Both:
    import mujoco

    by_position, by_velocity = np.zeros((2, model.nv, model.nv))

    def derivatives() -> tuple[Array, Array]:
        mujoco.mjd_inverseFD(model, data, step, False, by_position, by_velocity, None, None, None, None, None)
        return by_position.T, by_velocity.T

    return derivatives


def _method(name: str, model_format: str, is_inverse: bool, prepare: Callable[..., Compute], loop: str = "Python", **more: Any) -> Method:
    return Method(name, model_format, prepare, loop, is_inverse=is_inverse, of=(DERIVATIVES,), **more)


def _own(subject: str, name: str, is_inverse: bool, loop: str = "Python", **more: Any) -> Method:
    """Derivatives that an engine gives itself."""
    own = Subject(*subject.split("/"))
    return _method(name, own.format, is_inverse, partial(_of_engine, own, is_inverse), loop, **more)


METHODS = (
    _method("heyoka derivatives of qdd", EQUATIONS, False, partial(_compiled, False), "machine code"),
    _method("heyoka derivatives of tau", EQUATIONS, True, partial(_compiled, True), "machine code"),
    _own("pinocchio/urdf", "pinocchio computeABADerivatives", False, linear_velocity_in_body=True),
    _own("pinocchio/urdf", "pinocchio computeRNEADerivatives", True, linear_velocity_in_body=True),
    *(
        _method(
            f"central differences of pinocchio {name}",
            "urdf",
            is_inverse,
            partial(_differences_of_pinocchio, is_inverse),
            linear_velocity_in_body=True,
            steps=STEPS,
        )
        for name, is_inverse in (("aba", False), ("rnea", True))
    ),
    *(
        _method(f"mujoco {name}", "mjcf", is_inverse, partial(_of_mujoco, make, third), steps=STEPS)
        for name, is_inverse, make, third in (
            ("mjd_transitionFD", False, partial(_transition, False), "qfrc_applied"),
            ("mjd_transitionFD, centred", False, partial(_transition, True), "qfrc_applied"),
            ("mjd_inverseFD", True, _inverse, "qacc"),
        )
    ),
    # Of engines that not everybody installs, which read MJCF.
    _own("drake/mjcf", "drake AutoDiff of accelerations", False, engine="drake"),
    _own("drake/mjcf", "drake AutoDiff of CalcInverseDynamics", True, engine="drake"),
    _own("mjx/mjcf", "mjx jacfwd of forward", False, "XLA", engine="mjx"),
    _own("mjx/mjcf", "mjx jacfwd of inverse", True, "XLA", engine="mjx"),
)
