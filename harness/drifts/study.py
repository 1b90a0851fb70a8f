"""A drift as a study for worker processes: what both sides hold, all motions of the plan, and the shares."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any, Generic, TypeVar

from harness.comparison.robot_library import RobotLibrary
from harness.drifts.lines import Told, differences_of
from harness.drifts.log import MeasuredSettings
from harness.drifts.measured import ExplainedLog, explained_log
from harness.drifts.plan import DriftSettings, HeldSides, MovingSide, Plan, aligned, chunks, plan_of, told_places
from harness.drifts.shares import Track, drift_of
from harness.drifts.stepped import stepped, without_what_is_not_applied
from harness.engines import Engine, NotOffered, installed_version, load_engine
from harness.engines.moving import HeldNumbers, MotionsRequest, Moved, SimulatedFile
from harness.engines.request import Refused
from harness.environments import split_name
from harness.errors import InvalidRequest, not_installed
from harness.explain.changes import Change
from harness.results.cause import DriftCause
from harness.results.comparison import names_apart
from harness.results.drift import DriftRecord, Drifts, DriftSide
from harness.results.measured import MeasuredRecord
from harness.study import Inquiry, Part, Study, ask, call
from harness.workers import Task

# Motions of a task: a request to another process costs what a step does.
_OF_A_TASK = 64
_Settings = TypeVar("_Settings")


class _DriftOfOne(Study, Generic[_Settings]):
    """A drift as one inquiry."""

    def __init__(self, settings: _Settings) -> None:
        super().__init__(Drifts())
        self.settings: _Settings = settings

    def inquiries(self) -> Iterator[Iterable[Inquiry[None]]]:
        yield [self._drift()]

    @abstractmethod
    def _drift(self) -> Inquiry[None]:
        """Find the drift."""


class DriftStudy(_DriftOfOne[DriftSettings]):
    """The gap between two motions, and what it is due to."""

    title, steps = "drift", 3

    def _drift(self) -> Inquiry[None]:
        prepared = yield from ask(call, prepare, self.settings)
        if self.fails(prepared):
            return
        made: PreparedDrift = prepared.value
        yield Part("what both sides hold", Drifts())
        outcomes = yield [Task(None, call, (moved, engine, request)) for engine, request in made.requests(_OF_A_TASK)]
        # Each is told once, whatever the number of tasks that it stopped.
        failed = [self.fails(outcome) for outcome in outcomes]
        if any(failed):
            return
        yield Part("motions", Drifts())
        yield self.kept("shares", Drifts(drifts=[made.drift([outcome.value for outcome in outcomes])]))


class MeasuredStudy(_DriftOfOne[MeasuredSettings]):
    """A measured log, and the numbers of a model that would explain it."""

    title, steps = "drift from a log", 1

    def _drift(self) -> Inquiry[None]:
        found = yield from ask(call, measured_from, self.settings)
        if not self.fails(found):
            yield self.kept("numbers", Drifts(measured=[found.value]))


def drift_here(settings: DriftSettings) -> DriftRecord:
    """The same in this process, for a control that is a function.

    Raises:
        InvalidRequest: as ``prepare``.
    """
    made = prepare(settings, here=True)
    return made.drift([moved(engine, request, here=True) for engine, request in made.requests(_OF_A_TASK)])


@dataclass(frozen=True, eq=False)
class PreparedDrift:
    """A drift before its motions are computed."""

    settings: DriftSettings
    held: HeldSides
    plan: Plan
    versions: tuple[str, str]

    @cached_property
    def _told(self) -> dict[DriftCause, list[Told]]:
        return differences_of(self.settings.sides, self.held, self.plan)

    @property
    def changes(self) -> dict[DriftCause, list[Change]]:
        """The changes of the second side's files to what those of the first say, by cause; none where no attribute alone says it."""
        found = {cause: [change for _, change in told if change is not None] for cause, told in self._told.items()}
        return {cause: own for cause, own in found.items() if own}

    def requests(self, most: int) -> list[tuple[str, MotionsRequest]]:
        """The engines with what each is asked for; the first motion is that of the first side."""
        (first, second), plan = self.settings.sides, self.plan
        asked: tuple[tuple[str, Sequence[SimulatedFile]], ...] = (
            (first.engine, [*plan.motions.values(), *plan.rounded[0]]),
            (second.engine, [plan.own, *plan.rounded[1]]),
        )
        return [(engine, replace(plan.request, motions=part)) for engine, motions in asked for part in chunks(motions, most)]

    def drift(self, answers: Sequence[Moved]) -> DriftRecord:
        """The record, of the answers to ``requests``."""
        plan = self.plan
        tracks: list[Track] = [(q, v) for answer in answers for q, v in zip(answer.q, answer.v, strict=True)]
        count, rounded = len(plan.motions), len(plan.rounded[0])
        return drift_of(
            plan,
            dict(zip(plan.motions, tracks, strict=False)),
            tracks[count + rounded],
            (tracks[count : count + rounded], tracks[count + rounded + 1 :]),
            answers[0].mass,
            (self._sides(), {cause: [one for one, _ in told] for cause, told in self._told.items()}, told_places(plan.times)),
        )

    def _sides(self) -> tuple[DriftSide, DriftSide]:
        found = []
        for side, held, label, version in zip(
            self.settings.sides, (self.held.first, self.held.second), _labels(self.settings.sides), self.versions, strict=True
        ):
            timing = side.timing(held.length)
            made = DriftSide(
                path=str(side.path),
                label=label,
                engine=side.engine,
                version=version,
                integrator=held.integrator,
                length=held.length,
                period=timing.period,
                delay=timing.delay,
                note=held.note,
            )
            found.append(made)
        return found[0], found[1]


