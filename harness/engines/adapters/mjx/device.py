"""An ``MjModel`` on the device: ``mjx.forward`` and its derivatives, in blocks of states.

XLA compiles anew for every number of states, which takes longer than the rest: states go through one compiled function in blocks of
``BLOCK``, the last one filled up. A model's numbers are arguments of that function, so that models of one structure share it; JAX's
persistent cache keeps it on disk.

Derivatives are JAX's automatic ones, in forward mode, of ``mjx.forward`` and ``mjx.inverse``. Positions move along MuJoCo's velocities:
a ball joint turns about the axes of its body, and a free joint besides moves along the axes of the world.

Source: JAX documentation, ``jax.enable_x64`` and ``jax.jacfwd``.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from mujoco import mjx

from harness.arrays import Array
from harness.engines import Unsupported
from harness.engines.adapters.mujoco import robot
from harness.engines.adapters.mujoco.acting import actuators_of, rub_and_limit_alone
from harness.engines.adapters.mujoco.model import MujocoModel
from harness.engines.adapters.mujoco.on_device import CONTACT, DeviceFile, DeviceModel, contacts_in, in_blocks, still
from harness.engines.adapters.mujoco.versions import keep_what_is_on
from harness.engines.request import Refused, Request
from harness.files.model_file import ModelFile
from harness.storage import cache_directory

BLOCK = 64
# Dry friction [N or N m] that no acceleration shows, of numbers of float32 too.
_HARDLY_ANY = 1e-30
# XLA's fusion on CPUs computes what several elements of a chain of bodies share once for each: seven bodies take 51 CPU seconds to compile
# and 20 ms for each state with it, 8 s and 0.3 ms without and with the least effort of LLVM. Answers differ by roundoff.
COMPILER_OPTIONS = {"xla_disable_hlo_passes": "fusion,fusion_wrapper", "xla_backend_optimization_level": 0}


def _computed(model: Any, empty: Any, q: Any, v: Any, tau: Any, *driving: Any) -> Any:
    given = dict(zip(("ctrl", "act"), driving, strict=False))
    return mjx.forward(model, empty.replace(qpos=q, qvel=v, qfrc_applied=tau, **given))


def _forward(*state: Any) -> Any:
    return _computed(*state).qacc


def _touching(*state: Any) -> Any:
    data = _computed(*state)
    contact = data._impl.contact
    return data.qacc, {name: getattr(contact, name) for name in CONTACT} | {"dim": jnp.asarray(contact.dim)}


def _mass_matrix(model: Any, empty: Any, q: Any) -> Any:
    return mjx.full_m(model, mjx.forward(model, empty.replace(qpos=q)))


def _bias(model: Any, empty: Any, q: Any, v: Any) -> Any:
    return mjx.forward(model, empty.replace(qpos=q, qvel=v)).qfrc_bias


def _inverse(model: Any, empty: Any, q: Any, v: Any, qdd: Any) -> Any:
    return mjx.inverse(model, empty.replace(qpos=q, qvel=v, qacc=qdd)).qfrc_inverse


def _derivatives(function: Callable[..., Any], model: Any, empty: Any, q: Any, v: Any, third: Any) -> Any:
    """Derivatives of a function of one state by q, v and the third vector, (3, nv, nv)."""

    def after(moves: Any, v: Any, third: Any) -> Any:
        return function(model, empty, _moved(model, q, moves), v, third)

    return jnp.stack(jax.jacfwd(after, argnums=(0, 1, 2))(jnp.zeros_like(v), v, third))


def _moved(model: Any, q: Any, moves: Any) -> Any:
    """Positions after small moves along the velocities, (nv,), to first order, which derivatives at no move at all are of."""
    for kind, place, start in zip(model.jnt_type, model.jnt_qposadr, model.jnt_dofadr, strict=True):
        if kind in (mjx.JointType.HINGE, mjx.JointType.SLIDE):
            q = q.at[place].add(moves[start])
            continue
        if kind == mjx.JointType.FREE:
            q, place, start = q.at[place : place + 3].add(moves[start : start + 3]), place + 3, start + 3
        (w, x, y, z), turn = q[place : place + 4], moves[start : start + 3]
        rates = jnp.array([[-x, -y, -z], [w, -z, y], [z, w, -x], [-y, x, w]]) / 2
        q = q.at[place : place + 4].add(rates @ turn)
    return q


def keep_compiled() -> None:
    """Keep what is compiled in the harness's cache, as well what takes less than a second: a check asks many models."""
    jax.config.update("jax_compilation_cache_dir", str(cache_directory() / "jax"))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)


