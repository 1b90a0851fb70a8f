"""MuJoCo as its user calls it: ``mujoco.MjModel.from_xml_path``, then ``mujoco.mj_forward``.

What acts by constraints (limits, contacts, friction loss, and equalities that are not asked for) is off, and so are actuators and the
fluid. Meshes that are not beside the file are taken out with their geoms, and the answer says so.

Source: MuJoCo documentation, Modeling, URDF extensions; API reference, ``mjtDisableBit``.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.engines.adapters.mujoco.model import MujocoModel
from harness.engines.adapters.mujoco.robot_model import PARTS, aided, places_of, plain
from harness.engines.adapters.mujoco.steps import step
from harness.engines.adapters.mujoco.versions import fill_mass_matrix
from harness.engines.coordinates import multiplied, of_linear, rotations
from harness.engines.loaded_file import LoadedFile
from harness.engines.request import AskedJoint, Refused, Request, by_joint, projected
from harness.files.joint_kinds import JointKind
from harness.files.rules import StepRule

# Tags of a file by the names of MuJoCo's types of equality, where they are others.
_TYPES = {"mimic": "joint"}
_ELEMENT = re.compile(r"Element name '([^']*)'")


def read(request: Request) -> MujocoFile:
    """A file as its user loads it, or aided; see ``harness.engines.Engine``."""
    import mujoco

    # The default handler writes a log file into the current directory.
    mujoco.set_mju_user_warning(lambda message: None)
    try:
        model, notes = plain(request) if request.aid is None else aided(request, request.aid)
        if request.held is not None:
            switch_on(model, request.held.kinds, request.held.switched_on)
    except ValueError as error:
        words = " ".join(str(error).split())
        named = _ELEMENT.search(words)
        raise Refused(words, named[1] if named else "") from error
    return MujocoFile(model, request, notes)


def switch_on(model: Any, kinds: Sequence[str], numbers: Sequence[int]) -> None:
    """Let the equalities of these numbers act and no other; ``kinds`` are the tags of all that the file holds.

    Raises:
        ValueError: the compiled model has others.
    """
    import mujoco

    found = [mujoco.mjtEq(int(one)).name.removeprefix("mjEQ_").lower() for one in model.eq_type]
    wanted = [_TYPES.get(kind, kind) for kind in kinds]
    if found != wanted:
        raise ValueError(f"MuJoCo makes the equalities {', '.join(found) or 'none'} of the file's {', '.join(wanted)}")
    model.eq_active0[:] = 0
    model.eq_active0[list(numbers)] = 1


class MujocoFile(LoadedFile):
    """An ``MjModel`` with the joints of a request."""

    def __init__(self, model: Any, request: Request, notes: Sequence[str]) -> None:
        import mujoco

        flags = mujoco.mjtDisableBit
        for flag in (flags.mjDSBL_CONTACT, flags.mjDSBL_ACTUATION, flags.mjDSBL_SENSOR, flags.mjDSBL_AUTORESET):
            model.opt.disableflags |= flag
        others = flags.mjDSBL_LIMIT | flags.mjDSBL_FRICTIONLOSS
        model.opt.disableflags |= flags.mjDSBL_CONSTRAINT if request.held is None else others
        model.opt.density = model.opt.viscosity = 0.0
        places = places_of(model, request.joints)
        super().__init__(request, places)
        self.notes = tuple(notes)
        parts = [range(places[joint.name].id, places[joint.name].id + PARTS.get(joint.kind, 1)) for joint in self.found]
        self.compiled = MujocoModel(model, parts)
        read = {number for numbers in parts for number in numbers}
        self.further = tuple(f"joint {number}" for number in range(model.njnt) if number not in read)

    @property
    def model(self) -> Any:
        return self.compiled.model

    @property
    def addresses(self) -> tuple[list[int], list[int]]:
        return self.compiled.addresses

    @property
    def quantities(self) -> MujocoModel:
        return self.compiled

    def advanced(self, q: Array, v: Array, rule: StepRule, steps: int) -> tuple[Array, Array]:
        states = q[self.q_columns][None], v[self.v_columns][None], np.zeros((1, len(self.v_columns)))
        after = step(self.model, self.addresses, states, rule.length, rule.name, steps)[0]
        q, v = q.copy(), v.copy()
        q[self.q_columns], v[self.v_columns] = np.split(after, [len(self.q_columns)])
        return q, v

    def prepare(self, q: Array, v: Array, tau: Array) -> MujocoRun:
        q, v, tau = _in_the_world(self.request.joints, q, v, tau)
        return MujocoRun(self, q[:, self.q_columns], v[:, self.v_columns], tau[:, self.v_columns])


class MujocoRun:
    """States in MuJoCo's own q and v; of joints that the request does not name, those of its default state.

    Attributes:
        rows: q, v and forces of each state. found: accelerations of each, (n, nv), or with couplings of the joints that move by themselves.
    """

    def __init__(self, loaded: MujocoFile, q: Array, v: Array, tau: Array) -> None:
        import mujoco

        model = loaded.model
        self._loaded, self._data = loaded, mujoco.MjData(model)
        configuration = np.tile(self._data.qpos, (len(q), 1))
        velocity, force = np.zeros((len(q), model.nv)), np.zeros((len(q), model.nv))
        positions, self._velocities = loaded.addresses
        configuration[:, positions], velocity[:, self._velocities], force[:, self._velocities] = q, v, tau
        self.rows = list(zip(configuration, velocity, force, strict=True))
        couplings = loaded.couplings
        self.found = np.full((len(q), model.nv if couplings is None else couplings.shape[1]), np.nan)

    def compute(self) -> None:
        import mujoco

        model, data, found, couplings = self._loaded.model, self._data, self.found, self._loaded.couplings
        qpos, qvel, applied, accelerations = data.qpos, data.qvel, data.qfrc_applied, data.qacc
        for state, (q, v, force) in enumerate(self.rows):
            qpos[:], qvel[:], applied[:] = q, v, force
            # A solver that starts from the last answer would make this one depend on it.
            data.qacc_warmstart[:] = 0.0
            mujoco.mj_forward(model, data)
            found[state] = accelerations if couplings is None else _coupled(model, data, self._velocities, couplings)

    def accelerations(self) -> Array:
        found = self.found[:, self._velocities] if self._loaded.couplings is None else self.found
        columns = by_joint(self._loaded.joints, found)
        return np.hstack([np.empty((len(found), 0)), *(_from_the_world(joint, columns[joint.name]) for joint in self._loaded.joints)])


def _in_the_world(joints: Sequence[AskedJoint], q: Array, v: Array, tau: Array) -> tuple[Array, Array, Array]:
    """q, v and tau with free joints measured in the world, wherever the file measures them from."""
    q, v, tau = q.copy(), v.copy(), tau.copy()
    for joint in joints:
        if joint.kind == JointKind.FREE:
            turn, rotation = np.array(joint.turn), rotations(np.array([joint.turn]))[0]
            position, orientation = joint.positions[:3], joint.positions[3:]
            q[:, position] = np.array(joint.shift) + q[:, position] @ rotation.T
            q[:, orientation] = multiplied(turn, q[:, orientation])
            v[:, joint.velocities], tau[:, joint.velocities] = (of_linear(rotation, x[:, joint.velocities]) for x in (v, tau))
    return q, v, tau


def _from_the_world(joint: AskedJoint, accelerations: Array) -> Array:
    """Accelerations of a joint, those of a free joint measured as its file does."""
    if joint.kind != JointKind.FREE:
        return accelerations
    return np.asarray(of_linear(rotations(np.array([joint.turn]))[0].T, accelerations))


def _coupled(model: Any, data: Any, velocities: Sequence[int], couplings: Array) -> Array:
    """Accelerations of the joints that move by themselves, from MuJoCo's own M and forces."""

    mass = np.empty((model.nv, model.nv))
    fill_mass_matrix(model, data, mass)
    force = data.qfrc_passive + data.qfrc_applied - data.qfrc_bias
    return projected(mass[np.ix_(velocities, velocities)], force[velocities], couplings)
