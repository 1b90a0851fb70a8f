"""Shares of the gap between two simulated motions by cause, as plain data."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

from harness.results.cause import DriftCause
from harness.results.detail import Detail, telling
from harness.results.measured import MeasuredRecord
from harness.results.run import StudyResult
from harness.results.table import Column, Table, counted, first_of, grouped, joined, number_text

ENGINE = "the engine itself"
# A cause with less of the gap is not named in the sentence, and so many are at most.
NAMED, MOST_NAMED = 0.05, 3
# Rounding from this part of the gap on leaves no share to be claimed.
FELT_ROUNDING = 0.01
_MOST_OWNERS = 3
# Causes that are off as a whole, by the names of their switches.
_SWITCHED = {"actuation": "actuators", "contact": "contacts"}
_PLURAL = (DriftCause.TREE, DriftCause.SPRINGS, DriftCause.LIMITS, DriftCause.EQUALITIES, DriftCause.FRICTION, DriftCause.DAMPING)


@dataclass(frozen=True, kw_only=True)
class DriftSide:
    """One of the two sides.

    Attributes:
        path: of the file. label: what tells it from the other, as the name of its file. engine, version, integrator: who moves it.
        length: of a step [s]. period: between two controls [s], 0 for each step. delay: until a control acts [s].
        note: what the engine left out of the file to read it; "" for nothing.
        broken: the time at which the motion has broken down, a number of its state not finite or beyond ``LARGEST_STATE``; None where it
            has not.
    """

    path: str
    label: str
    engine: str
    version: str
    integrator: str
    length: float
    period: float
    delay: float
    note: str = ""
    broken: float | None = None

    @property
    def title(self) -> str:
        timing = [f"control each {self.period:g} s"] * (self.period > 0) + [f"{self.delay:g} s late"] * (self.delay > 0)
        by = f"{self.engine} {self.version}, {self.integrator}, steps of {self.length:g} s"
        return f"{self.label}: {self.path} by {', '.join(filter(None, [by, *timing, self.note]))}"


@dataclass(frozen=True, kw_only=True)
class SideDifference:
    """A difference between the sides, of one cause.

    Attributes:
        owner: of the numbers, as "actuator elbow"; "" for the whole model. what: the attribute of the files, or the engine's array; ""
            where each has another, which its value names.
        first, second: values, as the files write them or as they were compiled. first_place, second_place: as "line 12"; "" for none.
        is_absent: of which side the value is nothing: 0, none, or switched off; of the first and of the second.
        remedy: what is set in the second for it to move as the first, as 'kv="5.13"' or 'origin xyz="0 0 1"', or taken out of it where
            ``is_removed``; "" where no attribute alone says it. remedy_place: the line of its element.
    """

    owner: str
    what: str
    first: str
    second: str
    first_place: str = ""
    second_place: str = ""
    is_absent: tuple[bool, bool] = (False, False)
    remedy: str = ""
    remedy_place: str = ""
    is_removed: bool = False


@dataclass(frozen=True, kw_only=True)
class CauseShare:
    """The share that a cause has of the gap at each time: the parts of all of them sum to 1.

    Attributes:
        name: a ``DriftCause``, or what is left to the engine. positions, velocities: the parts; None where rounding is felt.
        error: standard error of ``positions`` where orders were sampled, 0 where all subsets were moved.
        whole: the part of the mean square of the gap in positions over all times at which it is not; None without any.
        whole_velocities: the same in velocities. whole_error: standard error of ``whole``.
    """

    name: str
    whole: float | None
    whole_velocities: float | None
    whole_error: float
    positions: list[float | None]
    velocities: list[float | None]
    error: list[float]
    differences: tuple[SideDifference, ...] = ()


@dataclass(frozen=True, kw_only=True)
class DriftRecord:
    """The gap between two motions over time.

    Attributes:
        times: [s]. told: the places among them that a table tells. joints: that move in both.
        of_positions, of_velocities: sizes of the gap, in the kinetic-energy norm of the first side.
        moved: how far that is from its start. rounding: what accumulated rounding makes of ``of_positions``.
        horizon: the time from which that is at least ``FELT_ROUNDING`` of the gap to the end, None where it is not at the end.
        uncontrolled: actuators of both sides that the control says nothing of, which are given 0.
        motions: how many were simulated. left_out: how many of these break down, with all orders of causes that come through them.
        orders: how many were sampled; 0 where all subsets were moved.
    """

    first: DriftSide
    second: DriftSide
    joints: list[str]
    times: list[float]
    told: list[int]
    of_positions: list[float]
    of_velocities: list[float]
    moved: list[float]
    rounding: list[float]
    horizon: float | None
    shares: tuple[CauseShare, ...]
    motions: int
    left_out: int = 0
    orders: int = 0
    uncontrolled: tuple[str, ...] = ()

    @property
    def ranked(self) -> list[CauseShare]:
        """The shares, those with most of the gap in positions first."""
        return sorted(self.shares, key=lambda one: -(one.whole or 0.0))

    @property
    def explained(self) -> float:
        """The time up to which the gap is divided [s]."""
        return max((time for time in self.times if self.horizon is None or time < self.horizon), default=0.0)

    @property
    def sentence(self) -> str:
        """The causes of the gap, and what to set."""
        one, other = self.first.label, self.second.label
        if not self.times:
            return f"{self._broken} No share is claimed: give fewer --seconds, or shorter steps."
        if not any(self.of_positions) and not any(self.of_velocities):
            return " ".join(filter(None, [self._alike(), self._broken]))
        if all(share.whole is None for share in self.shares):
            rounded = f"{one} and {other} differ by no more than rounding makes of two equal runs; no share is claimed."
            return " ".join(filter(None, [rounded, self._broken]))
        named = [share for share in self.ranked if (share.whole or 0.0) >= NAMED][:MOST_NAMED] or self.ranked[:1]
        over = f"of the gap over {self.explained:g} s"
        told = [_clause(share, (one, other), "" if place else over) for place, share in enumerate(named)]
        if taking := [share for share in self.ranked if (share.whole or 0.0) <= -NAMED]:
            told.append(
                f"{'Other' if taking[-1].name in _PLURAL else 'Another'} {taking[-1].name} takes {_words(-(taking[-1].whole or 0.0))} back."
            )
        if self.horizon is not None:
            part = _words(FELT_ROUNDING)
            told.append(f"From {self.horizon:g} s on rounding alone would make {part} of the gap; no share is claimed there.")
        return " ".join([*told, *filter(None, [self._broken])])

    def _alike(self) -> str:
        """A sentence where there is no gap: nothing moves, or nothing that differs is felt."""
        one, other = self.first.label, self.second.label
        if not any(self.moved):
            return f"Nothing moves in {one} and {other} for {self.times[-1]:g} s; give a --control, or another --start."
        unfelt = joined([share.name for share in self.shares if share.differences])
        differing = f"; they differ in {unfelt}, which this motion does not feel" if unfelt else ""
        return f"{one} and {other} move alike to the last digit for {self.times[-1]:g} s{differing}."

    @property
    def _broken(self) -> str:
        told = (f"{side.label} breaks down by {side.broken:g} s." for side in (self.first, self.second) if side.broken is not None)
        return " ".join(told)

    def table(self, detail: Detail = Detail.BRIEF) -> tuple[Table, str]:
        """A row for each cause with its part of the gap in positions at some times, the gap, and words that count other causes."""
        kept, others = telling(self.ranked, lambda one: one.whole, detail)
        rows = [
            [
                share.name,
                *(_percent(share.positions[place], share.error[place]) for place in self.told),
                _percent(share.whole, share.whole_error),
            ]
            for share in kept
        ]
        rows.append(["gap, of the way", *(_of_way(self.of_positions[place], self.moved[place]) for place in self.told), ""])
        rows.append(["rounding, of the way", *(_of_way(self.rounding[place], self.moved[place]) for place in self.told), ""])
        columns = [f"{self.times[place]:g} s" for place in self.told] + [f"over {self.explained:g} s"]
        return Table(["share of the gap", *(Column(title, "plain") for title in columns)], rows), others

    @property
    def lines(self) -> list[str]:
        """The differences, cause by cause."""
        return [f"{share.name}: {line}" for share in self.ranked for line in _differences(share, (self.first.label, self.second.label))]


def _clause(share: CauseShare, labels: tuple[str, str], over: str) -> str:
    """A cause with its share, its first lines and what to set; ``over`` says of what the share is, "" where that was said."""
    one, other = labels
    differences = share.differences
    size = " ".join(filter(None, [_words(share.whole or 0.0), over]))
    switched = [difference for difference in differences if {difference.first, difference.second} == {"on", "off"}]
    absent = [all(difference.is_absent[side] for difference in switched or differences) and bool(differences) for side in range(2)]
    # What follows from others, as the centre of a body of two links, comes behind what is set.
    differences = (*switched, *sorted((one for one in differences if one not in switched), key=lambda one: not one.remedy))
    name = _SWITCHED.get(switched[0].what, share.name) if switched else share.name
    if share.name == ENGINE:
        return f"{size} is left to the engines; no number of the files explains it."
    alone = [difference for difference in differences if {difference.first, difference.second} == {"present", "absent"}]
    if alone and share.name == DriftCause.TREE:
        lacking = other if alone[0].second == "absent" else one
        what = f"{lacking} has no {first_of([difference.what for difference in alone if difference.first == alone[0].first], _MOST_OWNERS)}"
    elif absent[1]:
        what = f"{other} has no {name}"
    elif absent[0]:
        what = f"{other} has {_with_article(name)} and {one} has none"
    else:
        what = f"{other} has {'other' if share.name in _PLURAL else 'another'} {share.name} than {one}"
    where = f" ({_where(differences, labels)})" if differences else ""
    return f"{what}: {size}{where}.{_remedies(differences, other)}"


def _remedies(differences: tuple[SideDifference, ...], other: str) -> str:
    """The words by which the second side gets what the first one has, each with its lines where there are several."""
    told = ""
    for is_removed, verb, into in ((False, "Set", "in"), (True, "Remove", "from")):
        places = grouped((one.remedy, one.remedy_place) for one in differences if one.remedy and one.is_removed == is_removed)
        lines = {remedy: first_of(list(dict.fromkeys(own)), _MOST_OWNERS) for remedy, own in places.items()}
        words = [f"{remedy} ({line})" if len(lines) > 1 else remedy for remedy, line in lines.items()]
        told += f" {verb} {first_of(words, _MOST_OWNERS)} {into} {other}." if words else ""
    return told


def _where(differences: tuple[SideDifference, ...], labels: tuple[str, str]) -> str:
    first = differences[0]
    both = [
        f"{label}{f' {place}' if place else ''}: {f'{first.what} {value}'.lstrip()}"
        for label, place, value in ((labels[1], first.second_place, first.second), (labels[0], first.first_place, first.first))
    ]
    more = len(differences) - 1
    return "; ".join(both) + (f"; and {counted(more, 'number')} more" if more else "")


def _differences(share: CauseShare, labels: tuple[str, str]) -> list[str]:
    """A line for each attribute with a pair of values, whose owners and places stand together."""
    found = []
    for (what, *values), alike in grouped(((one.what, one.first, one.second), one) for one in share.differences).items():
        owners = [one.owner for one in alike if one.owner]
        told = []
        for label, value, places in zip(
            labels, values, ([one.first_place for one in alike], [one.second_place for one in alike]), strict=True
        ):
            known = list(dict.fromkeys(filter(None, places)))
            told.append(f"{value} in {label}" + (f" ({first_of(known, _MOST_OWNERS)})" if known else ""))
        found.append(f"{' of '.join(filter(None, (what, first_of(owners, _MOST_OWNERS))))}: {', '.join(told)}")
    return found


def _with_article(name: str) -> str:
    return name if name in (*_PLURAL, *_SWITCHED.values(), DriftCause.GAIN) else f"{'an' if name[0] in 'aeio' else 'a'} {name}"


def _words(part: float) -> str:
    return f"{100 * part:.0f} %" if abs(part) >= 0.005 else f"{100 * part:.1g} %"


def _percent(part: float | None, error: float) -> str:
    return "-" if part is None else f"{100 * part:.1f} %{f' +- {100 * error:.1f}' if error else ''}"


def _of_way(size: float, way: float) -> str:
    return "-" if not way else number_text(float(f"{size / way:.2g}"))


@dataclass(kw_only=True)
class Drifts(StudyResult):
    """The drift that a run found, between two sides or from a measured log."""

    STUDY: ClassVar[str] = "drift"

    drifts: list[DriftRecord] = field(default_factory=list)
    measured: list[MeasuredRecord] = field(default_factory=list)

    @property
    def summary(self) -> str:
        return " ".join([*(drift.sentence for drift in self.drifts), *(log.sentence for log in self.measured)])
