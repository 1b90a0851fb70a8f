"""The cross-check: every subject of every system at the same states as the truth.

Of each system first the equations and the model files are loaded; then one batch of states is certified and every subject
asked there; then come the other batches, the search by hypothesis, and the superfluous parts of the models. All of it runs
on worker processes. Whatever goes wrong with one system, model or engine costs the records that depend on it and nothing
else: where a process dies, the subject that was being asked is set aside, and the others are asked again without it.
"""

from __future__ import annotations

import json
import math
import shlex
from collections.abc import Iterator, Sequence
from dataclasses import replace

from msgspec import structs

from harness.crosscheck import hypothesis_search, tasks
from harness.crosscheck.description import asked_features, describe_system
from harness.crosscheck.expected import AGREES, Expectations
from harness.crosscheck.explanation import explain
from harness.crosscheck.judgement import LARGEST, judge
from harness.crosscheck.loading import Loading
from harness.crosscheck.progress import Pair, Pairs, System, answering
from harness.crosscheck.settings import DEFAULT_STATES, Settings
from harness.crosscheck.stages import Answers, ask_one_by_one, compare_all
from harness.crosscheck.static_audit import find_differences, judge_differences
from harness.engines import EQUATIONS, engine_files, is_native
from harness.equations.mechanism import Mechanism
from harness.equations.states import States
from harness.errors import InvalidInput, InvalidRequest
from harness.library import Library
from harness.results.cross_check import CrossCheckResult
from harness.results.hard_states import replay_command
from harness.results.records import Record, SystemCard
from harness.study import Part, is_out_of_memory
from harness.verdict import AGREEMENT, Verdict
from harness.workers import Outcome


