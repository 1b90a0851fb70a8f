"""Places of the joints of a model file in Pinocchio's configurations and velocities.

Several joints of one body become one composite joint, which has a name of its own.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class JointPlace:
    """First index and number of a joint's positions and velocities."""

    idx_q: int
    nq: int
    idx_v: int
    nv: int


def joint_places(model: Any, composites: Mapping[str, Sequence[str]] | None = None) -> dict[str, JointPlace]:
    """The joints of a ``pinocchio.Model`` by name, in its order; ``composites`` names the parts of composite joints in theirs."""
    places: dict[str, JointPlace] = {}
    for name, joint in zip(list(model.names)[1:], list(model.joints)[1:], strict=True):
        parts = (composites or {}).get(name)
        if parts is None:
            places[name] = JointPlace(joint.idx_q, joint.nq, joint.idx_v, joint.nv)
        else:
            inner = zip(parts, joint.extract().joints, strict=True)
            places |= {part: JointPlace(one.idx_q, one.nq, one.idx_v, one.nv) for part, one in inner}
    return places
