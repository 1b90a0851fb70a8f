"""The benchmark as a study: one task per system and part, so that a crash costs that part alone."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from typing import Any

from harness.bench.methods import DERIVATIVES, find_methods
from harness.bench.parts import MOTION, PARTS, QUANTITIES, SOLVERS, BenchmarkPart, BenchmarkSettings, load, parts_of, vary_action
from harness.crosscheck.scene import Scene
from harness.engines import engine_files, file_engine, known_subjects, subjects
from harness.errors import InvalidInput, InvalidRequest
from harness.library import MECHANISMS, ROBOTS, member_of, nearest
from harness.motion.integrators import integrators, kind_of
from harness.results.benchmark import Benchmark
from harness.results.records import ACCELERATIONS
from harness.study import Inquiry, Study, ask
from harness.truth.quantities import select_quantities
from harness.workers import Outcome

# By what methods compute, what asks for it.
_OPTIONS = {
    ACCELERATIONS: "--quantity accelerations",
    QUANTITIES: "--quantity",
    DERIVATIVES: "--derivatives",
    MOTION: "--motion",
    SOLVERS: "--solvers",
}


def _names(kinds: Iterable[str], *finds: Callable[[str], Iterable[Any]]) -> list[str]:
    """Names of all that some ways of finding declarations have of kinds of scenes, each once."""
    return list(dict.fromkeys(one.name for find in finds for kind in kinds for one in find(kind)))


def methods_of(settings: BenchmarkSettings) -> dict[str, list[str]]:
    """Names of all methods by what they compute, those that may be measured on the library's systems."""
    library, kinds = settings.library, settings.library.kinds
    of_trees, answering = _names([DERIVATIVES], find_methods), [str(subject) for subject in known_subjects(library)]
    if MECHANISMS not in kinds:
        of_trees, answering = [], []
    return {
        ACCELERATIONS: _names(kinds, find_methods),
        QUANTITIES: answering,
        DERIVATIVES: of_trees,
        MOTION: _names(kinds, integrators),
        SOLVERS: [name for name, file in engine_files(library).items() if file.of_users and file_engine(library, name).solvers],
    }


def _by_default(settings: BenchmarkSettings, known: dict[str, list[str]]) -> set[str]:
    """All names but those of methods whose engine is installed nowhere."""
    names = {name for those in known.values() for name in those}
    needing = [method for method in find_methods(DERIVATIVES) if method.engine] if settings.derivatives else []
    if needing or settings.further_quantities:
        asked = subjects(settings.library)
        installed = {subject.engine for subject in asked}
        names -= {method.name for method in needing if method.engine not in installed}
        names -= set(known[QUANTITIES]) - {str(subject) for subject in asked}
    return names


def not_for(settings: BenchmarkSettings, scene: Scene) -> list[str]:
    """A sentence for each chosen method that a scene's kind has not."""
    kind = kind_of(scene)
    able = _names([kind, DERIVATIVES] if kind == MECHANISMS else [kind], find_methods, integrators)
    able += [name for kind in (QUANTITIES, SOLVERS) for name in methods_of(settings)[kind]]
    name = scene.mechanism.name
    return [f"{name}: {one!r} is not for {kind}; see harness list methods" for one in settings.methods if one not in able]


