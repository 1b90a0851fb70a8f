"""What iDynTree's parser of URDF stores and its computations leave out."""

from harness.explain.changes.readings import _left_out, law, with_inertias
from harness.files.tree import Tree
from harness.trees.robot import Robot

_FORMATS = ("urdf",)


@law("inertia without mass", "links")
def _without_frames(robot: Robot) -> Tree:
    """A link is taken for a frame if a fixed joint carries it, nothing but such links hangs on it, and its mass is 0."""
    frames: set[str] = set()
    parents = {body.name: body.parent for body in robot.tree.bodies}
    for body in reversed(robot.tree.bodies):
        carries = any(parent == body.name and name not in frames for name, parent in parents.items())
        if body.parent in parents and not (body.joints or carries or (body.inertia and body.inertia.mass)):
            frames.add(body.name)
    return with_inertias(
        robot.tree, lambda body: None if body.name in frames and body.inertia and any(body.inertia.moments) else body.inertia
    )


READINGS = (
    _without_frames(
        "idyntree",
        _FORMATS,
        "The parser of iDynTree takes a link of mass 0 at the end of fixed joints for a frame, and drops its inertia",
        "iDynTree, src/model/src/ModelTransformers.cpp, removeFakeLinks",
    ),
    _left_out.dampers(
        "idyntree",
        _FORMATS,
        "The parser of iDynTree stores the damping of joints, and no computation applies it",
        "iDynTree, src/model: IJoint::getDamping is read by no algorithm of ForwardKinematics.cpp or Dynamics.cpp",
    ),
    _left_out.springs(
        "idyntree",
        _FORMATS,
        "The parser of iDynTree reads no springs",
        "iDynTree, src/model_io/codecs: its parser of URDF knows links, joints and sensors",
    ),
    _left_out.rotors(
        "idyntree",
        _FORMATS,
        "The parser of iDynTree reads no rotor inertias",
        "iDynTree, src/model_io/codecs: its parser of URDF knows links, joints and sensors",
    ),
    _left_out.mimics(
        "idyntree",
        _FORMATS,
        "The parser of iDynTree takes a joint that mimics another for one that moves by itself, without a message",
        "iDynTree, src/model_io/codecs/src/URDFParsingUtils and JointElement.cpp, which know no <mimic>",
    ),
    _left_out.point_springs(
        "idyntree",
        _FORMATS,
        "The parser of iDynTree reads no springs between points",
        "iDynTree, src/model_io/codecs: its parser of URDF knows links, joints and sensors",
    ),
)
