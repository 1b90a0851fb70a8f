"""The benchmark as a study: its parts, and one task per system and part, so that a crash costs that part alone.

Whatever is timed for comparison runs by itself, one task after the other; the rest shares the processors.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

from harness.bench.acceleration_cost import FAMILY, acceleration_costs, growth
from harness.bench.derivative_cost import derivative_costs
from harness.bench.energy_drift import drifts
from harness.bench.methods import Method, find_derivative_methods, find_methods, select_methods
from harness.bench.motion_cost import motion_costs
from harness.bench.robot_growth import robot_growth
from harness.bench.stationary_action import stationarity
from harness.bench.thoroughness import THOROUGHNESS, Thoroughness
from harness.bench.tuned_mass_damper import SYSTEM, figures
from harness.bench.yardstick import Stopwatch
from harness.crosscheck.scene import Scene
from harness.crosscheck.tasks import Note
from harness.engines import subjects
from harness.errors import InvalidInput, InvalidRequest
from harness.library import Library, member_of, nearest
from harness.motion.integrators import CONSTRAINED, MECHANISMS, ROBOTS, integrators, kind_of
from harness.results.benchmark import Benchmark, Yardstick
from harness.study import Part, Rounds
from harness.workers import Outcome, Task

ACCELERATIONS, DERIVATIVES, MOTION = "accelerations", "derivatives", "motion"
# Of a robot's program. The motion of one of seven joints, of 3,600, takes minutes to be known in quadruple precision.
MOST_INSTRUCTIONS_OF_MOTION = 5000


@dataclass(frozen=True, kw_only=True)
class BenchmarkSettings:
    """A choice of measurements.

    Attributes:
        library: where systems and models are.
        names: systems; all for none.
        methods: names of methods and integrators, all for none; of a part, those of its own kind.
        motion, derivatives: whether to measure these too.
        profile: name of one of ``THOROUGHNESS``.
        seed: of the sampled states.
    """

    library: Library
    names: Sequence[str] = ()
    methods: Sequence[str] = ()
    motion: bool = False
    derivatives: bool = False
    profile: str = "quick"
    seed: int = 0

    @property
    def thoroughness(self) -> Thoroughness:
        return THOROUGHNESS[self.profile]

    @property
    def kinds(self) -> Sequence[str]:
        """What may be measured: robots, or mechanisms of either kind."""
        return (ROBOTS,) if self.library.is_of_robots else (MECHANISMS, CONSTRAINED)


@dataclass(frozen=True, kw_only=True)
class BenchmarkPart:
    """One part of a benchmark.

    Attributes:
        name: in words.
        measure: what a worker does with settings and a scene, which is None for a part that belongs to one system or family.
        kind: what its methods compute: accelerations, derivatives or motion.
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


def _chosen(settings: BenchmarkSettings, kind: str) -> list[Method]:
    """The methods of one kind that are asked for."""
    known = [method.name for method in find_methods(kind)]
    names = [name for name in settings.methods if name in known]
    return select_methods(names, kind) if names or not settings.methods else []


def _integrators(settings: BenchmarkSettings, kind: str) -> list[str]:
    """The names of the integrators of one kind that are asked for."""
    return [one.name for one in integrators(kind) if not settings.methods or one.name in settings.methods]


def _accelerations(settings: BenchmarkSettings, scene: Scene, note: Note) -> Benchmark:
    extent, methods = settings.thoroughness, _chosen(settings, kind_of(scene))
    stopwatch = Stopwatch()

    def noted(text: str) -> None:
        # Before each method, so that what else the machine does by then slows both.
        stopwatch.time()
        note(text)

    costs, found = acceleration_costs(scene, methods, extent.states, settings.seed, extent.minimum_seconds, noted)
    return Benchmark(
        accelerations=costs,
        findings=found,
        yardsticks=[Yardstick(system=scene.mechanism.name, seconds=stopwatch.fastest)] if costs else [],
        problems=[f"{cost.system}, {cost.method}: {cost.note}" for cost in costs if cost.failed],
    )


def _growth(settings: BenchmarkSettings, scene: None, note: Note) -> Benchmark:
    extent, methods = settings.thoroughness, _chosen(settings, MECHANISMS)
    found = growth(settings.library, methods, extent.states, settings.seed, extent.minimum_seconds, note, extent.sizes)
    return Benchmark(growth=found)


def _robot_growth(settings: BenchmarkSettings, scene: None, note: Note) -> Benchmark:
    extent = settings.thoroughness
    return Benchmark(growth=[robot_growth(extent.arms, settings.seed, extent.minimum_seconds, note)])


