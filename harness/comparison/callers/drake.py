"""Drake as its user calls it: ``Parser.AddModels`` into a ``MultibodyPlant`` in continuous time, with the root link of a URDF welded.

A free joint has its angular velocity before the linear one, both along the world's axes. What an MJCF gives a joint for a rotor is that
of an actuator in Drake. Source: Drake documentation, drake::multibody::Parser and MultibodyPlant.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.comparison.aided import AidedEngine
from harness.comparison.callers._state_by_state import StateByState, refuse_joints
from harness.comparison.callers._urdf import elements_of, root_link
from harness.comparison.questions import Aid, Caller, Loaded, Refused, Request
from harness.engines.rotations import FREE
from harness.files.tree import WORLD

_PLANT = "p = MultibodyPlant(0.0); Parser(p).AddModels(PATH); "
_ACCELERATIONS = "p.Finalize(); p.get_generalized_acceleration_output_port().Eval(c)"


class DrakeCaller(Caller):
    engine = "drake"
    formats: tuple[str, ...] = ("urdf", "mjcf")
    requires = ("pydrake", "drake")
    optional = True
    factorises_mass_matrix = False
    supplied: Mapping[str, str] = dict.fromkeys(
        formats, "gravity, and springs and rotor inertias of joints, are supplied from the file; dampers are its own"
    )
    why_no_equalities = "it holds equalities in discrete time steps alone, and has no acceleration at a state with them"
    call: Mapping[str, str] = {
        "urdf": f"{_PLANT}p.WeldFrames(p.world_frame(), p.GetFrameByName(ROOT)); {_ACCELERATIONS}",
        "mjcf": _PLANT + _ACCELERATIONS,
    }

    def load(self, request: Request) -> Loaded:
        from pydrake.multibody.parsing import Parser
        from pydrake.multibody.plant import MultibodyPlant

        floating = _floating_bodies(request)
        refuse_joints(request, "Drake", floating.values())
        plant = MultibodyPlant(0.0)
        with _silent():
            try:
                Parser(plant).AddModels(str(request.path))
                if request.format == "urdf" and not request.floating_base and (root := root_link(request)) != WORLD:
                    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName(root))
                if request.aid is not None:
                    _supply(plant, request, request.aid)
                plant.Finalize()
            except RuntimeError as error:
                raise Refused(" ".join(str(error).split())) from error
        return LoadedRobot(plant, request, floating)


@contextmanager
def _silent() -> Iterator[None]:
    """Without Drake's warnings: what they say is a reading, or bears on no acceleration. Whoever else reads them does so again after."""
    logger = logging.getLogger("drake")
    before = logger.level
    logger.setLevel(logging.ERROR)
    try:
        yield
    finally:
        logger.setLevel(before)


def _supply(plant: Any, request: Request, aid: Aid) -> None:
    """Gravity, and the rotor inertias that the parser has dropped, which belong to actuators in Drake."""
    plant.mutable_gravity_field().set_gravity_vector(aid.gravity.tolist())
    driven = {plant.get_joint_actuator(index).joint().name(): plant.get_joint_actuator(index) for index in plant.GetJointActuatorIndices()}
    for joint in request.joints:
        armature = float(aid.armature[joint.velocities[0]])
        if armature and joint.name != request.floating_base and plant.HasJointNamed(joint.name):
            actuator = driven.get(joint.name) or plant.AddJointActuator(f"rotor of {joint.name}", plant.GetJointByName(joint.name))
            actuator.set_default_gear_ratio(1.0)
            actuator.set_default_rotor_inertia(armature)


class LoadedRobot(StateByState):
    """A plant with a context for its states."""

    rotation_first = True
    applies_dampers = True

    def __init__(self, plant: Any, request: Request, floating: Mapping[str, str]) -> None:
        joints = [plant.get_joint(index) for index in plant.GetJointIndices()]
        self._joints = {floating.get(joint.name(), joint.name()): joint for joint in joints if joint.num_velocities()}
        super().__init__(request, {name: joint.velocity_start() for name, joint in self._joints.items()}, plant.num_velocities())
        # An actuator has what the harness supplies.
        self._armature[:] = 0.0
        self._plant, self._context = plant, plant.CreateDefaultContext()

    def _go_to(self, q: Array, v: Array) -> None:
        plant, context = self._plant, self._context
        positions = plant.GetDefaultPositions()
        for name, size in self.columns.sizes.items():
            given, start = q[self.columns.spans(name)[0]], self._joints[name].position_start()
            if size == FREE:
                given = np.concatenate([given[3:], given[:3]])
            positions[start : start + len(given)] = given
        plant.SetPositions(context, positions)
        plant.SetVelocities(context, v)

    def _accelerations(self, force: Array) -> Array:
        self._plant.get_applied_generalized_force_input_port().FixValue(self._context, force)
        try:
            return np.asarray(self._plant.get_generalized_acceleration_output_port().Eval(self._context))
        except RuntimeError as error:
            raise Refused(" ".join(str(error).split())) from error

    def _mass_matrix(self) -> Array:
        return np.asarray(self._plant.CalcMassMatrix(self._context))

    def _bias(self) -> Array:
        from pydrake.multibody.tree import MultibodyForces

        plant, context = self._plant, self._context
        forces = MultibodyForces(plant)
        # Gravity, springs between points and dampers.
        plant.CalcForceElementsContribution(context, forces)
        return np.asarray(plant.CalcBiasTerm(context) - plant.CalcGeneralizedForces(context, forces))


def _floating_bodies(request: Request) -> dict[str, str]:
    """The joints that float, by their bodies, after which Drake names them.

    Raises:
        Refused: a joint of an MJCF has no name.
    """
    if request.format == "urdf":
        return {root_link(request): request.floating_base} if request.floating_base else {}
    written = [joint for joint in elements_of(request).iterfind("worldbody//*") if joint.tag in ("joint", "freejoint")]
    if unnamed := {joint.name for joint in request.joints} - {joint.get("name") for joint in written}:
        raise Refused(f"the harness asks Drake about no joint without a name in this file, as {', '.join(sorted(unnamed))}")
    kinds = {joint.name: joint.kind for joint in request.joints}
    return {joint.getparent().get("name"): joint.get("name") for joint in written if kinds.get(joint.get("name")) == "free"}


CALLER = DrakeCaller()
ENGINE = AidedEngine(CALLER)
