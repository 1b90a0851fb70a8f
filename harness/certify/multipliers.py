"""Certified multipliers of a mechanism's constraints: what each row bears, with its derivatives by all inputs."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from harness.arrays import Array
from harness.certify.certified import Flags
from harness.certify.quantity import QuantityKernel
from harness.equations.constraint_forces import MULTIPLIERS
from harness.equations.evaluation import jacobians
from harness.equations.mechanism import Mechanism
from harness.equations.program import without_unused
from harness.equations.states import States


@dataclass(frozen=True)
class Multipliers:
    """What m rows bear at n states [N or N m].

    Attributes:
        high, low, radius: (n, m). slopes: (n, m, inputs of the mechanism's program), in float64. certified: (n,).
    """

    high: Array
    low: Array
    radius: Array
    slopes: Array
    certified: Flags


class MultiplierKernel:
    """The multipliers of a mechanism with ``rows`` rows, none of them for a tree; write once, evaluate many batches."""

    def __init__(self, mechanism: Mechanism, rows: int) -> None:
        self._mechanism, self._rows = mechanism, rows
        if rows:
            program = mechanism.program
            self._program = without_unused(replace(program, outputs={MULTIPLIERS: program.outputs[MULTIPLIERS]}))
            self._kernel = QuantityKernel(self._program, [[row] for row in range(rows)])

    def evaluate(self, states: States) -> Multipliers:
        """What the rows bear at ``states``."""
        inputs = np.ascontiguousarray(self._mechanism.inputs(states).T)
        n, count = inputs.shape
        none = np.zeros((n, 0))
        if not self._rows:
            return Multipliers(none, none, none, np.zeros((n, 0, count)), np.ones(n, dtype=np.bool_))
        found = self._kernel.evaluate(inputs)
        slopes = jacobians(self._program, np.ascontiguousarray(inputs.T))[MULTIPLIERS].transpose(2, 0, 1)
        return Multipliers(found.high[:, :, 0], found.low[:, :, 0], found.radius, slopes, found.certified)
