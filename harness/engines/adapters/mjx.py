"""MuJoCo XLA, ``mujoco.mjx``, on an MJCF model: ``mjx.forward`` on many states at once, in float64 or in float32.

JAX computes in float32 unless its 64 bits are switched on, so that each precision is an engine of its own. XLA compiles anew for every
number of states, which takes longer than the rest: states go through one compiled function in blocks of ``BLOCK``, the last one filled up.
A model's numbers are arguments of that function, so that models of one structure share it; JAX's persistent cache keeps it on disk.

Its constraints are MuJoCo's, soft by the law that the file declares (``harness.engines.adapters.mujoco.law``).

Derivatives are JAX's automatic ones, in forward mode, of ``mjx.forward`` and ``mjx.inverse``. Positions move along MuJoCo's velocities:
a ball joint turns about the axes of its body, and a free joint besides moves along the axes of the world.

Source: MuJoCo documentation, MuJoCo XLA (MJX), with its table of what is not implemented; JAX documentation, ``jax.enable_x64`` and
``jax.jacfwd``.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.engines import ConstraintLaw, Engine, HeldModel, LoadedModel, NotOffered, Unsupported
from harness.engines.adapters.mujoco import MujocoModel, law, robot
from harness.engines.loaded_file import LoadedFile
from harness.engines.request import Refused, Request
from harness.files.model_file import ModelFile
from harness.storage import cache_directory

BLOCK = 64
FLOAT32 = 2.0**-24
# XLA's fusion on CPUs computes what several elements of a chain of bodies share once for each: seven bodies take 51 CPU seconds to compile
# and 20 ms for each state with it, 8 s and 0.3 ms without and with the least effort of LLVM. Answers differ by roundoff.
COMPILER_OPTIONS = {"xla_disable_hlo_passes": "fusion,fusion_wrapper", "xla_backend_optimization_level": 0}


def _forward(model: Any, empty: Any, q: Any, v: Any, tau: Any) -> Any:
    from mujoco import mjx

    return mjx.forward(model, empty.replace(qpos=q, qvel=v, qfrc_applied=tau)).qacc


def _inverse(model: Any, empty: Any, q: Any, v: Any, qdd: Any) -> Any:
    from mujoco import mjx

    return mjx.inverse(model, empty.replace(qpos=q, qvel=v, qacc=qdd)).qfrc_inverse


def _derivatives(function: Callable[..., Any], model: Any, empty: Any, q: Any, v: Any, third: Any) -> Any:
    """Of a function of one state, by q, v and the third vector, (3, nv, nv)."""
    import jax
    import jax.numpy as jnp

    def after(moves: Any, v: Any, third: Any) -> Any:
        return function(model, empty, _moved(model, q, moves), v, third)

    return jnp.stack(jax.jacfwd(after, argnums=(0, 1, 2))(jnp.zeros_like(v), v, third))


def _moved(model: Any, q: Any, moves: Any) -> Any:
    """Positions after small moves along the velocities, (nv,), to first order, which derivatives at no move at all are of."""
    import jax.numpy as jnp
    from mujoco.mjx import JointType

    for kind, place, start in zip(model.jnt_type, model.jnt_qposadr, model.jnt_dofadr, strict=True):
        if kind in (JointType.HINGE, JointType.SLIDE):
            q = q.at[place].add(moves[start])
            continue
        if kind == JointType.FREE:
            q, place, start = q.at[place : place + 3].add(moves[start : start + 3]), place + 3, start + 3
        (w, x, y, z), turn = q[place : place + 4], moves[start : start + 3]
        rates = jnp.array([[-x, -y, -z], [w, -z, y], [z, w, -x], [-y, x, w]]) / 2
        q = q.at[place : place + 4].add(rates @ turn)
    return q


@functools.cache
def _compiled(of_a_state: Callable[..., Any]) -> Any:
    """A function of a model, its empty data and three vectors, of blocks of these; compiled at its first call."""
    import jax

    # What takes less than a second to compile is kept as well: a check asks many models.
    jax.config.update("jax_compilation_cache_dir", str(cache_directory() / "jax"))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
    of_a_block = jax.vmap(of_a_state, in_axes=(None, None, 0, 0, 0))
    return jax.jit(of_a_block, compiler_options=COMPILER_OPTIONS)


# Each is one object, by which what is compiled is kept.
_FORWARD_DERIVATIVES, _INVERSE_DERIVATIVES = (functools.partial(_derivatives, one) for one in (_forward, _inverse))


class OnDevice:
    """An ``mjx.Model`` of an ``MjModel``, asked in blocks of states.

    Raises:
        NotImplementedError: MJX has no such part of a model.
    """

    def __init__(self, model: Any, in_float64: bool) -> None:
        import jax
        from mujoco import mjx

        self._in_float64 = in_float64
        with jax.enable_x64(in_float64):
            self._model, self._empty = mjx.put_model(model), mjx.make_data(model)

    def accelerations(self, qpos: Array, qvel: Array, applied: Array) -> Array:
        """(n, nv) at MuJoCo's own positions (n, nq), velocities and applied forces (n, nv)."""
        return self.evaluate(_forward, qpos, qvel, applied)

    def evaluate(self, of_a_state: Callable[..., Any], *given: Array) -> Array:
        """What a function of the model, its empty data and one state answers, at n states: positions, velocities and a third vector."""
        import jax

        answers, states = [], len(given[0])
        for start in range(0, states, BLOCK):
            block = [values[start : start + BLOCK] for values in given]
            count = len(block[0])
            # A block that is not full repeats its first state, as zeros are no quaternion.
            full = [np.concatenate([values, np.repeat(values[:1], BLOCK - count, axis=0)]) for values in block]
            with jax.enable_x64(self._in_float64):
                answers.append(np.asarray(_compiled(of_a_state)(self._model, self._empty, *full), dtype=np.float64)[:count])
        return np.concatenate(answers)


