"""A log of measured joint positions as the second side: which number of the model, changed alone, explains most of the gap.

The model moves from the first row of the log; what other velocities there would do is no part of the gap. Each number that its author
measures is changed a little; along what that does to the motion the gap has a least-squares change. Those that explain most are moved anew,
from a multiple of the number on, until the gap is least: a part that is told is of a motion that was computed. Numbers whose effects are
parallel are told together, as no log of these joints tells them apart.

Source: Gauss-Newton method; Khalil, Dombre, Modeling, Identification and Control of Robots (2002), chapter 12, for what is identifiable.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from harness.arrays import Array
from harness.drifts.control import read_table
from harness.drifts.plan import MovingSide, acting, columns_of
from harness.engines.moving import Control, HeldNumbers, MotionsRequest, Moved, NamedNumber, SimulatedFile
from harness.errors import InvalidRequest
from harness.explain.changes.held import HeldFile
from harness.results.cause import DriftCause
from harness.results.measured import MeasuredNumber, MeasuredRecord

# At most so many rows of a log are held against the model, and so many numbers are fitted.
_ROWS, _FITTED = 200, 24
_ITERATIONS, _FACTORS = 6, (0.5, 0.75, 1.5, 2.0)
# Rows by which the velocity at the start is estimated.
_FIRST_ROWS = 5
# Change of a number by which its effect is computed, relative, and of a velocity [m/s or rad/s]; cosine from which on effects are parallel.
_CHANGE, _VELOCITY_CHANGE, PARALLEL = 1e-2, 1e-4, 0.98
# A gap that is less than this part of the way is what rounding and the velocities at the start leave.
_NO_GAP = 1e-12
# Parts of the gap that are one for what is told first.
_AS_MUCH = 1e-3
DELAY = NamedNumber(DriftCause.DELAY, "", "control delay [s]", 0.0, ("", ""), {}, least=0.0)


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


@dataclass(frozen=True, eq=False)
class _Model:
    """The model that moves: a request for one motion of the unchanged file, and all about the log.

    Attributes:
        columns: of the joints of the log, in v. measured: (k, joints) positions of the log at the recorded steps. first: at its first row.
    """

    held: HeldNumbers
    request: MotionsRequest
    motion: SimulatedFile
    columns: tuple[int, ...]
    places: tuple[int, ...]
    measured: Array
    first: Array


def measured_drift(settings: MeasuredSettings, move: Callable[[MotionsRequest], Moved], held: HeldNumbers) -> MeasuredRecord:
    """The record; ``move`` computes motions by the engine that has ``held`` of the file.

    Raises:
        InvalidRequest: the log is none of this model, or the model breaks down.
    """
    model = _model(settings, held)
    base = move(replace(model.request, motions=[model.motion]))
    if not np.isfinite(base.q).all():
        raise InvalidRequest(f"{settings.side.path.name} breaks down before {settings.log.name} ends; give fewer --seconds")
    whiten = _whitening(base.mass, model.columns)
    from_start = _beside(np.array([whiten(moved[:, model.places] - base.q[0][:, model.places]) for moved in _started(model, move)]))
    gap = from_start(whiten(model.measured - base.q[0][:, model.places]))
    way = whiten(model.measured - model.first)
    count, numbers = 1 + len(model.columns), [*held.named, *([DELAY] if model.request.control.names else [])]

    def positions(changed: Sequence[tuple[NamedNumber, float]]) -> Array:
        nonlocal count
        count += len(changed)
        motions = [_changed(model, number, value) for number, value in changed]
        tracks = _all(move, model.request, motions)
        return np.array([from_start(whiten(track[:, model.places] - base.q[0][:, model.places])) for track in tracks])

    is_gap = bool(np.linalg.norm(gap) > _NO_GAP * np.linalg.norm(way))
    fits = _fitted(numbers, gap, positions, _smallest(model)) if is_gap else []
    best = _likeliest_first(sorted(fits, key=lambda fit: -fit.explained))
    file = HeldFile(settings.side.path)
    return MeasuredRecord(
        path=settings.side.path.name,
        log=settings.log.name,
        mover=f"{settings.side.engine}, {held.integrator}, steps of {held.length:g} s",
        joints=[name for name, (place, _) in columns_of(held.joints).items() if place.start in model.places],
        seconds=model.motion.counts[-1] * held.length,
        gap=float(np.linalg.norm(gap) / np.linalg.norm(way)) if way.any() else float("inf"),
        numbers=tuple(_told(fit, best, file) for fit in best),
        motions=count,
    )


def _model(settings: MeasuredSettings, held: HeldNumbers) -> _Model:
    names, times, values = read_table(settings.log, "positions", "joint")
    if unknown := [name for name in names if name not in held.joints or held.joints[name].sizes != (1, 1)]:
        expected = ", ".join(name for name, kind in held.joints.items() if kind.sizes == (1, 1))
        raise InvalidRequest(f"{settings.log} has the column {unknown[0]!r}, which is no hinge or slide of the model; expected {expected}")
    own = columns_of(held.joints)
    places, columns = (tuple(own[name][part].start for name in names) for part in range(2))
    began, times = times[0], times - times[0]
    last = times[-1] if settings.seconds is None else min(times[-1], settings.seconds)
    counts = sorted({round(time / held.length) for time in times[times <= last * (1 + 1e-9)]} - {0})
    if not counts:
        raise InvalidRequest(f"{settings.log} ends within one step of {held.length:g} s; expected several rows")
    kept = sorted({counts[round(place)] for place in np.linspace(0, len(counts) - 1, min(_ROWS, len(counts)))})
    grid = np.array(kept) * held.length
    measured = np.column_stack([np.interp(grid, times, values[:, column]) for column in range(len(names))])
    q, v = held.q.copy(), held.v.copy()
    q[list(places)] = values[0]
    v[list(columns)] = [_first_velocity(times, positions) for positions in values.T]
    control = settings.control or Control.constant(held.control)
    if control.function is None:
        # Both tables are of one clock.
        control = replace(control, times=control.times - began)
    control = acting(control, list(held.control), held.servos, kept[-1] * held.length)
    motion = SimulatedFile(settings.side.file, {}, settings.side.timing(held.length), tuple(kept))
    request = MotionsRequest((), tuple(held.joints), q, v, control)
    return _Model(held, request, motion, columns, places, measured, values[0])


def _first_velocity(times: Array, positions: Array) -> float:
    """That of the parabola through the first row that is nearest to those behind it; a difference of two rows is half a step late."""
    few = slice(1, _FIRST_ROWS)
    t, moved = times[few], positions[few] - positions[0]
    return float(np.linalg.lstsq(np.column_stack([t, t**2]), moved)[0][0]) if len(t) > 1 else float(moved[0] / t[0])


def _whitening(mass: Array, columns: Sequence[int]) -> Callable[[Array], Array]:
    """Positions (k, joints) in the kinetic-energy norm of these joints, as one vector."""
    factors = np.linalg.cholesky(mass[np.ix_(range(len(mass)), columns, columns)])
    return lambda positions: np.einsum("kji,kj->ki", factors, positions).ravel()


def _started(model: _Model, move: Callable[[MotionsRequest], Moved]) -> list[Array]:
    """Motions that start with another velocity of one joint of the log."""
    found = []
    for column in model.columns:
        v = model.request.v.copy()
        v[column] += _VELOCITY_CHANGE
        found += _all(move, replace(model.request, v=v), [model.motion])
    return found


def _beside(effects: Array) -> Callable[[Array], Array]:
    """A vector without its part that effects (m, n) make together: velocities at the start are not measured."""
    basis = np.linalg.qr(effects[np.isfinite(effects).all(axis=1)].T)[0]
    return lambda vector: vector - basis @ (basis.T @ vector)


def _changed(model: _Model, number: NamedNumber, value: float) -> SimulatedFile:
    if number is DELAY:
        return replace(model.motion, timing=replace(model.motion.timing, delay=model.motion.timing.delay + value))
    rows = {key: row for own in model.held.by_cause.values() for key, row in own.items() if key in number.directions}
    return replace(model.motion, over={key: rows[key] + (value - number.value) * part for key, part in number.directions.items()})


def _all(move: Callable[[MotionsRequest], Moved], request: MotionsRequest, motions: Sequence[SimulatedFile]) -> list[Array]:
    return list(move(replace(request, motions=motions)).q) if motions else []


def _smallest(model: _Model) -> Callable[[NamedNumber], float]:
    """The change of a number by which its effect is computed."""

    def change(number: NamedNumber) -> float:
        return model.held.length if number is DELAY else _CHANGE * abs(number.value) or number.natural

    return change


@dataclass(eq=False)
class _Fit:
    number: NamedNumber
    value: float
    effect: Array
    explained: float


def _fitted(
    numbers: Sequence[NamedNumber],
    gap: Array,
    positions: Callable[[Sequence[tuple[NamedNumber, float]]], Array],
    change: Callable[[NamedNumber], float],
) -> list[_Fit]:
    """The numbers that explain most along their effects, each at the value at which its motion is nearest."""
    first = positions([(number, number.value + change(number)) for number in numbers])
    fits = [
        _Fit(number, number.value, moved / change(number), 0.0)
        for number, moved in zip(numbers, first, strict=True)
        if np.isfinite(moved).all() and moved.any()
    ]
    # Friction and limits of forces bend what a number does: its multiples are tried beside its derivative.
    scanned = [(fit, factor * fit.number.value) for fit in fits for factor in _FACTORS if fit.number.value]
    nearest = {id(fit): (_along(fit.effect, gap) ** 2, fit.value) for fit in fits}
    for (fit, value), moved in zip(scanned, positions([(fit.number, value) for fit, value in scanned]), strict=True):
        explained = 1.0 - float((gap - moved) @ (gap - moved) / (gap @ gap))
        if explained > nearest[id(fit)][0]:
            nearest[id(fit)] = explained, value
    fits = sorted(fits, key=lambda fit: -nearest[id(fit)][0])[:_FITTED]
    left = {id(fit): gap for fit in fits}

    def take(tried: Sequence[tuple[_Fit, float]]) -> list[bool]:
        """Move with other values, and keep each that leaves less."""
        found = positions([(fit.number, at) for fit, value in tried for at in (value, value + change(fit.number))])
        taken = []
        for (fit, value), moved, further in zip(tried, found[::2], found[1::2], strict=True):
            residual = gap - moved
            explained = 1.0 - float(residual @ residual / (gap @ gap)) if np.isfinite(moved).all() else -np.inf
            taken.append(explained > fit.explained)
            if taken[-1]:
                fit.value, fit.explained, left[id(fit)] = value, explained, residual
                effect = (further - moved) / change(fit.number)
                fit.effect = effect if np.isfinite(effect).all() and effect.any() else fit.effect
        return taken

    take([(fit, nearest[id(fit)][1]) for fit in fits])
    parts = np.ones(len(fits))
    for _ in range(_ITERATIONS):
        steps = [part * float(fit.effect @ left[id(fit)] / (fit.effect @ fit.effect)) for fit, part in zip(fits, parts, strict=True)]
        taken = take([(fit, max(fit.value + step, fit.number.least)) for fit, step in zip(fits, steps, strict=True)])
        parts = np.where(taken, 1.0, parts / 4)
    return fits


def _along(one: Array, other: Array) -> float:
    """Cosine of the angle between two vectors."""
    return float(one @ other / (np.linalg.norm(one) * np.linalg.norm(other)))


def _are_alike(one: _Fit, other: _Fit) -> bool:
    """True where the log does not tell two numbers apart."""
    return abs(one.explained - other.explained) <= 1 - PARALLEL**2 and abs(_along(one.effect, other.effect)) >= PARALLEL


def _likeliest_first(fits: list[_Fit]) -> list[_Fit]:
    """The same, of those that explain as much as the first the one before all others that changes least relative to itself."""

    def change(fit: _Fit) -> float:
        return abs(fit.value / fit.number.value - 1) if fit.number.value else np.inf

    likeliest = min((fit for fit in fits if fits[0].explained - fit.explained <= _AS_MUCH), key=change, default=None)
    return sorted(fits, key=lambda fit: fit is not likeliest)


def _told(fit: _Fit, fits: Sequence[_Fit], file: HeldFile) -> MeasuredNumber:
    array, owner = fit.number.key
    place = file.says(array, owner)[0].told(file.path) if array else ""
    alike = [other for other in fits if other is not fit and _are_alike(fit, other)]
    return MeasuredNumber(
        cause=fit.number.cause,
        owner=fit.number.owner,
        what=fit.number.what,
        place=place,
        value=fit.number.value,
        fitted=fit.value,
        explained=fit.explained,
        alike=tuple(" of ".join(filter(None, (other.number.what, other.number.owner))) for other in alike),
    )
