"""States at which engines are compared: bulk samples, and hypothesis strategies that shrink.

Source: Owen, Scrambling Sobol' and Niederreiter-Xing points, J. Complexity 14 (1998), through
``scipy.stats.qmc``.
"""

from __future__ import annotations

import base64
import math
from collections.abc import Iterator, Sequence
from enum import IntEnum
from typing import TYPE_CHECKING, Any

import numpy as np

from harness.arrays import Array
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.numbers import UNIT_ROUNDOFF
from harness.programs.states import States
from harness.storage import cache_directory, read_entry, write_entry
from harness.version import version_of

if TYPE_CHECKING:
    from hypothesis.strategies import SearchStrategy
    from scipy.stats import qmc

# Sampled angles of an unbounded coordinate; the special values go much further.
ANGLES = (-math.pi, math.pi)
HUGE_ANGLES = (1e3, 1e8, 1e15)
# Exponent of 2 of the largest sample that is kept between runs; what takes long to certify need not be found quickly.
MOST_KEPT = 12
# Of a mechanism whose equations depend on time [s].
TIMES = (0.0, 10.0)
# States of a block; a power of two, as balanced parts of the sequence have.
BLOCK = 2048
TINY = (1e-3, 1e-8, 1e-20, 1e-160, 5e-324)
# Taylor polynomials of so many terms reach an eighth of a turn.
_TERMS = 9
_HALF = math.sqrt(0.5)
# (w, x, y, z) of no turn and half turns about the axes, then of quarter turns.
SIMPLE_ROTATIONS = np.array([*np.eye(4), *([_HALF, *(sign * _HALF * unit)] for unit in np.eye(3) for sign in (1.0, -1.0))])


class Kind(IntEnum):
    """Kind of a sampled state.

    ``GENERIC``: positions, rates and applied forces anywhere in their ranges, which hides gravity at the first joint of a chain.
    ``LOADED``: forces of the size that gravity and velocity terms ask for. ``STATIC``: at rest, under forces of the size that gravity
    asks for. ``FREE``: no applied force. ``RELEASED``: at rest, without applied force.
    """

    GENERIC = 0
    LOADED = 1
    STATIC = 2
    FREE = 3
    RELEASED = 4


# The kinds of states in turn: a quarter is at rest, a quarter bears no force, and half is generic.
TURNS = (Kind.GENERIC, Kind.STATIC, Kind.GENERIC, Kind.FREE, Kind.GENERIC, Kind.RELEASED, Kind.GENERIC, Kind.LOADED)


def kinds(count: int) -> np.ndarray[Any, np.dtype[np.int64]]:
    """The ``Kind`` of each of the first ``count`` states of a sample, (count,)."""
    return np.resize(np.array(TURNS, dtype=np.int64), count)


def on_manifold(mechanism: Mechanism, states: States) -> States:
    """``harness.truth.manifold.closed``, of which nothing is imported for a tree; with what drives the actuators that act."""
    if mechanism.constraints is not None:
        from harness.truth.manifold import closed

        states = closed(mechanism, states)
    if mechanism.driving is not None:
        from harness.programs.mechanisms.driven import driven

        mechanism = driven(mechanism)
    return states if mechanism.actuation is None else mechanism.actuation.controlled(states)


def sample(mechanism: Mechanism, count: int, seed: int) -> States:
    """``count`` states of all kinds within the declared ranges; the same for the same seed, and the beginning of longer samples.

    The states of each kind follow a scrambled Sobol sequence of their own. They are the same to the last bit on every machine with
    the same versions of SciPy and NumPy: nothing here depends on how a processor rounds a sine.
    """
    return _joined(mechanism, sample_in_blocks(mechanism, count, seed))