class MjxModel:
    """An ``MjModel`` that the file compiles to, and the same on the device."""

    def __init__(self, model: Any, joints: Sequence[str], in_float64: bool) -> None:
        self._in_float64 = in_float64
        self._compiled, self._on_device = MujocoModel(model, joints), OnDevice(model, in_float64)

    def loaded(self) -> LoadedModel:
        return self._compiled.loaded()

    def held(self, positions: Mapping[str, float] | None = None, steps: Mapping[str, Sequence[float]] | None = None) -> HeldModel:
        """What the ``MjModel`` holds that is put on the device."""
        return self._compiled.held(positions, steps)

    def gaps(self, q: Array) -> dict[str, Array]:
        """See ``harness.engines``; by MuJoCo itself, from the same ``MjModel``."""
        return self._compiled.gaps(q)

    def forward_dynamics(self, q: Array, v: Array, tau: Array) -> Array:
        return self._on_device.accelerations(*self._own(q, v, tau))[:, self._compiled.addresses[1]]

    def forward_dynamics_derivatives(self, q: Array, v: Array, tau: Array) -> Array:
        """See ``harness.engines.interface``; raises NotOffered in float32."""
        return self._matrices(_FORWARD_DERIVATIVES, q, v, tau)

    def inverse_dynamics_derivatives(self, q: Array, v: Array, qdd: Array) -> Array:
        """See ``harness.engines.interface``; raises NotOffered in float32."""
        return self._matrices(_INVERSE_DERIVATIVES, q, v, qdd)

    def _matrices(self, of_a_state: Callable[..., Any], q: Array, v: Array, third: Array) -> Array:
        if not self._in_float64:
            raise NotOffered("derivatives are certified at states of float64, which float32 rounds")
        velocities = self._compiled.addresses[1]
        found = self._on_device.evaluate(of_a_state, *self._own(q, v, third))
        return np.ascontiguousarray(found[:, :, velocities][:, :, :, velocities])

    def _own(self, q: Array, v: Array, third: Array) -> tuple[Array, Array, Array]:
        """Positions, velocities, and forces or accelerations, in MuJoCo's order."""
        model, (positions, velocities) = self._compiled.model, self._compiled.addresses
        qpos, qvel, given = (np.zeros((len(q), size)) for size in (model.nq, model.nv, model.nv))
        qpos[:, positions], qvel[:, velocities], given[:, velocities] = q, v, third
        return qpos, qvel, given


