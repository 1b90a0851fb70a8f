"""What PyBullet's reader of URDF leaves out."""

from dataclasses import replace
from fractions import Fraction

import numpy as np

from harness.explain.changes.readings import _left_out, law, with_inertias
from harness.explain.changes.readings._bullet_boxes import half_extents
from harness.explain.changes.readings._bullet_matrices import diagonalized
from harness.explain.changes.readings._inertias import computed, matrix_of, moments_of, moving
from harness.files.tree import Body, Inertia, Tree
from harness.robots.robot import Robot

_FORMATS = ("urdf",)
_READER = "bullet3, examples/Importers/ImportURDFDemo/UrdfParser.cpp, parseJoint, parseJointDynamics"

_INERTIAS = "bullet3, examples/Importers/ImportURDFDemo/BulletUrdfImporter.cpp, getMassAndInertia2"
_NONE = (Fraction(0),) * 3


@law("inertia of collision shapes", "links", supplied=True, after=("links without inertia",))
def _boxes(robot: Robot) -> Tree:
    """In the frame of the inertia; a body without mass has none."""

    moved = moving(robot.tree)

    def read(body: Body) -> Inertia | None:
        if body.inertia is None or body.name not in moved:
            return body.inertia
        x, y, z = (4 * half**2 for half in half_extents(body))
        mass = float(body.inertia.mass) / 12
        squares = enumerate((y + z, x + z, x + y))
        moments = (computed(mass * square, body, "moment of PyBullet's box", index) for index, square in squares)
        return replace(body.inertia, moments=(*moments, *_NONE))

    return with_inertias(robot.tree, read)


@law("principal axes", "links", after=("impossible inertias",))
def _diagonal(robot: Robot) -> Tree:
    moved = moving(robot.tree)

    def read(body: Body) -> Inertia | None:
        if body.inertia is None or body.name not in moved or not any(body.inertia.moments[3:]):
            return body.inertia
        _, axes, rest = diagonalized(matrix_of(body.inertia))
        # Only what is left out is rounded, which is a millionth of the whole.
        lost = moments_of(axes @ rest @ axes.T)
        moments = (moment - Fraction(off) if off else moment for moment, off in zip(body.inertia.moments, lost, strict=True))
        return replace(body.inertia, moments=tuple(moments))

    return with_inertias(robot.tree, read)


@law("impossible inertias", "links", after=("inertia of collision shapes",))
def _possible(robot: Robot) -> Tree:
    moved = moving(robot.tree)

    def read(body: Body) -> Inertia | None:
        if body.inertia is None or body.name not in moved:
            return body.inertia
        first, second, third = np.sort(diagonalized(matrix_of(body.inertia))[0])
        return body.inertia if first >= 0 and third <= first + second else replace(body.inertia, moments=_NONE * 2)

    return with_inertias(robot.tree, read)


READINGS = (
    _left_out.unit_inertias(
        "pybullet",
        _FORMATS,
        "PyBullet gives a link without <inertial> 1 kg and moments of 1 kg m^2, and warns of it",
        "bullet3, examples/Importers/ImportURDFDemo/UrdfParser.cpp, parseLink",
    ),
    _boxes(
        "pybullet",
        _FORMATS,
        "PyBullet passes over moments of inertia, and takes those of the box around the collision shapes of a link, 1 mm wider",
        "PyBullet Quickstart Guide, loadURDF, URDF_USE_INERTIA_FROM_FILE; bullet3, btCompoundShape::calculateLocalInertia",
    ),
    _possible(
        "pybullet",
        _FORMATS,
        "PyBullet sets moments of inertia to zero where one is negative or more than the sum of the others, and warns of it",
        _INERTIAS,
    ),
    _diagonal(
        "pybullet",
        _FORMATS,
        "PyBullet turns an inertia matrix to its principal axes to 1e-6 of it, and passes over the products that are left",
        f"{_INERTIAS}; btMatrix3x3::diagonalize",
    ),
    _left_out.dampers("pybullet", _FORMATS, "PyBullet stores the damping of joints, and its inverse dynamics apply none", _READER),
    _left_out.springs("pybullet", _FORMATS, "PyBullet reads no springs of joints", _READER),
    _left_out.rotors("pybullet", _FORMATS, "PyBullet reads no rotor inertias", _READER),
    _left_out.mimics("pybullet", _FORMATS, "PyBullet takes a joint that mimics another for one that moves by itself", _READER),
    _left_out.tendons("pybullet", _FORMATS, "PyBullet reads no springs between points", _READER),
)
