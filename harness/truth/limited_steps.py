"""Steps of a robot with limits of joints that an engine has on in each, by the law that its rule declares."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from harness.arrays import Array
from harness.files.equalities import limits_of
from harness.files.rules import StepRule
from harness.programs.states import States
from harness.trees.mechanism import mechanism_of
from harness.trees.robot import Robot
from harness.trees.steps import step_by
from harness.truth.declared import DeclaredMechanism
from harness.truth.displaced import pressed
from harness.truth.optimum import optimum


class LimitedSteps:
    """A step of a robot by ``rule`` with its limits of these names; ``attitudes`` as of ``steps_program``.

    Attributes:
        program: its positions and velocities after the step, as of ``steps_program``.
    """

    def __init__(self, robot: Robot, names: Collection[str], attitudes: Sequence[int], rule: StepRule) -> None:
        assert rule.limited is not None
        chosen = [one for one in limits_of(robot.tree) if one.name in names]
        mechanism = optimum(mechanism_of(robot), robot, chosen, dict.fromkeys(names, rule.limited), fuses=False)
        assert isinstance(mechanism, DeclaredMechanism)
        self._mechanism = mechanism
        self.program = step_by(self._mechanism.program, attitudes, rule)

    def pressed(self, states: States, share: float) -> States:
        """The states, a share of them beyond limits and before them."""
        return pressed(self._mechanism, states, share)

    def inputs(self, states: States) -> Array:
        """Inputs of the program, (n, inputs); NaN where no side of some limit is proved."""
        mechanism = self._mechanism
        return np.ascontiguousarray(mechanism.inputs(states, mechanism.parameters_at(states)).T)
