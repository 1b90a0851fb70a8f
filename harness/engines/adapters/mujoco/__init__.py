"""MuJoCo's ``mj_forward`` on an MJCF or URDF model, many states at a time through ``mujoco.batch.Batch``.

Applied forces go through ``qfrc_applied``. Automatic reset is switched off at load: with it, a batch
answers a state beyond 1e10 with the rest state's accelerations and no error. What MuJoCo's reader of URDF passes
over is supplied to it by ``harness.engines.adapters.mujoco.urdf``.

Its constraints are soft: what it solves instead of rigid ones is documented, and follows from the file
(``harness.engines.adapters.mujoco.law``). Solver, iterations and tolerance are those of the file.

Source: MuJoCo documentation, Computation; Python bindings, ``mujoco.batch``.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.engines import ConstraintLaw, Engine, HeldModel, LoadedModel, StepRule, Terms
from harness.engines.adapters.mujoco import equalities, held, law, robot, steps, urdf, versions
from harness.engines.adapters.mujoco.quantities import MujocoQuantities
from harness.engines.request import Request
from harness.files.equalities import Equality
from harness.models.model_file import ModelFile


class MujocoModel(MujocoQuantities):
    """An ``MjModel`` and the batch that runs it; ``building`` is Python text that makes it of the spec of a URDF."""

    def __init__(self, model: Any, joints: Sequence[str], building: str | None = None) -> None:
        self.model = model
        self._building = building
        self._joints = joints
        self._batch: Any = None

    def loaded(self) -> LoadedModel:
        import mujoco

        model = self.model
        sizes = {mujoco.mjtJoint.mjJNT_FREE: (7, 6), mujoco.mjtJoint.mjJNT_BALL: (4, 3)}
        joints = {model.joint(i).name: sizes.get(mujoco.mjtJoint(int(model.jnt_type[i])), (1, 1)) for i in range(model.njnt)}
        moving = model.body_weldid != 0
        gravity = held.gravity_of(model).tolist()
        return LoadedModel(joints, (gravity[0], gravity[1], gravity[2]), float(model.body_mass[moving].sum()))

    def held(self, positions: Mapping[str, float] | None = None, steps: Mapping[str, Sequence[float]] | None = None) -> HeldModel:
        return held.held(self.model, positions or {}, steps or {})

    @cached_property
    def addresses(self) -> tuple[list[int], list[int]]:
        """Position and velocity addresses of the joints, in their order."""
        held = self.loaded().joints
        positions: list[int] = []
        velocities: list[int] = []
        for name in dict.fromkeys(self._joints):
            joint = self.model.joint(name)
            positions += range(int(joint.qposadr[0]), int(joint.qposadr[0]) + held[name][0])
            velocities += range(int(joint.dofadr[0]), int(joint.dofadr[0]) + held[name][1])
        return positions, velocities

    def forward_dynamics(self, q: Array, v: Array, tau: Array) -> Array:
        if self._batch is None or self._batch.nsim != len(q):
            self._batch = versions.batch(self.model, len(q))
        positions, velocities = self.addresses
        self._batch.bind("qpos")[:, positions] = q
        self._batch.bind("qvel")[:, velocities] = v
        self._batch.bind("qfrc_applied")[:, velocities] = tau
        if self.model.neq:
            # A solver that starts from the last answer would make this one depend on it.
            self._batch.bind("qacc_warmstart")[:] = 0.0
        accelerations = self._batch.bind("qacc")
        self._batch.forward()
        return np.ascontiguousarray(accelerations[:, velocities])

    def gaps(self, q: Array) -> dict[str, Array]:
        """``efc_pos`` of each equality; see ``harness.engines``."""
        import mujoco

        # A diagnosis asks hundreds of models; of those without equalities positions would be computed for nothing.
        if not self.model.neq:
            return {}
        data, rows = mujoco.MjData(self.model), list[Array]()
        for position in q:
            data.qpos[self.addresses[0]] = position
            mujoco.mj_fwdPosition(self.model, data)
            owners = np.where(data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY, data.efc_id, -1)
            rows.append(data.efc_pos.copy())
        return {self.model.equality(one).name: np.array(rows)[:, owners == one] for one in range(self.model.neq)} if rows else {}

    def reactions(self, q: Array, v: Array, tau: Array) -> Array:
        """See ``harness.engines.interface``: ``cfrc_int`` of ``mj_rnePostConstraint``, what a body's parent does to it.

        It stands as (moment, force) along the world's axes, about the centre of mass of the whole tree that the body is in.
        Spatial tendons and equality constraints pull at bodies from outside. The solver of constraints goes on until nothing improves: by
        its default tolerance of 1e-8 it leaves forces out of balance by what accelerations hardly feel, and moments about the hinges of
        light bodies by up to 4600 data roundoffs (Andrews' squeezer).
        Source: MuJoCo documentation, API reference, ``mj_rnePostConstraint``, and ``mjData.cfrc_int``; XML reference, option, tolerance.
        """
        import mujoco

        model, (positions, velocities) = copy.copy(self.model), self.addresses
        model.opt.tolerance = 0.0
        data = mujoco.MjData(model)
        bodies = self._bodies
        found = np.empty((len(q), len(bodies), 6))
        for state in range(len(q)):
            data.qpos[positions], data.qvel[velocities], data.qfrc_applied[velocities] = q[state], v[state], tau[state]
            mujoco.mj_forward(model, data)
            mujoco.mj_rnePostConstraint(model, data)
            moments, forces = np.split(data.cfrc_int[bodies], 2, axis=1)
            found[state, :, :3] = forces
            found[state, :, 3:] = moments + np.cross(data.subtree_com[model.body_rootid[bodies]] - self.anchors(data), forces)
        return found

    def step(self, q: Array, v: Array, tau: Array, length: float, integrator: str) -> Array:
        """See ``harness.engines.interface`` and ``harness.engines.adapters.mujoco.steps``."""
        return steps.step(copy.copy(self.model), self.addresses, (q, v, tau), length, integrator, 1)

    def terms(self, q: Array, v: Array, tau: Array) -> Terms:
        """Terms as MuJoCo computes them: M of composite rigid bodies with armature, passive of springs, dampers, tendons
        and constraints.

        Gravity is the bias force at rest, velocity the bias force without gravity, so that neither is what is left of a difference.
        Source: MuJoCo documentation, Computation, general framework: M v' + c = tau + J' f; API reference, ``mj_fullM``.
        """
        import mujoco

        model, (positions, velocities) = self.model, self.addresses
        weightless = copy.copy(model)
        weightless.opt.gravity[:] = 0.0
        data, without_gravity = mujoco.MjData(model), mujoco.MjData(weightless)
        mass, (velocity, gravity, passive, applied) = np.empty((len(q), model.nv, model.nv)), np.empty((4, len(q), model.nv))
        for state in range(len(q)):
            for each in (data, without_gravity):
                each.qpos[positions], each.qvel[velocities], each.qfrc_applied[velocities] = q[state], v[state], tau[state]
                mujoco.mj_forward(each.model, each)
            versions.fill_mass_matrix(model, data, mass[state])
            applied[state], velocity[state] = data.qfrc_applied, without_gravity.qfrc_bias
            passive[state] = data.qfrc_passive + data.qfrc_constraint
            data.qvel[:] = 0.0
            mujoco.mj_forward(model, data)
            gravity[state] = data.qfrc_bias
        vectors = (np.ascontiguousarray(vector[:, velocities]) for vector in (velocity, gravity, passive, applied))
        return Terms(np.ascontiguousarray(mass[:, velocities][:, :, velocities]), *vectors)

    def reproducer(self, source: str, q: Array, v: Array, tau: Array, certified: Array) -> str:
        """See ``harness.hard.reproducer``."""
        positions, velocities = self.addresses
        own = [np.zeros(size) for size in (self.model.nq, *[self.model.nv] * 3)]
        for values, places, given in zip(own, (positions, *[velocities] * 3), (q, v, tau, certified), strict=True):
            values[places] = given
        qpos, qvel, applied, expected = (values.tolist() for values in own)
        read = f"m = mujoco.MjModel.from_xml_string({source})"
        if self._building is not None:
            # The reader of URDF passes over springs, armatures and more; they are set in its spec.
            read = f"s = mujoco.MjSpec.from_string({source}); {self._building}"
        return (
            f"import mujoco; {read}; d = mujoco.MjData(m)\n"
            f"d.qpos[:], d.qvel[:], d.qfrc_applied[:] = {qpos}, {qvel}, {applied}\n"
            f"mujoco.mj_forward(m, d); print(d.qacc.tolist(), {expected}, sep='\\n')  # engine, certified\n"
        )


class MujocoEngine(Engine):
    requires = ("mujoco", "mujoco")
    formats = ("mjcf", "urdf")
    oldest: Mapping[str, str] = dict.fromkeys(formats, "3.3.0")
    factorises_mass_matrix = True
    supplied: Mapping[str, str] = {
        "urdf": (
            "gravity, springs and rotor inertias of joints, springs between points and a ball joint are supplied from the file, "
            "and each link keeps its own inertia"
        ),
        "mjcf": "its reader takes what the file holds; nothing is supplied",
    }
    takes_inertias_about_tree = True
    call: Mapping[str, str] = dict.fromkeys(
        formats,
        "m = mujoco.MjModel.from_xml_path(PATH); m.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT; mujoco.mj_forward(m, d)",
    )

    def read(self, request: Request) -> robot.MujocoFile:
        return robot.read(request)

    def load_model(self, file: ModelFile, joints: Sequence[str], gravity: float) -> MujocoModel:
        import mujoco

        # The default handler writes a log file into the current directory.
        mujoco.set_mju_user_warning(lambda message: None)
        if file.format == "urdf":
            compiled, building = urdf.read(file, gravity, joints)
            return MujocoModel(compiled, joints, building)
        model = versions.read_mjcf(file)
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
        return MujocoModel(model, joints)

    def constraint_laws(self, file: ModelFile) -> Mapping[str, ConstraintLaw]:
        """See ``harness.engines.adapters.mujoco.law``."""
        return law.constraint_laws(file)

    def step_rules(self, file: ModelFile) -> tuple[StepRule, ...]:
        """See ``harness.engines.adapters.mujoco.steps``."""
        return steps.step_rules(file)

    def laws(self, root: Any, model_format: str, constraints: Sequence[Equality]) -> Mapping[str, ConstraintLaw]:
        return law.laws_in(equalities.settings(root, model_format), constraints)

    def fuses(self, root: Any, model_format: str) -> bool:
        return equalities.fuses(root, model_format)

    def own_rules(self, root: Any, model_format: str) -> Sequence[StepRule]:
        return steps.rules_in(equalities.settings(root, model_format))


ENGINE = MujocoEngine()