class CrossCheck(Loading):
    """One cross-check of a library, system by system and subject by subject; a ``harness.study.Study``.

    A variant of models is compared as a system of its own, whose mechanism and states are those of the system it is named after.

    Raises as ``Loading``.
    """

    title = "cross-check"

    def __init__(self, settings: Settings) -> None:
        self._found = CrossCheckResult()
        super().__init__(settings)

    def result(self) -> CrossCheckResult:
        return self._found

    # Comparing: a batch of states is certified once, and every subject is asked there. Each batch asks for the next one, so that
    # of a long sample one batch is held at a time.

    def _compare(self, system: System, states: States, pairs: Pairs) -> None:
        self._ask(self._compared, system, pairs, compare_all, [pair.assignment for pair in pairs], states, about=states)

    def _compared(self, outcome: Outcome, system: System, pairs: Pairs, states: States) -> None:
        if not self._is_answered(outcome, system, pairs, "the reference", states):
            self._compare(system, states, answering(pairs))
            return
        seconds, compilation_seconds, answers = outcome.value
        for pair in pairs:
            self._take(pair, answers[pair.key], states)
        if not system.seconds:
            self._go_on(system)
        system.seconds.append(seconds)
        system.compilation_seconds = max(system.compilation_seconds or 0.0, compilation_seconds)
        following = next(system.batches, None)
        if following is not None:
            self._compare(system, following, answering(pairs))

    def _take(self, pair: Pair, answers: Answers, states: States | None = None) -> None:
        if answers.problem is not None:
            self.report(answers.problem)
        if answers.failure:
            pair.fail(answers.failure, answers.unsupported, refused=answers.problem is not None)
        if answers.remark and f"{answers.remark}." not in pair.remarks:
            pair.remarks.append(f"{answers.remark}.")
        if answers.comparison is not None and states is not None:
            # What is stored stands before the sample, in the first batch.
            pair.add(states, answers.comparison, slice(0 if pair.counts else pair.stored, None))
            pair.seconds += answers.seconds
            pair.from_rigid += [answers.from_rigid] if len(answers.from_rigid) else []

    def _go_on(self, system: System) -> None:
        """After the first batch: everything else, for the subjects that answered."""
        pairs = answering(system.pairs.values())
        self._hold(system, [pair for pair in pairs if pair.subject.format != EQUATIONS])
        if self._searched_of(system):
            for group in self._led_together(pairs):
                self._search(system, group)
        for pair in pairs:
            # The replay of one state is about that state alone, and what a file needs is what its native engine feels.
            # Other versions of it may feel less, and tell nothing of the file.
            is_sought = not self.settings.library.is_of_robots and self.settings.state is None and pair.subject.format != EQUATIONS
            is_elsewhere = engine_files(self.settings.library)[pair.subject.engine].elsewhere
            if is_sought and is_native(self.settings.library, pair.subject) and not is_elsewhere:
                self._ask(self._examined, system, [pair], tasks.find_superfluous, pair.assignment)

    # Holding: what engines hold after loading, which their accelerations need not feel.

    def _hold(self, system: System, readers: Pairs) -> None:
        # What other versions read otherwise, and optional engines, is told by ``harness upgrade`` and by their answers.
        readers = [pair for pair in readers if not engine_files(self.settings.library)[pair.subject.engine].elsewhere]
        # The replay of one state is about that state alone.
        if self.settings.state is None and len(readers) > 1:
            self._ask(self._held, system, readers, find_differences, [pair.assignment for pair in readers])

    def _held(self, outcome: Outcome, system: System, pairs: Pairs, about: None) -> None:
        if self._is_answered(outcome, system, pairs, "the static audit"):
            complete = not self.settings.subjects and not self.settings.stand_ins
            expected = self.expected_differences.get(system.name, [])
            self._found.differs += judge_differences(outcome.value, system.name, expected, complete)
        else:
            self._hold(system, answering(pairs))

    # Searching: hypothesis looks for the state at which each subject does worst.

    def _led_together(self, pairs: Pairs) -> list[Pairs]:
        """The subjects of each search: those beside the harness together, and each that has an environment alone.

        A search goes on where any of its subjects does badly. So the environments of a machine change no states of the others.
        """
        files = engine_files(self.settings.library)
        apart = [pair for pair in pairs if files[pair.subject.engine].elsewhere]
        beside = [pair for pair in pairs if not files[pair.subject.engine].elsewhere]
        return [*([beside] if beside else []), *([pair] for pair in apart)]

    def _search(self, system: System, pairs: Pairs) -> None:
        library = self.settings.library
        folder = self.settings.examples and self.settings.examples.absolute() / library.name / library.label(system.name)
        assignments = [pair.assignment for pair in pairs]
        self._ask(
            self._searched, system, pairs, hypothesis_search.search, assignments, self._searched_of(system), self.settings.seed, folder
        )

    def _searched(self, outcome: Outcome, system: System, pairs: Pairs, about: None) -> None:
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

    def _examined(self, outcome: Outcome, system: System, pairs: Pairs, about: None) -> None:
        [pair] = pairs
        # The subject's answers are judged without it: whatever ends the search costs no verdict, and a death no exit status.
        if failure := str(outcome.crash) if outcome.crash is not None else self.failure(outcome):
            pair.remarks.append(f"The search for superfluous parts was not finished: {failure}.")
        else:
            # A file of the harness holds nothing superfluous; somebody else's may.
            fails = self.settings.library == Library.built_in() and pair.subject.format not in self.settings.stand_ins
            parts = [replace(part, system=system.name, fails=fails) for part in outcome.value]
            # Engines that read the same file find the same parts.
            self._found.superfluous += [part for part in parts if part not in self._found.superfluous]

    # Lost digits: whether they are no such thing.

    def _explained(self, outcome: Outcome, system: System, pairs: Pairs, about: None) -> None:
        [pair] = pairs
        if failure := self.failure(outcome):
            pair.remarks.append(f"Whether one number explains the errors is not known: {failure}.")
        pair.explained = "" if outcome.value is None else outcome.value.sentence

    # Where a process dies: the subject that was being asked is set aside.

    def _is_answered(self, outcome: Outcome, system: System, pairs: Pairs, what: str, states: States | None = None) -> bool:
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

    def _replayed(self, outcome: Outcome, system: System, pairs: Pairs, about: None) -> None:
        if outcome.crash is not None and outcome.crash.note:
            pairs[0].failed_at = json.loads(outcome.crash.note)

    # A side task, which changes no verdict: the componentwise backward error at the worst state that any task has found.

    def _measure(self, system: System, pair: Pair) -> bool:
        """Ask for it where there is an error and it was not asked for; True if it was not."""
        if pair.componentwise is not None or pair.failure or pair.shown is None or math.isnan(pair.shown[1].backward_error[LARGEST]):
            return False
        pair.componentwise = math.nan
        state = pair.shown[0][[LARGEST]]
        beyond = 0.0 if self.settings.componentwise else AGREEMENT
        self._ask(self._measured, system, [pair], tasks.measure_componentwise, pair.assignment, state, beyond)
        return True

    def _measured(self, outcome: Outcome, system: System, pairs: Pairs, about: None) -> None:
        if outcome.value is not None:
            pairs[0].componentwise = outcome.value

    # Records.

    def _completed(self, system: System) -> Iterator[Part]:
        """Records of the pairs that have all they wait for, and forget them; with the last one goes the system."""
        for pair in [pair for pair in system.pairs.values() if not pair.pending]:
            if pair.verdict == Verdict.UNSTABLE and pair.explained is None:
                self._ask(self._explained, system, [pair], explain, pair.assignment, self.settings.seed)
                continue
            if self._measure(system, pair):
                continue
            del system.pairs[pair.key]
            record = replace(self._record(system.name, pair), features=asked_features(system, pair))
            self._found.records.append(record)
            yield Part(f"{record.system} {record.subject}", CrossCheckResult(records=[record]))
        if not system.pairs and system.mechanism is not None:
            # What there is to say of a mechanism stands with its system.
            if system.mechanism.name == self.settings.library.label(system.name):
                self._found.systems += self._described(system, system.mechanism)
            system.mechanism = None

    def _described(self, system: System, mechanism: Mechanism) -> list[SystemCard]:
        return [describe_system(mechanism, system.seconds, system.compilation_seconds)]

    def _expectations_of(self, pair: Pair) -> Expectations:
        return self.expectations

    def _replay_options_of(self, pair: Pair) -> Sequence[str]:
        return self.settings.replay_options

    def _record(self, name: str, pair: Pair) -> Record:
        """The record of a pair, with what was expected of it and how to see it again."""
        expectation = self._expectations_of(pair).of(self.settings.library.label(name), pair.subject)
        if expectation is AGREES and pair.unsupported and engine_files(self.settings.library)[pair.subject.engine].elsewhere:
            # What an engine beside the harness cannot do is listed, so that a new refusal shows. Others and other versions say why.
            expectation = structs.replace(AGREES, verdict=Verdict.UNSUPPORTED.value, reason=pair.failure)
        record = judge(name, str(pair.subject), pair, expectation)
        few = self.settings.state is not None or self.settings.states < DEFAULT_STATES
        if few and record.verdict == Verdict.AGREES and expectation.verdict != Verdict.UNSUPPORTED:
            # So few states need not meet the one that the expectation is about.
            record = judge(name, str(pair.subject), pair, AGREES)

        options = self._replay_options_of(pair)

        def replay(state: dict[str, list[float]]) -> str:
            return replay_command(name, record.subject, state, options)

        if record.worst_state is not None:
            again = replay(record.worst_state)
        else:
            command = ["harness", "check", name, "--subject", record.subject, *options]
            again = shlex.join([*command, "--states", str(self.settings.states), "--seed", str(self.settings.seed)])
        shown = record.representative and replace(record.representative, replay=replay(record.representative.state))
        origins = record.origins if self.settings.state is None else {}
        componentwise = None if pair.componentwise is None or math.isnan(pair.componentwise) else pair.componentwise
        return replace(record, replay=again, representative=shown, origins=origins, componentwise_error=componentwise)
