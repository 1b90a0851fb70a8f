"""Pinocchio's dynamics have no springs in joints."""

from harness.comparison.readings import _left_out

READING = _left_out.springs(
    "pinocchio",
    ("urdf", "mjcf"),
    "Pinocchio applies no springs",
    "Pinocchio 4.1, parsers/mjcf/mjcf-graph.cpp, which does not read stiffness, and aba.hxx, which has no such force",
)
