"""A file that MuJoCo has read, in a program that computes with its ``MjModel`` elsewhere, as MuJoCo XLA and MuJoCo Warp do."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import SimpleNamespace
from typing import Any, Generic, Protocol, TypeVar

import mujoco
import numpy as np

from harness.arrays import Array
from harness.engines import HeldModel, LoadedModel
from harness.engines.adapters.mujoco.acting import placed_controls
from harness.engines.adapters.mujoco.contacts import found_contacts, shapes_that_touch
from harness.engines.adapters.mujoco.model import MujocoModel
from harness.engines.adapters.mujoco.robot import MujocoFile
from harness.engines.loaded_file import EngineRun, LoadedFile

# What contacts of devices share with ``mjContact``, beside the number of their directions.
CONTACT = ("dist", "pos", "frame", "geom", "includemargin", "friction", "solref", "solreffriction", "solimp")


class OnDevice(Protocol):
    """An ``MjModel`` there.

    Attributes:
        contacts: of each state that was asked last, with the fields of ``mjContact``; none where they are off.
        touches_as_mujoco: whether they are meant to be in the points in which MuJoCo has them.
    """

    contacts: Sequence[Sequence[Any]]
    touches_as_mujoco: bool

    def accelerations(self, qpos: Array, qvel: Array, applied: Array, *driving: Array) -> Array:
        """(n, nv) at MuJoCo's own positions (n, nq), velocities and applied forces (n, nv); controls and activations where it drives."""
        ...


_Device = TypeVar("_Device", bound=OnDevice)


class DeviceModel(Generic[_Device]):
    """The ``MjModel`` that the file of a mechanism compiles to, and the same on the device."""

    def __init__(self, compiled: MujocoModel, on_device: _Device) -> None:
        self.takes_driving, self._compiled, self._on_device = bool(compiled.driven), compiled, on_device

    def loaded(self) -> LoadedModel:
        return self._compiled.loaded()

    def held(self, positions: Mapping[str, float] | None = None, steps: Mapping[str, Sequence[float]] | None = None) -> HeldModel:
        """The ``MjModel``'s numbers, which are put on the device."""
        return self._compiled.held(positions, steps)

    @property
    def is_tied(self) -> bool:
        """See ``harness.engines``."""
        return self._compiled.is_tied

    def gaps(self, q: Array) -> dict[str, Array]:
        """See ``harness.engines``; by MuJoCo itself, from the same ``MjModel``."""
        return self._compiled.gaps(q)

    def forward_dynamics(self, q: Array, v: Array, tau: Array, *driving: Array) -> Array:
        given = (placed_controls(self._compiled.model, self._compiled.driven, len(q), driving[0]), np.empty((len(q), 0))) if driving else ()
        return self._on_device.accelerations(*self._compiled.own(q, v, tau), *given)[:, self._compiled.addresses[1]]


class DeviceFile(LoadedFile):
    """A file that MuJoCo has read, on the device; conventions are MuJoCo's."""

    def __init__(self, compiled: MujocoFile, on_device: OnDevice) -> None:
        super().__init__(compiled.request, [joint.name for joint in compiled.found])
        self._compiled, self._on_device, self.notes = compiled, on_device, compiled.notes

    def forward_dynamics(self, q: Array, v: Array, tau: Array) -> Array:
        return self.driven_dynamics(q, v, tau)

    def driven_dynamics(self, q: Array, v: Array, tau: Array, *driving: Array) -> Array:
        run = DeviceRun(self._compiled.prepare(q, v, tau, *driving), self._on_device)
        run.compute()
        self.contacts = [found_contacts(self._compiled.model, own) for own in self._on_device.contacts]
        self.shapes = shapes_that_touch(self._compiled.model) if self.contacts and self._on_device.touches_as_mujoco else []
        return run.accelerations()

    def settled(self, v: Array, steps: Sequence[int]) -> tuple[Array, Array]:
        """See ``LoadedFile``; by MuJoCo itself, as any way to states at which bodies touch will do."""
        return self._compiled.settled(v, steps)

    def prepare(self, q: Array, v: Array, tau: Array) -> DeviceRun:
        return DeviceRun(self._compiled.prepare(q, v, tau), self._on_device)


class DeviceRun(EngineRun):
    """MuJoCo's run, computed on the device."""

    def __init__(self, run: EngineRun, on_device: OnDevice) -> None:
        super().__init__(run.loaded, run.own, run.evaluate, run.in_file)
        self._on_device = on_device

    def compute(self) -> None:
        own = self.own if self.loaded.request.driven else self.own[:3]
        self.found[:] = self._on_device.accelerations(*own)


def still(model: Any, driven: Sequence[int]) -> None:
    """Have all actuators but these give no force: no group of actuators is switched off there."""
    off = [number for number in range(model.nu) if number not in driven]
    model.actuator_gainprm[off], model.actuator_biasprm[off] = 0.0, 0.0
    # Numbers alone: with another type XLA and Warp compile anew.
    muscles = [number for number in off if model.actuator_gaintype[number] > int(mujoco.mjtGain.mjGAIN_AFFINE)]
    model.actuator_gaintype[muscles], model.actuator_biastype[muscles] = mujoco.mjtGain.mjGAIN_FIXED, mujoco.mjtBias.mjBIAS_NONE


def contacts_in(columns: Mapping[str, Array]) -> list[SimpleNamespace]:
    """Contacts one by one, of arrays of each of their fields."""
    own = {**columns, "frame": columns["frame"].reshape(-1, 9)}
    return [SimpleNamespace(**dict(zip(own, values, strict=True))) for values in zip(*own.values(), strict=True)]


def in_blocks(values: Array, size: int) -> list[tuple[Array, int]]:
    """Rows in blocks of one size, and how many of each are theirs; one that is not full repeats its first, as zeros are no quaternion."""
    blocks = [values[start : start + size] for start in range(0, len(values), size)]
    return [(np.concatenate([one, np.repeat(one[:1], size - len(one), axis=0)]), len(one)) for one in blocks]
