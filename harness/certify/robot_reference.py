"""Certified accelerations of a robot, and their data roundoff.

The data roundoff of a robot is that of a mechanism whose parameters are the numbers of its file: half an ulp of q, v, tau, and of
each number as it stands there, once however many elements share it through a class. Numbers that are zero are exact.
"""

from __future__ import annotations

import numpy as np

from harness.arrays import Array
from harness.certify.reference import Reference, ReferenceKernel
from harness.equations.mechanism import Mechanism
from harness.equations.states import States
from harness.robots.mechanism import mechanism_of
from harness.robots.robot import Robot


class RobotReference:
    """Certified accelerations of one robot; write its program once, evaluate many batches.

    ``linear_velocity_in_body`` says in which frame the states give the linear velocity of a free joint: that of the body, as
    Pinocchio has it, or that of the parent, as MuJoCo has it. ``mechanism`` is the robot's own by default, or that of its tree under
    constraints.
    """

    def __init__(self, robot: Robot, linear_velocity_in_body: bool = False, mechanism: Mechanism | None = None) -> None:
        self.robot = robot
        self.mechanism: Mechanism = mechanism_of(robot) if mechanism is None else mechanism
        self.kernel = ReferenceKernel(self.mechanism, linear_velocity_in_body)

    def evaluate(self, states: States, numbers: Array | None = None) -> Reference:
        """The reference at ``states``, whose q, v and tau follow ``robot.joints``; see ``recursion_program`` for the coordinates.

        ``numbers``, (n, parameters of ``mechanism``), gives each state numbers of its own in place of the file's.
        """
        return self.kernel.evaluate(states, numbers)

    def derivatives(self, states: States, accelerations: Array) -> Array:
        """d(force - M qdd)/dz at fixed qdd, (n, nv, number of inputs), in float64; inputs are q, v, tau, t and the file's numbers."""
        found = np.zeros((len(states), self.mechanism.nv, len(self.mechanism.program.inputs)))
        for chart, chosen in self.kernel.by_chart(states):
            inputs = np.ascontiguousarray(self.mechanism.inputs(states[chosen]).T)
            found[chosen] = chart.derivatives(inputs, np.ascontiguousarray(accelerations[chosen]))
        return found
