"""MuJoCo's reader of URDF passes over what other programs' extensions say of springs, rotors and ball joints."""

from harness.comparison.readings import _left_out

_URDF = ("urdf",)
_SOURCE = "MuJoCo documentation, Modeling, URDF extensions: its own element <mujoco> is the one extension that is read"
READINGS = (
    _left_out.springs("mujoco", _URDF, "MuJoCo's reader of URDF passes over Gazebo's springs of joints", _SOURCE),
    _left_out.point_springs("mujoco", _URDF, "MuJoCo's reader of URDF passes over Drake's springs between points", _SOURCE),
    _left_out.rotors("mujoco", _URDF, "MuJoCo's reader of URDF passes over Drake's rotor inertias", _SOURCE),
    _left_out.ball_joints(
        "mujoco", _URDF, "MuJoCo's reader of URDF passes over Drake's ball joint, and fixes the root link to the world", _SOURCE
    ),
)
