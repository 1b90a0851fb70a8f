"""Parts of a benchmark, each with what a worker does for it; the settings of a choice, and how much a profile measures.

Whatever is timed for comparison runs by itself, one task after the other; the rest shares the processors.
"""

from __future__ import annotations

import math
import timeit
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeVar

import numpy as np

from harness.bench.costs import Effort, acceleration_costs
from harness.bench.energy_drift import drifts
from harness.bench.further_costs import FAMILY, SIZES, STATES, derivative_costs, growth, quantity_costs, robot_growth
from harness.bench.methods import DERIVATIVES, Method, find_methods
from harness.bench.motion_cost import motion_costs
from harness.bench.solvers import solver_costs
from harness.bench.stationary_action import stationarity
from harness.bench.tuned_mass_damper import SYSTEM, figures
from harness.crosscheck.scene import Scene
from harness.engines import asked_of, select_subjects
from harness.library import ROBOTS, Library
from harness.motion.integrators import Integrator, integrators, kind_of
from harness.results.benchmark import AccelerationCost, Benchmark, DerivativeCost, QuantityCost, Yardstick
from harness.results.records import ACCELERATIONS
from harness.study import Note
from harness.trees.mechanism import RobotMechanism
from harness.truth.quantities import find_quantities, select_quantities

COUNT, CALLS = 4096, 10
Way = TypeVar("Way", Method, Integrator)


class Stopwatch:
    """The fastest call of the reference computation, of all that were timed; the noise of a machine only adds.

    Attributes:
        fastest: [s]; infinite before the first call.
    """

    def __init__(self) -> None:
        self.fastest = math.inf
        self._angles, self._lengths = np.linspace(0.0, 6.0, COUNT), np.linspace(1.0, 2.0, COUNT)

    def time(self) -> None:
        """Time some calls."""
        self.fastest = min(self.fastest, *timeit.repeat(self._compute, number=1, repeat=CALLS))

    def _compute(self) -> None:
        for _ in range(4):
            np.sqrt(self._lengths * np.sin(self._angles) ** 2 + np.cos(self._angles) ** 2)


@dataclass(frozen=True, kw_only=True)
class Thoroughness:
    """The extent of a benchmark.

    Attributes:
        states: states per system of the accelerations; minimum_seconds: how long each method is timed at least.
        derivative_states: numbers of states of which derivatives are asked for at once.
        quantity_states: at which errors of other quantities than accelerations are measured.
        solver_states: at which errors of solvers are measured.
        sizes: numbers of bodies of the growing chain; arms: of seven joints, of the growing robot.
        steps: steps of the integrators [s]; horizon: length of those motions [s].
        seconds: longest that an integrator may take with one step by its nominal time, else the step is left out.
        long_steps: steps of a long run, or as many as take an integrator ``long_seconds`` by that.
        time_limit: seconds a task may take.
    """

    states: int
    minimum_seconds: float
    derivative_states: Sequence[int]
    quantity_states: int
    solver_states: int
    sizes: Sequence[int]
    arms: Sequence[int]
    steps: Sequence[float]
    horizon: float
    seconds: float
    long_steps: int
    long_seconds: float
    time_limit: float


THOROUGHNESS = {
    "quick": Thoroughness(
        states=1000, minimum_seconds=0.05, derivative_states=(1, 10, 100, 1000), quantity_states=128,
        solver_states=64,
        sizes=(1, 2, 4, 8, 16), arms=(1, 2, 4, 8, 14),
        steps=(1e-1, 1e-2, 1e-3, 1e-4, 1e-5), horizon=2.0, seconds=0.5, long_steps=1_000_000, long_seconds=2.0, time_limit=300.0,
    ),
    "nightly": Thoroughness(
        states=10_000, minimum_seconds=0.5, derivative_states=(1, 10, 100, 1000, 10_000), quantity_states=1000, solver_states=256,
        sizes=(1, 2, 4, 8, 16, 32),
        arms=(1, 2, 4, 8, 14), horizon=10.0, seconds=30.0,
        steps=(1e-1, 3e-2, 1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 3e-5, 1e-5), long_steps=1_000_000, long_seconds=120.0, time_limit=3600.0,
    ),
}  # fmt: skip


MOTION, QUANTITIES, SOLVERS = "motion", "quantities", "solvers"
# Of a robot's program. The motion of one of seven joints, of 3,600, takes minutes to be known in quadruple precision.
MOST_INSTRUCTIONS_OF_MOTION = 5000


