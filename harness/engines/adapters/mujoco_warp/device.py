"""An ``MjModel`` in worlds of MuJoCo Warp: ``mujoco_warp.forward`` in blocks of states.

Warp's data are of a fixed number of worlds: states go through ``BLOCK`` of them, the last block filled up. Kernels depend on the structure
of a model and are kept in the harness's cache; on a terminal Warp says which it compiles.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import mujoco
import mujoco_warp
import numpy as np
import warp

from harness.arrays import Array
from harness.engines import Unsupported
from harness.engines.adapters.mujoco import robot
from harness.engines.adapters.mujoco.acting import actuators_of, rub_and_limit_alone
from harness.engines.adapters.mujoco.model import MujocoModel
from harness.engines.adapters.mujoco.on_device import CONTACT, DeviceFile, DeviceModel, contacts_in, in_blocks, still
from harness.engines.adapters.mujoco.versions import fill_mass_matrix
from harness.engines.request import Refused, Request
from harness.engines.warp_kernels import keep_compiled
from harness.files.model_file import ModelFile

BLOCK = 64
VELOCITIES_BEFORE = "docs/issues/mujoco-warp-velocities-of-the-call-before.md"
# Contacts of a world, and rows of its constraints, for which there is room where bodies touch; by default there are 64 rows.
MOST_CONTACTS, MOST_ROWS = 128, 1024
# Of ``Data``, all that a state has.
GIVEN = ("qvel", "qfrc_applied", "ctrl", "act", "qacc")


class ModelInWorlds:
    """An ``MjModel`` in ``BLOCK`` worlds of Warp; ``put`` are Warp's model and data of it where another program has put it there.

    Attributes:
        repeats: whether it computes each state twice, for what takes velocities of the call before; see ``VELOCITIES_BEFORE``.

    Raises:
        NotImplementedError: Warp has no such part of a model.
    """

    touches_as_mujoco = True

    def __init__(self, model: Any, put: tuple[Any, Any] | None = None) -> None:
        self.contacts: Sequence[Sequence[Any]] = ()
        self._touches = not model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
        ties = (int(mujoco.mjtEq.mjEQ_CONNECT), int(mujoco.mjtEq.mjEQ_WELD))
        self.repeats = bool(np.isin(model.eq_type, ties).any())
        with warp.ScopedDevice("cpu"):
            room = {"nconmax": MOST_CONTACTS, "njmax": MOST_ROWS} if self._touches else {}
            self._model, self._data = put or (mujoco_warp.put_model(model), mujoco_warp.make_data(model, nworld=BLOCK, **room))

    def accelerations(self, qpos: Array, qvel: Array, applied: Array, *driving: Array) -> Array:
        """See ``harness.engines.adapters.mujoco.on_device``."""
        given = dict(zip(("ctrl", "act"), driving, strict=False))
        return self.answers(mujoco_warp.forward, "qacc", qpos=qpos, qvel=qvel, qfrc_applied=applied, **given)

    def answers(self, compute: Callable[..., None], found: str, **given: Array) -> Array:
        """An array of ``Data`` at each state, (n, its width), by a function of Warp; what is not given of ``GIVEN`` is zero."""
        answers, contacts = [], list[list[Any]]()
        for block in zip(*(in_blocks(values, BLOCK) for values in given.values()), strict=True):
            with warp.ScopedDevice("cpu"):
                for name in (*GIVEN, "overflow"):
                    getattr(self._data, name).zero_()
                for name, (values, _) in zip(given, block, strict=True):
                    getattr(self._data, name).assign(values.astype(np.float32))
                for _ in range(1 + self.repeats):
                    # A solver that starts from the last answer would make this one depend on it.
                    self._data.qacc_warmstart.zero_()
                    compute(self._model, self._data)
                self._require_room(block[0][1])
                answers.append(getattr(self._data, found).numpy().astype(np.float64)[: block[0][1]])
                if self._touches:
                    contacts += self._touching(block[0][1])
        self.contacts = contacts
        return np.concatenate(answers)

    def _require_room(self, count: int) -> None:
        """Raises Refused where an answer of the first worlds is of a part of the contacts or rows alone."""
        without = np.bitwise_or.reduce(self._data.overflow.numpy()[:count]) & ~int(mujoco_warp.OverflowType.ITERATIONS)
        if without:
            raise Refused(f"MuJoCo Warp has no room for all of a state: {mujoco_warp.OverflowType(int(without))!r}")

    def _touching(self, count: int) -> list[list[Any]]:
        """The contacts of the first worlds, in which pairs of shapes come in the order in which threads found them."""
        found, contacts = self._data.nacon.numpy()[0], self._data.contact
        names, worlds = (*CONTACT, "dim", "adhesion", "surfacevel"), contacts.worldid.numpy()[:found]
        # Before 4.0 there was no surface that moves by itself.
        columns = {name: getattr(contacts, name).numpy()[:found] for name in names if hasattr(contacts, name)}
        return [contacts_in({name: own[worlds == world] for name, own in columns.items()}) for world in range(count)]


class WarpModel(DeviceModel[ModelInWorlds]):
    """A mechanism's ``MjModel`` in worlds of Warp."""

    def mass_matrix(self, q: Array) -> Array:
        """``Data.M``."""
        model, velocities = self._compiled.model, self._compiled.addresses[1]
        found, data = np.empty((len(q), model.nv, model.nv)), mujoco.MjData(model)
        for state, own in enumerate(self._answers(mujoco_warp.forward, "M", qpos=q)):
            data.M[:] = own
            fill_mass_matrix(model, data, found[state])
        return np.ascontiguousarray(found[:, velocities][:, :, velocities])

    def bias(self, q: Array, v: Array) -> Array:
        """``Data.qfrc_bias``."""
        return self._answers(mujoco_warp.forward, "qfrc_bias", qpos=q, qvel=v)[:, self._compiled.addresses[1]]

    def gravity(self, q: Array) -> Array:
        """``Data.qfrc_bias`` at rest."""
        return self.bias(q, np.zeros((len(q), len(self._compiled.addresses[1]))))

    def inverse_dynamics(self, q: Array, v: Array, qdd: Array) -> Array:
        """``mujoco_warp.inverse``."""
        return self._answers(mujoco_warp.inverse, "qfrc_inverse", qpos=q, qvel=v, qacc=qdd)[:, self._compiled.addresses[1]]

    def _answers(self, compute: Callable[..., None], found: str, **given: Array) -> Array:
        return self._on_device.answers(compute, found, **dict(zip(given, self._compiled.own(*given.values()), strict=True)))