class MjxFile(LoadedFile):
    """A file that MuJoCo has read, on the device; conventions are MuJoCo's."""

    def __init__(self, compiled: robot.MujocoFile) -> None:
        super().__init__(compiled.request, [joint.name for joint in compiled.found])
        self._compiled, self._on_device = compiled, OnDevice(compiled.model, in_float64=True)
        self.notes, self.further = compiled.notes, compiled.further

    def prepare(self, q: Array, v: Array, tau: Array) -> MjxRun:
        return MjxRun(self._compiled.prepare(q, v, tau), self._on_device)


class MjxRun:
    """MuJoCo's run, computed by MJX."""

    def __init__(self, run: robot.MujocoRun, on_device: OnDevice) -> None:
        self._run, self._on_device = run, on_device
        self._states = [np.array(part) for part in zip(*run.rows, strict=True)]

    def compute(self) -> None:
        self._run.found[:] = self._on_device.accelerations(*self._states)

    def accelerations(self) -> Array:
        return self._run.accelerations()


def keep_what_is_on(model: Any) -> None:
    """Have what is switched off of springs and dampers weigh nothing, and both switched on: MJX leaves out both where one is off.

    Source: mujoco/mjx/_src/passive.py, ``passive``; https://github.com/google-deepmind/mujoco/pull/3440.
    """
    import mujoco

    flags = mujoco.mjtDisableBit
    for flag, kind in ((flags.mjDSBL_SPRING, "stiffness"), (flags.mjDSBL_DAMPER, "damping")):
        if model.opt.disableflags & flag:
            for owner in ("jnt", "dof", "tendon"):
                if hasattr(model, f"{owner}_{kind}"):
                    getattr(model, f"{owner}_{kind}")[:] = 0.0
            model.opt.disableflags &= ~int(flag)


class MjxEngine(Engine):
    """The engine in float64, or else in float32."""

    requires = ("mujoco.mjx", "mujoco-mjx")
    formats = ("mjcf",)
    optional = True
    factorises_mass_matrix = True
    has_soft_constraints = True
    reader = "mujoco"
    takes_inertias_about_tree = True
    supplied: Mapping[str, str] = {"mjcf": "springs or dampers that it leaves out because the others are switched off"}
    why_no_equalities = "the harness asks it without the file's equalities"
    call: Mapping[str, str] = {
        "mjcf": (
            "m = mujoco.MjModel.from_xml_path(PATH); m.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT; "
            "mjx.forward(mjx.put_model(m), mjx.make_data(m).replace(qpos=q, qvel=v, qfrc_applied=tau)).qacc"
        )
    }

    def __init__(self, in_float64: bool) -> None:
        self._in_float64 = in_float64
        if not in_float64:
            # No user's file is handed over in float32.
            self.unit_roundoff, self.call = FLOAT32, {}

    def read(self, request: Request) -> MjxFile:
        compiled = robot.read(request)
        if request.aid is not None:
            keep_what_is_on(compiled.model)
        try:
            return MjxFile(compiled)
        except NotImplementedError as error:
            raise Refused(f"MJX: {' '.join(str(error).split())}") from error

    def load_model(self, file: ModelFile, joints: Sequence[str], gravity: float) -> MjxModel:
        import mujoco

        mujoco.set_mju_user_warning(lambda message: None)
        if file.constraints and not self._in_float64:
            one = file.constraints[0]
            why = "positions that are rounded to float32 do not close it, and off it there is no truth to judge by"
            raise Unsupported(f"line {one.line}: {one.couples} constraint {one.name!r}: {why}")
        model = mujoco.MjModel.from_xml_string(file.text)
        keep_what_is_on(model)
        try:
            return MjxModel(model, joints, self._in_float64)
        except NotImplementedError as error:
            raise Unsupported(f"MJX: {error}") from error

    def constraint_laws(self, file: ModelFile) -> Mapping[str, ConstraintLaw]:
        """See ``harness.engines.adapters.mujoco.law``; MJX has no term for how the rows turn with the motion, which MuJoCo has."""
        return {name: replace(one, has_curvature=False) for name, one in law.constraint_laws(file).items()}


ENGINE = MjxEngine(in_float64=True)
