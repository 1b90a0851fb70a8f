"""A plant in discrete time on a file as it stands: accelerations over a step, with limits of joints.

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
from harness.engines.request import Request


def stepped(built_by: Building, names: Mapping[str, str], request: Request) -> DrakeModel:
    """A plant whose limits act over one step; arguments as of ``DrakeModel``."""
    # Sampled outputs have what the last step left.
    discrete = built_by.replaced(CONTINUOUS, f"MultibodyPlant({STEP!r}); p.SetUseSampledOutputPorts(False)")
    model = DrakeModel(discrete, names, request)
    plant, limited = model.plant, set() if request.held is None else set(request.held.limited)
    for joint in map(plant.get_joint, plant.GetJointIndices()):
        if joint.num_positions() == 1 and f"joint {joint.name()}" not in limited:
            joint.set_position_limits(np.array([-math.inf]), np.array([math.inf]))
    for constraint in plant.GetConstraintIds():
        plant.SetConstraintActiveStatus(model.context, constraint, False)
    return model
