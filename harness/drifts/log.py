"""A log of measured joint positions beside the model that moves from its first row: how far it is from motions with other numbers.

Each row counts alike, the first one too, from which the model starts: the positions there are measured no better than others, and the
velocities are not measured at all.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from harness.arrays import Array
from harness.drifts.control import read_table
from harness.drifts.plan import ROUNDINGS, MovingSide, acting, columns_of
from harness.engines.moving import Control, HeldNumbers, MotionsRequest, Moved, NamedNumber, NumberKey, SimulatedFile
from harness.errors import InvalidRequest
from harness.results.cause import DriftCause
from harness.results.drift import FELT_ROUNDING

# At most so many rows of a log are held against the model.
_ROWS = 200
# Rows by which the velocity at the start is estimated.
_FIRST_ROWS = 5
# Change of a number by which its effect is computed, relative, and of a position or velocity at the start [m or rad, each 1/s].
_CHANGE, _START_CHANGE = 1e-2, 1e-4
# The parts of it over which derivatives are taken whose directions are compared, the first one that is this certain: limits and friction
# bend what a number does over larger ones, a solver's tolerance is felt over smaller ones.
_CLOSE, CERTAIN = (1e-3, 1e-2, 1e-1), 1e-3
DELAY = NamedNumber(DriftCause.DELAY, "", "control delay [s]", 0.0, ("", ""), {}, least=0.0)
# Numbers, by their places, that have other values.
Point = Mapping[int, float]


@dataclass(frozen=True, eq=False)
class MeasuredSettings:
    """A model, a log and the control under which it was recorded.

    Attributes:
        log: the path of a table of positions, a column for each joint that was measured; the model starts at its first row.
        seconds: how long both are held against each other, None for all of the log.
    """

    side: MovingSide
    log: Path
    control: Control | None = None
    seconds: float | None = None


class Log:
    """Rows of a log, and motions of the model held against them.

    A start is a vector (2, joints) of positions and velocities. What the log is away from a motion is a vector over rows and joints,
    (n,), in the kinetic-energy norm of the joints of the log, not finite where the motion breaks down.

    Attributes:
        numbers: that may be wrong. joints: of the log. seconds: of its rows. rows: how many. start: as the log has it.
        way: that of the log from its first row, (n,). motions: how many were computed.

    Raises:
        InvalidRequest: the log is none of this model, or the model breaks down.
    """

    def __init__(self, settings: MeasuredSettings, move: Callable[[MotionsRequest], Moved], held: HeldNumbers) -> None:
        names, times, values = read_table(settings.log, "positions", "joint")
        if unknown := [name for name in names if name not in held.joints or held.joints[name].sizes != (1, 1)]:
            expected = ", ".join(name for name, kind in held.joints.items() if kind.sizes == (1, 1))
            no_joint = f"{settings.log} has the column {unknown[0]!r}, which is no hinge or slide of the model"
            raise InvalidRequest(f"{no_joint}; expected {expected}")
        own, began, times = columns_of(held.joints), times[0], times - times[0]
        self._places, self._columns = ([own[name][part].start for name in names] for part in range(2))
        self.joints = [name for name in own if name in names]
        last = times[-1] if settings.seconds is None else min(times[-1], settings.seconds)
        counts = sorted({round(time / held.length) for time in times[times <= last * (1 + 1e-9)]} - {0})
        if not counts:
            raise InvalidRequest(f"{settings.log} ends within one step of {held.length:g} s; expected several rows")
        kept = [0, *sorted({counts[round(place)] for place in np.linspace(0, len(counts) - 1, min(_ROWS, len(counts)))})]
        grid = np.array(kept) * held.length
        measured = np.column_stack([np.interp(grid, times, values[:, column]) for column in range(len(names))])
        self.rows, self.seconds = len(kept), float(grid[-1])
        self.start = np.array([values[0], [_first_velocity(times, positions) for positions in values.T]])
        control = settings.control or Control.constant(held.control)
        if control.function is None:
            # Both tables are of one clock.
            control = replace(control, times=control.times - began)
        control = acting(control, list(held.control), held.servos, self.seconds)
        self.numbers = [*held.named, *([DELAY] if control.names else [])]
        self._held, self._move, self.motions = held, move, 0
        self._motion = SimulatedFile(settings.side.file, {}, settings.side.timing(held.length), tuple(kept))
        self._request = MotionsRequest((), tuple(held.joints), held.q, held.v, control)
        base = self._moved([self._motion], self.start, wants_mass=True)
        if not np.isfinite(base.q).all():
            raise InvalidRequest(f"{settings.side.path.name} breaks down before {settings.log.name} ends; give fewer --seconds")
        self._factors = np.linalg.cholesky(base.mass[np.ix_(range(self.rows), self._columns, self._columns)])
        self._measured = measured
        self.way = self._whitened(measured - measured[0])

    def left(self, points: Sequence[Point], start: Array) -> Array:
        """The log less the motions with other numbers, (points, n)."""
        return self._left([self._changed(point) for point in points], start)

    def is_rounding(self, left: Array) -> bool:
        """True where rounding is felt in what the log is away from a motion, so that nothing is claimed of that."""
        return bool(np.linalg.norm(left) * FELT_ROUNDING <= self._rounding)

    @cached_property
    def _rounding(self) -> float:
        """Length of what accumulated rounding makes of the motion of the file."""
        tracks = self._left([self._motion, *(replace(self._motion, rounding=seed) for seed in ROUNDINGS)], self.start)
        return float(np.linalg.norm(tracks[1:] - tracks[0], axis=1).max())

    def effects(self, point: Point, start: Array, changes: Mapping[int, float]) -> Array:
        """The effects of numbers by differences over their ``changes``, (changes, n) in the unit of each."""
        base, *others = self.left([point, *(self._beyond(point, place, by) for place, by in changes.items())], start)
        return np.array([(base - other) / by for other, by in zip(others, changes.values(), strict=True)]).reshape(-1, base.size)

    def slopes(self, point: Point, start: Array) -> dict[int, tuple[Array, Array]]:
        """The derivative by each number that is felt, and the same over twice the change, which tells what is uncertain of it."""
        base, found = self.left([point], start)[0], {}
        for place in range(len(self.numbers)):
            tried: list[tuple[float, int, Array, Array]] = []
            for part in _CLOSE:
                by = self.change(place, part)
                near, middle, far = base - self.left([self._beyond(point, place, times * by) for times in (1, 2, 4)], start)
                slope, wider = (4 * near - middle) / (2 * by), (4 * middle - far) / (4 * by)
                length = float(np.linalg.norm(slope))
                if 0 < length < np.inf and np.isfinite(wider).all():
                    tried.append((float(np.linalg.norm(wider - slope)) / length, len(tried), slope, wider))
                if not length or (tried and tried[-1][0] <= CERTAIN):
                    break
            if tried:
                found[place] = min(tried)[2:]
        return found

    def _beyond(self, point: Point, place: int, by: float) -> Point:
        return {**point, place: self.value(point, place) + by}

    def effects_of_start(self, point: Point, start: Array) -> Array:
        """The effects of positions and velocities at the start that are finite, (m, n)."""
        base, found = self.left([point], start)[0], []
        for place in range(start.size):
            other = start.copy()
            other.flat[place] += _START_CHANGE
            found.append((base - self.left([point], other)[0]) / _START_CHANGE)
        return np.array(found)

    def value(self, point: Point, place: int) -> float:
        return point.get(place, self.numbers[place].value)

    def change(self, place: int, part: float = 1.0) -> float:
        """A change of a number by which its effect is computed; ``part`` of it, where the number is no delay, which acts step by step."""
        number = self.numbers[place]
        return self._held.length if number is DELAY else part * (_CHANGE * abs(number.value) or number.natural)

    def _left(self, motions: Sequence[SimulatedFile], start: Array) -> Array:
        if not motions:
            return np.empty((0, self.way.size))
        tracks = self._moved(motions, start).q[:, :, self._places]
        return np.array([self._whitened(self._measured - track) for track in tracks])

    def _moved(self, motions: Sequence[SimulatedFile], start: Array, wants_mass: bool = False) -> Moved:
        self.motions += len(motions)
        q, v = self._request.q.copy(), self._request.v.copy()
        q[self._places], v[self._columns] = start
        return self._move(replace(self._request, motions=motions, q=q, v=v, wants_mass=wants_mass))

    def _whitened(self, positions: Array) -> Array:
        return np.asarray(np.einsum("kji,kj->ki", self._factors, positions).ravel())

    def _changed(self, point: Point) -> SimulatedFile:
        over: dict[NumberKey, Array] = {}
        timing = self._motion.timing
        for place, value in point.items():
            number = self.numbers[place]
            if number is DELAY:
                timing = replace(timing, delay=timing.delay + value)
            for key, part in number.directions.items():
                over[key] = over.get(key, self.row(key)) + (value - number.value) * part
        return replace(self._motion, over=over, timing=timing)

    def row(self, key: NumberKey) -> Array:
        """The numbers that the engine holds of the file in a row."""
        return next(own[key] for own in self._held.by_cause.values() if key in own)


def _first_velocity(times: Array, positions: Array) -> float:
    """That of the parabola through the first row that is nearest to those behind it; a difference of two rows is half a step late."""
    few = slice(1, _FIRST_ROWS)
    t, moved = times[few], positions[few] - positions[0]
    return float(np.linalg.lstsq(np.column_stack([t, t**2]), moved)[0][0]) if len(t) > 1 else float(moved[0] / t[0])
