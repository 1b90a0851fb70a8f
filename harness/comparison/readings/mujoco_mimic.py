"""A mimic joint of a URDF is free in MuJoCo."""

from harness.comparison.readings import _left_out

READING = _left_out.mimics(
    "mujoco",
    ("urdf",),
    "MuJoCo makes a joint that mimics another a joint of its own under a soft equality constraint, which is off here",
    "MuJoCo documentation, Modeling, URDF extensions, and XML reference, equality/joint",
)
