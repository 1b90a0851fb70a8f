"""The loop of a benchmark: one task per system and part, so that a crash costs that part alone.

Whatever is timed for comparison runs by itself, one task after the other; the rest shares the processors.
"""

from __future__ import annotations

from collections.abc import Iterator

from harness.bench.methods import find_methods
from harness.bench.parts import PARTS, PROFILES, Part, Request, Settings, load
from harness.check.scene import Scene
from harness.errors import InvalidInput, InvalidRequest
from harness.library import member_of, nearest
from harness.motion.integrators import integrators
from harness.results.benchmark import Benchmark
from harness.workers import Outcome, Task, Workers


class Bench:
    """One benchmark of a library.

    Attributes:
        problems: systems and models that could not be used.
        crashed: whether a process died or ran out of time.

    Raises:
        InvalidInput: the library cannot be used at all.
        InvalidRequest: a system, method or integrator that does not exist, or an integrator without motion.
    """

    def __init__(self, settings: Settings) -> None:
        self.settings = settings
        self.profile = PROFILES[settings.profile]
        self.names = settings.library.select(settings.names)
        methods, moving = [method.name for method in find_methods()], [integrator.name for integrator in integrators()]
        for name in settings.methods:
            if name not in (*methods, *moving):
                raise InvalidRequest(f"no method or integrator is called {name!r}; {nearest(name, [*methods, *moving])}")
            if name in moving and not settings.motion:
                raise InvalidRequest(f"{name!r} computes motion; ask for it with --motion")
        self._methods = [name for name in methods if name in (settings.methods or methods)]
        self._integrators = [name for name in moving if settings.motion and name in (settings.methods or moving)]
        self.problems: list[InvalidInput] = []
        self.crashed = False

    @property
    def expected_parts(self) -> int:
        """How many parts ``parts()`` yields where every system can be loaded."""
        return len(self.names) + sum(len(self._places(part)) for part in PARTS)

    def parts(self, workers: int | None = None) -> Iterator[tuple[str, Benchmark]]:
        """(what it is, what was measured) of each part as soon as it is done; a part that failed holds its problem.

        ``workers`` is the number of processes for what is not timed; one per CPU for None.
        """
        scenes: dict[str, Scene] = {}
        loading = [Task((name, "equations and models"), load, (self.settings.library, name)) for name in self.names]
        for outcome in self._outcomes(loading, workers):
            name, _ = outcome.task.key
            if isinstance(outcome.value, Scene):
                scenes[name] = outcome.value
            yield f"{name} loaded", self._failure(outcome) or Benchmark()
        for timed in (True, False):
            work = [
                Task((name, part.name), part.measure, (Request(
                    settings=self.settings, methods=self._methods, integrators=self._integrators, scene=scenes.get(name)
                ),))
                for part in PARTS if part.timed == timed
                for name in self._places(part) if name in scenes or part.system
            ]  # fmt: skip
            # Two timings at once would take turns on memory and caches, and measure each other.
            for outcome in self._outcomes(work, 1 if timed else workers):
                yield " ".join(outcome.task.key), self._failure(outcome) or outcome.value

    def _places(self, part: Part) -> list[str]:
        """Names of what a part is measured on."""
        if not (self._integrators if part.moving else self._methods):
            return []
        if not part.system:
            return self.names
        named = [name for name in self.names if name == part.system or self._family(name) == part.system]
        return [part.system] if named else []

    def _family(self, name: str) -> str | None:
        member = member_of(self.settings.library.system_path(name))
        return member[0].stem if member else None

    def _outcomes(self, work: list[Task], workers: int | None) -> Iterator[Outcome]:
        if work:
            with Workers(workers, time_limit=self.profile.time_limit) as pool:
                yield from pool.run(work)

    def _failure(self, outcome: Outcome) -> Benchmark | None:
        """What to say of a task that gave nothing; None for one that did."""
        if outcome.crash is None and outcome.exception is None:
            return None
        place = ", ".join(outcome.task.key)
        if outcome.crash is not None:
            self.crashed = True
            noted = f" ({outcome.crash.note})" if outcome.crash.note else ""
            return Benchmark(problems=[f"{place}{noted}: {outcome.crash}"])
        if isinstance(outcome.exception, InvalidInput):
            self.problems.append(outcome.exception)
            # Of a path, only the file stays, because reports are published.
            return Benchmark(problems=[f"{place}: {outcome.exception.path.name}: {outcome.exception.problem}"])
        return Benchmark(problems=[f"{place}: {type(outcome.exception).__name__}: {outcome.exception}"])
