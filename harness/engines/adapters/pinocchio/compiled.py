"""The numbers of a ``pinocchio.Model`` that may bear on motion, by the names of its arrays, of any version.

Inertias are about the centre of mass, along the axes of the joint's frame. Source: Pinocchio 4 documentation, ``pinocchio::Model``.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from typing import Any

import numpy as np
import pinocchio

from harness.engines.interface import AXES, QUATERNION, CompiledNumber

# By positions and by velocities of joints; those that no acceleration of ``aba`` feels.
_BY_POSITION = ("lowerPositionLimit", "upperPositionLimit")
_BY_VELOCITY = (
    "armature", "damping", "friction", "lowerDryFrictionLimit", "upperDryFrictionLimit", "rotorInertia", "rotorGearRatio",
    "lowerEffortLimit", "upperEffortLimit", "effortLimit", "lowerVelocityLimit", "upperVelocityLimit", "velocityLimit",
)  # fmt: skip
_FELT = ("armature",)


def compiled(model: Any) -> Iterator[CompiledNumber]:
    """Every such number of a model; what a version does not have is none of its."""
    yield CompiledNumber("gravity.linear", "", tuple(model.gravity.linear.tolist()), AXES)
    for number, name in enumerate(model.names):
        inertia, placement = model.inertias[number], model.jointPlacements[number]
        yield CompiledNumber("inertias.mass", name, (inertia.mass,))
        yield CompiledNumber("inertias.lever", name, tuple(inertia.lever.tolist()), AXES)
        yield CompiledNumber.of_inertia("inertias.inertia", name, inertia.inertia)
        yield CompiledNumber("jointPlacements.translation", name, tuple(placement.translation.tolist()), AXES)
        x, y, z, w = pinocchio.Quaternion(placement.rotation).coeffs().tolist()
        yield CompiledNumber("jointPlacements.rotation", name, (w, x, y, z), QUATERNION)
        if number:
            yield from _of_joint(model, model.joints[number], name)


def _of_joint(model: Any, joint: Any, name: str) -> Iterator[CompiledNumber]:
    yield CompiledNumber("joints.shortname", name, (joint.shortname(),))
    with suppress(AttributeError):
        joint.calc(data := joint.createData(), pinocchio.neutral(model))
        yield CompiledNumber("joints.S", name, tuple(np.ravel(data.S).tolist()))
    for quantities, start, size in ((_BY_POSITION, joint.idx_q, joint.nq), (_BY_VELOCITY, joint.idx_v, joint.nv)):
        for quantity in quantities:
            if (values := getattr(model, quantity, None)) is not None:
                yield CompiledNumber(quantity, name, tuple(values[start : start + size].tolist()), felt=quantity in _FELT)
