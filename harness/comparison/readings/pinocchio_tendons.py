"""Pinocchio's reader of MJCF passes over tendons."""

from harness.comparison.readings import _left_out

READING = _left_out.tendons(
    "pinocchio",
    ("urdf", "mjcf"),
    "Pinocchio has no springs between points, and no tendons",
    "Pinocchio 4.1, parsers/mjcf/mjcf-graph.cpp, which reads no <tendon>, and aba.hxx, which has no such force",
)
