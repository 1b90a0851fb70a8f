"""Least-squares fits of numbers of a model to a log, each alone or several at once, and which of them the noise of the log does not make.

Positions and velocities at the start are fitted with them, so that no number makes up for those. The standard errors hold for noise that
is of another size in each joint, and that neighbouring rows share.

Sources: Gauss-Newton method; Frisch and Waugh (1933) for effects beside others; Newey and West, A simple, positive semi-definite,
heteroskedasticity and autocorrelation consistent covariance matrix, Econometrica 55 (1987); their Automatic lag selection in covariance
matrix estimation (1994) for the number of lags.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from harness.arrays import Array
from harness.drifts.log import Log, Point

_ITERATIONS, _FACTORS = 6, (0.5, 0.75, 1.5, 2.0)
_MOST_STEPS = 20
# Steps that do not lessen what is left are shortened by this factor, so many times.
_SHORTENED, _MOST_SHORTENED = 0.25, 3
# After the first step, derivatives are taken over this part of the usual change.
_CLOSER = 0.1
# A step that lessens the square by a smaller part is the last; one that lessens it by this part needs no better derivatives. Those by the
# start, which take most motions, are good for so many steps that lessen it by less.
_LEAST_GAIN, _GOOD, _STEPS_BY_STARTS = 1e-4, 0.9, 4
# Chance that the noise of a log alone makes any number of the file significant.
_FALSE_ALARM = 1e-3


@dataclass(eq=False)
class Fit:
    """One number at the value at which its motion is nearest to the log.

    Attributes:
        left: what the log is away from that. effect: of a unit of the number there. explained: the part of the square that is gone.
    """

    place: int
    value: float
    effect: Array
    left: Array
    explained: float = 0.0


@dataclass(frozen=True, eq=False)
class JointFit:
    """Several numbers, and the start, at which the motion is nearest to the log.

    Attributes:
        columns: effects of the numbers beside those of the start, (numbers, n). starts: those of the start, (m, n).
        is_free: of the numbers, which are above the least that they can be.
    """

    point: Point
    start: Array
    left: Array
    columns: Array
    starts: Array
    is_free: Array

    @property
    def square(self) -> float:
        return float(self.left @ self.left)

    @property
    def variance(self) -> float:
        """The square that is left to each row and joint, beside those that determine what is fitted."""
        return self.square / max(1, self.left.size - len(self.starts) - len(self.columns))


def beside(effects: Array) -> Callable[[Array], Array]:
    """Vectors without the part that effects (m, n) make together."""
    effects = effects[np.isfinite(effects).all(axis=1) & effects.any(axis=1)]
    # Of effects that depend on one another the basis is of those that do not.
    basis, sizes, _ = np.linalg.svd((effects / np.linalg.norm(effects, axis=1, keepdims=True)).T, full_matrices=False)
    basis = basis[:, sizes > np.finfo(float).eps * max(effects.shape) * sizes[:1].sum()]
    return lambda vector: vector - (vector @ basis) @ basis.T


def alone(log: Log, others: Callable[[Array], Array], count: int) -> list[Fit]:
    """The numbers that explain most along their effects, each alone beside what ``others`` takes off, best first, at most ``count``."""
    return _nearest(log, {}, log.start, others, count, _FACTORS)


def further(log: Log, fit: JointFit, count: int) -> list[Fit]:
    """The same beside the numbers and the start of a fit, by their derivatives alone."""
    return _nearest(log, fit.point, fit.start, beside(np.vstack([fit.columns[fit.is_free], fit.starts])), count, ())


def _nearest(log: Log, point: Point, start: Array, others: Callable[[Array], Array], count: int, factors: Sequence[float]) -> list[Fit]:
    gap = others(log.left([point], start)[0])
    square = float(gap @ gap)

    def left(tried: Sequence[tuple[int, float]]) -> Array:
        return others(log.left([{**point, place: value} for place, value in tried], start))

    places = [place for place in range(len(log.numbers)) if place not in point]
    first = left([(place, log.value(point, place) + log.change(place)) for place in places])
    fits = [
        Fit(place, log.value(point, place), (gap - there) / log.change(place), gap)
        for place, there in zip(places, first, strict=True)
        if np.isfinite(there).all() and (gap - there).any()
    ]
    # Friction and limits of forces bend what a number does: its multiples are tried beside its derivative.
    scanned = [(fit, factor * fit.value) for fit in fits for factor in factors if fit.value]
    nearest = {fit.place: (_cosine(fit.effect, gap) ** 2, fit.value) for fit in fits}
    for (fit, value), there in zip(scanned, left([(fit.place, value) for fit, value in scanned]), strict=True):
        explained = 1.0 - float(there @ there) / square
        if explained > nearest[fit.place][0]:
            nearest[fit.place] = explained, value
    fits = sorted(fits, key=lambda fit: -nearest[fit.place][0])[:count]

    def take(tried: Sequence[tuple[Fit, float]]) -> list[bool]:
        """Move with other values, and keep each that leaves less."""
        found = left([(fit.place, at) for fit, value in tried for at in (value, value + log.change(fit.place))])
        taken = []
        for (fit, value), there, further in zip(tried, found[::2], found[1::2], strict=True):
            explained = 1.0 - float(there @ there) / square if np.isfinite(there).all() else -np.inf
            taken.append(explained > fit.explained)
            if taken[-1]:
                effect = (there - further) / log.change(fit.place)
                fit.value, fit.explained, fit.left = value, explained, there
                fit.effect = effect if np.isfinite(effect).all() and effect.any() else fit.effect
        return taken

    take([(fit, nearest[fit.place][1]) for fit in fits])
    parts = np.ones(len(fits))
    for _ in range(_ITERATIONS):
        steps = [part * float(fit.effect @ fit.left / (fit.effect @ fit.effect)) for fit, part in zip(fits, parts, strict=True)]
        taken = take([(fit, max(fit.value + step, log.numbers[fit.place].least)) for fit, step in zip(fits, steps, strict=True)])
        parts = np.where(taken, 1.0, parts / 4)
    return sorted(fits, key=lambda fit: -fit.explained)


def at_once(log: Log, point: Point, start: Array, starts: Array | None = None) -> JointFit:
    """The numbers of a point and the start, fitted together from their values there on; ``starts``: effects of the start if known."""
    places, closer, gain = list(point), 1.0, 1.0
    left = log.left([point], start)[0]
    since = 0
    for _ in range(_MOST_STEPS):
        effects = log.effects(point, start, {place: log.change(place, closer) for place in places})
        if starts is None or since >= _STEPS_BY_STARTS:
            starts, since = log.effects_of_start(point, start), 0
        every = np.vstack([effects, starts])
        step = _least_squares(every, left)
        ends = np.array([log.value(point, place) <= log.numbers[place].least for place in places], dtype=bool)
        if (blocked := np.flatnonzero(ends & (step[: len(places)] < 0))).size:
            every[blocked] = 0.0
            step = _least_squares(every, left)
        for shortening in range(_MOST_SHORTENED + 1):
            part = step * _SHORTENED**shortening
            values = [max(log.value(point, place) + by, log.numbers[place].least) for place, by in zip(places, part, strict=False)]
            tried = dict(zip(places, values, strict=True)), start + part[len(places) :].reshape(start.shape)
            there = log.left([tried[0]], tried[1])[0]
            gain = 1.0 - float(there @ there) / float(left @ left) if left.any() and np.isfinite(there).all() else -1.0
            if gain > 0:
                (point, start), left = tried, there
                break
        closer, is_last = _CLOSER, gain < _LEAST_GAIN
        if (is_last and not since) or log.is_rounding(left):
            break
        since = _STEPS_BY_STARTS if is_last else since + (gain < _GOOD)
    assert starts is not None
    is_free = np.array([value > log.numbers[place].least for place, value in point.items()], dtype=bool)
    return JointFit(point, start, left, beside(starts)(effects), starts, is_free)


def _least_squares(effects: Array, left: Array) -> Array:
    """The changes that leave least, 0 of what has no effect."""
    sizes = np.linalg.norm(effects, axis=1)
    usable = np.isfinite(sizes) & (sizes > 0)
    found = np.zeros(len(effects))
    found[usable] = np.linalg.lstsq((effects[usable] / sizes[usable, None]).T, left)[0] / sizes[usable]
    return found


def standard_errors(columns: Array, left: Array, rows: int) -> Array:
    """Standard errors of numbers with effects (numbers, n), beside all that is fitted with them, of what the log is away from the fit.

    Noise is of any size in each joint, and shared by neighbouring rows.
    """
    inverse = _inverse(columns)
    scores = (columns * left).reshape(len(columns), rows, left.size // rows).sum(axis=2)
    lags = int(4 * (rows / 100) ** (2 / 9))
    spread = scores @ scores.T
    for lag in range(1, min(lags, rows - 1) + 1):
        shared = scores[:, lag:] @ scores[:, :-lag].T
        spread += (1 - lag / (lags + 1)) * (shared + shared.T)
    scale = rows / _freedom(rows, len(columns))
    return np.asarray(np.sqrt(np.maximum(np.diag(inverse @ spread @ inverse), 0.0) * scale))


def _inverse(columns: Array) -> Array:
    """(C C')^-1 of columns (numbers, n) that may be of any size."""
    sizes = np.linalg.norm(columns, axis=1)
    units = columns / np.where(sizes > 0, sizes, 1.0)[:, None]
    return np.asarray(np.linalg.pinv(units @ units.T) / np.outer(sizes, sizes))


def _freedom(rows: int, fitted: int) -> int:
    """Rows beyond those that determine the start and so many numbers."""
    return max(1, rows - 2 - fitted)


def threshold(candidates: int, rows: int, fitted: int) -> float:
    """The multiple of its standard error beyond which the noise of a log changes none of so many numbers."""
    from scipy.special import stdtrit

    return float(stdtrit(_freedom(rows, fitted), 1 - _FALSE_ALARM / (2 * max(1, candidates))))


def _cosine(one: Array, other: Array) -> float:
    return float(one @ other / (np.linalg.norm(one) * np.linalg.norm(other)))


def significances(log: Log, fit: JointFit) -> Array:
    """Changes of the numbers in their standard errors, (numbers,)."""
    errors = standard_errors(fit.columns, fit.left, log.rows)
    changes = np.array([value - log.numbers[place].value for place, value in fit.point.items()])
    return np.asarray(np.divide(np.abs(changes), errors, out=np.full(len(changes), np.inf), where=errors > 0))


def is_white(left: Array, rows: int) -> bool:
    """True where neighbouring rows of what is left have no more in common than noise may, as it is once no number is missing.

    Source: Anderson, Distribution of the serial correlation coefficient (1942); Box, Jenkins, Time Series Analysis, section 2.1.
    """
    from scipy.special import ndtri

    by_row = left.reshape(rows, -1)
    shared, own = float((by_row[1:] * by_row[:-1]).sum()), float((by_row * by_row).sum())
    return bool(shared * np.sqrt(rows) <= float(ndtri(1 - _FALSE_ALARM)) * own)
