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
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.bench.methods import DerivativeMethod
from harness.crosscheck.scene import Scene
from harness.engines import EQUATIONS, Subject, Unsupported, installed_version, load_engine
from harness.engines.adapters.mujoco import MujocoModel
from harness.engines.adapters.pinocchio import PinocchioModel
from harness.programs.states import States

Compute = Callable[[], Array]
# From where truncation hides everything to where rounding does.
STEPS = tuple(10.0**-exponent for exponent in range(1, 13))


def _compiled(is_inverse: bool, scene: Scene, states: States, third: Array, step: float) -> Compute:
    kernel = scene.mechanism.derivatives()
    evaluate = kernel.inverse if is_inverse else kernel.forward
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


class _Mujoco:
    """States in MuJoCo's own form."""

    def __init__(self, scene: Scene, states: States, third: Array) -> None:
        import mujoco

        loaded: MujocoModel = scene.load("mujoco", "mjcf")
        self.model, self._loaded = copy.copy(loaded.model), loaded
        self.model.opt.integrator, self.model.opt.timestep = mujoco.mjtIntegrator.mjINT_EULER, 1.0
        self.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_EULERDAMP
        self.data, self._rows = mujoco.MjData(self.model), list(zip(states.q, states.v, third, strict=True))

    def one_by_one(self, name: str, derivatives: Callable[[Any, Any], tuple[Array, Array]]) -> Compute:
        """Of (model, data) at one state after the other, whose third vector is the data's ``name``."""
        model, data, (positions, velocities) = self.model, self.data, self._loaded.addresses
        found = np.empty((len(self._rows), 2, model.nv, model.nv))

        def compute() -> Array:
            for state, (q, v, third) in enumerate(self._rows):
                data.qpos[positions], data.qvel[velocities], getattr(data, name)[velocities] = q, v, third
                found[state] = derivatives(model, data)
            return np.ascontiguousarray(found[:, :, velocities][:, :, :, velocities])

        return compute


def _transition(is_centred: bool, scene: Scene, states: States, third: Array, step: float) -> Compute:
    import mujoco

    batch = _Mujoco(scene, states, third)
    nv = batch.model.nv
    matrix = np.zeros((2 * nv, 2 * nv))

    def derivatives(model: Any, data: Any) -> tuple[Array, Array]:
        mujoco.mjd_transitionFD(model, data, step, is_centred, matrix, None, None, None)
        return matrix[nv:, :nv].copy(), matrix[nv:, nv:] - np.eye(nv)

    return batch.one_by_one("qfrc_applied", derivatives)


def _inverse(scene: Scene, states: States, third: Array, step: float) -> Compute:
    import mujoco

    batch = _Mujoco(scene, states, third)
    by_position, by_velocity = np.zeros((2, batch.model.nv, batch.model.nv))

    def derivatives(model: Any, data: Any) -> tuple[Array, Array]:
        mujoco.mjd_inverseFD(model, data, step, False, by_position, by_velocity, None, None, None, None, None)
        return by_position.T, by_velocity.T

    return batch.one_by_one("qacc", derivatives)


def _of(subject: str, name: str, is_inverse: bool, loop: str = "Python", **more: Any) -> DerivativeMethod:
    """Derivatives that an engine gives itself."""
    own = Subject(*subject.split("/"))
    return DerivativeMethod(name, own.format, is_inverse, partial(_of_engine, own, is_inverse), loop, **more)


_DIFFERENCES: dict[str, Any] = {"loop": "Python", "steps": STEPS}
METHODS = (
    DerivativeMethod("heyoka derivatives of qdd", EQUATIONS, False, partial(_compiled, False), "machine code"),
    DerivativeMethod("heyoka derivatives of tau", EQUATIONS, True, partial(_compiled, True), "machine code"),
    _of("pinocchio/urdf", "pinocchio computeABADerivatives", False, linear_velocity_in_body=True),
    _of("pinocchio/urdf", "pinocchio computeRNEADerivatives", True, linear_velocity_in_body=True),
    *(
        DerivativeMethod(
            f"central differences of pinocchio {name}",
            "urdf",
            is_inverse,
            partial(_differences_of_pinocchio, is_inverse),
            linear_velocity_in_body=True,
            **_DIFFERENCES,
        )
        for name, is_inverse in (("aba", False), ("rnea", True))
    ),
    DerivativeMethod("mujoco mjd_transitionFD", "mjcf", False, partial(_transition, False), **_DIFFERENCES),
    DerivativeMethod("mujoco mjd_transitionFD, centred", "mjcf", False, partial(_transition, True), **_DIFFERENCES),
    DerivativeMethod("mujoco mjd_inverseFD", "mjcf", True, _inverse, **_DIFFERENCES),
    # Of engines that not everybody installs, which read MJCF.
    _of("drake/mjcf", "drake AutoDiff of accelerations", False, engine="drake"),
    _of("drake/mjcf", "drake AutoDiff of CalcInverseDynamics", True, engine="drake"),
    _of("mjx/mjcf", "mjx jacfwd of forward", False, "XLA", engine="mjx"),
    _of("mjx/mjcf", "mjx jacfwd of inverse", True, "XLA", engine="mjx"),
)