def sample_in_blocks(mechanism: Mechanism, count: int, seed: int) -> Iterator[States]:
    """The states of ``sample``, at most ``BLOCK`` at a time, so that a long sample need not be held at once."""
    of_kind, most = kinds(min(count, BLOCK)), _most(count)
    streams = {kind: _points(mechanism, most[kind], BLOCK * TURNS.count(kind) // len(TURNS), seed, kind) for kind in Kind}
    for start in range(0, count, BLOCK):
        own = of_kind[: count - start]
        parts = [_open_states(mechanism, next(streams[kind])[: (own == kind).sum()], kind) for kind in Kind]
        order = np.argsort(np.argsort(own, kind="stable"), kind="stable")
        # Closed together, as one way along a branch costs nearly as much as many.
        yield on_manifold(mechanism, States.concatenate(parts)[order])


def keep_points(mechanism: Mechanism, count: int, seed: int) -> None:
    """Draw the points of ``sample`` into the cache where it has none: in a process that will import parts of SciPy anyway."""
    for kind, most in _most(count).items():
        if (exponent := _exponent(most)) <= MOST_KEPT:
            sobol_points(_dimensions(mechanism), exponent, seed, kind)


def _most(count: int) -> dict[Kind, int]:
    """Largest number of points of each kind in a sample; each full block holds as many states of a kind as the first."""
    return {kind: math.ceil(count / len(TURNS)) * TURNS.count(kind) for kind in Kind}


def generic_sample(mechanism: Mechanism, count: int, seed: int) -> States:
    """``count`` states, all of them generic: the first are those of this kind in ``sample``."""
    blocks = (points[: count - number * BLOCK] for number, points in enumerate(_points(mechanism, count, BLOCK, seed, Kind.GENERIC)))
    return _joined(mechanism, (_states(mechanism, block, Kind.GENERIC) for block in blocks))


def _joined(mechanism: Mechanism, blocks: Iterator[States]) -> States:
    return States.concatenate([_states(mechanism, np.empty((0, _dimensions(mechanism))), Kind.GENERIC), *blocks])


def random_sample(mechanism: Mechanism, count: int, seed: int) -> States:
    """Independent generic states, less evenly spread than those of ``generic_sample``, without what takes a second to import."""
    points = np.random.default_rng(seed).random((count, _dimensions(mechanism)))
    return _states(mechanism, points, Kind.GENERIC)


def _points(mechanism: Mechanism, count: int, size: int, seed: int, kind: Kind) -> Iterator[Array]:
    """Points of the unit cube, at least ``count`` in all, ``size`` at a time or all that there are."""
    dimensions, exponent = _dimensions(mechanism), _exponent(count)
    if exponent <= MOST_KEPT:
        points = sobol_points(dimensions, exponent, seed, kind)
        return (points[start : start + size] for start in range(0, count, size))
    sequence = _sobol(dimensions, seed, kind)
    return (sequence.random(size) for _ in range(0, count, size))


def _exponent(count: int) -> int:
    """Exponent of the least power of two that is no less than ``count``."""
    return max(0, math.ceil(math.log2(max(count, 1))))


def _dimensions(mechanism: Mechanism) -> int:
    return 3 * mechanism.nv + mechanism.feels_time


def _states(mechanism: Mechanism, points: Array, kind: Kind) -> States:
    """The states of a kind that points of the unit cube, (n, 3 nv) or with time (n, 3 nv + 1), stand for."""
    return on_manifold(mechanism, _open_states(mechanism, points, kind))


def _open_states(mechanism: Mechanism, points: Array, kind: Kind) -> States:
    """``_states`` before constraints determine any of their coordinates."""
    bounds = [bounds or ANGLES for bounds in mechanism.position_ranges]
    bounds += [*_rate_ranges(mechanism, kind), *_force_ranges(mechanism, kind), *([TIMES] if mechanism.feels_time else [])]
    low, high = np.array(bounds).T
    q, v, tau, time = np.split(low + points * (high - low), np.arange(1, 4) * mechanism.nv, axis=1)
    for place in reversed(mechanism.attitudes):
        rotations = _uniform_rotations(points[:, place : place + 3])
        q = np.hstack([q[:, :place], rotations, q[:, place + 3 :]])
    times = time[:, 0] if mechanism.feels_time else np.zeros(len(points))
    return States(np.ascontiguousarray(q), np.ascontiguousarray(v), np.ascontiguousarray(tau), times)


def _rate_ranges(mechanism: Mechanism, kind: Kind) -> Sequence[tuple[float, float]]:
    if kind not in (Kind.STATIC, Kind.RELEASED):
        return mechanism.rate_ranges
    # As near to rest as a range allows.
    slowest = [min(max(0.0, low), high) for low, high in mechanism.rate_ranges]
    return [(rate, rate) for rate in slowest]


def _force_ranges(mechanism: Mechanism, kind: Kind) -> Sequence[tuple[float, float]]:
    if kind in (Kind.FREE, Kind.RELEASED):
        return [(0.0, 0.0)] * mechanism.nv
    loads = {Kind.LOADED: mechanism.moving_loads, Kind.STATIC: mechanism.static_loads}.get(kind)
    if not loads or not any(loads):
        return mechanism.force_ranges
    # A coordinate that nothing loads bears what would accelerate it as much as the most loaded one.
    share = max(load / high for load, (_, high) in zip(loads, mechanism.force_ranges, strict=True))
    reaches = [load or share * high for load, (_, high) in zip(loads, mechanism.force_ranges, strict=True)]
    return [(max(low, -reach), min(high, reach)) for (low, high), reach in zip(mechanism.force_ranges, reaches, strict=True)]


def sobol_points(dimensions: int, exponent: int, seed: int, stream: int = 0) -> Array:
    """2^exponent scrambled Sobol points, (2^exponent, dimensions), of the unit cube; each ``stream`` of a seed has others.

    They are kept in the cache, bit for bit: ``scipy.stats`` takes longer to import than a small mechanism to check.
    """
    versions = "-".join(f"{name}-{version_of(name)}" for name in ("scipy", "numpy"))
    entry = cache_directory() / "sobol" / f"{dimensions}-{exponent}-{seed}-{stream}-{versions}.txt"
    kept = read_entry(entry) if exponent <= MOST_KEPT else None
    if kept is not None:
        return np.frombuffer(base64.b64decode(kept), dtype="<f8").reshape(2**exponent, dimensions).astype(np.float64)
    points: Array = _sobol(dimensions, seed, stream).random_base2(exponent)
    if exponent <= MOST_KEPT:
        write_entry(entry, base64.b64encode(points.astype("<f8").tobytes()).decode())
    return points


def _sobol(dimensions: int, seed: int, stream: int) -> qmc.Sobol:
    from scipy.stats import qmc

    sequence = np.random.SeedSequence(seed, spawn_key=(stream,) if stream else ())
    return qmc.Sobol(dimensions, rng=np.random.default_rng(sequence))


def _uniform_rotations(points: Array) -> Array:
    """Quaternions (n, 4) of uniformly distributed rotations from uniform points (n, 3) of the unit cube.

    Source: Shoemake, Uniform random rotations, Graphics Gems III (1992).
    """
    radius = points[:, 0]
    inner, outer = np.sqrt(1 - radius), np.sqrt(radius)
    (first_sine, first_cosine), (second_sine, second_cosine) = map(sine_and_cosine, (points[:, 1], points[:, 2]))
    return np.stack([inner * first_sine, inner * first_cosine, outer * second_sine, outer * second_cosine], axis=1)


def sine_and_cosine(turns: Array) -> tuple[Array, Array]:
    """Sine and cosine of 2 pi ``turns``, (n,) each, to an ulp or two, by sums and products alone.

    IEEE 754 fixes their roundings; those of ``numpy.sin`` depend on the instructions that a processor has.
    """
    quarter = np.rint(4 * turns)
    angle = 2 * math.pi * (turns - quarter / 4)
    square = angle * angle
    sine, cosine = np.zeros_like(angle), np.zeros_like(angle)
    for power in range(_TERMS, -1, -1):
        sine = sine * square + (-1) ** power / math.factorial(2 * power + 1)
        cosine = cosine * square + (-1) ** power / math.factorial(2 * power)
    sine = sine * angle
    turned = quarter.astype(np.int64) % 4
    return np.choose(turned, [sine, cosine, -sine, -cosine]), np.choose(turned, [cosine, -sine, -cosine, sine])


def strategy(mechanism: Mechanism) -> SearchStrategy[States]:
    """Hypothesis strategy of single states of ``mechanism``, with the special values that matter.

    Zero, both ends of each range, tiny values, multiples of pi/2 and huge angles are drawn often, and
    everything shrinks to zero.
    """
    from hypothesis import strategies as st

    def bounded(bounds: tuple[float, float]) -> SearchStrategy[float]:
        inside, special = ([value for value in some if bounds[0] <= value <= bounds[1]] for some in ((0.0, *bounds), special_values()))
        return st.one_of(st.sampled_from(inside), *([st.sampled_from(special)] if special else []), st.floats(*bounds))

    quarter_turns = st.integers(-8, 8).map(lambda k: k * (math.pi / 2))
    angles = st.one_of(st.sampled_from([0.0]), quarter_turns, st.sampled_from(special_values(HUGE_ANGLES)), st.floats(*ANGLES))
    # Unit quaternions to rounding: none, half and quarter turns about the axes, and any other.
    simple = [tuple(quaternion) for quaternion in SIMPLE_ROTATIONS.tolist()]
    components = st.tuples(*[st.floats(-1.0, 1.0)] * 4).filter(lambda quaternion: math.hypot(*quaternion) > 0.01)
    others = components.map(lambda quaternion: tuple(beside_half_turns(np.array([quaternion]) / math.hypot(*quaternion))[0].tolist()))
    rotations = st.one_of(st.sampled_from(simple[:4]), st.sampled_from(simple[4:]), others)

    ranges = mechanism.position_ranges
    positions: list[SearchStrategy[tuple[float, ...]]] = [st.tuples(angles if own is None else bounded(own)) for own in ranges]
    for place in reversed(mechanism.attitudes):
        positions[place : place + 3] = [rotations]
    configuration = st.tuples(*positions).map(lambda parts: tuple(value for part in parts for value in part))
    # No rate or force leaves its range: what a wrist does under the torque of a shoulder belongs to hard cases.
    rates, forces = ([bounded(bounds) for bounds in ranges] for ranges in (mechanism.rate_ranges, mechanism.force_ranges))
    times = bounded(TIMES) if mechanism.feels_time else st.just(0.0)
    return st.tuples(configuration, st.tuples(*rates), st.tuples(*forces), times).map(lambda state: States.at(*state))


def beside_half_turns(quaternions: Array, unit_roundoff: float = UNIT_ROUNDOFF) -> Array:
    """Unit quaternions (n, 4), with the other sign where a real part below rounding is negative.

    The rotation is the same, and the vector along its axis is on that side of half a turn to which its angle is rounded, with an arc
    tangent that may be wrong by one unit in the last place: a spring in a ball joint jumps there.
    """
    real = quaternions[:, :1]
    return np.where((real < 0) & (real > -4 * unit_roundoff), -quaternions, quaternions)


def special_values(huge: Sequence[float] = ()) -> list[float]:
    """Tiny and ``huge`` numbers of both signs."""
    return [sign * magnitude for magnitude in (*TINY, *huge) for sign in (1.0, -1.0)]
