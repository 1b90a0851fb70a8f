"""Motion of a mechanism from a start, and its truth: Taylor's method to rounding, checked in higher precision.

The error of a state is relative to the size of the motion, in kinetic-energy norms |x|_M = sqrt(x' M x), which
make metres and radians comparable and do not depend on the choice of coordinates: the larger of

    |q - q*|_M / max over time of |q* - q*(0)|_M     and     |v - v*|_M / max over time of |v*|_M

with M at the true state q*. A difference of rotations is the vector of the rotation between them. Scaling each
component by its own largest value would divide by zero where a coordinate stays at rest.

Source: Biscani, Izzo, Revisiting high-order Taylor methods for astrodynamics and celestial mechanics, MNRAS 504
(2021); heyoka.py documentation, ``taylor_adaptive``.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.motion.taylor import Path, Taylor, displacement
from harness.programs.machine_code import load_heyoka
from harness.programs.mechanisms.kernel import EnergyKernel
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.states import States
from harness.truth.manifold import closed, closes, rows_left
from harness.truth.sampling import ANGLES

HORIZON = 20.0
# Error beyond which the reference is no truth any more: the motion is chaotic.
TRUSTED_ERROR = 1e-9
PIECES = 10
# Parts of the ranges that starts lie in: brisk, and not over the top where a motion turns chaotic.
POSITION_SHARE, RATE_SHARE = 0.25, 0.1
GOLDEN_RATIO = (1 + math.sqrt(5)) / 2
# (w, x, y, z) at which no chart is singular.
START_ROTATION = (0.8, 0.4, 0.4, 0.2)


@dataclass(frozen=True)
class Start:
    """The start of a motion without applied forces.

    Attributes:
        q, v: (nq,) and (nv,); quaternions as (w, x, y, z), a free joint's linear velocity in the joint's frame.
        horizon: length of the motion [s].
    """

    q: Array
    v: Array
    horizon: float

    @classmethod
    def of(cls, mechanism: Mechanism, horizon: float = HORIZON) -> Start:
        """The start a system declares, else a moderate one that moves every coordinate; the same every time.

        Raises:
            ValueError: as ``closing``.
        """
        if mechanism.start:
            q, v = (np.ascontiguousarray(part) for part in np.array(mechanism.start).T)
        else:
            nv = mechanism.nv
            # In (-1, 1), no two alike.
            spread = 2 * np.mod(np.arange(1, 2 * nv + 1) * GOLDEN_RATIO, 1.0) - 1
            position_bounds = np.array([bounds or ANGLES for bounds in mechanism.position_ranges])
            rate_bounds = np.array(mechanism.rate_ranges)
            q = position_bounds.mean(axis=1) + POSITION_SHARE * np.diff(position_bounds)[:, 0] / 2 * spread[:nv]
            v = rate_bounds.mean(axis=1) + RATE_SHARE * np.diff(rate_bounds)[:, 0] / 2 * spread[nv:]
            for place in reversed(mechanism.attitudes):
                q = np.concatenate([q[:place], START_ROTATION, q[place + 3 :]])
        return cls.closing(mechanism, q, v, horizon)

    @classmethod
    def closing(cls, mechanism: Mechanism, q: Array, v: Array, horizon: float) -> Start:
        """The start at q (nq,) and v (nv,); where constraints determine a coordinate or its rate, it has the value that they give it.

        Raises:
            ValueError: no configuration that closes the constraints could be proved there.
        """
        if mechanism.constraints is None:
            return cls(q, v, horizon)
        found = closed(mechanism, States.at(q[None], v[None], np.zeros((1, mechanism.nv))))
        if not closes(mechanism, found).all():
            raise ValueError(f"{mechanism.name}: its constraints do not close at q = {q.tolist()}, from where motions would start")
        return cls(found.q[0], found.v[0], horizon)


@dataclass(frozen=True)
class TrueMotion:
    """The true motion of a mechanism.

    Attributes:
        path: the motion, up to the horizon, or not far beyond ``trusted`` where that is shorter.
        trusted: time [s] up to which its error stays below ``TRUSTED_ERROR``.
        errors: (k + 1,) relative difference of ``path``, whose states are rounded to float64, from the run in higher precision; see the
            module's text.
        precision: how the two runs differ, in words.
    """

    path: Path
    trusted: float
    errors: Array
    precision: str

    @property
    def error(self) -> float:
        """The largest of ``errors`` up to ``trusted``."""
        return float(self.errors[self.path.times <= self.trusted].max())


class Metric:
    """Sizes of displacements and velocities of a mechanism in kinetic-energy norms."""

    def __init__(self, mechanism: Mechanism) -> None:
        self.mechanism = mechanism
        self._kernel = mechanism.float64()

    def norms(self, q: Array, tangents: Array) -> Array:
        """sqrt(x' M(q) x), (n,), of tangent vectors (n, nv)."""
        still = np.zeros_like(tangents)
        mass = self._kernel.terms(q, still, still)["mass"]
        return np.asarray(np.sqrt(np.maximum(np.einsum("ni,nij,nj->n", tangents, mass, tangents), 0.0)))

    def scales(self, truth: Path) -> tuple[float, float]:
        """Largest displacement from the start and largest velocity along a path, in the norm; 1 for what does not move."""
        q, v = truth.q.astype(np.float64), truth.v.astype(np.float64)
        moved = self.norms(q, displacement(self.mechanism, np.broadcast_to(q[:1], q.shape), q)).max()
        fastest = self.norms(q, v).max()
        return float(moved) or 1.0, float(fastest) or 1.0

    def errors(self, truth: Path, q: Array, v: Array, scales: tuple[float, float] | None = None) -> Array:
        """Relative errors (n,) of states at the times of ``truth``; ``scales`` are those of a longer part of the truth.

        Infinite where a state is not finite.
        """
        moved, fastest = scales or self.scales(truth)
        at = truth.q.astype(np.float64)
        with np.errstate(all="ignore"):
            position = self.norms(at, displacement(self.mechanism, truth.q, q)) / moved
            velocity = self.norms(at, (v - truth.v).astype(np.float64)) / fastest
            larger = np.maximum(position, velocity)
        return np.asarray(np.where(np.isfinite(larger), larger, np.inf))


def drift(mechanism: Mechanism, path: Path) -> float | None:
    """The largest that a holonomic row of the constraints leaves along a path [m or rad]; None of a tree, and of a broken path."""
    if mechanism.constraints is None or not (np.isfinite(path.q).all() and np.isfinite(path.v).all()):
        return None
    left, _ = rows_left(mechanism, States.at(path.q, path.v, np.zeros_like(path.v)))
    return float(np.abs(left[:, : mechanism.constraints.holonomic]).max(initial=0.0))


def energy_drift(mechanism: Mechanism, path: Path) -> Array | None:
    """Energy that is gained without work along a path without applied forces, (k + 1,), in its largest kinetic energy.

    None where it is not known: of a robot's file, which has no energies, and where the energies depend on time.
    """
    if not mechanism.energy_programs or mechanism.feels_time or path.work is None:
        return None
    along = EnergyKernel(mechanism).along(path.q, path.v, path.times)
    return np.asarray((along.energy - along.energy[0] - path.work) / (float(along.kinetic.max()) or 1.0))


def reference_motion(mechanism: Mechanism, start: Start, intervals: int = 1000) -> TrueMotion:
    """The true motion from ``start`` at equal intervals, with its error.

    Taylor's method runs in the two longest floating-point types there are; the second judges the first. float64
    alone would not do: on the collar, which nearly stops at the top of its guide, its roundings add up to 5e-13.
    """
    times = np.linspace(0.0, start.horizon, intervals + 1)
    began = time.perf_counter()
    lower, higher = _floating_point_types()[-2:]
    metric, solvers = Metric(mechanism), (Taylor(mechanism, lower), Taylor(mechanism, higher))
    found, check = (solver.solve(start.q, start.v, times[:1]) for solver in solvers)
    errors = np.zeros(1)
    # In pieces, as a chaotic motion is not worth following where its error has grown.
    for first in range(0, intervals, -(-intervals // PIECES)):
        piece = times[first : first - (-intervals // PIECES) + 1]
        found, check = (_continued(solver, so_far, piece) for solver, so_far in zip(solvers, (found, check), strict=True))
        truth = Path(found.times, _in_long_double(check.q), _in_long_double(check.v))
        # Of what is kept, which is in float64.
        errors = metric.errors(truth, found.q.astype(np.float64), found.v.astype(np.float64))
        if not (errors <= TRUSTED_ERROR).all():
            break
    seconds = time.perf_counter() - began
    beyond = np.flatnonzero(~(errors <= TRUSTED_ERROR))
    trusted = float(times[beyond[0] - 1]) if len(beyond) else start.horizon
    q, v, work = (part.astype(np.float64) for part in (found.q, found.v, np.asarray(found.work)))
    path = Path(found.times, q, v, work, found.evaluations, seconds)
    return TrueMotion(path, trusted, errors, f"Taylor's method in {lower.__name__}, kept in float64, against {higher.__name__}")


def _continued(solver: Taylor, so_far: Path, times: Array) -> Path:
    """A path with the motion at ``times`` after it, the first of which is its last."""
    after = solver.solve(so_far.q[-1], so_far.v[-1], times)
    assert so_far.work is not None and after.work is not None
    times, q, v = (np.concatenate([getattr(so_far, name), getattr(after, name)[1:]]) for name in ("times", "q", "v"))
    work = np.concatenate([so_far.work, so_far.work[-1] + after.work[1:]])
    return Path(times, q, v, work, so_far.evaluations + after.evaluations, so_far.seconds + after.seconds)


def _floating_point_types() -> list[Any]:
    """The types that heyoka integrates in, from the shortest; not every platform has all."""
    heyoka = load_heyoka()

    return [np.float64, np.longdouble, *([heyoka.real128] if hasattr(heyoka, "taylor_adaptive_f128") else [])]


def _in_long_double(values: Array) -> Array:
    """Quadruple precision in long double, for which there is no direct conversion."""
    if values.dtype in (np.float64, np.longdouble):
        return values
    high = values.astype(np.float64)
    low = (values - high.astype(values.dtype)).astype(np.float64)
    return np.asarray(high.astype(np.longdouble) + low)
