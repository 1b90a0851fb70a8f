"""A log of measured joint positions as the second side: the numbers of the model that explain most of the gap, alone and at once.

Each number that its author measures is changed a little; along what that does to the motion the gap has a least-squares change. Those that
explain most are moved anew, from a multiple of the number on, until the gap is least: a part that is told is of a motion that was computed.
Beside the number that explains most, the next one is sought in the same way, and all are fitted at once (forward selection). Each that
the others make needless, or that the noise of the log may make, is left out again (backward elimination). Numbers and sets of numbers that
the log does not tell from one another are told.

Sources: Efroymson, Multiple regression analysis (1960), for the steps; Khalil, Dombre, Modeling, Identification and Control of Robots
(2002), chapter 12, for what is identifiable.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from harness.arrays import Array
from harness.drifts.fits import (
    Fit,
    JointFit,
    alone,
    at_once,
    beside,
    further,
    is_white,
    significances,
    standard_errors,
    threshold,
)
from harness.drifts.log import CERTAIN, Log, MeasuredSettings
from harness.engines.moving import HeldNumbers, MotionsRequest, Moved
from harness.explain.changes import Change
from harness.explain.changes.held import HeldFile, SizedChange, sized_change
from harness.explain.identifiable import ColumnSets, EffectColumn
from harness.files.given import Place
from harness.results.cause import DriftCause
from harness.results.measured import MeasuredNumber, MeasuredRecord
from harness.results.table import grouped

# So many numbers are fitted alone, so many beside others, and so many at once.
_FITTED, _FITTED_BESIDE, _MOST = 24, 6, 4
# A gap that is less than this part of the way is what rounding and the velocities at the start leave.
_NO_GAP = 1e-12
# Parts of the square of the gap that are one for what is told first; and what may be left of it without another number being sought.
_AS_MUCH, _LEAST_LEFT = 1e-3, 1e-5


@dataclass(frozen=True, eq=False)
class ExplainedLog:
    """A log beside a model, and what was found.

    Attributes:
        gap: what the log is away from the motion of the file, beside another start, (n,). fits: numbers alone, the likeliest first.
        fit: those that explain the log at once, of which there may be none.
    """

    settings: MeasuredSettings
    held: HeldNumbers
    log: Log
    gap: Array
    fits: Sequence[Fit]
    fit: JointFit

    @property
    def changes(self) -> dict[DriftCause, list[tuple[Change, float]]]:
        """The changes of the file that say the numbers of ``fit``, by cause, with their values; none where no attribute alone says one."""
        told = [(self._changes[place], value) for place, value in self.fit.point.items()]
        return grouped((DriftCause(sized.change.kind), (sized.change, value)) for sized, value in told if sized is not None)

    @cached_property
    def _file(self) -> HeldFile:
        return HeldFile(self.settings.side.path)

    @cached_property
    def _changes(self) -> Mapping[int, SizedChange | None]:
        told = {*self.fit.point, *(fit.place for fit in self.fits)}
        return {place: sized_change(self._file, self.log.numbers[place], self.log.row) for place in told}

    @property
    def record(self) -> MeasuredRecord:
        log, way = self.log, float(np.linalg.norm(self.log.way))
        alike = _Untold(log, self.fit)
        single = [
            self._told(one.place, one.value, one.explained, alike.to(one.place, one.value, _significance(log, one, self.fit)))
            for one in self.fits
        ]
        return MeasuredRecord(
            path=self.settings.side.path.name,
            log=self.settings.log.name,
            mover=f"{self.settings.side.engine}, {self.held.integrator}, steps of {self.held.length:g} s",
            joints=log.joints,
            seconds=log.seconds,
            gap=float(np.linalg.norm(self.gap)) / way if way else float("inf"),
            numbers=tuple(single),
            together=tuple(self._together(alike)),
            motions=log.motions,
        )

    def _together(self, alike: _Untold) -> Iterator[MeasuredNumber]:
        """The numbers of ``fit``, the one that adds most first."""
        log, fit = self.log, self.fit
        square, errors, chances = float(self.gap @ self.gap), standard_errors(fit.columns, fit.left, log.rows), significances(log, fit)
        places = list(fit.point)
        own: dict[int, float] = {}
        for number in np.argsort(-chances, kind="stable").tolist():
            place = places[number]
            own[place] = value = fit.point[place]
            so_far = fit if len(own) == len(places) else at_once(log, own, fit.start, fit.starts)
            sets = alike.to(place, value, float(chances[number]), [other for other in places if other != place])
            yield replace(self._told(place, value, 1.0 - so_far.square / square, sets), error=float(errors[number]))

    def _told(self, place: int, value: float, explained: float, sets: Sequence[tuple[int, ...]]) -> MeasuredNumber:
        number, sized, path = self.log.numbers[place], self._changes[place], self.settings.side.path
        array, owner = number.key
        names = [tuple(_name(self.log, other) for other in members) for members in sets]
        remedy, line = "", ""
        if sized is not None:
            written = sized.change.place
            remedy = f'{written.attribute}="{sized.words(float(f"{value:.4g}"))}"'
            line = Place(sized.change.path or path, written.line).within(path)
        return MeasuredNumber(
            cause=number.cause,
            owner=number.owner,
            what=number.what,
            place=self._file.says(array, owner)[0].told(path) if array else "",
            value=number.value,
            fitted=float(value),
            explained=float(explained),
            alike=tuple(members[0] for members in names if len(members) == 1),
            groups=tuple(members for members in names if len(members) > 1),
            remedy=remedy,
            remedy_place=line,
        )


def explained_log(settings: MeasuredSettings, move: Callable[[MotionsRequest], Moved], held: HeldNumbers) -> ExplainedLog:
    """The numbers that explain a log; ``move`` computes motions by the engine that has ``held`` of the file.

    Raises:
        InvalidRequest: the log is none of this model, or the model breaks down.
    """
    log = Log(settings, move, held)
    others = beside(log.effects_of_start({}, log.start))
    gap = others(log.left([{}], log.start)[0])
    if not np.linalg.norm(gap) > _NO_GAP * np.linalg.norm(log.way):
        return ExplainedLog(settings, held, log, gap, [], at_once(log, {}, log.start))
    fits = _likeliest_first(log, alone(log, others, _FITTED))
    search = _Search(log, gap)
    fit = search.fewest(search.needed(search.replaced(search.forward(fits))))
    if len(fit.point) == 1:
        # Fitted with the start it is nearer still.
        [(place, value)] = fit.point.items()
        explained = 1.0 - fit.square / float(gap @ gap)
        others_alone = [one for one in fits if one.place != place]
        fits = [Fit(place, value, fit.columns[0], fit.left, explained), *others_alone]
    return ExplainedLog(settings, held, log, gap, fits, fit)


class _Search:
    """The numbers that explain a log at once."""

    def __init__(self, log: Log, gap: Array) -> None:
        self._log, self._square = log, float(gap @ gap)

    def forward(self, fits: Sequence[Fit]) -> JointFit:
        """Numbers one by one, each the one that explains most beside those before it, until what is left is noise."""
        fit = at_once(self._log, {}, self._log.start)
        while not self._is_noise(fit) and len(fit.point) < _MOST and (fits := self._next(fit) if fit.point else fits):
            fit = self._with(fit, fits)
        return fit

    def replaced(self, fit: JointFit) -> JointFit:
        """The same with others in place of numbers, one by one, as long as that leaves less than white noise would."""
        places, unchanged = list(fit.point), 0
        while len(places) > 1 and unchanged < len(places) and not self._is_noise(fit):
            place = places[unchanged]
            rest = self._without(fit, place)
            fits = [one for one in self._next(rest) if one.place != place]
            tried = self._with(rest, fits) if fits else fit
            if fit.square - tried.square > _threshold(self._log, tried) ** 2 * tried.variance:
                fit, places, unchanged = tried, list(tried.point), 0
            else:
                unchanged += 1
        return fit

    def needed(self, fit: JointFit) -> JointFit:
        """The same without each number that noise may make, the least significant one first."""
        while fit.point:
            chances = significances(self._log, fit)
            least = int(np.argmin(chances))
            if chances[least] > _threshold(self._log, fit):
                break
            fit = self._without(fit, list(fit.point)[least])
        return fit

    def fewest(self, fit: JointFit) -> JointFit:
        """A fit of fewer numbers, others among them, that leaves noise as well."""
        while len(fit.point) > 2 and self._is_noise(fit):
            least = list(fit.point)[int(np.argmin(significances(self._log, fit)))]
            fewer = self.needed(self.replaced(self._without(fit, least)))
            if not self._is_noise(fewer):
                break
            fit = fewer
        return fit

    def _is_noise(self, fit: JointFit) -> bool:
        """True where next to nothing is left, rounding is felt in it, or it is white, so that nothing more is claimed of it."""
        return fit.square <= _LEAST_LEFT * self._square or self._log.is_rounding(fit.left) or is_white(fit.left, self._log.rows)

    def _next(self, fit: JointFit) -> Sequence[Fit]:
        return _likeliest_first(self._log, further(self._log, fit, _FITTED_BESIDE))

    def _with(self, fit: JointFit, fits: Sequence[Fit]) -> JointFit:
        return at_once(self._log, {**fit.point, fits[0].place: fits[0].value}, fit.start, fit.starts)

    def _without(self, fit: JointFit, place: int) -> JointFit:
        return at_once(self._log, {other: value for other, value in fit.point.items() if other != place}, fit.start, fit.starts)


def _threshold(log: Log, fit: JointFit) -> float:
    return threshold(len(log.numbers), log.rows, len(fit.point))


def _likeliest_first(log: Log, fits: Sequence[Fit]) -> Sequence[Fit]:
    """The same, of those that explain as much as the first the one before all others that changes least relative to itself."""

    def change(fit: Fit) -> float:
        own = log.numbers[fit.place].value
        return abs(fit.value / own - 1) if own else np.inf

    likeliest = min((fit for fit in fits if fits[0].explained - fit.explained <= _AS_MUCH), key=change, default=None)
    return sorted(fits, key=lambda fit: fit is not likeliest)


def _significance(log: Log, one: Fit, fit: JointFit) -> float:
    """The change of a number alone in its standard errors, by the noise that a fit leaves."""
    error = standard_errors(beside(fit.starts)(one.effect)[None], fit.left, log.rows)[0]
    return abs(one.value - log.numbers[one.place].value) / error if error else np.inf


def _name(log: Log, place: int) -> str:
    number = log.numbers[place]
    return " of ".join(filter(None, (number.what, number.owner)))


class _Untold:
    """Sets of numbers that do what a number does, by the derivatives at a fit."""

    def __init__(self, log: Log, fit: JointFit) -> None:
        self._log, self._fit = log, fit
        self._slopes = log.slopes(fit.point, fit.start)
        self._known: dict[tuple[int, ...], tuple[list[int], ColumnSets]] = {}

    def to(self, place: int, value: float, significance: float, others: Sequence[int] = ()) -> list[tuple[int, ...]]:
        """Those that the log does not tell from a number at a value, so many standard errors from the file's, ``others`` fitted with it."""
        own_places, sets = self._beside(tuple(others))
        if place not in own_places:
            # The others may do the same.
            return self.to(place, value, significance) if others else []
        change = value - self._log.numbers[place].value
        unknown = _threshold(self._log, self._fit) / significance if significance else np.inf
        if unknown >= 1.0:
            # Noise may make it.
            return []

        def is_possible(factors: Mapping[int, float]) -> bool:
            """True where one number may have such a value; of several, which bend what they do, only a motion would tell."""
            [(one, factor), *others] = factors.items()
            number = self._log.numbers[own_places[one]]
            return bool(others) or self._log.value(self._fit.point, own_places[one]) + factor * change >= number.least

        found = sets.alternatives(own_places.index(place), unknown, is_possible)
        return [tuple(own_places[one] for one in members) for members in found]

    def _beside(self, others: tuple[int, ...]) -> tuple[list[int], ColumnSets]:
        """The numbers whose columns are certain where ``others`` are fitted with them, and the sets of these columns."""
        if others in self._known:
            return self._known[others]
        beside_these = beside(np.vstack([self._fit.starts, *(self._slopes[other][0][None] for other in others if other in self._slopes)]))
        columns: dict[int, EffectColumn] = {}
        for own, (slope, wider) in self._slopes.items():
            values, beyond = beside_these(np.array([slope, wider]))
            # Of a column of which less is certain nothing is claimed.
            if own not in others and values.any() and (noise := np.linalg.norm(beyond - values) / np.linalg.norm(values)) <= CERTAIN:
                columns[own] = EffectColumn(values.reshape(self._log.rows, -1), float(noise))
        self._known[others] = list(columns), ColumnSets([*columns.values()])
        return self._known[others]
