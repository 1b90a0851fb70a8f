"""Hamilton's principle along computed paths: of all paths between two configurations, is it the one a system takes?

Systems with ball or free joints are left out: their positions are no vectors, so q + eps eta is no path of theirs.

Proofs and sources: docs/inside/numerics.md, "Stationary action".
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from harness.arrays import Array
from harness.crosscheck.scene import Scene
from harness.engines import Unsupported
from harness.motion.integrators import integrators
from harness.motion.taylor import Taylor
from harness.motion.trajectories import Start
from harness.programs.mechanisms.kernel import LagrangianKernel
from harness.programs.mechanisms.mechanism import Mechanism
from harness.results.motion_benchmark import Stationarity
from harness.study import Note

# Sizes of the variations, relative to the motion: above what integration errors leave of the first variation,
# below what a model that is wrong by a per cent leaves of it.
SIZES = np.geomspace(1e-4, 1e-3, 5)
# The velocities of the path are the derivative of a spline through its positions, of this degree.
DEGREE = 7
# A change of the action below this many roundings of its terms is noise.
MOST_ROUNDINGS = 1e3
# Long enough for a few swings, too short for chaos to matter [s].
HORIZON, STEP = 2.0, 1e-3
# Of integrators that choose their own steps.
TOLERANCE = 1e-12
WRONG_TIME = 1.01


def stationarity(scene: Scene, note: Note) -> list[Stationarity]:
    """Every integrator's path, the reference motion, and what must fail: the reference motion in another time.

    None for a mechanism with ball or free joints; no path of an integrator that cannot express the mechanism.
    """
    mechanism = scene.mechanism
    if mechanism.attitudes:
        return []
    kernel, start = LagrangianKernel(mechanism), Start.of(mechanism, HORIZON)
    found: list[Stationarity] = []
    for integrator in integrators():
        note(f"{integrator.name} on {mechanism.name}")
        try:
            advance = integrator.prepare(scene)
        except Unsupported:
            continue
        # A low order leaves some of the first variation; unlike that of a wrong model, it falls with the step.
        for step in (STEP, STEP / 10) if integrator.order is not None and integrator.order < 2 else (STEP,):
            path = advance(start, TOLERANCE if integrator.adaptive else step, round(HORIZON / step), 1)
            found.append(stationarity_of(kernel, integrator.name, path.times, path.q))
    times = np.linspace(0.0, HORIZON, round(HORIZON / STEP) + 1)
    true = Taylor(mechanism).solve(start.q, start.v, times).q
    found.append(stationarity_of(kernel, "reference motion", times, true))
    found.append(stationarity_of(kernel, f"reference motion, {WRONG_TIME - 1:.0%} slower", WRONG_TIME * times, true))
    return found


def residual(kernel: LagrangianKernel, times: Array, q: Array) -> float:
    """Largest discrete Euler-Lagrange residual of a path, relative to the largest of its terms along the path.

    ``times`` (k + 1,) [s], equally spaced, and ``q`` (k + 1, nv), k at least 2. The terms, divided by the step, are the
    rate of the momenta, dL/dq and the non-conservative forces.

    Raises:
        ValueError: the times are not equally spaced.
    """
    step = _step(times)
    terms = kernel.terms((q[1:] + q[:-1]) / 2, np.diff(q, axis=0) / step, (times[1:] + times[:-1]) / 2)
    rates = np.diff(terms.momenta, axis=0) / step
    of_positions, forces, mass = ((values[1:] + values[:-1]) / 2 for values in (terms.of_positions, terms.forces, terms.mass))
    left = _as_accelerations(rates - of_positions - forces, mass).max()
    largest = max(_as_accelerations(part, mass).max() for part in (rates, of_positions, forces))
    return float(left / largest) if largest > 0 or math.isnan(largest) else 0.0


def vary(kernel: LagrangianKernel, times: Array, q: Array) -> tuple[Array, float | None, float]:
    """The action of a path under variations eta of the sizes ``SIZES``; arguments as of ``residual``, k at least ``DEGREE``.

    The root mean square over eta of S[q + eps eta] - S[q] + eps int Q eta dt for each size eps [J s]; the slope of its logarithm
    over log eps, None where it is noise, or no number; and the largest |dS/d eps + int Q eta dt| over eta, relative to the largest
    term in any.

    Integrals are sums over the path's own nodes: eta vanishes with all derivatives at both ends, where the
    trapezoidal rule converges faster than any power of the step.

    Raises:
        ValueError: the times are not equally spaced.
    """
    step = _step(times)
    if not np.isfinite(q).all():
        return np.full(len(SIZES), math.nan), None, math.nan
    from scipy.interpolate import make_interp_spline

    spline = make_interp_spline(times, q, k=DEGREE)
    v, acceleration = (np.asarray(spline.derivative(order)(times)) for order in (1, 2))
    terms = kernel.terms(q, v, times)
    unvaried = kernel.lagrangian(q, v, times)
    firsts, scales, changes = [], [], []
    for coordinate, eta, eta_rate in _variations(kernel.mechanism, times, q, v, acceleration, terms.mass):
        of_position, work = terms.of_positions[:, coordinate] * eta, terms.forces[:, coordinate] * eta
        of_rate = terms.momenta[:, coordinate] * eta_rate
        firsts.append(abs(float(np.sum(of_position + of_rate + work))))
        scales.append(max(float(np.abs(part).sum()) for part in (of_position, of_rate, work)))
        axis = np.eye(kernel.mechanism.nv)[coordinate]
        varied = (kernel.lagrangian(q + eps * eta[:, None] * axis, v + eps * eta_rate[:, None] * axis, times) for eps in SIZES)
        changes.append([np.sum(lagrangian - unvaried + eps * work) for eps, lagrangian in zip(SIZES, varied, strict=True)])
    size = step * np.sqrt(np.mean(np.square(changes), axis=0))
    noise = MOST_ROUNDINGS * np.finfo(np.float64).eps * step * math.sqrt(len(times)) * float(np.abs(unvaried).max())
    slope = float(np.polyfit(np.log(SIZES), np.log(size), 1)[0]) if size.min() > noise else None
    return size, slope, max(firsts) / max(scales) if max(scales) > 0 else 0.0


def stationarity_of(kernel: LagrangianKernel, path: str, times: Array, q: Array) -> Stationarity:
    """Both measures of one path, called ``path``; arguments as of ``vary``."""
    _, slope, first = vary(kernel, times, q)
    left = residual(kernel, times, q)
    return Stationarity(system=kernel.mechanism.name, path=path, step=_step(times), residual=left, slope=slope, first_variation=first)


def _variations(
    mechanism: Mechanism, times: Array, q: Array, v: Array, acceleration: Array, mass: Array
) -> Iterator[tuple[int, Array, Array]]:
    """(coordinate, eta, d eta/dt), (k + 1,) each: a bump, and bumps that swing as the coordinate does and as its rate does.

    A wrong path's defect swings with the motion, and a bump that is slower averages it away. The size of eta is what
    the whole motion inside the bump would be in this coordinate alone, and at most a radian: a motion that
    dies away is not measured by where it began.
    """
    duration = times[-1] - times[0]
    bump, bump_rate = _bump((times - times[0]) / duration)
    bump_rate = bump_rate / duration
    displacement = q - bump @ q / bump.sum()
    extent = float((bump * _norms(displacement, mass)).max())
    still = np.ones(len(times)), np.zeros(len(times))
    for coordinate in range(mechanism.nv):
        amplitude = extent / math.sqrt(mass[0, coordinate, coordinate])
        if mechanism.rotating[coordinate]:
            amplitude = min(amplitude, 1.0)
        position, rate = displacement[:, coordinate], v[:, coordinate]
        for swing, swing_rate in (still, (position, rate), (rate, acceleration[:, coordinate])):
            eta, eta_rate = bump * swing, bump_rate * swing + bump * swing_rate
            largest = float(np.abs(eta).max())
            if largest > 0:
                yield coordinate, amplitude / largest * eta, amplitude / largest * eta_rate


def _bump(place: Array) -> tuple[Array, Array]:
    """exp(1 - 1/(4 s (1 - s))) and its derivative at s of [0, 1]: zero with all derivatives at both ends, 1 in the middle."""
    inside = place * (1 - place)
    # At the very ends, and where a product underflows, the bump is zero.
    inside = np.maximum(inside, 1e-4)
    bump = np.where((place > 0) & (place < 1), np.exp(1 - 1 / (4 * inside)), 0.0)
    return bump, bump * (1 - 2 * place) / (4 * inside**2)


def _step(times: Array) -> float:
    """The step of equally spaced times [s]."""
    step = float(times[-1] - times[0]) / (len(times) - 1)
    if not np.allclose(np.diff(times), step, rtol=1e-6, atol=0):
        raise ValueError("the times of the path are not equally spaced")
    return step


def _norms(displacements: Array, mass: Array) -> Array:
    """|x|_M, (n,), of x (n, nv)."""
    return np.asarray(np.sqrt(np.einsum("ni,nij,nj->n", displacements, mass, displacements)))


def _as_accelerations(forces: Array, mass: Array) -> Array:
    """|M^-1 f|_M, (n,), of f (n, nv)."""
    accelerations = np.linalg.solve(mass, forces[:, :, None])[:, :, 0]
    return np.asarray(np.sqrt(np.abs(np.sum(forces * accelerations, axis=1))))
