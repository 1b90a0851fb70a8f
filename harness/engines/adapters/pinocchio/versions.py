"""Pieces of Pinocchio that the adapter's modules share, and differences between the versions that the harness knows, from 2.7 on.

Source: Pinocchio's changelog, and the versions themselves.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
import pinocchio

from harness.arrays import Array
from harness.engines import Unsupported
from harness.engines.reading import captured_standard_error
from harness.files.tree import WORLD

# Pinocchio's own q, v and tau, (nq, n), (nv, n) and (nv, n), one contiguous column a state.
Columns = tuple[Array, Array, Array]


def parent_joint(frame: Any) -> int:
    """Index of the joint that carries a frame, which was its ``parent``."""
    return int(frame.parentJoint if hasattr(frame, "parentJoint") else frame.parent)


@contextmanager
def reasons(refusal: Callable[[str], Exception]) -> Iterator[None]:
    """Raises ``refusal`` of the words of a reader that refuses a file; its exceptions do not hold them, file descriptor 2 does."""
    with captured_standard_error() as captured:
        try:
            yield
        except (Unsupported, MemoryError):
            raise
        except Exception as error:
            raise refusal(_without_origin(captured() or str(error))) from error


def _without_origin(words: str) -> str:
    """The message of an exception without the place in Pinocchio's source that it begins with."""
    return words.rpartition("message:")[2].strip() if words.startswith("From file:") else words


def states(*columns: Array) -> Iterator[tuple[Array, ...]]:
    """The columns of each state. Rows of a transpose cost half of what columns cost."""
    return zip(*(each.T for each in columns), strict=True)


def mass_matrix(model: Any, data: Any, configuration: Array) -> Array:
    """M, (nv, nv), by ``crba``, whose lower triangle is not written."""
    upper = np.triu(pinocchio.crba(model, data, configuration))
    return np.asarray(upper + np.triu(upper, 1).T)


def has_body(model: Any, body: str) -> bool:
    """True for a body of the model, and for the world."""
    return body == WORLD or bool(model.existFrame(body, pinocchio.FrameType.BODY))


def carrier(model: Any, body: str) -> tuple[int, Any]:
    """The joint that carries a body, 0 for the world, and the body's frame in that of the joint."""
    if body == WORLD and not model.existFrame(body, pinocchio.FrameType.BODY):
        return 0, pinocchio.SE3.Identity()
    frame = model.frames[model.getFrameId(body, pinocchio.FrameType.BODY)]
    return parent_joint(frame), frame.placement


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
    if not hasattr(pinocchio, "JointModelMimic"):
        raise Unsupported(f"{_this_version()} has no joints that mimic others")
    return pinocchio.buildModelFromXML(text, *root, mimic=True)


def require(what: str, *names: str) -> None:
    """Raises ``Unsupported`` where this version has not every one of ``names``, without which it has no ``what``."""
    if missing := [name for name in names if not hasattr(pinocchio, name)]:
        raise Unsupported(f"{_this_version()} has no {' and no '.join(missing)}, so that it has no {what}")


def ready_for_constraints(model: Any, data: Any, constraints: Any, memories: Any) -> None:
    """``initConstraintDynamics``, which took no memories of the constraints before it did."""
    try:
        pinocchio.initConstraintDynamics(model, data, constraints, memories)
    except TypeError:
        pinocchio.initConstraintDynamics(model, data, constraints)


def _this_version() -> str:
    return f"Pinocchio {pinocchio.__version__}"