class BenchmarkStudy(Study):
    """One benchmark of a library; a ``harness.study.Study`` of ``Benchmark`` parts.

    Raises:
        InvalidInput: the library cannot be used at all.
        InvalidRequest: a system, method, integrator or quantity that does not exist, a method of what is not asked for, or a quantity
            beyond accelerations of a robot.
    """

    title = "benchmark"

    def __init__(self, settings: BenchmarkSettings) -> None:
        super().__init__(Benchmark())
        self.settings = settings
        self.names = settings.library.select(settings.names)
        if ROBOTS in settings.library.kinds and settings.further_quantities:
            raise InvalidRequest(f"{settings.further_quantities[0]} is measured on mechanisms, and {self.names[0]} is none")
        if settings.solvers and ROBOTS not in settings.library.kinds:
            raise InvalidRequest(f"solvers are measured on a robot's file with all that it holds, and {self.names[0]} is a mechanism")
        self._parts, known = parts_of(settings), methods_of(settings)
        asked = {
            ACCELERATIONS: ACCELERATIONS in select_quantities(settings.quantities),
            QUANTITIES: bool(settings.further_quantities),
            DERIVATIVES: settings.derivatives,
            MOTION: settings.motion,
            SOLVERS: settings.solvers,
        }
        kinds = {name: kind for kind, names in known.items() for name in names}
        for name in settings.methods:
            other = MECHANISMS if ROBOTS in settings.library.kinds else ROBOTS
            if name not in kinds and name in _names([other], find_methods, integrators):
                raise InvalidRequest(f"{name!r} is for {other}, and {self.names[0]} is none of them; see harness list methods")
            if name not in kinds:
                raise InvalidRequest(f"no method or integrator is called {name!r}; {nearest(name, list(kinds))}")
            if not asked[kinds[name]]:
                raise InvalidRequest(f"{name!r} computes {kinds[name]}; ask for it with {_OPTIONS[kinds[name]]}")
        chosen = settings.methods or _by_default(settings, known)
        # By what they compute.
        self.methods = {kind: [name for name in names if asked[kind] and name in chosen] for kind, names in known.items()}
        self._scenes: dict[str, Scene] = {}

    @property
    def constrained(self) -> list[str]:
        """The systems whose action is not varied, because variations would have to keep their constraints."""
        varied = [part for part in PARTS if part.measure is vary_action and self.methods[part.kind]]
        return [name for name, scene in self._scenes.items() if varied and scene.mechanism.constraints is not None]

    @property
    def left_out(self) -> list[str]:
        """The names of the parts that were asked for and need energies, where there are none."""
        without = MECHANISMS not in self.settings.library.kinds
        return [part.name for part in PARTS if without and part.needs_energies and self.methods[part.kind]]

    @property
    def steps(self) -> int:  # type: ignore[override]
        return len(self.names) + sum(len(self._asked(part)) for part in self._parts)

    def inquiries(self) -> Iterator[Iterable[Inquiry[None]]]:
        yield [self._loaded(name) for name in self.names]
        for timed in (True, False):
            yield [
                self._measured_part(name, what, part, settings)
                for part in self._parts
                for name, what, settings in (self._asked(part) if part.timed == timed else ())
                if name in self._scenes or part.system
            ]

    def _loaded(self, name: str, what: str = "equations and models") -> Inquiry[None]:
        outcome = yield from ask(load, self.settings.library, name)
        found = self._problem(outcome, name, what) or Benchmark()
        if isinstance(outcome.value, Scene):
            self._scenes[name] = outcome.value
            # Of systems that nobody named, those that a method is for are meant.
            if self.settings.names and self.settings.methods:
                found.problems += not_for(self.settings, outcome.value)
        yield self.kept(f"{name} loaded", found)

    def _measured_part(self, name: str, what: str, part: BenchmarkPart, settings: BenchmarkSettings) -> Inquiry[None]:
        # Two timings at once would take turns on memory and caches, and measure each other.
        outcome = yield from ask(part.measure, settings, self._scenes.get(name), affinity=part.timed or None)
        yield self.kept(f"{name} {what}", self._problem(outcome, name, what) or outcome.value)

    def _asked(self, part: BenchmarkPart) -> list[tuple[str, str, BenchmarkSettings]]:
        """Places where a part is measured, each with its words and its methods.

        Those of an engine that not everybody installs are measured by themselves: one that dies costs no measurements of others.
        """
        files = engine_files(self.settings.library)
        engines = {method.name: method.engine for method in find_methods(DERIVATIVES)}
        engines |= {str(one): one.engine for one in known_subjects(self.settings.library) if files[one.engine].elsewhere}
        by_engine: dict[str, list[str]] = {}
        for name in self.methods[part.kind]:
            by_engine.setdefault(engines.get(name, ""), []).append(name)
        return [
            (place, f"{part.name} of {engine}" if engine else part.name, replace(self.settings, methods=methods))
            for place in self._places(part)
            for engine, methods in by_engine.items()
        ]

    def _places(self, part: BenchmarkPart) -> list[str]:
        """Names of what a part is measured on."""
        if (self.settings.methods and not part.by_methods) or part.name in self.left_out:
            return []
        if not part.system:
            return self.names
        members = {name: member_of(self.settings.library.system_path(name)) for name in self.names}
        named = [name for name, member in members.items() if part.system in (name, member and member[0].stem)]
        return [part.system] if named else []

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