def _labels(sides: tuple[MovingSide, MovingSide]) -> list[str]:
    """Labels that tell the sides apart: their files, of one file their engines, and of one engine the names of the command's arguments."""
    if sides[0].path != sides[1].path:
        return list(names_apart([str(side.path) for side in sides]).values())
    engines = [side.engine for side in sides]
    return engines if engines[0] != engines[1] else ["A", "B"]


# Tasks for worker processes.


def prepare(settings: DriftSettings, here: bool = False) -> PreparedDrift:
    """Both sides as their engines hold them, and the plan of motions; ``here``: the engine is called in this process.

    Raises:
        InvalidInput: a file cannot be read. InvalidRequest: an engine is not installed or refuses a file, or as ``plan_of``.
    """
    first, second = settings.sides
    engines = [_engine(side.engine, here) for side in settings.sides]
    try:
        own = _held(engines[0], first)
    except NotOffered as refusal:
        turned = "name it second, beside mujoco as the first"
        raise InvalidRequest(f"{first.engine} moves no first side, whose numbers are exchanged; {turned}") from refusal
    try:
        its_own = _held(engines[1], second)
        other = its_own if second.engine == first.engine else _held(engines[0], second)
    except NotOffered:
        # The first engine holds what the second one, which exchanges no numbers, applies of it.
        other = _held(engines[0], second)
        its_own = _refusing(second, without_what_is_not_applied, engines[1], second, other)
        second = replace(second, length=other.length)
        settings = replace(settings, sides=(first, second))
    held = HeldSides(own, aligned(its_own, own), aligned(other, own))
    versions = [installed_version(engine) or "" for engine in engines]
    return PreparedDrift(settings, held, plan_of(settings, held), (versions[0], versions[1]))


def measured_from(settings: MeasuredSettings, here: bool = False) -> MeasuredRecord:
    """The numbers that would explain a log; raises as ``explained_from``."""
    return explained_from(settings, here).record


def explained_from(settings: MeasuredSettings, here: bool = False) -> ExplainedLog:
    """The same with the changes of the file.

    Raises:
        InvalidInput, InvalidRequest: as ``prepare``, and as ``explained_log``.
    """
    engine = settings.side.engine
    return explained_log(settings, partial(moved, engine, here=here), _held(_engine(engine, here), settings.side))


def moved(engine: str, request: MotionsRequest, here: bool = False) -> Moved:
    """The motions of a request.

    Raises:
        InvalidRequest: the engine refuses a file, or the control is none.
    """
    found = _engine(engine, here)
    try:
        try:
            return found.moved(request)
        except NotOffered:
            return stepped(found, request)
    except (Refused, ValueError) as refusal:
        raise InvalidRequest(f"{engine}: {refusal}") from refusal


def _engine(name: str, here: bool) -> Engine:
    if here and split_name(name)[1]:
        raise InvalidRequest(f"a control that is a function is for engines beside the harness, and {name} is not; give a table instead")
    found = load_engine(replace(RobotLibrary.without_files(), calls_engines_here=here), name)
    if installed_version(found) is None:
        raise InvalidRequest(f"{not_installed(found.requires[1])}; harness engines add {name}")
    return found


def _held(engine: Engine, side: MovingSide) -> HeldNumbers:
    """Raises NotOffered of an engine that exchanges no numbers, and InvalidRequest where it refuses the file."""
    held: HeldNumbers = _refusing(side, engine.held_numbers, side.file)
    return held


def _refusing(side: MovingSide, function: Callable[..., Any], *arguments: Any) -> Any:
    try:
        return function(*arguments)
    except (Refused, ValueError) as refusal:
        raise InvalidRequest(f"{side.engine} does not move {side.path}: {refusal}") from refusal
