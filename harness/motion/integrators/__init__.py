"""Integrators: ways of computing a motion, each a small declaration in a module of this package.

Every module-level ``Integrator`` of every module here is one of the harness's integrators; adding one touches
no list. Programs are imported where they are used, so that finding integrators costs nothing.

Sources: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., chapters I, VI and IX, for orders and
for energy over long times.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from harness.arrays import Array
from harness.crosscheck.scene import Scene
from harness.library import CONSTRAINED, MECHANISMS, ROBOTS
from harness.motion.taylor import Path
from harness.motion.trajectories import Start
from harness.programs.mechanisms.mechanism import Mechanism
from harness.registry import declared, select

# What an integrator integrates, and a method computes: mechanisms that are trees, those with constraints, and robots' files.
KINDS = (MECHANISMS, CONSTRAINED, ROBOTS)
# From a start, in steps of so many seconds, so many of them, of which every so-many-th is kept. An adaptive
# integrator is given its relative tolerance, and the number of equal intervals of the horizon to keep.
Advance = Callable[[Start, float, int, int], Path]
# A state beyond it is broken down, and what follows is not a number.
LARGEST = 1e12
# Looking costs as much as a step of a small mechanism.
ROWS_BETWEEN_LOOKS = 64


def compiled_seconds(mechanism: Mechanism) -> float:
    """Nominal time of one evaluation of the compiled equations [s]."""
    return 3e-7 + 1.7e-8 * len(mechanism.charts(linear_velocity_in_body=False)[0].instructions)


@dataclass(frozen=True, kw_only=True)
class Integrator:
    """One way of computing a motion.

    Attributes:
        name: as "equations RK4".
        format: what it reads: "equations", or the model format "mjcf" or "urdf".
        order: of convergence of the state, by theory; None for one without a fixed order.
        prepare: loads and compiles for a scene; raises harness.engines.Unsupported where it cannot.
        adaptive: whether it chooses its steps by a tolerance.
        long_run: what theory says of its energy on a conservative system over many steps: "bounded",
            "secular", or "" where it is silent.
        of: what it integrates, some of ``KINDS``: mechanisms with their energies and models, those with constraints, robots' files.
        nominal_seconds: of one evaluation of a mechanism's accelerations, to a factor of two or so. Budgets count evaluations by it, so
            that what is measured does not depend on the machine and its load.
        explain: says, from runs on a scene with a step [s], where the method is not what its name promises; "" if it is.
    """

    name: str
    format: str
    order: int | None
    prepare: Callable[[Scene], Advance]
    adaptive: bool = False
    long_run: str = ""
    nominal_seconds: Callable[[Mechanism], float] = compiled_seconds
    explain: Callable[[Scene, Start, float], str] | None = None
    of: tuple[str, ...] = (MECHANISMS,)

    def run(self, advance: Advance, start: Start, size: float, count: int, kept: int) -> Path:
        """The motion in ``count`` steps of ``size`` [s], or to the tolerance ``size``, of which about ``kept`` states are kept."""
        return advance(start, size, kept, 1) if self.adaptive else advance(start, size, count, max(1, count // kept))


def integrators(of: str = MECHANISMS) -> list[Integrator]:
    """All integrators of one of ``KINDS``, by module and in the order of their declaration."""
    return [one for one in declared(__name__, Integrator, "integrator").values() if of in one.of]


def kind_of(scene: Scene) -> str:
    """The kind of a scene, of ``KINDS``."""
    return ROBOTS if not scene.mechanism.energy_programs else MECHANISMS if scene.mechanism.constraints is None else CONSTRAINED


def select_integrators(names: Iterable[str], of: str = MECHANISMS) -> list[Integrator]:
    """The integrators of one of ``KINDS`` called ``names``, or all for none.

    Raises:
        InvalidRequest: a name none has; the message gives the nearest one.
    """
    return select(names, {one.name: one for one in integrators(of)}, "integrator")


def keep(start: Start, step: float, steps: int, every: int, evaluations_per_step: int, go: Callable[[int], tuple[Array, Array]]) -> Path:
    """The path of ``go(n)``, which makes n steps and returns q and v.

    The kept states are the start and every ``every``-th one, and the last whether or not it is one. What follows a
    breakdown is not a number.
    """
    counts = [*range(every, steps, every), steps]
    q, v = np.full((len(counts) + 1, len(start.q)), np.nan), np.full((len(counts) + 1, len(start.v)), np.nan)
    q[0], v[0] = start.q, start.v
    done = 0
    began = time.perf_counter()
    with np.errstate(over="ignore", invalid="ignore"):
        for row, count in enumerate(counts, start=1):
            q[row], v[row] = go(count - done)
            done = count
            if (row % ROWS_BETWEEN_LOOKS == 0 or count == steps) and (broken := _broken_down(q, v, row)):
                done = counts[broken - 1]
                q[broken + 1 :] = v[broken + 1 :] = np.nan
                break
    seconds = time.perf_counter() - began
    return Path(np.array([0, *counts]) * step, q, v, None, done * evaluations_per_step, seconds)


def _broken_down(q: Array, v: Array, last: int) -> int:
    """The first row up to ``last``, of those since the last look, that is broken down; 0 if none is."""
    first = max(last - ROWS_BETWEEN_LOOKS, 0) + 1
    sizes = np.abs(np.hstack([q[first : last + 1], v[first : last + 1]])).max(axis=1)
    rows = np.flatnonzero(~(sizes < LARGEST))
    return first + int(rows[0]) if len(rows) else 0
