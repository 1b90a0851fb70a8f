"""Elements that PyBullet's reader of URDF leaves out, the boxes that it takes inertias of, and its way to their principal axes."""

import math
from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction

import numpy as np
from lxml import etree

from harness.arrays import Array
from harness.explain.changes.readings import (
    _left_out,
    computed,
    element_at,
    law,
    matrix_of,
    moments_of,
    moving,
    readings_of,
    with_inertias,
)
from harness.files.tree import Body, Inertia, Tree

# gUrdfDefaultCollisionMargin [m].
_MARGIN = 0.001
# As btPolyhedralConvexShape and btCapsuleShape have it.
_TWELFTH = 0.08333333


def half_extents(body: Body) -> Array:
    """(3,) [m] of the box that Bullet lays around the collision shapes of a link, along the axes of the link's inertia.

    A single shape in the very frame of the inertia is taken by itself; a cylinder is a hull of points, around which a margin is laid twice.

    Source: bullet3, examples/Importers/ImportURDFDemo/BulletUrdfImporter.cpp, ``convertURDFToCollisionShape``; btCompoundShape.cpp,
    ``getAabb``; btPolyhedralConvexShape.cpp, ``recalcLocalAabb``.
    """
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
    """A shape by itself: a sphere has the moments of a cube, a cylinder its margin once more, and 1/12 is rounded for some."""
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


_THRESHOLD, _STEPS = 1e-6, 30
_EPSILON = 2.0**-52


def diagonalized(matrix: Array) -> tuple[Array, Array, Array]:
    """The moments (3,) that Bullet takes of a symmetric matrix (3, 3), their axes (3, 3) as columns, and what it leaves out there.

    The matrix is axes (diag(moments) + rest) axes'.

    Source: bullet3, src/LinearMath/btMatrix3x3.h, ``btMatrix3x3::diagonalize``, as its importer of URDF calls it.
    """
    found, axes = np.array(matrix, dtype=float), np.eye(3)
    for step in range(_STEPS):
        p, q = max(((0, 1), (0, 2), (1, 2)), key=lambda place: abs(found[place]))
        largest, allowed = abs(found[p, q]), _THRESHOLD * float(np.abs(np.diag(found)).sum())
        if largest <= _EPSILON * allowed:
            break
        turn = _turn(found, p, q)
        found, axes = turn.T @ found @ turn, axes @ turn
        found[p, q] = found[q, p] = 0.0
        if largest <= allowed or step == _STEPS - 1:
            break
    return np.diag(found).copy(), axes, found - np.diag(np.diag(found))


def _turn(matrix: Array, p: int, q: int) -> Array:
    """Jacobi's rotation by which the element (p, q) vanishes."""
    theta = (matrix[q, q] - matrix[p, p]) / (2 * matrix[p, q])
    tangent = (1.0 if theta >= 0 else -1.0) / (abs(theta) + np.hypot(1.0, theta))
    cosine = 1 / np.hypot(1.0, tangent)
    turn = np.eye(3)
    turn[p, p] = turn[q, q] = cosine
    turn[p, q], turn[q, p] = cosine * tangent, -cosine * tangent
    return turn


_URDF = ("urdf",)
_READER = "bullet3, examples/Importers/ImportURDFDemo/UrdfParser.cpp, parseJoint, parseJointDynamics"
_INERTIAS = "bullet3, examples/Importers/ImportURDFDemo/BulletUrdfImporter.cpp, getMassAndInertia2"
_NONE = (Fraction(0),) * 3


def _moved(tree: Tree, change: Callable[[Body, Inertia], Inertia]) -> Tree:
    """The tree with the inertia of each moving body that has one as ``change`` gives it."""
    moved = moving(tree)
    return with_inertias(tree, lambda body: change(body, body.inertia) if body.inertia and body.name in moved else body.inertia)


@law("inertia of collision shapes", "links", supplied=True, after=("links without inertia",), each=_moved)
def _boxes(body: Body, inertia: Inertia) -> Inertia:
    """In the frame of the inertia; a body without mass has none."""
    x, y, z = (4 * half**2 for half in half_extents(body))
    mass = float(inertia.mass) / 12
    squares = enumerate((y + z, x + z, x + y))
    moments = (computed(mass * square, body, "moment of PyBullet's box", index) for index, square in squares)
    return replace(inertia, moments=(*moments, *_NONE))


@law("principal axes", "links", after=("impossible inertias",), each=_moved)
def _diagonal(_body: Body, inertia: Inertia) -> Inertia:
    if not any(inertia.moments[3:]):
        return inertia
    _, axes, rest = diagonalized(matrix_of(inertia))
    # Only what is left out is rounded, which is a millionth of the whole.
    lost = moments_of(axes @ rest @ axes.T)
    moments = (moment - Fraction(off) if off else moment for moment, off in zip(inertia.moments, lost, strict=True))
    return replace(inertia, moments=tuple(moments))


@law("impossible inertias", "links", after=("inertia of collision shapes",), each=_moved)
def _possible(_body: Body, inertia: Inertia) -> Inertia:
    first, second, third = np.sort(diagonalized(matrix_of(inertia))[0])
    return inertia if first >= 0 and third <= first + second else replace(inertia, moments=_NONE * 2)


READINGS = readings_of(
    "pybullet",
    {
        _URDF: {
            _left_out.unit_inertias: (
                "PyBullet gives a link without <inertial> 1 kg and moments of 1 kg m^2, with a warning",
                _left_out.WRITE_INERTIA,
                "bullet3, examples/Importers/ImportURDFDemo/UrdfParser.cpp, parseLink",
            ),
            _boxes: (
                "PyBullet uses the inertia of the box around a link's collision shapes, 1 mm wider, and not that of the file",
                "load the file with flags=p.URDF_USE_INERTIA_FROM_FILE",
                "PyBullet Quickstart Guide, loadURDF, URDF_USE_INERTIA_FROM_FILE; bullet3, btCompoundShape::calculateLocalInertia",
            ),
            _possible: (
                "PyBullet sets moments of inertia to zero if one is negative or more than the sum of the others, with a warning",
                _left_out.POSSIBLE,
                _INERTIAS,
            ),
            _diagonal: (
                "PyBullet rotates an inertia matrix to its principal axes to a relative 1e-6, and ignores the remaining products",
                "write these inertias about their principal axes, and the turn into rpy of the origin",
                f"{_INERTIAS}; btMatrix3x3::diagonalize",
            ),
            _left_out.dampers: (
                "PyBullet stores the damping of joints, but its inverse dynamics do not apply it",
                _left_out.ADD_DAMPING,
                _READER,
            ),
            _left_out.springs: ("PyBullet reads no springs of joints", _left_out.ADD_SPRINGS, _READER),
            _left_out.rotors: ("PyBullet reads no rotor inertias", _left_out.ADD_ROTORS, _READER),
            _left_out.mimics: ("PyBullet leaves a mimic joint free", _left_out.LEAD, _READER),
            _left_out.point_springs: ("PyBullet reads no springs between points", _left_out.ADD_POINT_SPRINGS, _READER),
        },
    },
)
