"""The loop of an atlas: one task per family and subject, and per motion, so that a crash costs that part alone."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from harness.engines import Subject, installed_version, load_engine, select_subjects
from harness.errors import InvalidRequest
from harness.hard.atlas import expectations, rows
from harness.hard.cases import hard_cases
from harness.hard.motions import OSCILLATOR, STABILITY_LIMITS, hard_motions, partings, stable_steps
from harness.library import Library, nearest
from harness.results.atlas import Atlas
from harness.workers import Outcome, Task, Workers


@dataclass(frozen=True, kw_only=True)
class AtlasSettings:
    """What to measure.

    Attributes:
        library: whose engines are meant; the cases are the harness's own.
        cases: names; all for none.
        subjects: as text; for none every native one whose engine is installed, as the cases try engines, not readers.
        motion: whether partings and stable steps are measured too.
    """

    library: Library
    cases: Sequence[str] = ()
    subjects: Sequence[str] = ()
    motion: bool = False


class AtlasRun:
    """One run along the hard cases.

    Attributes:
        cases, subjects: what is measured.
        crashed: whether an engine's process died or ran out of time.

    Raises:
        InvalidInput: an engine or the file of expected verdicts cannot be used.
        InvalidRequest: a case or subject that does not exist, or one by name whose engine is not installed.
    """

    def __init__(self, settings: AtlasSettings) -> None:
        self.settings = settings
        self.crashed = False
        for name in settings.cases:
            if name not in hard_cases():
                raise InvalidRequest(f"no hard case is called {name!r}; {nearest(name, hard_cases())}")
        self.cases = list(dict.fromkeys(settings.cases)) or list(hard_cases())
        self.subjects: list[Subject] = []
        for subject in select_subjects(settings.library, settings.subjects, native_only=True):
            engine = load_engine(settings.library, subject.engine)
            if installed_version(engine) is not None:
                self.subjects.append(subject)
            elif settings.subjects:
                raise InvalidRequest(f"{subject} cannot be measured: {engine.requires[1]} is not installed")
        if not self.subjects:
            raise InvalidRequest("no engine is installed")
        self._expected = expectations(settings.library)

    @property
    def expected_parts(self) -> int:
        """How many parts ``parts()`` yields."""
        return len(self.cases) * len(self.subjects) + len(self._motions())

    def parts(self, workers: Workers) -> Iterator[tuple[str, Atlas]]:
        """(what it is, what was measured) of each part as soon as it is done, on workers whose context the caller has entered."""
        for row in rows(self.cases, self.subjects, self.settings.library, workers, self._expected):
            self.crashed = self.crashed or row.crashed
            yield f"{row.case} {row.subject}", Atlas(rows=[row])
        for outcome in workers.run(self._motions()):
            part, name = outcome.task.key
            yield name, self._failure(outcome) or Atlas(**{part: outcome.value})

    def _motions(self) -> list[Task]:
        if not self.settings.motion:
            return []
        values = hard_cases()[OSCILLATOR].values
        tasks = [Task(("partings", name), partings, (name, self.settings.library)) for name in hard_motions()]
        return tasks + [Task(("stable_steps", name), stable_steps, (name, values)) for name in STABILITY_LIMITS]

    def _failure(self, outcome: Outcome) -> Atlas | None:
        _, name = outcome.task.key
        if outcome.crash is not None:
            self.crashed = True
            noted = f" ({outcome.crash.note})" if outcome.crash.note else ""
            return Atlas(problems=[f"{name}{noted}: {outcome.crash}"])
        if outcome.exception is not None:
            return Atlas(problems=[f"{name}: {type(outcome.exception).__name__}: {outcome.exception}"])
        return None
