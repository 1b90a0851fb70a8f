"""What adam's parser of URDF leaves out, and the gravity that it takes."""

from dataclasses import replace
from fractions import Fraction

import numpy as np

from harness.explain.changes.readings import _left_out, law
from harness.files.tree import Given, Tree, vector
from harness.trees.robot import Robot

_FORMATS = ("urdf",)
# The default of KinDynComputations, which is rounded to float32.
_GRAVITY = float(np.float32(-9.80665))
_PARSER = "adam, src/adam/model/std_factories: of a URDF it takes links with their inertials, and joints with origin, axis and limits"


@law("gravity", "files", supplied=True)
def _gravity(robot: Robot) -> Tree:
    tree, place = robot.tree, robot.tree.place
    down = Fraction(_GRAVITY) if place is None else Given(_GRAVITY, place, "gravity of adam")
    return replace(tree, gravity=vector((0, 0, down)))


READINGS = (
    _left_out.dampers("adam", _FORMATS, "The computations of adam apply no joint damping", _PARSER),
    _left_out.springs("adam", _FORMATS, "The parser of adam reads no springs", _PARSER),
    _left_out.rotors("adam", _FORMATS, "The parser of adam reads no rotor inertias", _PARSER),
    _left_out.mimics("adam", _FORMATS, "The parser of adam takes a joint that mimics another for one that moves by itself", _PARSER),
    _left_out.point_springs("adam", _FORMATS, "The parser of adam reads no springs between points", _PARSER),
    _gravity(
        "adam",
        _FORMATS,
        "The computations of adam take 9.80665 m/s^2 along -z for gravity, rounded to float32",
        "adam, src/adam/numpy/computations.py, KinDynComputations: gravity",
    ),
)