def load(file: ModelFile, joints: Sequence[str]) -> WarpModel:
    """See ``harness.engines.Engine.load``."""
    keep_compiled(warp)
    mujoco.set_mju_user_warning(lambda message: None)
    model = mujoco.MjModel.from_xml_string(file.text)
    rub_and_limit_alone(model, joints, file.acting)
    driven = actuators_of(model, file.driven)
    still(model, driven)
    try:
        return WarpModel(MujocoModel(model, joints, driven=driven), ModelInWorlds(model))
    except NotImplementedError as error:
        raise Unsupported(f"MuJoCo Warp: {error}") from error


def read(request: Request) -> DeviceFile:
    """A file that MuJoCo reads, in worlds of Warp; see ``harness.engines.Engine``."""
    keep_compiled(warp)
    compiled = robot.read(request)
    # Warp refuses the flag, and resets nothing.
    compiled.model.opt.disableflags &= ~int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
    if request.driven:
        still(compiled.model, request.driven)
    try:
        file = DeviceFile(compiled, on_device := ModelInWorlds(compiled.model))
    except NotImplementedError as error:
        raise Refused(f"MuJoCo Warp: {' '.join(str(error).split())}") from error
    if on_device.repeats:
        file.notes += (f"is asked twice at each state, as its connect and weld take velocities of the call before: {VELOCITIES_BEFORE}",)
    return file
