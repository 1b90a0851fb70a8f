"""Pinocchio stores the damping of joints, and its dynamics apply none."""

from harness.comparison.readings import _left_out

READING = _left_out.dampers(
    "pinocchio",
    ("urdf", "mjcf"),
    "Pinocchio's ABA applies no joint damping",
    "stack-of-tasks/pinocchio issues 1291 and 1147: damping and friction are the user's, in tau; Model.damping is data only",
)
