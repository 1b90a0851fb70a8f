"""Pinocchio's reader of MJCF passes over ``<frame>`` and ``<replicate>`` with all that they hold."""

from harness.comparison.readings import _left_out

READING = _left_out.frames(
    "pinocchio",
    ("mjcf",),
    "Pinocchio's MJCF reader passes over <frame> and <replicate> with all that they hold",
    "Pinocchio 4.1, parsers/mjcf/mjcf-graph.cpp, parseJointAndBody, which knows neither element",
)
