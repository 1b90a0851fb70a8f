"""A mimic joint of a URDF is free in Pinocchio."""

from harness.comparison.readings import _left_out

READING = _left_out.mimics(
    "pinocchio",
    ("urdf",),
    "Pinocchio's URDF reader takes a joint that mimics another for one that moves by itself",
    "Pinocchio 4.1, parsers/urdf.hpp, buildModel: mimic is false unless the caller asks; aba refuses models with mimic joints",
)