def _motion(settings: BenchmarkSettings, scene: Scene, note: Note) -> Benchmark:
    extent, size = settings.thoroughness, len(scene.mechanism.program.instructions)
    if settings.library.is_of_robots and size > MOST_INSTRUCTIONS_OF_MOTION:
        found = f"its equations take {size:,} instructions; expected at most {MOST_INSTRUCTIONS_OF_MOTION:,}"
        return Benchmark(problems=[f"{scene.mechanism.name}, motion: {found}, for the truth is integrated in quadruple precision"])
    names = _integrators(settings, kind_of(scene))
    if not names:
        return Benchmark()
    truth, costs, orders = motion_costs(scene, names, extent.steps, extent.horizon, extent.seconds, note)
    return Benchmark(truths=[truth], motion=costs, orders=orders)


def _drifts(settings: BenchmarkSettings, scene: Scene, note: Note) -> Benchmark:
    extent = settings.thoroughness
    names = _integrators(settings, kind_of(scene))
    return Benchmark(drifts=drifts(scene, names, extent.long_steps, note, seconds=extent.long_seconds) if names else [])


def _stationarity(settings: BenchmarkSettings, scene: Scene, note: Note) -> Benchmark:
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
    extent, methods = settings.thoroughness, [one for one in find_derivative_methods() if one.name in settings.methods]
    # A tenth, as each method is timed at several numbers of states.
    costs = derivative_costs(scene, methods, extent.derivative_states, settings.seed, extent.minimum_seconds / 10, note)
    return Benchmark(derivatives=costs, problems=[f"{cost.system}, {cost.method}: {cost.note}" for cost in costs if cost.failed])


PARTS = (
    BenchmarkPart(name="accelerations", measure=_accelerations, kind=ACCELERATIONS, timed=True),
    BenchmarkPart(name="derivatives", measure=_derivatives, kind=DERIVATIVES, timed=True),
    BenchmarkPart(name="growth", measure=_growth, kind=ACCELERATIONS, timed=True, system=FAMILY),
    BenchmarkPart(name="growth of robots", measure=_robot_growth, kind=ACCELERATIONS, timed=True, system=FAMILY, by_methods=False),
    BenchmarkPart(name="motion", measure=_motion, kind=MOTION, timed=True),
    BenchmarkPart(name="long runs", measure=_drifts, kind=MOTION, timed=False, needs_energies=True),
    BenchmarkPart(name="stationary action", measure=_stationarity, kind=MOTION, timed=False, needs_energies=True),
    BenchmarkPart(name="figures of the text", measure=_figures, kind=MOTION, timed=False, system=SYSTEM),
)


