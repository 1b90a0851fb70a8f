"""A file that Newton has read, in MuJoCo Warp as ``SolverMuJoCo`` converts it: ``mujoco_warp.forward`` in blocks of states.

Its positions, velocities and forces are MuJoCo's, in worlds that it has made itself: what it converts of Newton's model is judged, and not
what Newton's ``State`` becomes of them.

What is lost before MuJoCo Warp: docs/issues/newton-mjcf-connect-by-sites.md, docs/issues/newton-mjcf-tendons-lose-joints.md, and inverse
weights, docs/issues/mujoco-warp-set-const-inverse-weights.md.

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
from harness.engines.adapters.mujoco import law
from harness.engines.adapters.mujoco.acting import held_of, switch_on
from harness.engines.adapters.mujoco.on_device import DeviceFile
from harness.engines.adapters.mujoco.robot import MujocoFile
from harness.engines.adapters.mujoco_warp.device import BLOCK, MOST_CONTACTS, MOST_ROWS, ModelInWorlds, WarpModel
from harness.engines.adapters.newton.importing import Joined, armature_of, read_by, sanitized, starts_of
from harness.engines.interface import LoadedModel, Unsupported
from harness.engines.reading import elements_of
from harness.engines.request import AskedJoint, Held, Refused, Request
from harness.engines.tree_request import model_request
from harness.files.contacts import FoundContact
from harness.files.model_file import ModelFile
from harness.files.tree import WORLD

# Beyond which Newton takes a limit for none, newton.MAXVAL.
_NO_LIMIT = 1e10
_NOTHING_HELD = Held((), ())
# Number of an actuator that is not in the file: the last column of controls, which is zero.
_NO_ACTUATOR = -1


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
        solver = _solver_of(request, robot, starts, held)
        compiled, on_device = solver.mj_model, solver.mjw_model
        switch_on(compiled, held.kinds, held.switched_on)
        velocities = solver.mjc_dof_to_newton_dof.numpy()[0].tolist()
        places = {name: compiled.joint(compiled.dof_jntid[velocities.index(start)]) for name, (_, start) in starts.items()}
        read = MujocoFile(compiled, request, (), places)
        on_device.opt.disableflags |= compiled.opt.disableflags
        # Which users pass to each step: the least time constants of constraints follow from it.
        compiled.opt.timestep = law.time_step(elements_of(request))
        on_device.opt.timestep.fill_(compiled.opt.timestep)
        self._actuators = _actuators(solver, robot)
        if not {*held.actuators} <= {*self._actuators}:
            raise Refused("it makes no actuator of one of the file")
        with warp.ScopedDevice("cpu"):
            solver.mjw_data.eq_active.assign(np.tile(compiled.eq_active0.astype(bool), (BLOCK, 1)))
            _still(on_device, [place for place, number in enumerate(self._actuators) if number not in held.actuators])
        super().__init__(read, worlds := ModelInWorlds(compiled, (on_device, solver.mjw_data)))
        # Its shapes have parameters that Newton has converted: contacts are taken as they are found.
        worlds.touches_as_mujoco = False
        self._bodies = _names_of_bodies(solver, robot, request)
        self._model = WarpModel(read.placed, worlds)
        # Of a URDF the importer reads no springs.
        self.applies_dampers, self.applies_springs = True, request.format == "mjcf"

    def loaded(self) -> LoadedModel:
        own = self._model.loaded()
        return replace(own, joints={joint.name: joint.kind.sizes for joint in self.found})

    @property
    def takes_driving(self) -> bool:
        """See ``harness.engines``."""
        return bool(self.request.driven)

    def forward_dynamics(self, q: Array, v: Array, tau: Array, *driving: Array) -> Array:
        """See ``LoadedFile``; of a mechanism, with controls of the actuators that act, in their order."""
        return self.driven_dynamics(q, v, tau, *(self._of_all(own, self.request.driven) for own in driving))

    def driven_dynamics(self, q: Array, v: Array, tau: Array, *driving: Array) -> Array:
        own = (self._of_all(one, range(one.shape[1]))[:, self._actuators] for one in driving)
        found = super().driven_dynamics(q, v, tau + self.supplied(q, v), *own)
        self.contacts = [tuple(map(self._in_file, those)) for those in self.contacts]
        return found

    def _in_file(self, contact: FoundContact) -> FoundContact:
        """A contact with the names that bodies have in the file."""
        first, second = (self._bodies.get(body, "") for body in contact.bodies)
        why_not = contact.why_not or ("" if first and second else "is of a body without a name")
        return replace(contact, bodies=(first, second), why_not=why_not, shapes=("", ""))

    def _of_all(self, own: Array, numbers: Sequence[int]) -> Array:
        """(n, actuators of the file and one more), of those with these numbers; 0 of all others."""
        found = np.zeros((len(own), 2 + max([*self._actuators, *numbers], default=-1)))
        found[:, list(numbers)] = own
        return found

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
    return read_by(request, _builder, SolverFile, with_equalities=request.held is not None)


def load(file: ModelFile, joints: Sequence[str], gravity: float) -> SolverFile:
    """See ``harness.engines.Engine.load``."""
    request, names = model_request(file, joints, gravity), [name for name, _ in file.actuators]
    held = replace(held_of(file.acting), actuators=tuple(names.index(name) for name in file.driven))
    try:
        return read(replace(request, held=held) if file.acting or file.driven else request)
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


def _names_of_bodies(solver: Any, robot: Any, request: Request) -> dict[str, str]:
    """The names that bodies of the solver have in the file, by their own; none of a body that has no name there."""
    elements = elements_of(request).iter("body", "link")
    in_file = {sanitized(name, request.format): name for element in elements if (name := element.get("name"))}
    found = {WORLD: WORLD}
    for place, number in enumerate(solver.mjc_body_to_newton.numpy()[0].tolist()):
        if number >= 0 and (name := in_file.get(robot.body_label[number].rpartition("/")[2])):
            found[solver.mj_model.body(place).name] = name
    return found


def _actuators(solver: Any, robot: Any) -> list[int]:
    """The number in the file of each actuator of the solver, which has those that drive towards targets of joints first.

    ``_NO_ACTUATOR`` for one that the file does not have.
    """
    rows = [robot.custom_attributes[f"mujoco:{name}"].values or [] for name in ("ctrl_source", "ctrl_type", "actuator_trnid")]
    kinds = newton.solvers.SolverMuJoCo.CtrlType
    targets = {
        (int(trnid[0]), kind == kinds.VELOCITY): number
        for number, (source, kind, trnid) in enumerate(zip(*rows, strict=True))
        if source == newton.solvers.SolverMuJoCo.CtrlSource.JOINT_TARGET
    }
    found, sources = [], solver.mjc_actuator_ctrl_source
    places = [] if sources is None else zip(sources.numpy().tolist(), solver.mjc_actuator_to_newton_idx.numpy().tolist(), strict=True)
    for source, index in places:
        if source == newton.solvers.SolverMuJoCo.CtrlSource.JOINT_TARGET:
            # Of those that drive towards velocities it is negative. Importers make some of their own.
            found.append(targets.get((index, False) if index >= 0 else (-index - 2, True), _NO_ACTUATOR))
        else:
            found.append(index)
    return found


def _still(on_device: Any, actuators: Sequence[int]) -> None:
    """``mujoco.on_device.still`` in worlds."""
    for values in (on_device.actuator_gainprm, on_device.actuator_biasprm) if actuators else ():
        own = values.numpy()
        own[:, actuators] = 0.0
        values.assign(own)
    kinds = {"actuator_gaintype": mujoco.mjtGain.mjGAIN_FIXED, "actuator_biastype": mujoco.mjtBias.mjBIAS_NONE}
    for name, kind in kinds.items() if actuators else ():
        own = getattr(on_device, name).numpy()
        own[actuators] = int(kind)
        getattr(on_device, name).assign(own)


def _solver_of(request: Request, robot: Any, starts: Mapping[str, tuple[int, int]], held: Held) -> Any:
    """``SolverMuJoCo`` of ``BLOCK`` worlds; raises Refused."""
    if request.aid is not None and request.format == "urdf":
        # They bound actuators, of which a URDF has none, and SolverMuJoCo takes no effort of zero.
        robot.joint_effort_limit = [_NO_LIMIT] * robot.joint_dof_count
    scene = _builder()
    scene.replicate(robot, BLOCK)
    with warp.ScopedDevice("cpu"), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        model = scene.finalize(skip_validation_inertia=request.aid is not None)
        if request.aid is not None:
            model.set_gravity(request.aid.gravity)
            if request.format == "urdf":
                model.joint_armature.assign(np.tile(armature_of(request, robot, starts), BLOCK))
        try:
            return newton.solvers.SolverMuJoCo(model, **_settings(held))
        except (ValueError, NotImplementedError, RuntimeError) as error:
            raise Refused(f"SolverMuJoCo: {' '.join(str(error).split())}") from error


def _settings(held: Held) -> dict[str, Any]:
    """Arguments of ``SolverMuJoCo``."""
    # Roots that nobody makes kinematic need no weld.
    found: dict[str, Any] = {"density": 0.0, "viscosity": 0.0, "kinematic_switchable_roots": False, "disable_contacts": not held.touches}
    if held.touches:
        found |= {"nconmax": MOST_CONTACTS, "njmax": MOST_ROWS}
    if held.solver is not None:
        solver = held.solver
        given = {
            "solver": solver.method.lower(),
            "iterations": solver.iterations,
            "tolerance": solver.tolerance,
            "jacobian": solver.jacobian or None,
            "ls_iterations": solver.line_search,
        }
        found |= {name: value for name, value in given.items() if value is not None}
    return found
