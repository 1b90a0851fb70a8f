"""A file that Newton has read, in MuJoCo Warp as ``SolverMuJoCo`` converts it: ``mujoco_warp.forward`` in blocks of states.

Its positions, velocities and forces are MuJoCo's, in worlds that it has made itself: what it converts of Newton's model is judged, and not
what Newton's ``State`` becomes of them. The importer takes the second site of a connect for its body alone,
docs/issues/newton-mjcf-connect-by-sites.md.

Source: Newton documentation, ``SolverMuJoCo`` and its page MuJoCo; its sources of 1.8.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import mujoco
import newton
import numpy as np
import warp

from harness.arrays import Array
from harness.engines.adapters.mujoco.acting import held_of, switch_on
from harness.engines.adapters.mujoco.on_device import DeviceFile
from harness.engines.adapters.mujoco.robot import MujocoFile
from harness.engines.adapters.mujoco_warp.device import BLOCK, ModelInWorlds, WarpModel
from harness.engines.adapters.newton.worlds import Joined, read_by, starts_of
from harness.engines.interface import LoadedModel, Unsupported
from harness.engines.request import AskedJoint, Held, Refused, Request, SolverSettings
from harness.engines.tree_request import model_request
from harness.files.model_file import ModelFile

# Beyond which Newton takes a limit for none, newton.MAXVAL.
_NO_LIMIT = 1e10
_NOTHING_HELD = Held((), ())


class SolverFile(DeviceFile):
    """A file that Newton has read, in ``BLOCK`` equal worlds of its ``SolverMuJoCo``; raises Refused."""

    def __init__(self, request: Request, robot: Any, joined: Joined) -> None:
        if request.couplings is not None:
            raise Refused("SolverMuJoCo ties joints that mimic others by soft constraints, and the harness eliminates none of them there")
        if request.aid is not None and request.aid.springs and request.format != "mjcf":
            raise Refused("the harness supplies SolverMuJoCo with no springs between points")
        starts, held = starts_of(robot, joined), request.held or _NOTHING_HELD
        if held.limited and request.format == "urdf":
            raise Refused("SolverMuJoCo pushes joints of a URDF back from their limits by gains of Newton's own, which no URDF gives")
        _rub_and_limit(robot, request.joints, starts, held)
        if request.aid is not None:
            # They bound actuators, which are off, and SolverMuJoCo takes no effort of zero.
            robot.joint_effort_limit = [_NO_LIMIT] * robot.joint_dof_count
        scene = newton.ModelBuilder()
        newton.solvers.SolverMuJoCo.register_custom_attributes(scene)
        scene.replicate(robot, BLOCK)
        with warp.ScopedDevice("cpu"), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            model = scene.finalize(skip_validation_inertia=request.aid is not None)
            if request.aid is not None:
                model.set_gravity(request.aid.gravity)
                if request.format == "urdf":
                    model.joint_armature.assign(np.tile(_armature(request, robot, starts), BLOCK))
            try:
                solver = newton.solvers.SolverMuJoCo(model, **_settings(held.solver))
            except (ValueError, NotImplementedError, RuntimeError) as error:
                raise Refused(f"SolverMuJoCo: {' '.join(str(error).split())}") from error
        compiled, on_device = solver.mj_model, solver.mjw_model
        switch_on(compiled, held.kinds, held.switched_on)
        velocities = solver.mjc_dof_to_newton_dof.numpy()[0].tolist()
        places = {name: compiled.joint(compiled.dof_jntid[velocities.index(start)]) for name, (_, start) in starts.items()}
        read = MujocoFile(compiled, request, (), places)
        on_device.opt.disableflags |= compiled.opt.disableflags | int(mujoco.mjtDisableBit.mjDSBL_ACTUATION)
        with warp.ScopedDevice("cpu"):
            solver.mjw_data.eq_active.assign(np.tile(compiled.eq_active0.astype(bool), (BLOCK, 1)))
        super().__init__(read, worlds := ModelInWorlds(compiled, (on_device, solver.mjw_data)))
        self._model = WarpModel(read.placed, worlds)
        # Of a URDF the importer reads no springs.
        self.applies_dampers, self.applies_springs = True, request.format == "mjcf"

    def loaded(self) -> LoadedModel:
        own = self._model.loaded()
        return replace(own, joints={joint.name: joint.kind.sizes for joint in self.found})

    def forward_dynamics(self, q: Array, v: Array, tau: Array) -> Array:
        return super().forward_dynamics(q, v, tau + self.supplied(q, v))

    @property
    def quantities(self) -> WarpModel:
        return self._model

    def mass_matrix(self, q: Array) -> Array:
        return self._model.mass_matrix(q)

    def bias(self, q: Array, v: Array) -> Array:
        return self._model.bias(q, v)

    def gravity(self, q: Array) -> Array:
        return self._model.gravity(q)

    def inverse_dynamics(self, q: Array, v: Array, qdd: Array) -> Array:
        return self._model.inverse_dynamics(q, v, qdd)


def read(request: Request) -> SolverFile:
    """See ``harness.engines.Engine.read``."""
    return read_by(request, _builder, SolverFile)


def load(file: ModelFile, joints: Sequence[str], gravity: float) -> SolverFile:
    """See ``harness.engines.Engine.load``."""
    request = model_request(file, joints, gravity)
    try:
        return read(replace(request, held=held_of(file.acting)) if file.acting else request)
    except Refused as refusal:
        raise (ValueError if file.format == "mjcf" else Unsupported)(str(refusal)) from refusal


def _builder() -> Any:
    """One that takes from a file what is of ``SolverMuJoCo`` alone."""
    builder = newton.ModelBuilder()
    newton.solvers.SolverMuJoCo.register_custom_attributes(builder)
    return builder


def _rub_and_limit(robot: Any, joints: tuple[AskedJoint, ...], starts: Mapping[str, tuple[int, int]], held: Held) -> None:
    """Let those joints and tendons rub and be limited that are ``held``, and no other."""
    names = {starts[joint.name][1]: f"joint {joint.name}" for joint in joints if joint.name in starts and joint.kind.is_single}
    for dof in range(robot.joint_dof_count):
        if names.get(dof) not in held.rubbing:
            robot.joint_friction[dof] = 0.0
        if names.get(dof) not in held.limited:
            robot.joint_limit_lower[dof], robot.joint_limit_upper[dof] = -_NO_LIMIT, _NO_LIMIT
    labels, friction, limited = (robot.custom_attributes[f"mujoco:tendon_{name}"].values for name in ("label", "frictionloss", "limited"))
    for tendon, label in enumerate(labels or ()):
        name = f"tendon {label or f'(tendon {tendon + 1})'}"
        if name not in held.rubbing:
            friction[tendon] = 0.0
        if name not in held.limited:
            limited[tendon] = 0


def _armature(request: Request, robot: Any, starts: Mapping[str, tuple[int, int]]) -> Array:
    """(nv,) rotor inertias that are supplied, in Newton's order."""
    assert request.aid is not None
    found = np.zeros(robot.joint_dof_count, dtype=np.float32)
    for joint in request.joints:
        if joint.name in starts:
            found[starts[joint.name][1] :][: len(joint.velocities)] = request.aid.armature[list(joint.velocities)]
    return found


def _settings(solver: SolverSettings | None) -> dict[str, Any]:
    """Arguments of ``SolverMuJoCo``."""
    # Roots that nobody makes kinematic need no weld.
    found: dict[str, Any] = {"disable_contacts": True, "density": 0.0, "viscosity": 0.0, "kinematic_switchable_roots": False}
    if solver is not None:
        given = {
            "solver": solver.method.lower(),
            "iterations": solver.iterations,
            "tolerance": solver.tolerance,
            "jacobian": solver.jacobian or None,
            "ls_iterations": solver.line_search,
        }
        found |= {name: value for name, value in given.items() if value is not None}
    return found
