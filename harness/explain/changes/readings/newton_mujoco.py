"""Elements that Newton's ``SolverMuJoCo`` loses, and of which ``SolverFeatherstone`` has no part, or that it holds softly."""

from dataclasses import replace

from harness.explain.changes.readings import _left_out, law, readings_of
from harness.files.tree import Tree
from harness.trees.robot import Robot


@law("joints of tendons", "tendons")
def _of_bodies_with_one_joint(robot: Robot) -> Tree:
    """Springs, dampers and inertias of tendons without joints whose body has several; none of a tendon without any left."""
    shared = {joint.name for body in robot.tree.bodies if len(body.joints) > 1 for joint in body.joints}
    found = []
    for one in robot.tree.couplings:
        left = one.joints if one.of_actuator else tuple((name, multiple) for name, multiple in one.joints if name not in shared)
        if left:
            found.append(replace(one, joints=left))
    return replace(robot.tree, couplings=tuple(found))


READINGS = readings_of(
    "newton_mujoco",
    {
        ("mjcf",): {
            _of_bodies_with_one_joint: (
                "Newton's importer of MJCF leaves joints out of a fixed tendon where their body has several, and a tendon without any left",
                "give each of these joints a body of its own",
                "Newton 1.8, newton/_src/utils/import_mjcf.py, parse_tendons; docs/issues/newton-mjcf-tendons-lose-joints.md",
            ),
        },
    },
    is_misread=True,
)

DOCUMENTED = readings_of(
    "newton_mujoco",
    {
        ("urdf",): {
            _left_out.mimics: (
                "Newton's SolverMuJoCo holds a mimic joint by a soft constraint",
                "keep that constraint on, and make its solref stiffer where it gives",
                "Newton documentation, SolverMuJoCo: mimic relationships are equality constraints",
            ),
        },
    },
)
