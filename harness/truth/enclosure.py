"""The configurations in which a mechanism closes its constraints, and the rates there: found by compiled loops, and enclosed.

``Configurations`` goes along a branch and encloses in double-double, by the loops that ``harness.programs.loops.closing`` writes. What
they leave unproved, and rows that they have no code for, are for ``Encloser``, in balls, and for ``harness.truth.manifold``.

The Krawczyk operator proves that one configuration, and no other, is near the positions given. The rows over its image, a third run of
the loops, bound the redundant rows, which must contain zero, and the Jacobian, which gives the rates;
``harness.programs.loops.interpreter`` says how.

Source: Krawczyk, Newton-Algorithmen zur Bestimmung von Nullstellen mit Fehlerschranken, Computing 4 (1969); Rump, Verification methods:
rigorous results using floating-point arithmetic, Acta Numerica 19 (2010), section 13.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from harness.arrays import Array, Indices, Rows
from harness.programs.kernels import BallKernel
from harness.programs.loops.encoding import EncodedProgram, encode_program
from harness.programs.loops.interpreter import Bounded, by_state, in_lanes, loop
from harness.programs.mechanisms.mechanism import JACOBIAN, RESIDUAL, Mechanism
from harness.programs.numbers import LANES
from harness.programs.states import States
from harness.storage import Kept


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

    @property
    def rounded(self) -> np.ndarray[Any, np.dtype[np.bool_]]:
        """(n,) whether ``high`` is proved to be the float64 number nearest to each of the numbers."""
        return np.asarray(self.proved & Bounded(self.high, self.low, self.bound).is_nearest.all(axis=1))


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
        """Configurations near the determined positions of q, (n, nv), and their rates, with those of v, (n, nv), that no row determines."""
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


# Bits of the balls, of which the first that give float64 numbers suffice: near a dead point rates of 1e-100 are nothing unusual.
_PRECISIONS = (192, 1024, 4096)
# Of the bits, the share by which a configuration is sought around where Newton's method ended: what its second step leaves.
_SHARE = 0.5
_REFINEMENTS = 12
# Radius of a ball relative to its number, for which that is known to every bit of float64.
_SHARP = 2.0**-60


@dataclass(frozen=True)
class Enclosure:
    """Balls that hold the determined positions, in the order of ``Constraints.positions``, and the rates, of ``Constraints.rates``."""

    positions: Sequence[Any]
    rates: Sequence[Any]


def nearest_float64(ball: Any) -> float:
    """The float64 number nearest to what a ball holds; 0 where that may be zero."""
    return 0.0 if ball.contains(0) else float(ball)


class Encloser:
    """The constraints of one mechanism at its own parameters."""

    def __init__(self, mechanism: Mechanism) -> None:
        assert mechanism.constraints is not None
        self._mechanism, self._constraints = mechanism, mechanism.constraints
        self._rows = self._constraints.independent
        self._holding = [row for row in self._rows if row < self._constraints.holonomic]
        self._evaluators: Kept[Callable[..., Any]] = Kept(len(_PRECISIONS))
        # A mechanism whose constraints are softened has parameters more, which stand last and which no row knows.
        inputs = len(self._constraints.program.inputs)
        self._parameters = mechanism.parameter_values[: inputs - mechanism.nq - 2 * mechanism.nv - 1]
        self._balls = BallKernel(self._constraints.placing, len(self._parameters))

    def enclose(self, q: Sequence[float], v: Sequence[float]) -> Enclosure | None:
        """As ``enclosed``; what is zero, for all that the highest precision tells, is a ball around zero."""
        import flint

        found = None
        for precision in _PRECISIONS:
            with flint.ctx.workprec(precision):
                found = self._enclosed(q, v, precision)
                if found is None or all(ball.rad() <= _SHARP * abs(ball).mid() for ball in (*found.positions, *found.rates)):
                    break
        return found

    def _enclosed(self, q: Sequence[float], v: Sequence[float], precision: int) -> Enclosure | None:
        import flint

        reach = flint.arb(2) ** -round(_SHARE * precision)
        evaluate = self._bound(precision)
        nv, nothing = self._mechanism.nv, [0.0] * (2 * self._mechanism.nv + 1)
        positions, rates = self._constraints.positions, self._constraints.rates
        balls: list[Any] = [flint.arb(value) for value in q]
        jacobian = None
        if positions:
            for _ in range(_REFINEMENTS):
                residual, jacobian = self._parts(evaluate(*balls, *nothing))
                change = _in_balls(jacobian, self._holding, positions, [residual[row] for row in self._holding])
                if change is None:
                    return None
                if all(abs(step) < reach / 4 for step in change):
                    break
                for place, step in zip(positions, change, strict=True):
                    balls[place] = (balls[place] - step).mid()
            else:
                return None
            if not self._is_proved(balls, evaluate, nothing, reach, residual, jacobian):
                return None
        residual, jacobian = self._parts(evaluate(*balls, *nothing))
        if not all(residual[row].contains(0) for row in range(self._constraints.holonomic) if row not in self._holding):
            return None
        others = [place for place in range(nv) if place not in rates]
        moved = [sum((jacobian[row][place] * v[place] for place in others), flint.arb(0)) for row in self._rows]
        found = _in_balls(jacobian, self._rows, rates, moved)
        return None if found is None else Enclosure([balls[place] for place in positions], [-rate for rate in found])

    def _is_proved(
        self,
        balls: list[Any],
        evaluate: Callable[..., Any],
        nothing: Sequence[float],
        reach: Any,
        residual: Sequence[Any],
        at_middle: Sequence[Sequence[Any]],
    ) -> bool:
        """Widen the determined positions to the ball that the Krawczyk operator maps into itself; whether it does.

        ``residual`` and ``at_middle`` are what the rows leave and their Jacobian at the positions given.
        """
        import flint

        positions = self._constraints.positions
        middle = [balls[place] for place in positions]
        for place, ball in zip(positions, middle, strict=True):
            balls[place] = ball + flint.arb(0, 1) * reach * max(1.0, abs(float(ball)))
        _, over_ball = self._parts(evaluate(*balls, *nothing))
        # The last step of Newton's method solved with this matrix.
        approximate, m = _matrix(at_middle, self._holding, positions).inv(), len(positions)
        contraction = flint.arb_mat(m, m, [int(i == j) for i in range(m) for j in range(m)])
        contraction -= approximate * _matrix(over_ball, self._holding, positions)
        step = approximate * flint.arb_mat(m, 1, [residual[row] for row in self._holding])
        reach = contraction * flint.arb_mat(m, 1, [balls[place] - ball for place, ball in zip(positions, middle, strict=True)])
        for number, place in enumerate(positions):
            mapped = middle[number] - step[number, 0] + reach[number, 0]
            if not balls[place].contains_interior(mapped):
                return False
            balls[place] = mapped
        return True

    def _bound(self, precision: int) -> Callable[..., Any]:
        """The rows' program at a precision, which is the one in force."""
        return self._evaluators.get(precision, lambda: self._balls.bind(self._parameters))

    def _parts(self, outputs: Sequence[Any]) -> tuple[Sequence[Any], list[Sequence[Any]]]:
        """The residual, and the Jacobian by rows."""
        nv, first, rows = self._mechanism.nv, self._constraints.holonomic, len(self._constraints.rows)
        return outputs[:first], [outputs[first + row * nv :][:nv] for row in range(rows)]


def _matrix(jacobian: Sequence[Sequence[Any]], rows: Sequence[int], places: Sequence[int]) -> Any:
    import flint

    return flint.arb_mat([[jacobian[row][place] for place in places] for row in rows])


def _in_balls(jacobian: Sequence[Sequence[Any]], rows: Sequence[int], places: Sequence[int], right: Sequence[Any]) -> list[Any] | None:
    """The solution of the rows' square part in balls; None where that is not certainly regular."""
    import flint

    try:
        found = _matrix(jacobian, rows, places).solve(flint.arb_mat(len(places), 1, list(right)))
    except ZeroDivisionError:
        return None
    solution = [found[place, 0] for place in range(len(places))]
    return solution if all(ball.is_finite() for ball in solution) else None
