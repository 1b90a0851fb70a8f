"""The benchmark as a study: one task per system and part, so that a crash costs that part alone.

Whatever is timed for comparison runs by itself, one task after the other; the rest shares the processors.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from harness.bench.methods import find_methods
from harness.bench.parts import PARTS, BenchmarkPart, BenchmarkSettings, load
from harness.crosscheck.scene import Scene
from harness.errors import InvalidInput, InvalidRequest
from harness.library import member_of, nearest
from harness.motion.integrators import integrators
from harness.results.benchmark import Benchmark
from harness.study import Part, Rounds
from harness.workers import Outcome, Task


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
        methods, moving = [method.name for method in find_methods()], [integrator.name for integrator in integrators()]
        for name in settings.methods:
            if name not in (*methods, *moving):
                raise InvalidRequest(f"no method or integrator is called {name!r}; {nearest(name, [*methods, *moving])}")
            if name in moving and not settings.motion:
                raise InvalidRequest(f"{name!r} computes motion; ask for it with --motion")
        chosen = settings.methods or [*methods, *(moving if settings.motion else ())]
        # By whether it is motion that they compute.
        self._methods = {False: [name for name in methods if name in chosen], True: [name for name in moving if name in chosen]}
        self._measured = Benchmark()
        self._scenes: dict[str, Scene] = {}

    @property
    def steps(self) -> int:
        return len(self.names) + sum(len(self._places(part)) for part in PARTS)

    def rounds(self) -> Iterator[list[Task]]:
        yield list(self._loading())
        yield list(self._measuring(timed=True))
        yield list(self._measuring(timed=False))

    def result(self) -> Benchmark:
        return self._measured

    def _loading(self) -> Iterator[Task]:
        for name in self.names:
            yield Task((self._loaded, name, "equations and models"), load, (self.settings.library, name))

    def _measuring(self, timed: bool) -> Iterator[Task]:
        for part in PARTS:
            for name in self._places(part) if part.timed == timed else ():
                if name in self._scenes or part.system:
                    given = replace(self.settings, methods=self._methods[part.moving]), self._scenes.get(name)
                    # Two timings at once would take turns on memory and caches, and measure each other.
                    yield Task((self._taken, name, part.name), part.measure, given, affinity="timed" if timed else None)

    def _places(self, part: BenchmarkPart) -> list[str]:
        """Names of what a part is measured on."""
        if not self._methods[part.moving]:
            return []
        if not part.system:
            return self.names
        named = [name for name in self.names if name == part.system or self._family(name) == part.system]
        return [part.system] if named else []

    def _family(self, name: str) -> str | None:
        member = member_of(self.settings.library.system_path(name))
        return member[0].stem if member else None

    def _loaded(self, outcome: Outcome, name: str, what: str) -> Iterator[Part]:
        if isinstance(outcome.value, Scene):
            self._scenes[name] = outcome.value
        yield self._part(f"{name} loaded", self._problem(outcome, name, what) or Benchmark())

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
