"""The accelerations that a model file means, by recursion over it in balls."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from harness.arrays import Array
from harness.equations.balls import mass_matrix, solved
from harness.equations.kernels import BallKernel
from harness.equations.program import right_hand_side
from harness.equations.states import States
from harness.models.model_file import ModelFile
from harness.robots.recursion import Recursion, recursion_program
from harness.robots.robot import tree_of

BITS, LEAST_BITS = 192, 80


def accelerations(model: ModelFile, joints: Sequence[str], gravity: float, states: States) -> Array:
    """qdd, (n, nv), at states as ``recursion_program`` takes them; NaN where fewer than ``LEAST_BITS`` bits of one are certain.

    ``gravity`` [m/s^2, along -z] is for a URDF, which holds none. No float64 kernel is compiled.

    Raises:
        InvalidModel: as ``read_robot``. ValueError: the model has other joints.
    """
    return accelerations_of(recursion_program(tree_of(model, gravity), joints), states)


def accelerations_of(recursion: Recursion, states: States) -> Array:
    """``accelerations`` of a tree's program."""
    import flint

    program, nv = recursion.program, states.v.shape[1]
    found = np.full_like(states.v, np.nan)
    with flint.ctx.workprec(BITS):
        evaluate = BallKernel(program, len(recursion.parameters)).bind([float(value) for value in recursion.parameters])
        for row, (q, v, tau, time) in enumerate(zip(states.q, states.v, states.tau, states.time, strict=True)):
            values = iter(evaluate(*q.tolist(), *v.tolist(), *tau.tolist(), float(time)))
            outputs = {name: [next(values) for _ in places] for name, places in program.outputs.items()}
            force = right_hand_side(outputs, [flint.arb(applied) for applied in tau.tolist()])
            solution = solved(mass_matrix(outputs["mass"], nv), force)
            if all(ball.rel_accuracy_bits() >= LEAST_BITS or ball == 0 for ball in solution):
                found[row] = [float(ball) for ball in solution]
    return found