class BenchmarkStudy(Rounds):
    """One benchmark of a library; a ``harness.study.Study`` of ``Benchmark`` parts.

    Raises:
        InvalidInput: the library cannot be used at all.
        InvalidRequest: a system, method or integrator that does not exist, or an integrator without motion.
    """

    title = "benchmark"

    def __init__(self, settings: BenchmarkSettings) -> None:
        super().__init__()
        self.settings = settings
        self.names = settings.library.select(settings.names)
        known = self._known()
        asked = {ACCELERATIONS: True, DERIVATIVES: settings.derivatives, MOTION: settings.motion}
        for name in settings.methods:
            kind = next((kind for kind, names in known.items() if name in names), None)
            if kind is None:
                self._refuse_other_kind(name)
                raise InvalidRequest(
                    f"no method or integrator is called {name!r}; {nearest(name, [one for names in known.values() for one in names])}"
                )
            if not asked[kind]:
                raise InvalidRequest(f"{name!r} computes {kind}; ask for it with --{kind}")
        chosen = settings.methods or self._measured_by_default(known)
        # By what they compute.
        self.methods: dict[str, list[str]] = {
            kind: [name for name in names if asked[kind] and name in chosen] for kind, names in known.items()
        }
        self._measured = Benchmark()
        self._scenes: dict[str, Scene] = {}

    def _known(self) -> dict[str, list[str]]:
        """The names of all methods by what they compute, those that may be measured on the library's systems."""
        methods, moving = (
            list(dict.fromkeys(one.name for kind in self.settings.kinds for one in find(kind))) for find in (find_methods, integrators)
        )
        of_trees = [] if self.settings.library.is_of_robots else [method.name for method in find_derivative_methods()]
        return {ACCELERATIONS: methods, DERIVATIVES: of_trees, MOTION: moving}

    def _measured_by_default(self, known: dict[str, list[str]]) -> set[str]:
        """All names but those of methods whose engine is installed nowhere."""
        names = {name for those in known.values() for name in those}
        needing = [method for method in find_derivative_methods() if method.engine] if self.settings.derivatives else []
        if needing:
            installed = {subject.engine for subject in subjects(self.settings.library)}
            names -= {method.name for method in needing if method.engine not in installed}
        return names

    def _refuse_other_kind(self, name: str) -> None:
        other = MECHANISMS if self.settings.library.is_of_robots else ROBOTS
        if name in [one.name for find in (find_methods, integrators) for one in find(other)]:
            raise InvalidRequest(f"{name!r} is for {other}, and {self.names[0]} is none of them; see harness list methods")

    @property
    def constrained(self) -> list[str]:
        """The systems whose action is not varied, because variations would have to keep their constraints."""
        varied = [part for part in PARTS if part.measure is _stationarity and self.methods[part.kind]]
        return [name for name, scene in self._scenes.items() if varied and scene.mechanism.constraints is not None]

    @property
    def left_out(self) -> list[str]:
        """The names of the parts that were asked for and need energies, where there are none."""
        chosen = (part for part in PARTS if part.needs_energies and self.methods[part.kind])
        return [part.name for part in chosen] if self.settings.library.is_of_robots else []

    @property
    def steps(self) -> int:
        return len(self.names) + sum(len(self._places(part)) * len(self._by_engine(part)) for part in PARTS)

    def rounds(self) -> Iterator[list[Task]]:
        yield [Task((self._loaded, name, "equations and models"), load, (self.settings.library, name)) for name in self.names]
        yield list(self._measuring(timed=True))
        yield list(self._measuring(timed=False))

    def result(self) -> Benchmark:
        return self._measured

    def _measuring(self, timed: bool) -> Iterator[Task]:
        for part in PARTS:
            for name in self._places(part) if part.timed == timed else ():
                if name in self._scenes or part.system:
                    for engine, methods in self._by_engine(part).items():
                        what = f"{part.name} of {engine}" if engine else part.name
                        given = replace(self.settings, methods=methods), self._scenes.get(name)
                        # Two timings at once would take turns on memory and caches, and measure each other.
                        yield Task((self._taken, name, what), part.measure, given, affinity="timed" if timed else None)

    def _by_engine(self, part: BenchmarkPart) -> dict[str, list[str]]:
        """The methods of a part by the engine that not everybody installs, "" for none: one that dies costs no measurements of others."""
        engines = {method.name: method.engine for method in find_derivative_methods()}
        found: dict[str, list[str]] = {}
        for name in self.methods[part.kind]:
            found.setdefault(engines.get(name, ""), []).append(name)
        return found

    def _places(self, part: BenchmarkPart) -> list[str]:
        """Names of what a part is measured on."""
        if not self.methods[part.kind] or (self.settings.methods and not part.by_methods):
            return []
        if part.name in self.left_out:
            return []
        if not part.system:
            return self.names
        members = {name: member_of(self.settings.library.system_path(name)) for name in self.names}
        named = [name for name, member in members.items() if part.system in (name, member and member[0].stem)]
        return [part.system] if named else []

    def _loaded(self, outcome: Outcome, name: str, what: str) -> Iterator[Part]:
        found = self._problem(outcome, name, what) or Benchmark()
        if isinstance(outcome.value, Scene):
            self._scenes[name] = outcome.value
            # Of systems that nobody named, those that a method is for are meant.
            if self.settings.names and self.settings.methods:
                found.problems += self.not_for(outcome.value)
        yield self._part(f"{name} loaded", found)

    def not_for(self, scene: Scene) -> list[str]:
        """A sentence for each chosen method that a scene's kind has not."""
        kind = kind_of(scene)
        able = [one.name for find in (find_methods, integrators) for one in find(kind)]
        able += [one.name for one in find_derivative_methods() if kind == MECHANISMS]
        name = scene.mechanism.name
        return [f"{name}: {one!r} is not for {kind}; see harness list methods" for one in self.settings.methods if one not in able]

    def _taken(self, outcome: Outcome, name: str, what: str) -> Iterator[Part]:
        yield self._part(f"{name} {what}", self._problem(outcome, name, what) or outcome.value)

    def _part(self, label: str, found: Benchmark) -> Part:
        self._measured.extend(found)
        return Part(label, found)

    def _problem(self, outcome: Outcome, name: str, what: str) -> Benchmark | None:
        """The part of a task that gave nothing; None for one that did."""
        failure = self.failure(outcome)
        if not failure:
            return None
        noted = f" ({outcome.crash.note})" if outcome.crash is not None and outcome.crash.note else ""
        if isinstance(outcome.exception, InvalidInput):
            # Of a path, only the file stays, because reports are published.
            failure = f"{outcome.exception.path.name}: {outcome.exception.problem}"
        return Benchmark(problems=[f"{name}, {what}{noted}: {failure}"])
