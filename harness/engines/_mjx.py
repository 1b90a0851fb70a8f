"""MuJoCo XLA, ``mujoco.mjx``, on an MJCF model: ``mjx.forward`` on many states at once, in float64 or in float32.

JAX computes in float32 unless its 64 bits are switched on, so that each precision is an engine of its own. XLA compiles anew for every
number of states, which takes longer than the rest: states go through one compiled function in blocks of ``BLOCK``, the last one filled up.
A model's numbers are arguments of that function, so that models of one structure share it; JAX's persistent cache keeps it on disk.

Its constraints are MuJoCo's, soft by the law that the file declares (``harness.engines._mujoco_law``).

Source: MuJoCo documentation, MuJoCo XLA (MJX), with its table of what is not implemented; JAX documentation, ``jax.enable_x64``.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from harness.arrays import Array
from harness.engines import ConstraintLaw, HeldModel, LoadedModel, Unsupported, _mujoco_law, require_model
from harness.engines.mujoco import MujocoModel
from harness.models.model_file import ModelFile
from harness.storage import cache_directory

if TYPE_CHECKING:
    from harness.equations.mechanism import Mechanism

BLOCK = 64
FLOAT32 = 2.0**-24
# XLA's fusion on CPUs computes what several elements of a chain of bodies share once for each: seven bodies take 51 CPU seconds to compile
# and 20 ms for each state with it, 8 s and 0.3 ms without and with the least effort of LLVM. Answers differ by roundoff.
COMPILER_OPTIONS = {"xla_disable_hlo_passes": "fusion,fusion_wrapper", "xla_backend_optimization_level": 0}


@functools.cache
def _accelerations() -> Any:
    """The function of a model, its empty data, and a block of positions, velocities and applied forces; compiled at its first call."""
    import jax
    from mujoco import mjx

    # What takes less than a second to compile is kept as well: a check asks many models.
    jax.config.update("jax_compilation_cache_dir", str(cache_directory() / "jax"))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)

    def accelerations(model: Any, empty: Any, q: Any, v: Any, tau: Any) -> Any:
        return mjx.forward(model, empty.replace(qpos=q, qvel=v, qfrc_applied=tau)).qacc

    of_a_block = jax.vmap(accelerations, in_axes=(None, None, 0, 0, 0))
    return jax.jit(of_a_block, compiler_options=COMPILER_OPTIONS)


class MjxModel:
    """An ``mjx.Model`` of the ``MjModel`` that the file compiles to."""

    def __init__(self, model: Any, joints: Sequence[str], in_float64: bool) -> None:
        import jax
        from mujoco import mjx

        self._compiled = MujocoModel(model, joints)
        self._in_float64 = in_float64
        with jax.enable_x64(in_float64):
            self._on_device, self._empty = mjx.put_model(model), mjx.make_data(model)

    def loaded(self) -> LoadedModel:
        return self._compiled.loaded()

    def held(self, positions: Mapping[str, float] | None = None, steps: Mapping[str, Sequence[float]] | None = None) -> HeldModel:
        """What the ``MjModel`` holds that is put on the device."""
        return self._compiled.held(positions, steps)

    def gaps(self, q: Array) -> dict[str, Array]:
        """See ``harness.engines``; by MuJoCo itself, from the same ``MjModel``."""
        return self._compiled.gaps(q)

    def forward_dynamics(self, q: Array, v: Array, tau: Array) -> Array:
        import jax

        model, (positions, velocities) = self._compiled.model, self._compiled.addresses
        answer = np.empty(v.shape)
        for start in range(0, len(q), BLOCK):
            states = slice(start, min(start + BLOCK, len(q)))
            count = states.stop - start
            qpos, qvel, applied = (np.zeros((BLOCK, size)) for size in (model.nq, model.nv, model.nv))
            # A block that is not full repeats its first state, as zeros are no quaternion.
            for own, places, given in ((qpos, positions, q), (qvel, velocities, v), (applied, velocities, tau)):
                own[:count, places] = given[states]
                own[count:] = own[0]
            with jax.enable_x64(self._in_float64):
                found = np.asarray(_accelerations()(self._on_device, self._empty, qpos, qvel, applied))
            answer[states] = found[:count, velocities]
        return answer


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


class MjxEngine:
    """The engine in float64, or else in float32."""

    requires = ("mujoco.mjx", "mujoco-mjx")
    formats = ("mjcf",)
    optional = True
    factorises_mass_matrix = True

    def __init__(self, in_float64: bool) -> None:
        self._in_float64 = in_float64
        if not in_float64:
            self.unit_roundoff = FLOAT32

    def load(self, source: ModelFile | Mechanism, joints: Sequence[str], gravity: float) -> MjxModel:
        import mujoco

        mujoco.set_mju_user_warning(lambda message: None)
        file = require_model(source, "mjx")
        if file.constraints and not self._in_float64:
            one = file.constraints[0]
            why = "positions that are rounded to float32 do not close it, and off it there is no truth to judge by"
            raise Unsupported(f"line {one.line}: {one.kind} constraint {one.name!r}: {why}")
        model = mujoco.MjModel.from_xml_string(file.text)
        keep_what_is_on(model)
        try:
            return MjxModel(model, joints, self._in_float64)
        except NotImplementedError as error:
            raise Unsupported(f"MJX: {error}") from error

    def constraint_laws(self, file: ModelFile) -> Mapping[str, ConstraintLaw]:
        """See ``harness.engines._mujoco_law``; MJX has no term for how the rows turn with the motion, which MuJoCo has."""
        return {name: replace(law, has_curvature=False) for name, law in _mujoco_law.constraint_laws(file).items()}
