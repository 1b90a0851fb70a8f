"""The box that Bullet lays around the collision shapes of a link of a URDF, of which it takes the moments of inertia.

A single shape in the very frame of the inertia is taken by itself; a cylinder is a hull of points, around which a margin is laid twice.

Source: bullet3, examples/Importers/ImportURDFDemo/BulletUrdfImporter.cpp, ``convertURDFToCollisionShape``; btCompoundShape.cpp,
``getAabb``; btPolyhedralConvexShape.cpp, ``recalcLocalAabb``.
"""

from __future__ import annotations

import math

import numpy as np
from lxml import etree

from harness.arrays import Array
from harness.explain.changes.readings import element_at
from harness.files.tree import Body

# gUrdfDefaultCollisionMargin [m].
_MARGIN = 0.001
# As btPolyhedralConvexShape and btCapsuleShape have it.
_TWELFTH = 0.08333333


def half_extents(body: Body) -> Array:
    """(3,) [m], along the axes of the link's inertia."""
    link = element_at(body.place)
    collisions = [] if link is None else [one for one in link.iterfind("collision") if _half_size(one) is not None]
    if not collisions:
        return np.full(3, _MARGIN)
    assert link is not None
    turn, origin = _frame(link.find("inertial"))
    lowest, highest, is_alone = np.full(3, np.inf), np.full(3, -np.inf), len(collisions) == 1
    for collision in collisions:
        size, (own_turn, own_origin) = _half_size(collision), _frame(collision)
        assert size is not None
        half = size if collision.find("geometry/sphere") is not None else np.abs(turn.T @ own_turn) @ size
        centre = turn.T @ (own_origin - origin)
        is_alone = is_alone and (own_turn == turn).all() and (turn == np.eye(3)).all() and not centre.any()
        lowest, highest = np.minimum(lowest, centre - half), np.maximum(highest, centre + half)
    extents: Array = (highest - lowest) / 2
    return _of_single_shape(collisions[0], extents) if is_alone else extents + _MARGIN


def _of_single_shape(collision: etree._Element, extents: Array) -> Array:
    """Of a shape by itself: a sphere has the moments of a cube, a cylinder its margin once more, and 1/12 is rounded for some."""
    shape = collision.find("geometry/*")
    if shape.tag == "sphere":
        # 2/5 m r^2 is m/12 of twice the square of this edge.
        return extents * math.sqrt(0.6)
    if shape.tag == "box":
        return extents
    return (extents + (_MARGIN if shape.tag == "cylinder" else 0.0)) * math.sqrt(12 * _TWELFTH)


def _half_size(collision: etree._Element) -> Array | None:
    """(3,) of the box around a shape in its own frame [m]; None for a mesh, which no plain PyBullet is given here."""
    shape = collision.find("geometry/*")
    if shape is None:
        return None
    if shape.tag == "box":
        return np.array([float(word) / 2 for word in shape.get("size", "").split()])
    if shape.tag not in ("sphere", "cylinder", "capsule"):
        return None
    radius, length = float(shape.get("radius", "0")), float(shape.get("length", "0"))
    if shape.tag == "cylinder":
        return np.array([radius, radius, length / 2]) + 2 * _MARGIN
    return np.array([radius, radius, radius + (length / 2 if shape.tag == "capsule" else 0.0)])


def _frame(element: etree._Element | None) -> tuple[Array, Array]:
    """Orientation (3, 3) and origin (3,) [m] that ``<origin>`` of an element says."""
    origin = None if element is None else element.find("origin")
    xyz, (roll, pitch, yaw) = (
        [0.0] * 3 if origin is None else [float(word) for word in origin.get(name, "0 0 0").split()] for name in ("xyz", "rpy")
    )
    about_x = np.array([[1, 0, 0], [0, math.cos(roll), -math.sin(roll)], [0, math.sin(roll), math.cos(roll)]])
    about_y = np.array([[math.cos(pitch), 0, math.sin(pitch)], [0, 1, 0], [-math.sin(pitch), 0, math.cos(pitch)]])
    about_z = np.array([[math.cos(yaw), -math.sin(yaw), 0], [math.sin(yaw), math.cos(yaw), 0], [0, 0, 1]])
    return about_z @ about_y @ about_x, np.array(xyz)