@functools.cache
def _compiled(of_a_state: Callable[..., Any], vectors: int) -> Any:
    """A function of a model, its empty data and so many vectors, of blocks of these; compiled at its first call."""
    keep_compiled()
    of_a_block = jax.vmap(of_a_state, in_axes=(None, None, *(0,) * vectors))
    return jax.jit(of_a_block, compiler_options=COMPILER_OPTIONS)


# Each is one object, by which what is compiled is kept.
_FORWARD_DERIVATIVES, _INVERSE_DERIVATIVES = (functools.partial(_derivatives, one) for one in (_forward, _inverse))


def _plain(values: Any) -> Array:
    """An array of the device as one of NumPy, of real numbers in float64."""
    return np.asarray(values, dtype=np.float64 if jnp.issubdtype(values.dtype, jnp.floating) else None)


class ModelOnDevice:
    """An ``mjx.Model`` of an ``MjModel``, asked in blocks of states.

    ``numbers`` stand in the place of the model's own there, by their names.

    Raises:
        NotImplementedError: MJX has no such part of a model.
    """

    contacts: Sequence[Sequence[Any]] = ()
    # It takes a manifold of its own, of corners within 1 mm of the deepest: mjx/_src/collision_convex.py, plane_convex.
    touches_as_mujoco = False

    def __init__(self, model: Any, in_float64: bool, **numbers: Array) -> None:
        self._in_float64, self._touches = in_float64, not model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
        with jax.enable_x64(in_float64):
            self._model, self._empty = mjx.put_model(model).replace(**numbers), mjx.make_data(model)

    def accelerations(self, qpos: Array, qvel: Array, applied: Array, *driving: Array) -> Array:
        """(n, nv) at MuJoCo's own positions (n, nq), velocities and applied forces (n, nv); controls and activations where it drives."""
        accelerations: Array
        if self._touches:
            accelerations, contacts = self.evaluate(_touching, qpos, qvel, applied, *driving)
            self.contacts = [contacts_in({name: own[state] for name, own in contacts.items()}) for state in range(len(qpos))]
        else:
            accelerations = self.evaluate(_forward, qpos, qvel, applied, *driving)
        return accelerations

    def evaluate(self, of_a_state: Callable[..., Any], *given: Array) -> Any:
        """Arrays of a function of the model, its empty data and one state, at n states: positions, velocities and further vectors."""
        answers = []
        for block in zip(*(in_blocks(values, BLOCK) for values in given), strict=True):
            full, count = [values for values, _ in block], block[0][1]
            with jax.enable_x64(self._in_float64):
                found = _compiled(of_a_state, len(given))(self._model, self._empty, *full)
                answers.append(jax.tree.map(lambda own, count=count: _plain(own)[:count], found))
        return jax.tree.map(lambda *parts: np.concatenate(parts), *answers)


