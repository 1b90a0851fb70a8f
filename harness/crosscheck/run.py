"""The cross-check: every subject of every system at the same states as the truth.

Of each system first the equations and the model files are loaded; then one batch of states is certified and every subject
asked there; then come the other batches, the search by hypothesis, and the superfluous parts of the models. All of it runs
on worker processes. Whatever goes wrong with one system, model or engine costs the records that depend on it and nothing
else: where a process dies, the subject that was being asked is set aside, and the others are asked again without it.
"""

from __future__ import annotations

import itertools
import json
import shlex
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from harness.certify.sampling import sample_in_blocks
from harness.crosscheck import hypothesis_search, tasks
from harness.crosscheck.description import describe_system
from harness.crosscheck.expected import AGREES, load_expectations, why_no_model
from harness.crosscheck.judgement import Evidence, judge
from harness.crosscheck.settings import DEFAULT_STATES, Settings, stored_states
from harness.crosscheck.stages import Answers, ask_one_by_one, compare_all
from harness.crosscheck.tasks import Assignment
from harness.engines import EQUATIONS, Subject, engine_files, is_native, select_subjects
from harness.equations.mechanism import Mechanism
from harness.equations.states import States
from harness.errors import InvalidInput, InvalidModel, InvalidRequest
from harness.library import Library
from harness.models.model_file import ModelFile
from harness.results.cross_check import CrossCheckResult
from harness.results.hard_states import replay_command
from harness.results.records import Record
from harness.study import Part, Rounds, is_out_of_memory
from harness.verdict import Verdict
from harness.workers import Outcome, Task


@dataclass(kw_only=True)
class _Pair(Evidence):
    """A subject on a system while its answers come in; ``pending`` counts the tasks that are still to answer for it."""

    subject: Subject
    assignment: Assignment | None = None
    pending: int = 0

    def fail(self, failure: str, unsupported: bool = False) -> None:
        """The first failure is the one that is reported."""
        if not self.failure:
            self.failure, self.unsupported = failure, unsupported


Pairs = Sequence[_Pair]


def answering(pairs: Iterable[_Pair]) -> list[_Pair]:
    """The pairs that can be asked and have not failed."""
    return [pair for pair in pairs if pair.assignment is not None and not pair.failure]


@dataclass
class _System:
    """A system while it is compared."""

    name: str
    pairs: dict[str, _Pair]
    mechanism: Mechanism | None = None
    models: dict[str, ModelFile | str] = field(default_factory=dict)
    batches: Iterator[States] = field(default_factory=lambda: iter(()))
    seconds: list[float] = field(default_factory=list)
    compilation_seconds: float | None = None