@dataclass(frozen=True, kw_only=True)
class BenchmarkSettings:
    """A choice of measurements.

    Attributes:
        library: where systems and models are.
        names: systems; all for none.
        methods: names of methods, integrators and, of quantities, subjects, all for none; of a part, those of its own kind.
        quantities: names of quantities, accelerations for none.
        motion, derivatives, solvers: whether to measure these too.
        profile: name of one of ``THOROUGHNESS``.
        seed: of the sampled states.
    """

    library: Library
    names: Sequence[str] = ()
    methods: Sequence[str] = ()
    quantities: Sequence[str] = ()
    motion: bool = False
    derivatives: bool = False
    solvers: bool = False
    profile: str = "quick"
    seed: int = 0

    @property
    def thoroughness(self) -> Thoroughness:
        return THOROUGHNESS[self.profile]

    @property
    def effort(self) -> Effort:
        """Effort for each way of computing accelerations."""
        return Effort((self.thoroughness.states,), self.thoroughness.states, self.seed, self.thoroughness.minimum_seconds)

    def effort_at(self, counts: Sequence[int], judged: int) -> Effort:
        """Effort for each way of computing something else, a tenth of the time at each of several numbers of states."""
        return Effort(counts, judged, self.seed, self.thoroughness.minimum_seconds / 10)

    def chosen(self, known: Iterable[Way]) -> list[Way]:
        """Those of the methods or integrators that are asked for, in that order; all for none."""
        by_name = {one.name: one for one in known}
        return [by_name[name] for name in self.methods or by_name if name in by_name]

    @property
    def further_quantities(self) -> list[str]:
        """The quantities beyond accelerations that are asked for; raises InvalidRequest where there is none of a name."""
        return [name for name in select_quantities(self.quantities) if not find_quantities()[name].is_default]


@dataclass(frozen=True, kw_only=True)
class BenchmarkPart:
    """One part of a benchmark.

    Attributes:
        name: in words.
        measure: what a worker does with settings and a scene, which is None for a part that belongs to one system or family.
        kind: what its methods compute: accelerations, other quantities, derivatives, motion, or accelerations by solvers of constraints.
        timed: whether it must run by itself because its times are compared.
        system: the one system or family it belongs to; "" for a part that is measured on every system.
        by_methods: whether it is measured for the methods that were chosen; one that is not, only where none were.
        needs_energies: whether it needs T and V, which a robot's file does not have.
    """

    name: str
    measure: Callable[[BenchmarkSettings, Any, Note], Benchmark]
    kind: str
    timed: bool
    system: str = ""
    by_methods: bool = True
    needs_energies: bool = False


def load(library: Library, name: str, note: Note) -> Scene:
    """The equations and models of system ``name``."""
    return Scene.of(library, name)


def _failures(costs: Iterable[AccelerationCost | DerivativeCost]) -> list[str]:
    """A sentence for each way that failed."""
    ways = ((cost, f"{cost.quantity} of {cost.method}" if isinstance(cost, QuantityCost) else cost.method) for cost in costs)
    return [f"{cost.system}, {way}: {cost.note}" for cost, way in ways if cost.failed]


def _accelerations(settings: BenchmarkSettings, scene: Scene, note: Note) -> Benchmark:
    stopwatch = Stopwatch()

    def noted(text: str) -> None:
        # Before each method, so that what else the machine does by then slows both.
        stopwatch.time()
        note(text)

    costs, found = acceleration_costs(scene, settings.chosen(find_methods(kind_of(scene))), settings.effort, noted)
    return Benchmark(
        accelerations=costs,
        findings=found,
        yardsticks=[Yardstick(system=scene.mechanism.name, seconds=stopwatch.fastest)] if costs else [],
        problems=_failures(costs),
    )


def _growth(settings: BenchmarkSettings, scene: None, note: Note) -> Benchmark:
    methods = settings.chosen(find_methods())
    return Benchmark(growth=growth(settings.library, methods, settings.thoroughness.sizes, settings.effort, note))


def _robot_growth(settings: BenchmarkSettings, scene: None, note: Note) -> Benchmark:
    extent = settings.thoroughness
    return Benchmark(growth=[robot_growth(extent.arms, settings.seed, extent.minimum_seconds, note)])


