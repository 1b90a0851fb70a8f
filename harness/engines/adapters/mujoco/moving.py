"""Motions of a file by ``mujoco.mj_step``, as its user simulates it: contacts, limits, friction, equalities and actuators are on.

Source: MuJoCo documentation, Programming, simulation loop; API reference, ``mj_step``.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np

from harness.arrays import Array
from harness.engines.adapters.mujoco.causes import idle_numbers, lay_over, numbers_by_cause, rules, switches_of, words
from harness.engines.adapters.mujoco.measured import named_numbers, servos_of
from harness.engines.adapters.mujoco.model import sizes_of
from harness.engines.adapters.mujoco.robot import POINT, plain_model, refusals
from harness.engines.adapters.mujoco.versions import fill_mass_matrix, inputs_of
from harness.engines.moving import Control, HeldNumbers, MotionsRequest, Moved, MovedFile, SimulatedFile
from harness.engines.request import Refused, Request
from harness.files.joint_kinds import JointKind

_KINDS = {"FREE": JointKind.FREE, "BALL": JointKind.BALL, "SLIDE": JointKind.SLIDE, "HINGE": JointKind.HINGE}
_HALF_ULP = 2.0**-53


def held_numbers(file: MovedFile) -> HeldNumbers:
    """See ``harness.engines.Engine``."""
    model, note = _compiled(file)
    data = mujoco.MjData(model)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    controls = inputs_of(model, model.nu)[0]
    kinds = [_KINDS[mujoco.mjtJoint(int(kind)).name.removeprefix("mjJNT_")] for kind in model.jnt_type]
    return HeldNumbers(
        numbers_by_cause(model),
        {_name(model, number): kind for number, kind in enumerate(kinds)},
        data.qpos.copy(),
        data.qvel.copy(),
        {name: float(data.ctrl[controls[number]]) for number, name in enumerate(_actuators(model)) if controls[number] >= 0},
        float(model.opt.timestep),
        words()["opt_integrator"][int(model.opt.integrator)],
        words(),
        switches_of(model),
        rules(),
        servos_of(model),
        named_numbers(model),
        idle_numbers(model),
        note,
    )


def moved(request: MotionsRequest) -> Moved:
    """See ``harness.engines.Engine``."""
    compiling = compiled_file if request.as_it_stands else _without_its_meshes
    compiled = {file: compiling(file) for file in dict.fromkeys(motion.file for motion in request.motions)}
    found: list[tuple[Array, Array]] = []
    mass: Array = np.empty(0)
    for motion in request.motions:
        model = copy.copy(compiled[motion.file])
        with refusals():
            lay_over(model, motion.over)
        states, masses = _move(model, request, motion, wants_mass=request.wants_mass and not found)
        found.append(states)
        mass = masses if len(found) == 1 else mass
    q, v = (np.array([states[part] for states in found]) for part in range(2))
    return Moved(q, v, mass)


def _move(model: Any, request: MotionsRequest, motion: SimulatedFile, wants_mass: bool) -> tuple[tuple[Array, Array], Array]:
    """q (k, nq), v (k, nv) at the recorded steps, and M there, (k, nv, nv)."""
    data, (positions, velocities) = mujoco.MjData(model), tuple(map(_index, places_of(model, request.joints)))
    if model.nkey:
        # Activations, mocap bodies and joints of no motion are where the file starts.
        mujoco.mj_resetDataKeyframe(model, data, 0)
    # A state that breaks down must not begin anew.
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
    data.ctrl[:] = 0.0
    data.qpos[positions], data.qvel[velocities] = request.q, request.v
    size = len(motion.counts)
    q, v = (np.full((size, len(of)), np.nan) for of in (request.q, request.v))
    masses = np.full((size * wants_mass, len(request.v), len(request.v)), np.nan)
    generator = np.random.default_rng(motion.rounding) if motion.rounding else None
    driver = _Driver(model, data, request.control, motion, (positions, velocities))
    # The engine's own memory, which each step changes.
    own_q, own_v = data.qpos, data.qvel
    done, recorded = 0, 0
    for recorded, until in enumerate(motion.counts):
        while done < until:
            count = driver.drive(done, until if generator is None else done + 1)
            mujoco.mj_step(model, data, count)
            if generator is not None:
                _round(model, data, generator)
            done += count
        # The engine takes a control that is none for 0.
        if not (_are_finite(own_q) and _are_finite(own_v) and _are_finite(driver.given)):
            break
        q[recorded], v[recorded] = own_q[positions], own_v[velocities]
        if wants_mass:
            full = np.empty((model.nv, model.nv))
            mujoco.mj_forward(model, data)
            fill_mass_matrix(model, data, full)
            masses[recorded] = full[velocities][:, velocities]
    return (q, v), masses


def _index(places: Sequence[int]) -> Any:
    """Index of places: a slice where they follow one another, which takes a tenth of the time of a list, at each step of a motion."""
    [first, *_], count = [*places, 0], len(places)
    follow = count > 0 and [*places] == list(range(first, first + count))
    return slice(first, first + count) if follow else np.array(places, dtype=np.intp)


def _are_finite(values: Array) -> bool:
    # A reduction by ``all`` takes three times as long.
    return bool(np.count_nonzero(np.isfinite(values)) == len(values))


class _Driver:
    """The controls of one motion; ``given`` are those of the last step."""

    def __init__(self, model: Any, data: Any, control: Control, motion: SimulatedFile, places: tuple[Any, Any]) -> None:
        self._data, self._control, self._timing, self._places = data, control, motion.timing, places
        known = dict(zip(_actuators(model), inputs_of(model, model.nu)[0], strict=False))
        if lacking := [name for name in control.names if name not in known]:
            raise Refused(f"it has no actuator {lacking[0]!r}, which is controlled")
        self._inputs, self._columns = data.ctrl, _index([int(known[name]) for name in control.names])
        self._length = float(model.opt.timestep)
        times = self._timing.asked_at(np.arange(motion.counts[-1], dtype=np.float64) * self._length)
        self._times, self._table = times, control.held_at(times) if control.function is None else None
        # Of each step, the one from which other controls act.
        self._ends: list[int] = []
        if self._table is not None:
            changes = np.array([*(np.flatnonzero((self._table[1:] != self._table[:-1]).any(axis=1)) + 1), len(times)])
            self._ends = np.repeat(changes, np.diff(changes, prepend=0)).tolist()
        self._called: list[tuple[float, Array]] = []
        self.given = np.zeros(0)

    def drive(self, step: int, until: int) -> int:
        """Set the controls before a step; the number of steps before ``until`` in which they stay."""
        if not self._control.names:
            return until - step
        if self._table is None:
            self._inputs[self._columns] = self.given = self._calculated(step)
            return 1
        self._inputs[self._columns] = self.given = self._table[step]
        end = self._ends[step]
        return (end if end < until else until) - step

    def _calculated(self, step: int) -> Array:
        """The value of the function at the time of which the control acts by now."""
        now, period = step * self._length, self._timing.period
        if not self._called or not period or now >= self._called[-1][0] + period * (1 - 1e-9):
            positions, velocities = self._places
            asked = self._control.called(now, self._data.qpos[positions].copy(), self._data.qvel[velocities].copy())
            self._called.append((now if not period else round(now / period) * period, asked))
        late = self._times[step] * (1 + 1e-9) + 1e-12
        while len(self._called) > 1 and self._called[1][0] <= late:
            self._called.pop(0)
        return self._called[0][1]


def _round(model: Any, data: Any, generator: np.random.Generator) -> None:
    for values in (data.qpos, data.qvel):
        values *= 1 + generator.uniform(-1, 1, len(values)) * _HALF_ULP
    mujoco.mj_normalizeQuat(model, data.qpos)


def compiled_file(file: MovedFile) -> Any:
    """The ``MjModel`` of a file.

    Raises:
        Refused: MuJoCo does not read the file, its meshes among it, or has no such integrator.
    """
    model, note = _compiled(file)
    if note:
        raise Refused(note)
    return model


def _without_its_meshes(file: MovedFile) -> Any:
    return _compiled(file)[0]


def _compiled(file: MovedFile) -> tuple[Any, str]:
    """The ``MjModel`` of a file, and "" or that it is without meshes which are not found; geoms of these touch nothing."""
    with refusals():
        model, notes = plain_model(Request(path=file.path, format=file.format, joints=(), moving=()))
    if notes:
        points = model.geom_rbound == POINT
        model.geom_contype[points] = model.geom_conaffinity[points] = 0
    if file.integrator:
        known = {word.lower(): number for number, word in words()["opt_integrator"].items()}
        if file.integrator.lower() not in known:
            raise Refused(f"it has no integrator {file.integrator!r}; expected {', '.join(words()['opt_integrator'].values())}")
        model.opt.integrator = known[file.integrator.lower()]
    if file.length is not None:
        model.opt.timestep = file.length
    return model, f"{notes[0]}; their contacts are left out" if notes else ""


def _name(model: Any, number: int) -> str:
    return str(model.joint(number).name or f"joint {number}")


def _actuators(model: Any) -> list[str]:
    return [model.actuator(number).name or f"actuator {number}" for number in range(len(model.actuator_group))]


def places_of(model: Any, joints: Sequence[str]) -> tuple[list[int], list[int]]:
    """Positions and velocities of joints in MuJoCo's own q and v."""
    by_name = {_name(model, number): model.joint(number) for number in range(model.njnt)}
    positions, velocities = list[int](), list[int]()
    for name in joints:
        joint = by_name[name]
        nq, nv = sizes_of(joint)
        positions += range(joint.qposadr[0], joint.qposadr[0] + nq)
        velocities += range(joint.dofadr[0], joint.dofadr[0] + nv)
    return positions, velocities
