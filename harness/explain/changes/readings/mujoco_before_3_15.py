"""The reading of the damping ratio of a servo by MuJoCo before 3.15."""

from dataclasses import replace

from harness.explain.changes.readings import law, readings_of
from harness.files.tree import Actuator, Tree
from harness.trees.robot import Robot, damped_by_ratio, inertia_by_coordinates


@law("damping ratio", "actuators")
def _by_coordinates(robot: Robot) -> Tree:
    """Damping by the inertia that each coordinate has alone, which is that at the actuator where it drives one joint and no other moves."""

    def changed(actuator: Actuator) -> Actuator:
        return damped_by_ratio(robot.tree, actuator, inertia_by_coordinates) if actuator.damping_ratio else actuator

    return replace(robot.tree, actuators=tuple(map(changed, robot.tree.actuators)))


READINGS = readings_of(
    "mujoco",
    {
        ("mjcf",): {
            _by_coordinates: (
                "MuJoCo before 3.15 takes sum M_jj / J_j^2 for the inertia of dampratio, and not 1 / (J M^-1 J')",
                "write kv instead of dampratio, or use MuJoCo 3.15 or later",
                "MuJoCo 3.13.0, src/engine/engine_setconst.c, setActuatorDamping over dof_M0; changelog of 3.15.0",
            ),
        },
    },
    versions="<3.15",
)
