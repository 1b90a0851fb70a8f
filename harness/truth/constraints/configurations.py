"""The configurations of a mechanism with constraints by compiled loops: the way along a branch, and enclosures in double-double.

``harness.programs.loops.closing`` writes the loops. What they leave unproved, and rows that they have no code for, are for
``harness.truth.constraints.manifold`` and ``harness.truth.constraints.enclosure``.

The Krawczyk operator proves that one configuration, and no other, is near the positions given. A third run of the rows over its image
bounds the redundant rows and the Jacobian, which gives the rates; ``harness.programs.loops.interpreter`` says how.

Source: Rump, Verification methods: rigorous results using floating-point arithmetic, Acta Numerica 19 (2010), section 13.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from harness.arrays import Array, Indices, Rows
from harness.programs.loops.encoding import EncodedProgram, encode_program
from harness.programs.loops.interpreter import by_state, in_lanes, loop
from harness.programs.mechanisms.mechanism import JACOBIAN, RESIDUAL, Mechanism
from harness.programs.numbers import LANES
from harness.programs.states import States


@dataclass(frozen=True)
class Enclosed(Rows):
    """The positions that rows determine, in the order of ``Constraints.positions``, and then the rates, of ``Constraints.rates``.

    Attributes:
        high, low, bound: (n, held + tied); each number is within ``bound`` of high + low, where that is proved.
        proved: (n,) whether it is.
    """

    high: Array
    low: Array
    bound: Array
    proved: np.ndarray[Any, np.dtype[np.bool_]]

    def __len__(self) -> int:
        return len(self.high)

    @property
    def rounded(self) -> np.ndarray[Any, np.dtype[np.bool_]]:
        """(n,) whether ``high`` is proved to be the float64 number nearest to each of the numbers."""
        # Half the gap to the next number towards zero, which is never the wider one.
        half = np.spacing(np.nextafter(np.abs(self.high), 0.0)) / 2
        exact = np.isfinite(self.high) & (self.low == 0) & (self.bound == 0)
        with np.errstate(all="ignore"):
            near = (np.abs(self.low) + self.bound) * (1 + 1e-10) < half
        return np.asarray(self.proved & (near | exact).all(axis=1))


class Configurations:
    """The rows of one mechanism at its own parameters, for the loops."""

    def __init__(self, mechanism: Mechanism, steps: EncodedProgram, places: dict[str, Indices]) -> None:
        constraints = mechanism.constraints
        assert constraints is not None
        self._mechanism, self._steps = mechanism, steps
        nv, rows = mechanism.nv, list(constraints.independent)
        holding = [row for row in rows if row < constraints.holonomic]
        redundant = [row for row in range(constraints.holonomic) if row not in holding]
        self.positions, self.rates = list(constraints.positions), list(constraints.rates)
        self.others = [place for place in range(nv) if place not in self.positions]
        self.free = [place for place in range(nv) if place not in self.rates]
        residual, jacobian = places[RESIDUAL], places[JACOBIAN].reshape(-1, nv)
        by_positions, self._by_others = (np.ascontiguousarray(jacobian[np.ix_(holding, some)]) for some in (self.positions, self.others))
        self._held = len(holding), np.array(self.positions, dtype=np.int64), residual[holding], by_positions
        self._redundant = residual[redundant]
        self._by_rates, self._by_free = (np.ascontiguousarray(jacobian[np.ix_(rows, some)]) for some in (self.rates, self.free))

    @classmethod
    def of(cls, mechanism: Mechanism) -> Configurations | None:
        """None where the rows hold a function that the loops have no code for."""
        assert mechanism.constraints is not None
        encoded = encode_program(mechanism.constraints.placing)
        return None if encoded is None else cls(mechanism, *encoded)

    def follow(self, begun: Array, target: Array, steps: int, corrections: int, much: float, least_much: float) -> tuple[Array, Array]:
        """The determined positions, (n, held), on a straight way in ``steps`` from ``begun``, (nv,), to ``target``, (n, others), for the
        other coordinates, and how far the last of ``corrections`` moved them, (n,).

        NaN where a step along the tangent is corrected by more than ``much`` of it and ``least_much``.
        """
        n, held = len(target), len(self.positions)
        blocks = -(-n // LANES)
        found, change = np.empty((blocks, held, LANES)), np.empty((blocks, LANES))
        q = np.broadcast_to(begun, (n, len(begun)))
        loop("follow", "closing")(
            *self._program(n, len(self.others), 1), *self._held, steps, corrections, float(much), float(least_much),
            np.array(self.others, dtype=np.int64), self._by_others, np.ascontiguousarray(begun), self._given(q), in_lanes(target),
            np.zeros((held, held + 2, LANES)), found, change,
        )  # fmt: skip
        return by_state(found, n), by_state(change, n)

    def enclose(self, q: Array, v: Array) -> Enclosed:
        """What is near the determined positions of q, (n, nv), and the rates there, with those of v, (n, nv), that no row determines."""
        n, held, tied = len(q), len(self.positions), len(self.rates)
        blocks = -(-n // LANES)
        found, is_proved = np.empty((blocks, held + tied, 3, LANES)), np.empty((blocks, LANES))
        room = (2 * tied * tied,), (7, tied + 3, tied + 3), (tied, 2)
        matrix, work, rates = (np.zeros((*shape, LANES)) for shape in room)
        loop("enclose", "closing")(
            *self._program(n, len(self.free), 3, tied), *self._held, len(self._redundant), tied, self._redundant, self._by_rates,
            self._by_free, np.arange(self._steps.places, self._steps.places + tied), self._given(q), in_lanes(v[:, self.free]),
            np.ones((tied, LANES)), matrix, work, rates, found, np.empty((tied, LANES)), is_proved,
        )  # fmt: skip
        numbers = by_state(found, n)
        high, low, bound = (np.ascontiguousarray(numbers[..., part]) for part in range(3))
        return Enclosed(high, low, bound, by_state(is_proved, n) > 0)

    def _program(self, n: int, free: int, width: int, further: int = 0) -> tuple[object, ...]:
        """The arguments of a loop that are of its program, with room for its results, ``width`` numbers each, and for ``further``."""
        steps = self._steps
        sizes = n, len(steps.instructions), steps.inputs, len(steps.constants), free
        return *sizes, steps.instructions, steps.constants, np.zeros((steps.places + further, width, LANES))

    def _given(self, q: Array) -> Array:
        """The inputs of the rows at rest."""
        still = np.zeros((len(q), self._mechanism.nv))
        inputs = self._mechanism.inputs(States(q, still, still, np.zeros(len(q))))
        return in_lanes(inputs[: self._steps.inputs].T)
