"""What differs between the versions of Pinocchio that the harness knows, from 2.7 on.

Source: Pinocchio's changelog, and the versions themselves.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.engines import Unsupported


def parent_joint(frame: Any) -> int:
    """Index of the joint that carries a frame, which was its ``parent``."""
    return int(frame.parentJoint if hasattr(frame, "parentJoint") else frame.parent)


def armature(model: Any) -> Array:
    """The reflected inertias, (nv,), that ``aba`` adds to the diagonal of M; versions that add none have a zero for each."""
    return np.asarray(getattr(model, "armature", np.zeros(model.nv)))


def set_armature(model: Any, velocities: Sequence[int], reflected_inertias: Sequence[float] | Array) -> None:
    """Have ``aba`` add reflected inertias [kg m^2 or kg] to the diagonal of M at the given velocities.

    Raises:
        Unsupported: this version adds none, and one of them is not zero.
    """
    if hasattr(model, "armature"):
        model.armature[velocities] = reflected_inertias
    elif np.any(reflected_inertias):
        raise Unsupported(f"{_this_version()} adds no reflected inertias to M, and the file has some")


def read_urdf(text: str, *root: Any) -> Any:
    """The model of a URDF, its root link on the world, or by the joint model and name given; older readers take no name."""
    import pinocchio

    try:
        return pinocchio.buildModelFromXML(text, *root)
    except TypeError:
        model = pinocchio.buildModelFromXML(text, *root[:1])
        model.names[1] = root[1]
        return model


def read_mimics(text: str, *root: Any) -> Any:
    """The model of a URDF whose joints that mimic others are such.

    Raises:
        Unsupported: this version has no such joints.
    """
    import pinocchio

    if not hasattr(pinocchio, "JointModelMimic"):
        raise Unsupported(f"{_this_version()} has no joints that mimic others")
    return pinocchio.buildModelFromXML(text, *root, mimic=True)


def require(what: str, *names: str) -> None:
    """Raises ``Unsupported`` where this version has not every one of ``names``, without which it has no ``what``."""
    import pinocchio

    if missing := [name for name in names if not hasattr(pinocchio, name)]:
        raise Unsupported(f"{_this_version()} has no {' and no '.join(missing)}, so that it has no {what}")


def ready_for_constraints(model: Any, data: Any, constraints: Any, memories: Any) -> None:
    """``initConstraintDynamics``, which took no memories of the constraints before it did."""
    import pinocchio

    try:
        pinocchio.initConstraintDynamics(model, data, constraints, memories)
    except TypeError:
        pinocchio.initConstraintDynamics(model, data, constraints)


def _this_version() -> str:
    import pinocchio

    return f"Pinocchio {pinocchio.__version__}"
