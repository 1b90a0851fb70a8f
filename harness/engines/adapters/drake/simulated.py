"""Motions of a file by Drake's discrete steps, with contacts.

Bodies that a joint connects touch, which they do not by default: the ground may be what carries the first one.

Source: Drake documentation, ``AddMultibodyPlantSceneGraph``, ``MultibodyPlant::set_adjacent_bodies_collision_filters``.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from harness.arrays import Array
from harness.engines.moving import MotionsRequest, SimulatedFile
from harness.engines.request import Refused


def simulated(motion: SimulatedFile, request: MotionsRequest) -> tuple[Array, Array]:
    """q and v, (k, joints) each, after the recorded steps of one motion; joints have one velocity each.

    Raises:
        Refused: Drake does not read it.
    """
    from pydrake.systems.analysis import Simulator

    assert motion.file.length is not None
    diagram, plant = _built(motion)
    if lacking := [name for name in request.joints if not plant.HasJointNamed(name)]:
        raise Refused(f"it has no joint {lacking[0]!r}")
    joints = [plant.GetJointByName(name) for name in request.joints]
    simulator = Simulator(diagram)
    context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    positions, velocities = plant.GetPositions(context), plant.GetVelocities(context)
    places = [joint.position_start() for joint in joints], [joint.velocity_start() for joint in joints]
    positions[places[0]], velocities[places[1]] = request.q, request.v
    plant.SetPositions(context, positions)
    plant.SetVelocities(context, velocities)
    found = []
    for until in motion.counts:
        simulator.AdvanceTo(until * motion.file.length)
        found.append((plant.GetPositions(context)[places[0]], plant.GetVelocities(context)[places[1]]))
    q, v = (np.array([state[part] for state in found]) for part in range(2))
    return q, v


def _built(motion: SimulatedFile) -> tuple[Any, Any]:
    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
    from pydrake.systems.framework import DiagramBuilder

    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlantSceneGraph(builder, motion.file.length)
    plant.set_adjacent_bodies_collision_filters(False)
    try:
        Parser(plant).AddModels(str(motion.file.path))
        plant.Finalize()
    except RuntimeError as error:
        raise Refused(" ".join(str(error).split())) from error
    return builder.Build(), plant