class CrossCheck(Rounds):
    """One cross-check of a library, system by system and subject by subject; a ``harness.study.Study``.

    Attributes:
        faults: what failed in the harness itself, each with its system.
        crashes: (system, what of it died, ran out of time or cannot be loaded): a subject, the format of a model, or None for the
            system itself.

    Raises:
        InvalidInput: the library or its expected verdicts cannot be used at all; from ``take``, a stand-in cannot.
        InvalidRequest: a system or subject that does not exist.
    """

    title = "cross-check"

    def __init__(self, settings: Settings) -> None:
        super().__init__()
        self.settings = settings
        self.names = settings.library.select(settings.names)
        self.subjects = select_subjects(settings.library, settings.subjects)
        self.expectations = load_expectations(settings.library)
        if settings.stand_ins and len(self.names) != 1:
            raise InvalidRequest("--mjcf and --urdf stand in for one system's models; name exactly one system")
        if settings.state is not None and len(self.names) != 1:
            raise InvalidRequest("--state belongs to one system; name exactly one system")
        if not settings.names:
            for path in settings.library.orphaned_models():
                self.report(InvalidModel(path, None, f"has no system; expected systems/{path.stem}.py beside it"))
        self.faults: list[str] = []
        self.crashes: set[tuple[str, str | None]] = set()
        self._found = CrossCheckResult()
        self._systems = {name: _System(name, {str(subject): _Pair(subject=subject) for subject in self.subjects}) for name in self.names}
        for subject in self.subjects:
            if failure := self.failure(engine_files(settings.library)[subject.engine].outcome):
                for name, system in self._systems.items():
                    system.pairs[str(subject)].fail(failure)
                    self.crashes.add((name, str(subject)))
        for system in self._systems.values():
            self._load(system)

    @property
    def steps(self) -> int:
        return len(self.names) * len(self.subjects)

    def result(self) -> CrossCheckResult:
        return self._found

    # Loading: the equations, and each model file.

    def _load(self, system: _System) -> None:
        library, name, pairs = self.settings.library, system.name, list(system.pairs.values())
        stand_ins = self.settings.stand_ins
        # Before anything that takes long: a file that was named and cannot be used ends the run.
        for model_format, path in stand_ins.items():
            self._ask(self._loaded, system, pairs, tasks.read, path, model_format, about=(model_format, path))
        self._ask(self._loaded, system, pairs, tasks.derive, library, name, about=(None, library.system_path(name)))
        for model_format in dict.fromkeys(subject.format for subject in self.subjects if subject.format not in (EQUATIONS, *stand_ins)):
            if any(subject.format == model_format and not self._why_no_model(name, subject) for subject in self.subjects):
                path = library.model_path(name, model_format)
                self._ask(self._loaded, system, pairs, tasks.read, path, model_format, about=(model_format, path))

    def _loaded(self, outcome: Outcome, system: _System, pairs: Pairs, about: tuple[str | None, Path]) -> None:
        (model_format, path), failure = about, self.failure(outcome)
        if outcome.crash is not None:
            self.crashes.add((system.name, model_format))
        if failure and not isinstance(outcome.exception, InvalidInput):
            # Whatever a file makes the harness do, it is the file that has to be mended.
            self.report(InvalidInput(path, None, failure))
        if failure and model_format in self.settings.stand_ins:
            raise self.problems[-1]
        if model_format is not None:
            system.models[model_format] = failure or outcome.value
        elif failure:
            for pair in pairs:
                pair.fail(failure)
        else:
            system.mechanism = outcome.value
        if system.mechanism is not None and not any(pair.pending for pair in pairs):
            self._begin(system, system.mechanism)

    def _begin(self, system: _System, mechanism: Mechanism) -> None:
        """Choose the states, and ask for the first batch of them."""
        state = self.settings.state
        if state is not None and (state.q.shape[1], state.v.shape[1]) != (mechanism.nq, mechanism.nv):
            given = f"{state.q.shape[1]} numbers for q and {state.v.shape[1]} for v and tau"
            raise InvalidRequest(f"--state has {given}; {mechanism.name} has {mechanism.nq} and {mechanism.nv} degrees of freedom")
        try:
            system.batches = self._states(system, mechanism)
        except InvalidInput as error:
            self.report(error)
            for pair in system.pairs.values():
                pair.fail(str(error))
            return
        for pair in system.pairs.values():
            self._assign(system, mechanism, pair)
        pairs = answering(system.pairs.values())
        stand_ins = [pair.assignment for pair in pairs if pair.subject.format in self.settings.stand_ins]
        if stand_ins:
            self._ask(self._accepted, system, pairs, tasks.accept, stand_ins)
        else:
            self._compare(system, next(system.batches), pairs)

    def _accepted(self, outcome: Outcome, system: _System, pairs: Pairs, about: None) -> None:
        if isinstance(outcome.exception, InvalidInput):
            raise outcome.exception
        # Whatever else an engine does there it does again, and it costs its own record.
        self._compare(system, next(system.batches), pairs)

    def _states(self, system: _System, mechanism: Mechanism) -> Iterator[States]:
        """Batch by batch; what is stored stands before the first block of the sample."""
        if self.settings.state is not None:
            return iter([self.settings.state])
        sampled = sample_in_blocks(mechanism, self.settings.states - self.settings.searched, self.settings.seed)
        stored = stored_states(self.settings.library, mechanism)
        if stored is None:
            return sampled
        for pair in system.pairs.values():
            pair.stored = len(stored)
        return itertools.chain([States.concatenate([stored, next(sampled)])], sampled)

    def _assign(self, system: _System, mechanism: Mechanism, pair: _Pair) -> None:
        """Give a pair what it is asked with, or the reason why it cannot be asked."""
        file = engine_files(self.settings.library)[pair.subject.engine]
        model = system.models.get(pair.subject.format)
        if reason := self._why_no_model(system.name, pair.subject):
            pair.fail(reason, unsupported=True)
        elif isinstance(model, str):
            pair.fail(model)
        elif file.version is None:
            pair.fail(f"{file.requires[1]} is not installed", unsupported=True)
        else:
            pair.assignment = Assignment(self.settings.library, pair.subject, mechanism, model)

    def _why_no_model(self, name: str, subject: Subject) -> str:
        """The reason of the entry that excuses a missing model; a stand-in is a model."""
        if subject.format in self.settings.stand_ins:
            return ""
        return why_no_model(self.settings.library, name, subject, self.expectations)

    # Comparing: a batch of states is certified once, and every subject is asked there. Each batch asks for the next one, so that
    # of a long sample one batch is held at a time.

    def _compare(self, system: _System, states: States, pairs: Pairs) -> None:
        self._ask(self._compared, system, pairs, compare_all, [pair.assignment for pair in pairs], states, about=states)

    def _compared(self, outcome: Outcome, system: _System, pairs: Pairs, states: States) -> None:
        if not self._is_answered(outcome, system, pairs, "the reference", states):
            self._compare(system, states, answering(pairs))
            return
        seconds, compilation_seconds, answers = outcome.value
        for pair in pairs:
            self._take(pair, answers[str(pair.subject)], states)
        if not system.seconds:
            self._go_on(system)
        system.seconds.append(seconds)
        system.compilation_seconds = max(system.compilation_seconds or 0.0, compilation_seconds)
        following = next(system.batches, None)
        if following is not None:
            self._compare(system, following, answering(pairs))

    def _take(self, pair: _Pair, answers: Answers, states: States | None = None) -> None:
        if answers.problem is not None:
            self.report(answers.problem)
        if answers.failure:
            pair.fail(answers.failure, answers.unsupported)
        if answers.comparison is not None and states is not None:
            pair.add(states, answers.comparison)
            pair.seconds += answers.seconds

    def _go_on(self, system: _System) -> None:
        """After the first batch: everything else, for the subjects that answered."""
        pairs = answering(system.pairs.values())
        if self.settings.searched:
            self._search(system, pairs)
        for pair in pairs:
            # The replay of one state is about that state alone, and what a file needs is what its native engine feels.
            if pair.subject.format != EQUATIONS and self.settings.state is None and is_native(self.settings.library, pair.subject):
                self._ask(self._examined, system, [pair], tasks.find_superfluous, pair.assignment)

    # Searching: hypothesis looks for the state at which each subject does worst.

    def _search(self, system: _System, pairs: Pairs) -> None:
        folder = self.settings.examples and self.settings.examples.absolute() / self.settings.library.name / system.name
        assignments = [pair.assignment for pair in pairs]
        self._ask(self._searched, system, pairs, hypothesis_search.search, assignments, self.settings.searched, self.settings.seed, folder)

    def _searched(self, outcome: Outcome, system: _System, pairs: Pairs, about: None) -> None:
        if self._is_answered(outcome, system, pairs, "the search"):
            for pair in pairs:
                found = outcome.value[str(pair.subject)]
                if isinstance(found, Answers):
                    self._take(pair, found)
                else:
                    pair.found = found
                    pair.add(found.states, found.comparison)
        else:
            self._search(system, answering(pairs))

    def _examined(self, outcome: Outcome, system: _System, pairs: Pairs, about: None) -> None:
        [pair] = pairs
        if outcome.crash is not None:
            self.crashes.add((system.name, str(pair.subject)))
        if failure := self.failure(outcome):
            # Errors of the model itself are already in the pair's own answers.
            pair.fail(f"looking for superfluous parts failed: {failure}")
        else:
            # A file of the harness holds nothing superfluous; somebody else's may.
            fails = self.settings.library == Library.built_in() and pair.subject.format not in self.settings.stand_ins
            parts = [replace(part, fails=fails) for part in outcome.value]
            # Engines that read the same file find the same parts.
            self._found.superfluous += [part for part in parts if part not in self._found.superfluous]

    # One task that answers for several pairs.

    def _ask(
        self, taker: Callable[..., None], system: _System, pairs: Pairs, function: Callable[..., Any], *arguments: Any, about: Any = None
    ) -> None:
        """Ask for the next round one task that answers for ``pairs``; ``taker(outcome, system, pairs, about)`` takes its outcome."""
        if pairs:
            for pair in pairs:
                pair.pending += 1
            self._next.append(Task((self._answered, system.name, taker, pairs, about), function, arguments, system.name))

    def _answered(self, outcome: Outcome, name: str, taker: Callable[..., None], pairs: Pairs, about: Any) -> Iterator[Part]:
        for pair in pairs:
            pair.pending -= 1
        taker(outcome, self._systems[name], pairs, about)
        yield from self._completed(self._systems[name])

    # Where a process dies: the subject that was being asked is set aside.

    def _is_answered(self, outcome: Outcome, system: _System, pairs: Pairs, what: str, states: States | None = None) -> bool:
        """True if a task gave a value; where its process died, the culprit and the state it died at are noted."""
        failure = self.failure(outcome)
        if not failure:
            return True
        note = json.loads(outcome.crash.note) if outcome.crash is not None and outcome.crash.note else {}
        culprit = system.pairs.get(note.get("subject", ""))
        if outcome.crash is not None:
            self.crashes.add((system.name, None if culprit is None else str(culprit.subject)))
        if culprit is None:
            if is_out_of_memory(outcome.exception):
                self.report(InvalidRequest(f"{system.name}: {what} failed: {failure}"))
            elif outcome.crash is None and not isinstance(outcome.exception, InvalidInput):
                self.faults.append(f"{system.name}: {what} failed: {failure}")
            for pair in pairs:
                pair.fail(f"{what} failed: {failure}")
            return False
        culprit.fail(failure)
        states = States.at(**note["states"]) if "states" in note else states
        if states is not None and culprit.failed_at is None:
            self._ask(self._replayed, system, [culprit], ask_one_by_one, culprit.assignment, states)
        return False

    def _replayed(self, outcome: Outcome, system: _System, pairs: Pairs, about: None) -> None:
        if outcome.crash is not None and outcome.crash.note:
            pairs[0].failed_at = json.loads(outcome.crash.note)

    # Records.

    def _completed(self, system: _System) -> Iterator[Part]:
        """Records of the pairs that have all they wait for, and forget them; with the last one goes the system."""
        for pair in [pair for pair in system.pairs.values() if not pair.pending]:
            del system.pairs[str(pair.subject)]
            record = self._record(system.name, pair)
            self._found.records.append(record)
            yield Part(f"{record.system} {record.subject}", CrossCheckResult(records=[record]))
        if not system.pairs and system.mechanism is not None:
            self._found.systems.append(describe_system(system.mechanism, system.seconds, system.compilation_seconds))
            system.mechanism = None

    def _record(self, name: str, pair: _Pair) -> Record:
        """The record of a pair, with what was expected of it and how to see it again."""
        expectation = self.expectations.get((name, str(pair.subject)), AGREES)
        record = judge(name, str(pair.subject), pair, expectation)
        few = self.settings.state is not None or self.settings.states < DEFAULT_STATES
        if few and record.verdict == Verdict.AGREES and expectation.verdict != Verdict.UNSUPPORTED:
            # So few states need not meet the one that the expectation is about.
            record = judge(name, str(pair.subject), pair, AGREES)

        def replay(state: dict[str, list[float]]) -> str:
            return replay_command(name, record.subject, state, self.settings.replay_options)

        if record.worst_state is not None:
            again = replay(record.worst_state)
        else:
            command = ["harness", "check", name, "--subject", record.subject, *self.settings.replay_options]
            again = shlex.join([*command, "--states", str(self.settings.states), "--seed", str(self.settings.seed)])
        shown = record.representative and replace(record.representative, replay=replay(record.representative.state))
        origins = record.origins if self.settings.state is None else {}
        return replace(record, replay=again, representative=shown, origins=origins)
