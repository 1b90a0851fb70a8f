"""The motion that a rule gives over many steps without applied forces, in balls.

Precision rises until every number of the end is known to ``SOUGHT_RADIUS``: each step widens the balls by what it does to a difference.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from harness.files.rules import StepRule
from harness.programs.kernels import BallKernel
from harness.trees.stepping.step_forces import StepForces
from harness.trees.stepping.steps import LARGEST_TURN, steps_program

PRECISIONS = (128, 256, 512, 1024, 2048, 4096)
# Relative to a number's size, and at least to 1.
SOUGHT_RADIUS = 2.0**-80


class DeclaredMotion:
    """Steps of one rule on the forces of one tree; ``attitudes`` as of ``steps_program``."""

    def __init__(self, forces: StepForces, attitudes: Sequence[int], rule: StepRule) -> None:
        self._steps, self._length, self._attitudes = steps_program(forces, attitudes, (rule,)), rule.length, attitudes
        self._kernel = BallKernel(self._steps.program, len(self._steps.parameters) + 1)

    def end(self, q: Sequence[float], v: Sequence[float], steps: int) -> tuple[list[Any], list[Any]]:
        """q and v after so many steps, as ``arb``.

        Raises:
            ValueError: the last precision does not give it, as where the motion breaks down, or a rotation turns by more than
                ``LARGEST_TURN`` in a step.
        """
        import flint

        for precision in PRECISIONS:
            with flint.ctx.workprec(precision):
                found = self._end([*map(flint.arb, (*q, *v))], len(q), steps)
                if all(ball.is_finite() and ball.rad() <= SOUGHT_RADIUS * (1 + abs(ball)) for ball in found):
                    return found[: len(q)], found[len(q) :]
        raise ValueError(f"the motion is not certain after {steps} steps of {self._length:g} s, with {PRECISIONS[-1]} bits either")

    def _end(self, state: list[Any], nq: int, steps: int) -> list[Any]:
        numbers = [*map(float, self._steps.parameters), self._length]
        evaluate, still = self._kernel.bind(numbers), [0.0] * (len(state) - nq + 1)
        for _ in range(steps):
            *state, _ = evaluate(*state, *still)
            if not all(ball.is_finite() for ball in state):
                break
            for place in self._attitudes:
                turn = self._length * math.hypot(*map(float, state[nq + place : nq + place + 3]))
                if turn > LARGEST_TURN:
                    raise ValueError(f"a rotation turns by {turn:.3g} rad in a step of {self._length:g} s; expected up to {LARGEST_TURN:g}")
        return state
