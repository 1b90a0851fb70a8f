"""What Drake's parsers leave out in a plant in continuous time."""

import math
from dataclasses import replace
from fractions import Fraction

import numpy as np

from harness.comparison.readings import Reading, _left_out, with_inertias
from harness.comparison.readings._inertias import computed, matrix_of
from harness.robots.robot import Robot
from harness.robots.tree import Body, Inertia, Tree

# Of the sphere [kg/m^3], and its mass where the file's is none [kg].
_DENSITY, _MASS = 1000.0, 1.0
# Of the trace, by which moments may be off: RotationalInertia::CouldBePhysicallyValid.
_ROUNDINGS = 64 * 2.0**-52


def _is_possible(inertia: Inertia) -> bool:
    matrix = matrix_of(inertia)
    if not inertia.mass > 0:
        return not (inertia.mass or matrix.any())
    moments, allowed = np.linalg.eigvalsh(matrix), _ROUNDINGS * float(np.trace(matrix)) / 2
    return bool(moments[0] >= -allowed and moments[0] + moments[1] + allowed >= moments[2])


def _sphere(body: Body, inertia: Inertia) -> Inertia:
    mass = inertia.mass if inertia.mass > 0 else computed(_MASS, body, "mass of Drake's sphere")
    radius = math.cbrt(3 * float(mass) / (4 * math.pi * _DENSITY))
    moment = computed(0.4 * float(mass) * radius**2, body, "moment of Drake's sphere")
    return replace(inertia, mass=mass, moments=(moment,) * 3 + (Fraction(0),) * 3)


def _possible(robot: Robot) -> Tree:
    def read(body: Body) -> Inertia | None:
        return body.inertia if body.inertia is None or _is_possible(body.inertia) else _sphere(body, body.inertia)

    return with_inertias(robot.tree, read)


READINGS = (
    _left_out.springs(
        "drake",
        ("urdf", "mjcf"),
        "Drake's parser passes over the springs of joints, with a warning for those of an MJCF",
        'Drake documentation, "Parsing model files": <springStiffness> is unknown, and stiffness of an MJCF\'s joint is not supported',
    ),
    Reading(
        name="impossible inertias",
        engine="drake",
        formats=("urdf", "mjcf"),
        sentence=(
            "Drake has a solid sphere of 1000 kg/m^3 instead of an inertia that no body can have, with its mass, "
            "or 1 kg where it has none; it warns of it"
        ),
        concerns="links",
        source="Drake, multibody/parsing/detail_common.h, ParseSpatialInertia, and its fallback",
        tree=_possible,
    ),
)
