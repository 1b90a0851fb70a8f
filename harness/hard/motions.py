"""Motions that are hard: chaos, unstable equilibria of rotation, and steps at the edge of stability.

Engines that integrate by one scheme with one step differ by rounding alone. Where motions diverge, as exp(rate t),
they must part, and no sooner than a motion whose start is off by as much as an answer that agrees may be: parting
is then no defect. ``partings`` measures rates and times beside those of nudged starts or of theory.

The largest stable step of an integrator on a spring is its scheme's, in units of the spring's own frequency,
however stiff the spring; ``stable_steps`` looks for it by bisection.

Sources: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, 2nd ed., section I.13 (Lyapunov
exponents of the propagation of errors); Hairer, Wanner, Solving Ordinary Differential Equations II, 2nd ed., section
IV.2 (stability domains); Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., section I.4 (symplectic
Euler: a step of 2 over the frequency); Goldstein, Poole, Safko, Classical Mechanics, 3rd ed., section 5.6 (middle axis).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from harness.arrays import Array
from harness.crosscheck.scene import Scene
from harness.hard.cases import decades, hard_cases
from harness.library import Library
from harness.motion.integrators import Advance, select_integrators
from harness.motion.taylor import Path
from harness.motion.trajectories import Metric, Start
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.numbers import UNIT_ROUNDOFF
from harness.results.atlas import Parting, StableStep
from harness.study import Note
from harness.verdict import AGREEMENT, Verdict

# Of distances relative to the motion: between these they grow as theory has it, and at the last one motions have parted.
FITTED = (1e-10, 1e-3)
PARTED = 0.1
FEWEST_TIMES_FITTED = 20


@dataclass(frozen=True, kw_only=True)
class HardMotion:
    """A family of motions that diverge.

    Attributes:
        name: of the family.
        system: name in the built-in library.
        knob: name and unit of what chooses the start; values: of it.
        start: (mechanism, value) to where every integrator starts.
        baseline: the same for the motion of the same integrator that distances are measured from; None where it is the
            first integrator's motion from the same start.
        integrators: names, of one scheme; the first one's motion is the one that is nudged.
        step, steps: of all motions [s]; every: of how many steps one is kept.
        rate: (mechanism, value) to the rate of divergence by theory [1/s]; None where there is none but the nudged motion's.
        source: where that is from.
    """

    name: str
    system: str
    knob: tuple[str, str]
    values: tuple[float, ...]
    start: Callable[[Mechanism, float], Start]
    baseline: Callable[[Mechanism, float], Start] | None
    integrators: tuple[str, ...]
    step: float
    steps: int
    every: int = 20
    rate: Callable[[Mechanism, float], float] | None = None
    source: str


_RUNGE_KUTTA = ("equations RK4", "mujoco RK4", "pinocchio RK4")


# A double pendulum let go at rest, from gentle to over the top.
CHAOS = HardMotion(
    name="chaos",
    system="double_pendulum",
    knob=("first angle", "rad"),
    values=tuple(0.3 + 2.7 * i / 29 for i in range(30)),
    start=lambda mechanism, angle: Start(np.array([angle, angle / 2]), np.zeros(2), 40.0),
    baseline=None,
    integrators=_RUNGE_KUTTA,
    step=2e-3,
    steps=20_000,
    source="Lichtenberg, Lieberman, Regular and Chaotic Dynamics, 2nd ed., section 5.2 (Lyapunov exponents)",
)


# About the middle axis [rad/s].
_SPIN = 5.0


def _spinning(mechanism: Mechanism, nudge: float) -> Start:
    """About the middle axis, with ``nudge`` about the two others."""
    q = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0])
    return Start(q, np.array([0.0, 0.0, 0.0, nudge, _SPIN, nudge, 0.0]), 50.0)


def _middle_axis_rate(mechanism: Mechanism, nudge: float) -> float:
    """Rate of a body whose wheel turns freely about z, and so has no part in its inertia about that axis."""
    inertia = {name: value for name, value, _ in mechanism.parameters}
    a, b, c = inertia["A"] + inertia["D"], inertia["B"] + inertia["D"], inertia["C"]
    return _SPIN * math.sqrt((b - a) * (c - b) / (a * c))


# A satellite set spinning about its middle principal axis, drifting out of it.
MIDDLE_AXIS = HardMotion(
    name="middle_axis",
    system="satellite_wheel",
    knob=("rate about the other axes", "rad/s"),
    values=decades(-16, -4),
    start=_spinning,
    baseline=lambda mechanism, nudge: _spinning(mechanism, 0.0),
    integrators=_RUNGE_KUTTA,
    step=5e-3,
    steps=10_000,
    rate=_middle_axis_rate,
    source="Goldstein, Poole, Safko, Classical Mechanics, 3rd ed., section 5.6; Hughes, Spacecraft Attitude Dynamics, chapter 6",
)


def hard_motions() -> dict[str, HardMotion]:
    """Every ``HardMotion`` of this module by name."""
    return {value.name: value for value in globals().values() if isinstance(value, HardMotion)}


def partings(name: str, library: Library, note: Note) -> list[Parting]:
    """Every integrator from every start of one family, as a task for ``harness.workers``."""
    motion = hard_motions()[name]
    scene = Scene.of(library, motion.system)
    advances = {integrator.name: integrator.prepare(scene) for integrator in select_integrators(motion.integrators)}
    found: list[Parting] = []
    for value in motion.values:
        note(f"{motion.knob[0]} = {value!r}")
        found += _partings_from(motion, value, scene.mechanism, advances)
    return found


def _partings_from(motion: HardMotion, value: float, mechanism: Mechanism, advances: dict[str, Advance]) -> Iterator[Parting]:
    start = motion.start(mechanism, value)
    from_there = start if motion.baseline is None else motion.baseline(mechanism, value)
    metric = Metric(mechanism)

    def run(integrator: str, at: Start) -> Path:
        return advances[integrator](at, motion.step, motion.steps, motion.every)

    def distances(path: Path, baseline: Path) -> Array:
        return metric.errors(baseline, path.q, path.v, metric.scales(baseline))

    first = motion.integrators[0]
    truth = run(first, from_there)
    by_many = distances(run(first, nudged(start, AGREEMENT * UNIT_ROUNDOFF)), truth)
    if motion.rate is None:
        expected = growth_rate(truth.times, distances(run(first, nudged(start, UNIT_ROUNDOFF)), truth))
    else:
        expected = motion.rate(mechanism, value)
    earliest = parting_time(truth.times, by_many)
    for name in motion.integrators:
        away = distances(run(name, start), truth if motion.baseline is None or name == first else run(name, from_there))
        parted = parting_time(truth.times, away)
        # Times are known to one interval.
        too_soon = parted is not None and (earliest is None or parted < earliest - 1.5 * motion.step * motion.every)
        yield Parting(
            motion=motion.name,
            system=motion.system,
            integrator=name,
            knob=value,
            rate=growth_rate(truth.times, away),
            expected_rate=expected,
            parted=parted,
            earliest=earliest,
            largest=float(away.max()),
            verdict=(Verdict.DISAGREES if too_soon else Verdict.AGREES).value,
        )


def nudged(start: Start, size: float) -> Start:
    """The start with ``size`` times the largest position and the largest rate added to every position and rate."""

    def moved(part: Array) -> Array:
        return part + size * float(np.abs(part).max(initial=0.0))

    return replace(start, q=moved(start.q), v=moved(start.v))


def growth_rate(times: Array, distances: Array) -> float | None:
    """Slope of log distance over time [1/s] from the first time in ``FITTED`` until it is left; None for too few times."""
    above = np.flatnonzero(distances > FITTED[0])
    beyond = np.flatnonzero(distances > FITTED[1])
    if not len(above):
        return None
    chosen = slice(above[0], beyond[0] if len(beyond) else len(times))
    usable = distances[chosen] > 0
    if int(usable.sum()) < FEWEST_TIMES_FITTED or not len(beyond):
        return None
    return float(np.polyfit(times[chosen][usable], np.log(distances[chosen][usable]), 1)[0])


def parting_time(times: Array, distances: Array) -> float | None:
    """The first time [s] at which the distance is ``PARTED``; None where it never is."""
    beyond = np.flatnonzero(~(distances < PARTED))
    return float(times[beyond[0]]) if len(beyond) else None


# Integrator to its largest stable step times the frequency of an undamped oscillator.
STABILITY_LIMITS = {
    "equations Euler-Cromer": 2.0,
    "equations RK4": math.sqrt(8.0),
    "equations variational midpoint": math.inf,
    "mujoco Euler": 2.0,
    "mujoco RK4": math.sqrt(8.0),
    # Implicit in the velocity alone, which an undamped spring does not feel.
    "mujoco implicit": 2.0,
    "mujoco implicitfast": 2.0,
    "pinocchio semi-implicit Euler": 2.0,
    "pinocchio RK4": math.sqrt(8.0),
}
OSCILLATOR = "stiff_mode"
STEPS_TRIED = 2000
# Displacement [m] of the start, and how much of growth is none any more.
DISPLACEMENT, GROWN = 1e-6, 1e3
# Steps times the frequency between which the limit is looked for, and how near.
TRIED = (0.5, 64.0)
RESOLUTION = 2e-3


def stable_steps(integrator_name: str, values: Sequence[float], note: Note) -> list[StableStep]:
    """The largest stable steps of one integrator along the stiffness of a spring, as a task for ``harness.workers``."""
    case = hard_cases()[OSCILLATOR]
    [integrator] = select_integrators([integrator_name])
    expected = STABILITY_LIMITS[integrator_name]
    found: list[StableStep] = []
    for value in values:
        note(f"{case.knob[0]} = {value!r}")
        scene = case.scene_at(value)
        parameters = {name: number for name, number, _ in scene.mechanism.parameters}
        frequency = math.sqrt(parameters["k"] / parameters["m"])
        measured = _limit(integrator.prepare(scene), frequency)
        # Some growth near the limit is too slow to be seen.
        agrees = measured == expected or abs(measured / expected - 1) < 0.01
        found.append(
            StableStep(
                case=case.name,
                system=scene.mechanism.name,
                integrator=integrator_name,
                knob=value,
                frequency=frequency,
                measured=measured,
                expected=expected,
                verdict=(Verdict.AGREES if agrees else Verdict.DISAGREES).value,
            )
        )
    return found


def _limit(advance: Advance, frequency: float) -> float:
    low, high = TRIED
    if _is_stable(advance, high / frequency):
        return math.inf
    while high / low > 1 + RESOLUTION:
        middle = math.sqrt(low * high)
        low, high = (middle, high) if _is_stable(advance, middle / frequency) else (low, middle)
    return math.sqrt(low * high)


def _is_stable(advance: Advance, step: float) -> bool:
    start = Start(np.array([DISPLACEMENT]), np.zeros(1), STEPS_TRIED * step)
    with np.errstate(all="ignore"):
        path = advance(start, step, STEPS_TRIED, STEPS_TRIED)
    return bool(np.isfinite(path.q).all() and np.abs(path.q).max() < GROWN * DISPLACEMENT)
