"""The parts of a benchmark: what each measures on a system, in a worker process."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from harness.bench.acceleration_cost import FAMILY, acceleration_costs, growth
from harness.bench.energy_drift import drifts
from harness.bench.methods import select_methods
from harness.bench.motion_cost import motion_costs
from harness.bench.stationary_action import stationarity
from harness.bench.tuned_mass_damper import SYSTEM, figures
from harness.crosscheck.scene import Scene
from harness.crosscheck.tasks import Note
from harness.library import Library
from harness.results.benchmark import Benchmark


@dataclass(frozen=True, kw_only=True)
class Thoroughness:
    """The extent of a benchmark.

    Attributes:
        states: states per system of the accelerations; minimum_seconds: how long each method is timed at least.
        sizes: numbers of bodies of the growing chain.
        steps: steps of the integrators [s]; horizon: length of those motions [s].
        seconds: longest that an integrator may take with one step, else the step is left out.
        long_steps: steps of a long run, or as many as take an integrator ``long_seconds``.
        time_limit: seconds a task may take.
    """

    states: int
    minimum_seconds: float
    sizes: Sequence[int]
    steps: Sequence[float]
    horizon: float
    seconds: float
    long_steps: int
    long_seconds: float
    time_limit: float


THOROUGHNESS = {
    "quick": Thoroughness(
        states=1000, minimum_seconds=0.05, sizes=(1, 2, 4, 8, 16), steps=(1e-1, 1e-2, 1e-3, 1e-4, 1e-5), horizon=2.0, seconds=0.5,
        long_steps=1_000_000, long_seconds=2.0, time_limit=300.0,
    ),
    "nightly": Thoroughness(
        states=10_000, minimum_seconds=0.5, sizes=(1, 2, 4, 8, 16, 32), horizon=10.0, seconds=30.0,
        steps=(1e-1, 3e-2, 1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 3e-5, 1e-5), long_steps=1_000_000, long_seconds=120.0, time_limit=3600.0,
    ),
}  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class BenchmarkSettings:
    """A choice of measurements.

    Attributes:
        library: where systems and models are.
        names: systems; all for none.
        methods: names of methods and integrators, all for none; of a part, those of its own kind.
        motion: whether to measure motion too.
        profile: name of one of ``THOROUGHNESS``.
        seed: of the sampled states.
    """

    library: Library
    names: Sequence[str] = ()
    methods: Sequence[str] = ()
    motion: bool = False
    profile: str = "quick"
    seed: int = 0

    @property
    def thoroughness(self) -> Thoroughness:
        return THOROUGHNESS[self.profile]


@dataclass(frozen=True, kw_only=True)
class BenchmarkPart:
    """One part of a benchmark.

    Attributes:
        name: in words.
        measure: what a worker does with settings and a scene, which is None for a part that belongs to one system or family.
        moving: whether it is about motion.
        timed: whether it must run by itself because its times are compared.
        system: the one system or family it belongs to; "" for a part that is measured on every system.
    """

    name: str
    measure: Callable[[BenchmarkSettings, Any, Note], Benchmark]
    moving: bool
    timed: bool
    system: str = ""


def load(library: Library, name: str, note: Note) -> Scene:
    """The equations and models of system ``name``."""
    return Scene.of(library, name)


def _accelerations(settings: BenchmarkSettings, scene: Scene, note: Note) -> Benchmark:
    extent, methods = settings.thoroughness, select_methods(settings.methods)
    return Benchmark(accelerations=acceleration_costs(scene, methods, extent.states, settings.seed, extent.minimum_seconds, note))


def _growth(settings: BenchmarkSettings, scene: None, note: Note) -> Benchmark:
    extent, methods = settings.thoroughness, select_methods(settings.methods)
    found = growth(settings.library, methods, extent.states, settings.seed, extent.minimum_seconds, note, extent.sizes)
    return Benchmark(growth=found)


def _motion(settings: BenchmarkSettings, scene: Scene, note: Note) -> Benchmark:
    extent = settings.thoroughness
    truth, costs, orders = motion_costs(scene, settings.methods, extent.steps, extent.horizon, extent.seconds, note)
    return Benchmark(truths=[truth], motion=costs, orders=orders)


def _drifts(settings: BenchmarkSettings, scene: Scene, note: Note) -> Benchmark:
    extent = settings.thoroughness
    return Benchmark(drifts=drifts(scene, settings.methods, extent.long_steps, note, seconds=extent.long_seconds))


def _stationarity(settings: BenchmarkSettings, scene: Scene, note: Note) -> Benchmark:
    return Benchmark(stationarity=stationarity(scene, note))


def _figures(settings: BenchmarkSettings, scene: None, note: Note) -> Benchmark:
    return Benchmark(figures=figures(settings.library, note))


PARTS = (
    BenchmarkPart(name="accelerations", measure=_accelerations, moving=False, timed=True),
    BenchmarkPart(name="growth", measure=_growth, moving=False, timed=True, system=FAMILY),
    BenchmarkPart(name="motion", measure=_motion, moving=True, timed=True),
    BenchmarkPart(name="long runs", measure=_drifts, moving=True, timed=False),
    BenchmarkPart(name="stationary action", measure=_stationarity, moving=True, timed=False),
    BenchmarkPart(name="figures of the text", measure=_figures, moving=True, timed=False, system=SYSTEM),
)