def _motion(settings: BenchmarkSettings, scene: Scene, note: Note) -> Benchmark:
    extent, size = settings.thoroughness, len(scene.mechanism.program.instructions)
    if kind_of(scene) == ROBOTS and size > MOST_INSTRUCTIONS_OF_MOTION:
        found = f"its equations take {size:,} instructions; expected at most {MOST_INSTRUCTIONS_OF_MOTION:,}"
        return Benchmark(problems=[f"{scene.mechanism.name}, motion: {found}, for the truth is integrated in quadruple precision"])
    chosen = settings.chosen(integrators(kind_of(scene)))
    if not chosen:
        return Benchmark()
    # What moves is the file: an engine that reads otherwise has another motion.
    scene = scene.aided
    truth, costs, orders = motion_costs(scene, chosen, extent.steps, extent.horizon, extent.seconds, note)
    return Benchmark(truths=[truth], motion=costs, orders=orders)


def _drifts(settings: BenchmarkSettings, scene: Scene, note: Note) -> Benchmark:
    extent, chosen = settings.thoroughness, settings.chosen(integrators(kind_of(scene)))
    return Benchmark(drifts=drifts(scene, chosen, extent.long_steps, note, seconds=extent.long_seconds) if chosen else [])


def vary_action(settings: BenchmarkSettings, scene: Scene, note: Note) -> Benchmark:
    if scene.mechanism.constraints is not None:
        # Variations are of all coordinates; see ``BenchmarkStudy.constrained``.
        return Benchmark()
    return Benchmark(stationarity=stationarity(scene, note))


def _figures(settings: BenchmarkSettings, scene: None, note: Note) -> Benchmark:
    return Benchmark(figures=figures(settings.library, note))


def _derivatives(settings: BenchmarkSettings, scene: Scene, note: Note) -> Benchmark:
    if scene.mechanism.constraints is not None:
        # None is along motions that they allow.
        return Benchmark()
    effort = settings.effort_at(settings.thoroughness.derivative_states, STATES)
    costs = derivative_costs(scene, settings.chosen(find_methods(DERIVATIVES)), effort, note)
    return Benchmark(derivatives=costs, problems=_failures(costs))


def _solvers(settings: BenchmarkSettings, scene: Scene, note: Note) -> Benchmark:
    assert isinstance(scene.mechanism, RobotMechanism)
    path, states = scene.mechanism.robot.path, settings.thoroughness.solver_states
    costs = [cost for name in settings.methods for cost in solver_costs(path, name, states, settings.seed, note)]
    return Benchmark(solvers=costs)


def _quantity(quantity: str, settings: BenchmarkSettings, scene: Scene, note: Note) -> Benchmark:
    asked = asked_of(settings.library, scene.mechanism.name, select_subjects(settings.library, settings.methods))
    effort = settings.effort_at(SIZES, settings.thoroughness.quantity_states)
    costs = quantity_costs(scene, find_quantities()[quantity], asked, effort, note)
    return Benchmark(quantities=costs, problems=_failures(costs))


def parts_of(settings: BenchmarkSettings) -> list[BenchmarkPart]:
    """The parts of ``PARTS``, and one for each quantity beyond accelerations that is asked for."""
    further = settings.further_quantities
    return [*PARTS, *(BenchmarkPart(name=name, measure=partial(_quantity, name), kind=QUANTITIES, timed=True) for name in further)]


PARTS = (
    BenchmarkPart(name="accelerations", measure=_accelerations, kind=ACCELERATIONS, timed=True),
    BenchmarkPart(name="derivatives", measure=_derivatives, kind=DERIVATIVES, timed=True),
    BenchmarkPart(name="solvers", measure=_solvers, kind=SOLVERS, timed=True),
    BenchmarkPart(name="growth", measure=_growth, kind=ACCELERATIONS, timed=True, system=FAMILY),
    BenchmarkPart(name="growth of robots", measure=_robot_growth, kind=ACCELERATIONS, timed=True, system=FAMILY, by_methods=False),
    BenchmarkPart(name="motion", measure=_motion, kind=MOTION, timed=True),
    BenchmarkPart(name="long runs", measure=_drifts, kind=MOTION, timed=False, needs_energies=True),
    BenchmarkPart(name="stationary action", measure=vary_action, kind=MOTION, timed=False, needs_energies=True),
    BenchmarkPart(name="figures of the text", measure=_figures, kind=MOTION, timed=False, system=SYSTEM),
)
