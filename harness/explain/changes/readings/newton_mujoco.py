"""Elements of an MJCF that Newton's ``SolverMuJoCo`` is asked without, beside what Newton's importer leaves out."""

from harness.explain.changes.readings import _left_out, readings_of

READINGS = readings_of(
    "newton_mujoco",
    {
        ("mjcf",): {
            _left_out.actuators: (
                "Newton's SolverMuJoCo drives by targets and controls that the user sets; its actuators are off here",
                _left_out.DRIVE,
                "Newton documentation, SolverMuJoCo: joint_target_mode, and custom attributes: mujoco:ctrl",
            ),
        },
    },
)
