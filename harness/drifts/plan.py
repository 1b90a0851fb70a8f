"""The causes by which two sides differ, and the motions that divide their gap."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.comparison.shares import Chosen, along, sampled_orders
from harness.engines.moving import Control, HeldNumbers, MotionsRequest, MovedBy, MovedFile, NumberKey, SimulatedFile, Timing
from harness.errors import InvalidRequest
from harness.files.joint_kinds import JointKind
from harness.files.reading import format_of
from harness.results.cause import DriftCause

# So many causes are exchanged in all subsets; of more, so many orders and their reverses are sampled.
MOST_EXACT, PAIRS_OF_ORDERS = 10, 40
# Recorded times, and those of them that a table tells.
RECORDED, TOLD = 50, 5
# Seeds of the motions that are rounded anew in each step, of each side.
ROUNDINGS = (1, 2, 3)


@dataclass(frozen=True)
class MovingSide:
    """One side of a drift: a file, who moves it, and when controls come.

    Attributes:
        engine: its name, or NAME@VERSION of an environment. integrator, length: "" and None for those of the file.
        delay: until a control acts [s]. decimation: steps from one control to the next.

    Raises:
        InvalidRequest: one of the last two is none.
    """

    path: Path
    engine: str = "mujoco"
    integrator: str = ""
    length: float | None = None
    delay: float = 0.0
    decimation: int = 1

    def __post_init__(self) -> None:
        if not 0 <= self.delay < math.inf or self.decimation != max(1, int(self.decimation)):
            timing = f"a delay of {self.delay:g} s and a decimation of {self.decimation:g}"
            raise InvalidRequest(f"{timing}: expected 0 s or more, and a whole number of steps from 1 on")

    def by(self, text: str) -> MovingSide:
        """The same by whom a text says; raises as ``MovedBy.parsed``."""
        return replace(self, **vars(MovedBy.parsed(text)))

    @property
    def file(self) -> MovedFile:
        return MovedFile(self.path.resolve(), format_of(self.path), self.integrator, self.length)

    def timing(self, length: float) -> Timing:
        return Timing(self.decimation * length if self.decimation > 1 else 0.0, self.delay)


def sides_of(
    paths: tuple[Path, Path | None], by: Sequence[str], delay: Sequence[float] = (0.0, 0.0), decimation: Sequence[int] = (1, 1)
) -> tuple[MovingSide, MovingSide]:
    """Both sides, the second of the same file where it has no path; ``by`` says who moves both, or each.

    Raises:
        InvalidRequest: as ``MovingSide``, or there are not two of each.
    """
    if not by or max(len(by), len(delay), len(decimation)) > len(paths) or min(len(delay), len(decimation)) < len(paths):
        raise InvalidRequest("a drift has two sides: expected one or two who move them, and two delays and decimations")
    first, second = (
        replace(MovingSide(path or paths[0]).by(text), delay=late, decimation=steps)
        for path, text, late, steps in zip(paths, (*by, *by)[: len(paths)], delay, decimation, strict=True)
    )
    return first, second


@dataclass(frozen=True, eq=False)
class DriftSettings:
    """Two sides, moved for ``seconds`` from one start under one control.

    Attributes:
        control: None for that of the first side's first keyframe, else 0.
        start: {joint: [its positions, its velocities]} of joints that start elsewhere than in the first side's first keyframe.
    """

    sides: tuple[MovingSide, MovingSide]
    seconds: float = 1.0
    control: Control | None = None
    start: Mapping[str, tuple[Sequence[float], Sequence[float]]] = field(default_factory=dict)
    seed: int = 0


@dataclass(frozen=True, eq=False)
class HeldSides:
    """The numbers that engines hold: each side's of its own file, and the first side's of the second file."""

    first: HeldNumbers
    second: HeldNumbers
    second_by_first: HeldNumbers


@dataclass(frozen=True, eq=False)
class Plan:
    """The motions of a drift.

    Attributes:
        request: what all have in common. kinds: of the joints. times: recorded [s]. causes: that differ, in the order of the bits.
        motions: of the first side's engine, each with the numbers of the second side for the chosen causes. own: of the second side.
        rounded: of both sides, rounded anew. orders: sampled ones; none where all subsets are moved.
        uncontrolled: actuators of both sides that a table of controls has no column of.
    """

    request: MotionsRequest
    kinds: tuple[JointKind, ...]
    times: Array
    causes: tuple[DriftCause, ...]
    motions: Mapping[Chosen, SimulatedFile]
    own: SimulatedFile
    rounded: tuple[Sequence[SimulatedFile], Sequence[SimulatedFile]]
    orders: Sequence[tuple[int, ...]]
    differing: Mapping[DriftCause, Sequence[NumberKey]]
    uncontrolled: tuple[str, ...] = ()


def aligned(numbers: HeldNumbers, to: HeldNumbers) -> HeldNumbers:
    """The same with each number under the cause of its like in ``to``."""
    places = {key: cause for cause, own in to.by_cause.items() for key in own}
    found: dict[DriftCause, dict[NumberKey, Array]] = {cause: {} for cause in DriftCause}
    for cause, own in numbers.by_cause.items():
        for key, value in own.items():
            found[places.get(key, cause)][key] = value
    return replace(numbers, by_cause=found)


def plan_of(settings: DriftSettings, held: HeldSides) -> Plan:
    """The plan of a drift.

    Raises:
        InvalidRequest: the sides move other joints, the start is none of theirs, or their steps end together nowhere.
    """
    first, second = settings.sides
    kinds, (q, v) = _joints(settings, held), _start(settings, held.first)
    differing = _differing(settings, held)
    causes = tuple(cause for cause in DriftCause if cause in differing)
    lengths = (held.first.length, held.second.length)
    times = _times(settings.seconds, lengths)
    counts = tuple(tuple(round(time / length) for time in times) for length in lengths)
    timings = tuple(side.timing(length) for side, length in zip(settings.sides, lengths, strict=True))
    every = (1 << len(causes)) - 1

    files = (first.file, second.file)

    # Thousands of motions are put together of the same few parts.
    @cache
    def laid_over(cause: DriftCause, is_base: bool, is_exchanged: bool) -> dict[NumberKey, Array]:
        base = held.second_by_first if is_base else held.first
        wanted = held.second if is_exchanged else held.first if cause in causes else base
        return {key: wanted[cause][key] for key in base[cause] if key in wanted[cause] and _differ(wanted[cause][key], base[cause][key])}

    def motion(chosen: Chosen) -> SimulatedFile:
        exchanged = [cause for place, cause in enumerate(causes) if chosen >> place & 1]
        is_base = DriftCause.TREE in exchanged or (chosen == every and bool(causes))
        over: dict[NumberKey, Array] = {}
        for cause in DriftCause:
            over |= laid_over(cause, is_base, cause in exchanged)
        timing = Timing(
            timings[DriftCause.DECIMATION in exchanged].period,
            timings[DriftCause.DELAY in exchanged].delay,
        )
        return SimulatedFile(files[is_base], over, timing, counts[DriftCause.STEP in exchanged])

    orders = sampled_orders(len(causes), PAIRS_OF_ORDERS, settings.seed) if len(causes) > MOST_EXACT else []
    subsets = {chosen | bit for order in orders for place, chosen in along(order) for bit in (0, 1 << place)} or range(every + 1)
    motions = {chosen: motion(chosen) for chosen in sorted(subsets)}
    own = SimulatedFile(files[1], {}, timings[1], counts[1])
    rounded = tuple([replace(one, rounding=seed + settings.seed) for seed in ROUNDINGS] for one in (motions[0], own))
    control = settings.control or Control.constant({name: held.first.control[name] for name in _driven(held)})
    control = acting(control, _driven(held), held.first.servos, float(times[-1]))
    uncontrolled = tuple(name for name in _driven(held) if name not in control.names)
    request = MotionsRequest((), tuple(held.first.joints), q, v, control)
    return Plan(request, kinds, times, causes, motions, own, (rounded[0], rounded[1]), orders, differing, uncontrolled)


def told_places(times: Array) -> list[int]:
    """The places of the times that a table tells, evenly up to the end."""
    return sorted({round((number + 1) * len(times) / TOLD) - 1 for number in range(TOLD) if (number + 1) * len(times) >= TOLD / 2})


def _joints(settings: DriftSettings, held: HeldSides) -> tuple[JointKind, ...]:
    names = [side.path.name for side in settings.sides]
    for other in (held.second_by_first, held.second):
        for one, its_like, name in ((held.first, other, names[0]), (other, held.first, names[1])):
            if alone := [joint for joint in one.joints if joint not in its_like.joints]:
                raise InvalidRequest(f"{name} alone moves joint {alone[0]!r}; a drift is of two sides that move the same joints, by name")
        if changed := [joint for joint, kind in held.first.joints.items() if other.joints[joint] != kind]:
            raise InvalidRequest(f"joint {changed[0]!r} is of another kind in {names[1]} than in {names[0]}; expected the same")
    if not held.first.joints:
        raise InvalidRequest(f"{names[0]} has no joint that moves")
    return tuple(held.first.joints.values())


def _start(settings: DriftSettings, held: HeldNumbers) -> tuple[Array, Array]:
    q, v = held.q.copy(), held.v.copy()
    if unknown := [name for name in settings.start if name not in held.joints]:
        raise InvalidRequest(f"the start has joint {unknown[0]!r}; expected some of {', '.join(held.joints)}")
    for name, (positions, velocities) in columns_of(held.joints).items():
        if name in settings.start:
            given, (nq, nv) = _given(settings.start[name]), held.joints[name].sizes
            if [part.shape for part in given] != [(nq,), (nv,)] or not all(np.isfinite(part).all() for part in given):
                raise InvalidRequest(f"the start of joint {name!r} is {settings.start[name]}; expected {nq} positions and {nv} velocities")
            q[positions], v[velocities] = given
    return q, v


def _given(start: Any) -> list[Array]:
    """The two parts of a start; none of what is no pair of numbers or lists."""
    try:
        return [np.atleast_1d(np.array(part, dtype=np.float64)) for part in start]
    except (TypeError, ValueError):
        return []


def columns_of(joints: Mapping[str, JointKind]) -> dict[str, tuple[slice, slice]]:
    """The places of each joint in q and in v."""
    found, q, v = {}, 0, 0
    for name, kind in joints.items():
        nq, nv = kind.sizes
        found[name] = slice(q, q + nq), slice(v, v + nv)
        q, v = q + nq, v + nv
    return found


def acting(control: Control, actuators: Sequence[str], servos: Mapping[str, str], end: float) -> Control:
    """A control of these actuators for a motion until ``end`` [s].

    Raises:
        InvalidRequest: it is of others, or begins behind that.
    """
    if control.function is None and control.times[0] >= end:
        begins = f"the control begins at {control.times[0]:g} s, behind the end of the motion at {end:g} s"
        raise InvalidRequest(f"{begins}; let its first time be 0 s, or give more --seconds")
    return control.of_actuators(actuators, servos)


def _driven(held: HeldSides) -> list[str]:
    """Actuators of both sides."""
    return [name for name in held.first.control if name in held.second.control and name in held.second_by_first.control]


def _differing(settings: DriftSettings, held: HeldSides) -> dict[DriftCause, list[NumberKey]]:
    """Each cause that differs, with the numbers of the engine by which it does."""
    found = {cause: [key for key in held.first[cause] if _is_other(held, cause, key)] for cause in DriftCause}
    for cause in DriftCause:
        # What one file alone holds comes with its tree, whose numbers are laid over no other.
        found[DriftCause.TREE] += sorted(held.first[cause].keys() ^ held.second_by_first[cause].keys())
    timings = [side.timing(numbers.length) for side, numbers in zip(settings.sides, (held.first, held.second), strict=True)]
    of_sides = {DriftCause.DELAY: timings[0].delay != timings[1].delay, DriftCause.DECIMATION: timings[0].period != timings[1].period}
    return {cause: keys for cause, keys in found.items() if keys or of_sides.get(cause, False)}


def _is_other(held: HeldSides, cause: DriftCause, key: NumberKey) -> bool:
    is_idle = key in held.first.idle and key in held.second.idle
    return not is_idle and key in held.second[cause] and _differ(held.first[cause][key], held.second[cause][key])


def _differ(one: Array, other: Array) -> bool:
    # Of other versions a row may have other columns behind those that both have.
    count = min(len(one), len(other))
    return not np.array_equal(one[:count], other[:count], equal_nan=True)


def _times(seconds: float, lengths: tuple[float, float]) -> Array:
    """Recorded times, at which steps of both sides end.

    Raises:
        InvalidRequest: there is none within ``seconds``.
    """
    if not 0 < seconds < math.inf:
        raise InvalidRequest(f"a motion of {seconds:g} s; expected more than 0 s, and an end")
    one, other = (Fraction(repr(length)) for length in lengths)
    period = Fraction(math.lcm(one.numerator * other.denominator, other.numerator * one.denominator), one.denominator * other.denominator)
    most = int(Fraction(repr(seconds)) / period + Fraction(1, 10**9))
    if most < 1:
        lengths_text = " and ".join(f"{length:g} s" for length in dict.fromkeys(lengths))
        raise InvalidRequest(f"steps of {lengths_text} do not end together within {seconds:g} s; expected {float(period):g} s at least")
    return np.array(
        [float(count * period) for count in sorted({round(most * number / RECORDED) for number in range(1, RECORDED + 1)} - {0})]
    )


def chunks(motions: Sequence[SimulatedFile], most: int) -> Iterator[Sequence[SimulatedFile]]:
    """Motions in runs of at most so many, of which each is a task."""
    for start in range(0, len(motions), most):
        yield motions[start : start + most]
