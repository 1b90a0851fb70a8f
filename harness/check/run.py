"""The loop: (system, subject, states) to records, on worker processes.

``CrossCheck.records()`` yields each record as soon as it is complete; whatever goes wrong with one
system, model or engine costs the records that depend on it and nothing else.
"""

from __future__ import annotations

import json
import shlex
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from harness.certify.compare import compare
from harness.certify.reference import Reference
from harness.certify.sampling import sample
from harness.check import tasks
from harness.check.description import describe_system
from harness.check.expected import Expectation, load_expectations, why_no_model
from harness.check.judgement import Answers, judge
from harness.check.settings import DEFAULT_STATES, Settings
from harness.check.stored_states import stored_states
from harness.engines import (
    EQUATIONS,
    Subject,
    Unsupported,
    installed_version,
    is_native,
    linear_velocity_in_body,
    load_engine,
    select_subjects,
    subjects,
)
from harness.equations.mechanism import Mechanism
from harness.equations.states import States
from harness.errors import InvalidInput, InvalidModel, InvalidRequest
from harness.models.model_file import ModelFile
from harness.results.records import Record, SystemCard
from harness.results.superfluous import SuperfluousPart
from harness.verdict import Verdict
from harness.workers import Outcome, Task, Workers

STATES_PER_TASK = 20_000
STATES_REPLAYED_AFTER_CRASH = 2000


@dataclass
class _Pair:
    """A (system, subject) while its answers come in."""

    subject: Subject
    answers: dict[int, Any] = field(default_factory=dict)
    found: tasks.Found | None = None
    seconds: list[float] = field(default_factory=list)
    failure: str = ""
    failed_at: dict[str, list[float]] | None = None
    unsupported: bool = False
    pending: int = 0


@dataclass
class _System:
    """A system while its references come in."""

    mechanism: Mechanism
    bulk: list[States]
    frames: set[bool]
    references: dict[tuple[bool, int], Reference] = field(default_factory=dict)
    seconds: list[float] = field(default_factory=list)
    compilation_seconds: float | None = None
    failure: str = ""
    pairs: dict[Subject, _Pair] = field(default_factory=dict)


