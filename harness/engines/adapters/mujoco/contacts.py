"""The contacts that MuJoCo finds at a state, as plain data.

Source: MuJoCo documentation, API reference, ``mjContact``.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from harness.engines.adapters.mujoco.versions import release
from harness.files.contacts import FoundContact
from harness.files.tree import WORLD

# The first version whose margin and gap are what is documented today: 3.9.0, its changelog says.
_SUMS_MARGINS = (3, 9)
_DEFORMABLE = "is of a deformable body"
# What a contact may have that the harness has no rows for, by the name of its field, which older versions do not know.
_UNREAD = {"adhesion": "has adhesion", "surfacevel": "is of a surface that moves by itself"}


def found_contacts(model: Any, contacts: Iterable[Any]) -> tuple[FoundContact, ...]:
    """The contacts of a state, each with the fields of ``mjContact``, as ``data.contact`` after ``mj_forward``; not all of them push.

    Frames are as they are found, which need not be square, docs/issues/mujoco-tangent-of-upright-capsules.md.
    """
    return tuple(_found(model, one) for one in contacts)


def _found(model: Any, one: Any) -> FoundContact:
    is_rigid = min(one.geom) >= 0
    bodies = [model.geom_bodyid[geom] for geom in one.geom] if is_rigid else [0, 0]
    first, second = (_name_of(model, body) for body in bodies)
    why_not = next((why for field, why in _UNREAD.items() if np.any(getattr(one, field, 0.0))), "") if is_rigid else _DEFORMABLE
    point, frame, friction = (tuple(map(float, own)) for own in (one.pos, one.frame, one.friction[: one.dim - 1]))
    (time, ratio), (sliding, slid), (least, most, width, midpoint, power) = (
        map(float, own) for own in (one.solref, one.solreffriction, one.solimp)
    )
    return FoundContact(
        bodies=(first, second),
        point=point,
        frame=frame,
        distance=float(one.dist),
        margin=float(one.includemargin),
        friction=friction,
        solref=(time, ratio),
        solimp=(least, most, width, midpoint, power),
        sliding=(sliding, slid),
        why_not=why_not,
        shapes=(_shape(model, one.geom[0]), _shape(model, one.geom[1])) if is_rigid else ("", ""),
    )


def _name_of(model: Any, body: int) -> str:
    """The name of a body; of one without a name as ``harness.files.mjcf.reading`` gives it."""
    if not body:
        return WORLD
    name: str = model.body(body).name
    parent = model.body_parentid[body]
    beside = [other for other in range(1, model.nbody) if model.body_parentid[other] == parent]
    return name or f"(body {beside.index(body) + 1} of {_name_of(model, parent)})"


def shapes_that_touch(model: Any) -> list[str]:
    """The names of the shapes that may touch; none of versions whose rules for margins are others."""
    if release() < _SUMS_MARGINS:
        return []
    paired = {*model.pair_geom1, *model.pair_geom2}
    return [_shape(model, geom) for geom in range(model.ngeom) if _may_touch(model, geom) or geom in paired]


def _may_touch(model: Any, geom: int) -> bool:
    return bool(model.geom_contype[geom] or model.geom_conaffinity[geom])


def _shape(model: Any, geom: int) -> str:
    """The name of a shape; of one without a name as of ``harness.files.shapes.Shape``."""
    name: str = model.geom(geom).name
    if name:
        return name
    body = model.geom_bodyid[geom]
    start = model.body_geomadr[body]
    number = sum(_may_touch(model, other) for other in range(start, geom + 1))
    return f"(geom {number} of {_name_of(model, body)})"
