"""Pinocchio's dynamics have no springs, and its readers pass over what makes them."""

from harness.comparison.readings import _left_out

_NO_FORCE = "and aba.hxx, which has no such force"
_URDF, _BOTH = ("urdf",), ("urdf", "mjcf")
READINGS = (
    _left_out.springs(
        "pinocchio",
        _BOTH,
        "Pinocchio applies no springs",
        f"Pinocchio 4.1, parsers/mjcf/mjcf-graph.cpp, which does not read stiffness, {_NO_FORCE}",
    ),
    _left_out.point_springs(
        "pinocchio",
        _BOTH,
        "Pinocchio has no springs between points, and no tendons",
        f"Pinocchio 4.1, parsers/mjcf/mjcf-graph.cpp, which reads no <tendon>, {_NO_FORCE}",
    ),
    _left_out.linear_tendons(
        "pinocchio",
        ("mjcf",),
        "Pinocchio has no tendons on joints",
        f"Pinocchio 4.1, parsers/mjcf/mjcf-graph.cpp, which reads no <tendon>, {_NO_FORCE}",
    ),
    _left_out.rotors(
        "pinocchio",
        _URDF,
        "Pinocchio's reader of URDF reads no rotor inertias",
        "Pinocchio 4.1, parsers/urdf/model.cpp, which reads no <transmission>",
    ),
    _left_out.ball_joints(
        "pinocchio",
        _URDF,
        "Pinocchio's reader of URDF passes over Drake's ball joint, and fixes the root link to the world",
        "Pinocchio 4.1, parsers/urdf/model.cpp, which reads the joints of URDF alone",
    ),
)