class CrossCheck:
    """One cross-check of a library, system by system and subject by subject.

    Attributes:
        problems: systems, models and engines that could not be used, in the order found.
        crashes: (system, what of it died or ran out of time): a subject, the format of a model, or None for the system itself.
        superfluous: parts of models that their scenes do not need; those of a pair are there before its record.
        cards: what to show of each system, complete when ``records()`` is exhausted.
        expected_records: how many records ``records()`` will yield.

    Raises:
        InvalidInput: the library or its expected verdicts cannot be used at all.
        InvalidRequest: a system or subject that does not exist.
    """

    def __init__(self, settings: Settings, workers: Workers) -> None:
        self.settings = settings
        self.workers = workers
        self.names = settings.library.select(settings.names)
        self.subjects = select_subjects(settings.library, settings.subjects)
        every_subject = [str(subject) for subject in subjects(settings.library)]
        self.expectations = load_expectations(settings.library, every_subject)
        if settings.stand_ins and len(self.names) != 1:
            raise InvalidRequest("--mjcf and --urdf stand in for one system's models; name exactly one system")
        if settings.state is not None and len(self.names) != 1:
            raise InvalidRequest("--state belongs to one system; name exactly one system")
        self.problems: list[InvalidInput] = []
        if not settings.names:
            self.problems += [
                InvalidModel(path, None, f"has no system; expected systems/{path.stem}.py beside it")
                for path in settings.library.orphaned_models()
            ]
        self.crashes: set[tuple[str, str | None]] = set()
        self.superfluous: list[SuperfluousPart] = []
        self.cards: list[SystemCard] = []

    @property
    def expected_records(self) -> int:
        return len(self.names) * len(self.subjects)

    def records(self) -> Iterator[Record]:
        """Every record once, as it is completed."""
        mechanisms: dict[str, Mechanism] = {}
        models: dict[tuple[str, str], ModelFile | str] = {}
        paths = {
            (name, subject.format): self._model_path(name, subject.format)
            for name in self.names
            for subject in self.subjects
            if subject.format != EQUATIONS and not self._why_no_model(name, subject)
        }
        work = [Task((name, None), tasks.derive, (self.settings.library, name)) for name in self.names]
        work += [Task(key, tasks.read, (path, key[1])) for key, path in paths.items()]
        for outcome in self.workers.run(work):
            name, model_format = outcome.task.key
            failure = self._failure_of(outcome)
            if outcome.crash is not None:
                path = self.settings.library.system_path(name) if model_format is None else paths[name, model_format]
                self.problems.append(InvalidInput(path, None, failure))
            if model_format is not None:
                models[name, model_format] = failure or outcome.value
            elif failure:
                for subject in self.subjects:
                    yield self._told(Answers(failure=failure), name, subject)
            else:
                mechanisms[name] = outcome.value
        yield from self._compare({name: mechanisms[name] for name in self.names if name in mechanisms}, models)

    def _model_path(self, name: str, model_format: str) -> Path:
        return self.settings.stand_ins.get(model_format) or self.settings.library.model_path(name, model_format)

    def _why_no_model(self, name: str, subject: Subject) -> str:
        """The reason of the entry that excuses a missing model; a stand-in is a model."""
        if subject.format in self.settings.stand_ins:
            return ""
        return why_no_model(self.settings.library, name, str(subject), subject.format, self.expectations)

    def _compare(self, mechanisms: Mapping[str, Mechanism], models: Mapping[tuple[str, str], ModelFile | str]) -> Iterator[Record]:
        systems: dict[str, _System] = {}
        work: list[Task] = []
        for name, mechanism in mechanisms.items():
            state = self.settings.state
            if state is not None and (state.q.shape[1], state.v.shape[1]) != (mechanism.nq, mechanism.nv):
                given = f"{state.q.shape[1]} numbers for q and {state.v.shape[1]} for v and tau"
                raise InvalidRequest(f"--state has {given}; {name} has {mechanism.nq} and {mechanism.nv} degrees of freedom")
            frames = {self._in_body(mechanism, subject) for subject in self.subjects}
            try:
                bulk = self._bulk(mechanism)
            except InvalidInput as error:
                self.problems.append(error)
                for subject in self.subjects:
                    yield self._told(Answers(failure=str(error)), name, subject)
                continue
            system = systems[name] = _System(mechanism, bulk, frames)
            for in_body in sorted(frames):
                work += [
                    Task((name, None, (in_body, index)), tasks.certify, (mechanism, in_body, states))
                    for index, states in enumerate(system.bulk)
                ]
        for name, system in systems.items():
            for subject in self.subjects:
                pair = system.pairs[subject] = _Pair(subject)
                engine = load_engine(self.settings.library, subject.engine)
                model = models.get((name, subject.format))
                if reason := self._why_no_model(name, subject):
                    pair.unsupported, pair.failure = True, reason
                elif isinstance(model, str):
                    pair.failure = model
                elif installed_version(engine) is None:
                    pair.unsupported, pair.failure = True, f"{engine.requires[1]} is not installed"
                else:
                    work += self._tasks(name, pair, system, model)
        for name, system in systems.items():
            yield from self._completed(name, system)
        for outcome in self._outcomes(work):
            name, subject, index = outcome.task.key
            system = systems[name]
            if subject is None:
                self._take_reference(system, index, outcome)
            elif outcome.task.function is tasks.find_superfluous:
                self._take_superfluous(system.pairs[subject], outcome)
            else:
                self._take_answer(system.pairs[subject], index, outcome)
            yield from self._completed(name, system)
        self.cards += [describe_system(system.mechanism, system.seconds, system.compilation_seconds) for system in systems.values()]

    def _in_body(self, mechanism: Mechanism, subject: Subject) -> bool:
        """Whether a subject's answers need the reference with linear velocities in the body's frame."""
        return bool(mechanism.charts_in_body) and linear_velocity_in_body(load_engine(self.settings.library, subject.engine))

    def _bulk(self, mechanism: Mechanism) -> list[States]:
        if self.settings.state is not None:
            return [self.settings.state]
        states = sample(mechanism, self.settings.states - self.settings.searched, self.settings.seed)
        found = stored_states(self.settings.library, mechanism)
        states = states if found is None else States.concatenate([found, states])
        return [states[start : start + STATES_PER_TASK] for start in range(0, len(states), STATES_PER_TASK)]

    def _tasks(self, name: str, pair: _Pair, system: _System, model: ModelFile | None) -> list[Task]:
        assignment = tasks.Assignment(self.settings.library, pair.subject, system.mechanism, model)
        work = [Task((name, pair.subject, index), tasks.accelerate, (assignment, states)) for index, states in enumerate(system.bulk)]
        if self.settings.searched:
            examples = self.settings.examples and (
                self.settings.examples.absolute() / self.settings.library.name / name / str(pair.subject).replace("/", "-")
            )
            work.append(Task((name, pair.subject, None), tasks.search, (assignment, self.settings.searched, self.settings.seed, examples)))
        # The replay of one state is about that state alone, and what a file needs is what its native engine feels.
        if model is not None and self.settings.state is None and is_native(self.settings.library, pair.subject):
            work.append(Task((name, pair.subject, None), tasks.find_superfluous, (assignment,)))
        pair.pending = len(work)
        return work

    def _outcomes(self, work: list[Task]) -> Iterator[Outcome]:
        """Outcomes of ``work``; a crash at a batch of states is told after a replay has found the state."""
        crashes: list[Outcome] = []
        for outcome in self.workers.run(work):
            if outcome.crash is not None and outcome.task.function is tasks.accelerate:
                crashes.append(outcome)
            else:
                yield outcome
        replays = [Task(crash, tasks.accelerate_one_by_one, crash.task.arguments) for crash in crashes]
        for replay in self.workers.run(replays):
            crash = replay.task.key.crash
            yield Outcome(replay.task.key.task, crash=replace(crash, note=replay.crash.note if replay.crash else ""))

    def _take_reference(self, system: _System, place: tuple[bool, int], outcome: Outcome) -> None:
        failure = self._failure_of(outcome)
        if failure:
            system.failure = f"the reference failed: {failure}"
        else:
            system.references[place], seconds, compilation_seconds = outcome.value
            system.seconds.append(seconds)
            system.compilation_seconds = max(system.compilation_seconds or 0.0, compilation_seconds)

    def _take_answer(self, pair: _Pair, index: int | None, outcome: Outcome) -> None:
        pair.pending -= 1
        failure = self._failure_of(outcome)
        if failure:
            pair.failure = failure
            pair.unsupported = isinstance(outcome.exception, Unsupported)
            if outcome.crash is not None and outcome.crash.note:
                pair.failed_at = json.loads(outcome.crash.note)
        elif index is None:
            pair.found = outcome.value
        else:
            pair.answers[index], seconds = outcome.value
            pair.seconds.append(seconds)

    def _take_superfluous(self, pair: _Pair, outcome: Outcome) -> None:
        pair.pending -= 1
        failure = self._failure_of(outcome)
        if failure:
            # What is wrong with the model as it is, the pair's own answers tell.
            pair.failure = pair.failure or f"looking for superfluous parts failed: {failure}"
        else:
            # Engines that read the same file find the same parts.
            self.superfluous += [finding for finding in outcome.value if finding not in self.superfluous]

    def _failure_of(self, outcome: Outcome) -> str:
        """Why a task gave no value, "" if it did; what the caller must fix is added to ``problems``."""
        if outcome.crash is not None:
            name, what, *_ = outcome.task.key
            self.crashes.add((name, None if what is None else str(what)))
            return str(outcome.crash)
        if isinstance(outcome.exception, InvalidInput):
            if str(outcome.exception) not in map(str, self.problems):
                self.problems.append(outcome.exception)
            return str(outcome.exception)
        if isinstance(outcome.exception, Unsupported):
            return str(outcome.exception)
        return f"{type(outcome.exception).__name__}: {outcome.exception}" if outcome.exception is not None else ""

    def _completed(self, name: str, system: _System) -> Iterator[Record]:
        """Records of the pairs that have all they wait for, and forget them."""
        if len(system.references) < len(system.bulk) * len(system.frames) and not system.failure:
            return
        for pair in [pair for pair in system.pairs.values() if not pair.pending]:
            del system.pairs[pair.subject]
            yield self._record(name, system, pair)

    def _record(self, name: str, system: _System, pair: _Pair) -> Record:
        in_body = self._in_body(system.mechanism, pair.subject)
        bulk = [(index, answers) for index, answers in sorted(pair.answers.items()) if (in_body, index) in system.references]
        parts = [(system.bulk[index], compare(system.references[in_body, index], answers)) for index, answers in bulk]
        answers = Answers(parts, pair.found, pair.seconds, pair.failure or system.failure, pair.unsupported, pair.failed_at)
        return self._told(answers, name, pair.subject)

    def _told(self, answers: Answers, name: str, subject: Subject) -> Record:
        """The record of a pair, with what was expected of it and how to see it again."""
        expectation = self.expectations.get((name, str(subject)), Expectation())
        record = judge(name, str(subject), answers, expectation)
        few = self.settings.state is not None or self.settings.states < DEFAULT_STATES
        if few and record.verdict == Verdict.AGREES and expectation.verdict != Verdict.UNSUPPORTED:
            # So few states need not meet the one that the expectation is about.
            record = judge(name, str(subject), answers, Expectation())
        command = ["harness", "check", name, "--subject", str(subject), *self.settings.replay_options]
        if record.worst_state is not None:
            command += ["--state", json.dumps(record.worst_state)]
        else:
            command += ["--states", str(self.settings.states), "--seed", str(self.settings.seed)]
        return replace(record, replay=shlex.join(command))