class MjxModel(DeviceModel[ModelOnDevice]):
    """A mechanism's ``MjModel`` on the device; raises as ``ModelOnDevice``."""

    def __init__(self, model: Any, joints: Sequence[str], in_float64: bool, driven: Sequence[int] = ()) -> None:
        super().__init__(MujocoModel(model, joints, driven=driven), ModelOnDevice(model, in_float64))

    def forward_dynamics_derivatives(self, q: Array, v: Array, tau: Array) -> Array:
        """See ``harness.engines.interface``."""
        return self._matrices(_FORWARD_DERIVATIVES, q, v, tau)

    def inverse_dynamics_derivatives(self, q: Array, v: Array, qdd: Array) -> Array:
        """See ``harness.engines.interface``."""
        return self._matrices(_INVERSE_DERIVATIVES, q, v, qdd)

    def mass_matrix(self, q: Array) -> Array:
        """``mjx.full_m``."""
        velocities = self._compiled.addresses[1]
        found = self._on_device.evaluate(_mass_matrix, *self._compiled.own(q))
        return np.ascontiguousarray(found[:, velocities][:, :, velocities])

    def bias(self, q: Array, v: Array) -> Array:
        """``qfrc_bias``."""
        found: Array = self._on_device.evaluate(_bias, *self._compiled.own(q, v))
        return found[:, self._compiled.addresses[1]]

    def gravity(self, q: Array) -> Array:
        """``qfrc_bias`` at rest."""
        return self.bias(q, np.zeros((len(q), len(self._compiled.addresses[1]))))

    def inverse_dynamics(self, q: Array, v: Array, qdd: Array) -> Array:
        """``mjx.inverse``."""
        found: Array = self._on_device.evaluate(_inverse, *self._compiled.own(q, v, qdd))
        return found[:, self._compiled.addresses[1]]

    def _matrices(self, of_a_state: Callable[..., Any], q: Array, v: Array, third: Array) -> Array:
        velocities = self._compiled.addresses[1]
        found: Array = self._on_device.evaluate(of_a_state, *self._compiled.own(q, v, third))
        return np.ascontiguousarray(found[:, :, velocities][:, :, :, velocities])


def _frictions(model: Any, request: Request) -> dict[str, Array]:
    """The dry friction that acts; the rest of the file's is next to nothing, as each set of rows is compiled anew.

    None at all would hold its joint still: MJX 3.17, solver.py, has no linear part of the cost where the friction is 0.
    """
    if request.held is None or not request.held.rubbing:
        return {}
    of_file, found = robot.read(replace(request, held=None)).model, {}
    for name in ("dof_frictionloss", "tendon_frictionloss"):
        acting, written = getattr(model, name), getattr(of_file, name)
        found[name] = np.where((acting == 0.0) & (written > 0.0), _HARDLY_ANY, acting)
        acting[:] = written
    return found


def _have_no_cones(model: Any) -> None:
    """Pyramids for cones where nothing touches: MJX fails on elliptic ones then, docs/issues/mjx-elliptic-cones-without-contacts.md."""
    if model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_CONTACT):
        model.opt.cone = mujoco.mjtCone.mjCONE_PYRAMIDAL


def read(request: Request, in_float64: bool) -> DeviceFile:
    """A file that MuJoCo reads, on the device; see ``harness.engines.Engine``."""
    compiled = robot.read(request)
    if request.aid is not None:
        keep_what_is_on(compiled.model)
    _have_no_cones(compiled.model)
    try:
        # What rubs is taken of what acts, before the rest of it is put beside.
        frictions = _frictions(compiled.model, request)
        if request.driven:
            still(compiled.model, request.driven)
        return DeviceFile(compiled, ModelOnDevice(compiled.model, in_float64, **frictions))
    except NotImplementedError as error:
        raise Refused(f"MJX: {' '.join(str(error).split())}") from error


def load(file: ModelFile, joints: Sequence[str], in_float64: bool) -> MjxModel:
    """See ``harness.engines.Engine.load``."""
    mujoco.set_mju_user_warning(lambda message: None)
    model = mujoco.MjModel.from_xml_string(file.text)
    rub_and_limit_alone(model, joints, file.acting)
    driven = actuators_of(model, file.driven)
    still(model, driven)
    keep_what_is_on(model)
    try:
        return MjxModel(model, joints, in_float64, driven)
    except NotImplementedError as error:
        raise Unsupported(f"MJX: {error}") from error
