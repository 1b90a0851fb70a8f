"""States at which engines are compared: bulk samples, and hypothesis strategies that shrink.

Source: Owen, Scrambling Sobol' and Niederreiter-Xing points, J. Complexity 14 (1998), through
``scipy.stats.qmc``.
"""

from __future__ import annotations

import base64
import importlib.metadata
import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from harness.arrays import Array
from harness.equations.mechanism import Mechanism
from harness.equations.states import States
from harness.storage import cache_directory, read_entry, write_entry

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
_HALF = math.sqrt(0.5)
# (w, x, y, z) of no turn and half turns about the axes, then of quarter turns.
SIMPLE_ROTATIONS = np.array([*np.eye(4), *([_HALF, *(sign * _HALF * unit)] for unit in np.eye(3) for sign in (1.0, -1.0))])


def sample(mechanism: Mechanism, count: int, seed: int) -> States:
    """``count`` states from a scrambled Sobol sequence over the declared ranges; the same for the same seed."""
    blocks = list(sample_in_blocks(mechanism, count, seed))
    return States.concatenate(blocks) if blocks else _states(mechanism, np.empty((0, _dimensions(mechanism))))


def sample_in_blocks(mechanism: Mechanism, count: int, seed: int) -> Iterator[States]:
    """The states of ``sample``, at most ``BLOCK`` at a time, so that a long sample need not be held at once."""
    dimensions, exponent = _dimensions(mechanism), max(0, math.ceil(math.log2(max(count, 1))))
    if exponent <= MOST_KEPT:
        points = sobol_points(dimensions, exponent, seed)
        blocks = (points[start : start + BLOCK] for start in range(0, count, BLOCK))
    else:
        sequence = _sobol(dimensions, seed)
        blocks = (sequence.random(BLOCK) for _ in range(0, count, BLOCK))
    for number, block in enumerate(blocks):
        yield _states(mechanism, block[: count - number * BLOCK])


def _dimensions(mechanism: Mechanism) -> int:
    return 3 * mechanism.nv + mechanism.feels_time


def _states(mechanism: Mechanism, points: Array) -> States:
    """The states that points of the unit cube, (n, 3 nv) or with time (n, 3 nv + 1), stand for."""
    bounds = [bounds or ANGLES for bounds in mechanism.position_ranges]
    bounds += [*mechanism.rate_ranges, *mechanism.force_ranges, *([TIMES] if mechanism.feels_time else [])]
    low, high = np.array(bounds).T
    q, v, tau, time = np.split(low + points * (high - low), np.arange(1, 4) * mechanism.nv, axis=1)
    for place in reversed(mechanism.attitudes):
        rotations = _uniform_rotations(points[:, place : place + 3])
        q = np.hstack([q[:, :place], rotations, q[:, place + 3 :]])
    times = time[:, 0] if mechanism.feels_time else np.zeros(len(points))
    return States(np.ascontiguousarray(q), np.ascontiguousarray(v), np.ascontiguousarray(tau), times)


def sobol_points(dimensions: int, exponent: int, seed: int) -> Array:
    """2^exponent scrambled Sobol points, (2^exponent, dimensions), of the unit cube.

    They are kept in the cache, bit for bit: ``scipy.stats`` takes longer to import than a small mechanism to check.
    """
    versions = "-".join(f"{name}-{importlib.metadata.version(name)}" for name in ("scipy", "numpy"))
    entry = cache_directory() / "sobol" / f"{dimensions}-{exponent}-{seed}-{versions}.txt"
    kept = read_entry(entry) if exponent <= MOST_KEPT else None
    if kept is not None:
        return np.frombuffer(base64.b64decode(kept), dtype="<f8").reshape(2**exponent, dimensions).astype(np.float64)
    points: Array = _sobol(dimensions, seed).random_base2(exponent)
    if exponent <= MOST_KEPT:
        write_entry(entry, base64.b64encode(points.astype("<f8").tobytes()).decode())
    return points


def _sobol(dimensions: int, seed: int) -> qmc.Sobol:
    from scipy.stats import qmc

    return qmc.Sobol(dimensions, rng=np.random.default_rng(seed))


def _uniform_rotations(points: Array) -> Array:
    """Quaternions (n, 4) of uniformly distributed rotations from uniform points (n, 3) of the unit cube.

    Source: Shoemake, Uniform random rotations, Graphics Gems III (1992).
    """
    radius, first, second = points[:, 0], 2 * math.pi * points[:, 1], 2 * math.pi * points[:, 2]
    inner, outer = np.sqrt(1 - radius), np.sqrt(radius)
    return np.stack([inner * np.sin(first), inner * np.cos(first), outer * np.sin(second), outer * np.cos(second)], axis=1)


def strategy(mechanism: Mechanism) -> SearchStrategy[States]:
    """Hypothesis strategy of single states of ``mechanism``, with the special values that matter.

    Zero, both ends of each range, tiny values, multiples of pi/2 and huge angles are drawn often, and
    everything shrinks to zero.
    """
    from hypothesis import strategies as st

    positions: list[SearchStrategy[tuple[float, ...]]] = [st.tuples(_position(bounds)) for bounds in mechanism.position_ranges]
    for place in reversed(mechanism.attitudes):
        positions[place : place + 3] = [_rotation()]
    configuration = st.tuples(*positions).map(lambda parts: tuple(value for part in parts for value in part))
    # No rate or force leaves its range: what a wrist does under the torque of a shoulder belongs to hard cases.
    rates, forces = ([_bounded(bounds) for bounds in ranges] for ranges in (mechanism.rate_ranges, mechanism.force_ranges))
    times = _bounded(TIMES) if mechanism.feels_time else st.just(0.0)
    return st.tuples(configuration, st.tuples(*rates), st.tuples(*forces), times).map(lambda state: States.at(*state))


def _position(bounds: tuple[float, float] | None) -> SearchStrategy[float]:
    from hypothesis import strategies as st

    if bounds is not None:
        return _bounded(bounds)
    quarter_turns = st.integers(-8, 8).map(lambda k: k * (math.pi / 2))
    return st.one_of(st.sampled_from([0.0]), quarter_turns, st.sampled_from(special_values(HUGE_ANGLES)), st.floats(*ANGLES))


def _rotation() -> SearchStrategy[tuple[float, ...]]:
    """Unit quaternions to rounding: none, half and quarter turns about the axes, and any other."""
    from hypothesis import strategies as st

    simple = [tuple(quaternion) for quaternion in SIMPLE_ROTATIONS.tolist()]
    components = st.tuples(*[st.floats(-1.0, 1.0)] * 4).filter(lambda quaternion: math.hypot(*quaternion) > 0.01)
    others = components.map(lambda quaternion: tuple(component / math.hypot(*quaternion) for component in quaternion))
    return st.one_of(st.sampled_from(simple[:4]), st.sampled_from(simple[4:]), others)


def _bounded(bounds: tuple[float, float]) -> SearchStrategy[float]:
    from hypothesis import strategies as st

    inside = [value for value in (0.0, *bounds) if bounds[0] <= value <= bounds[1]]
    special = [value for value in special_values() if bounds[0] <= value <= bounds[1]]
    return st.one_of(st.sampled_from(inside), *([st.sampled_from(special)] if special else []), st.floats(*bounds))


def special_values(huge: Sequence[float] = ()) -> list[float]:
    """Tiny and ``huge`` numbers of both signs."""
    return [sign * magnitude for magnitude in (*TINY, *huge) for sign in (1.0, -1.0)]
