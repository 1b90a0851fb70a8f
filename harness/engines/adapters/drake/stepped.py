"""A plant in discrete time on a file as it stands: accelerations over a step, with limits of joints, and with contacts (``touching``).

Joints that mimic others, and limits that are not to act, are switched off.

Source: Drake documentation, drake::multibody::MultibodyPlant: the output port of accelerations has (v' - v) / h of a discrete plant.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from harness.engines.adapters.drake import DrakeModel
from harness.engines.adapters.drake.files import CONTINUOUS, Building
from harness.engines.adapters.drake.step_law import STEP
from harness.engines.loaded_file import LoadedFile
from harness.engines.request import Request


def stepped(built_by: Building, names: Mapping[str, str], request: Request) -> LoadedFile:
    """A plant whose limits, and bodies that touch, act over one step; arguments as of ``DrakeModel``."""
    touches, limited = (False, set[str]()) if request.held is None else (request.held.touches, set(request.held.limited))
    # Sampled outputs have what the last step left.
    discrete = built_by.replaced(CONTINUOUS, f"MultibodyPlant({STEP!r}); p.SetUseSampledOutputPorts(False)")
    if touches:
        from harness.engines.adapters.drake.touching import TouchingFile, in_diagram

        discrete = in_diagram(built_by)
    model = DrakeModel(discrete, names, request)
    plant = model.plant
    for joint in map(plant.get_joint, plant.GetJointIndices()):
        if joint.num_positions() == 1 and f"joint {joint.name()}" not in limited:
            joint.set_position_limits(np.array([-math.inf]), np.array([math.inf]))
    for constraint in plant.GetConstraintIds():
        plant.SetConstraintActiveStatus(model.context, constraint, False)
    return TouchingFile(model, request) if touches else model
