"""The cross-check: every subject of every system at the same states as the truth.

``CrossCheck._compared`` is the whole way of one system: its files are loaded, one batch of states is certified and every subject asked
there; then come what models hold after loading, the search by hypothesis, the superfluous parts of the models, the other batches, and
the records. All of it runs on worker processes. Whatever goes wrong with one system, model or engine costs the records that depend on
it and nothing else: where a process dies, the subject that was being asked is set aside, and the others are asked again without it.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from harness.crosscheck import held_quantities, hypothesis_search
from harness.crosscheck.expected import expectations_by_quantity, load_expected_differences
from harness.crosscheck.held import find_differences, judge_differences
from harness.crosscheck.judgement import LARGEST, Pair, Pairs, SystemProgress, answering, card_of, record_of
from harness.crosscheck.loading import (
    accept,
    assign,
    batches_of,
    chosen_names,
    derive_and_sample,
    led_together,
    library_folder,
    natives_among,
    orphans,
    readers_among,
    why_no_model,
)
from harness.crosscheck.settings import Settings
from harness.crosscheck.side_tasks import ask_one_by_one, measure_componentwise, readings_and_refusal
from harness.crosscheck.stages import (
    NOT_OFFERED,
    Answers,
    compare_all,
)
from harness.crosscheck.superfluous import find_superfluous
from harness.crosscheck.together import TOGETHER
from harness.engines import Subject, asked_of, engine_files, select_subjects
from harness.errors import InvalidInput, InvalidRequest, is_out_of_memory
from harness.files.model_file import read_model
from harness.library import Library
from harness.programs.states import States
from harness.results.cross_check import CrossCheckResult
from harness.results.records import ACCELERATIONS, quantity_words
from harness.study import Inquiry, Study, ask, call
from harness.verdict import AGREEMENT, Verdict
from harness.workers import Outcome, Task


class CrossCheck(Study):
    """One cross-check of a library in one or several quantities, system by system and subject by subject; a ``harness.study.Study``.

    A variant of models is compared as a system of its own, whose mechanism and states are those of the system it is named after.
    ``audits``: whether what engines hold after loading is compared where accelerations are not, with which it always is. ``without``:
    (system, subject) that are not asked.

    Attributes:
        names: of the systems and variants. subjects: those asked for.
        faults: what failed in the harness itself, each with its system.
        crashes: (system, what of it died, ran out of time or cannot be loaded): a subject, the format of a model, or None for the
            system itself.

    Raises:
        InvalidInput: the library or its expected verdicts cannot be used at all; from ``take``, a stand-in cannot.
        InvalidRequest: a system or subject that does not exist.
    """

    def __init__(
        self,
        settings: Settings,
        quantities: Sequence[str] = (ACCELERATIONS,),
        audits: bool = True,
        without: Collection[tuple[str, str]] = (),
    ) -> None:
        super().__init__(CrossCheckResult())
        library = settings.library
        self.settings, self.quantities = settings, tuple(quantities)
        self.title = "cross-check" if self._moves else quantities[0] if len(quantities) == 1 else "further quantities"
        self.faults: list[str] = []
        self.crashes: set[tuple[str, str | None]] = set()
        self.names = chosen_names(settings)
        self.subjects = select_subjects(library, settings.subjects)
        self._expectations = expectations_by_quantity(library, {ACCELERATIONS, *quantities})
        self._expected_differences = load_expected_differences(library, held_quantities.ALL)
        self._audits = settings.state is None and (audits or self._moves)
        if not settings.names:
            for orphan in orphans(library):
                self.report(orphan)
        self._systems = [SystemProgress(name, {pair.key: pair for pair in self._pairs_of(name, without)}) for name in self.names]
        self.steps = sum(len(system.pairs) for system in self._systems)
        if not self.steps:
            formats = " and ".join(library.formats_of(self.names[0]))
            raise InvalidRequest(
                f"{self.names[0]} has a model in {formats} alone, which {', '.join(map(str, self.subjects))} does not read"
            )
        for subject in self.subjects:
            if failure := self.failure(engine_files(library)[subject.engine].outcome):
                for system in self._systems:
                    for pair in (pair for pair in system.pairs.values() if pair.subject == subject):
                        pair.fail(failure)
                        self.crashes.add((system.name, str(subject)))

    @property
    def _moves(self) -> bool:
        """True where accelerations are compared, by which states are searched for and parts of models found superfluous."""
        return ACCELERATIONS in self.quantities

    def subjects_of(self, name: str) -> list[Subject]:
        """The subjects that are asked of a system or of a variant."""
        return asked_of(self.settings.library, name, self.subjects, more=self.settings.stand_ins)

    def _pairs_of(self, name: str, without: Collection[tuple[str, str]]) -> list[Pair]:
        asked = [subject for subject in self.subjects_of(name) if (name, str(subject)) not in without]
        return [Pair(subject=subject, quantity=quantity) for quantity in self.quantities for subject in asked]

    def inquiries(self) -> Iterator[Iterable[Inquiry[None]]]:
        yield [self._compared(system) for system in self._systems]

    def _compared(self, system: SystemProgress) -> Inquiry[None]:
        """The cross-check of one system, from its files to its records."""
        settings, library, seed = self.settings, self.settings.library, self.settings.seed
        # A variant is there for what readers make of it, as any state shows.
        searched = settings.searched if self._moves and not library.is_variant(system.name) else 0
        sampled = settings.states - searched
        yield from self._load(system, 0 if settings.state is not None else sampled)
        batches: Iterator[States] = iter(())
        if (mechanism := system.mechanism) is not None:
            try:
                batches = batches_of(settings, system, mechanism, sampled)
                for pair in system.pairs.values():
                    assign(settings, self._expectations[ACCELERATIONS], system, mechanism, pair)
            except InvalidInput as error:
                self.report(error)
                system.fail(str(error))

        stand_ins = [pair.assignment for pair in answering(system.pairs.values()) if pair.subject.format in settings.stand_ins]
        if stand_ins:
            outcome = yield from ask(call, accept, stand_ins, affinity=system.name)
            if isinstance(outcome.exception, InvalidInput):
                raise outcome.exception
            # Whatever else an engine does there it does again, and it costs its own record.

        # A batch is certified once, and every subject is asked there. Of a long sample one batch is held at a time.
        for number, states in enumerate(batches):
            if not answering(system.pairs.values()):
                break
            yield from self._asked_at(system, states)
            if number:
                continue
            # A reader that is known to make another mechanism of its file tells nothing of this one.
            pairs = [pair for pair in answering(system.pairs.values()) if pair.verdict != Verdict.MISREADS]
            # What engines hold after loading, which their accelerations need not feel. The replay of a state is about that state alone.
            readers, natives = (readers_among(library, pairs), natives_among(library, pairs)) if settings.state is None else ([], [])
            if self._audits and len(readers) > 1:
                found = yield from self._together(system, readers, "the static audit", find_differences)
                if found is not None:
                    complete = not settings.subjects and not settings.stand_ins
                    expected = self._expected_differences.get(system.name, [])
                    self.found.differs += judge_differences(found, system.name, expected, complete)

            # Hypothesis looks for the state at which each subject does worst.
            folder = settings.examples and settings.examples.absolute() / library_folder(library) / library.label(system.name)
            for group in led_together(library, pairs) if searched else []:
                found = yield from self._together(system, group, "the search", hypothesis_search.search, searched, seed, folder)
                for pair in group if found is not None else []:
                    if isinstance(one := found.get(str(pair.subject)), Answers):
                        self._take(pair, one)
                    elif one is not None:
                        pair.found = one
                        pair.add(one.states, one.comparison)
                        # Of the sample more is known than of what was searched.
                        if one.remark and not pair.remarks:
                            pair.remarks.append(f"{one.remark}.")

            for pair in natives if self._moves else []:
                outcome = yield from ask(call, find_superfluous, pair.assignment, affinity=system.name)
                # The subject's answers are judged without it: whatever ends the search costs no verdict, and a death no exit status.
                if failure := str(outcome.crash) if outcome.crash is not None else self.failure(outcome):
                    pair.remarks.append(f"The search for superfluous parts was not finished: {failure}.")
                    continue
                # A file of the harness holds nothing superfluous; somebody else's may.
                fails = library == Library.built_in() and pair.subject.format not in settings.stand_ins
                parts = [replace(part, system=system.name, fails=fails) for part in outcome.value]
                # Engines that read the same file find the same parts.
                self.found.superfluous += [part for part in parts if part not in self.found.superfluous]

        for pair in list(system.pairs.values()):
            yield from self._explain(system, pair)
            record = record_of(settings, self._expectations[pair.quantity], system, pair)
            del system.pairs[pair.key]
            yield self.kept(f"{record.system} {record.subject}", CrossCheckResult(records=[record]))
        # What there is to say of a mechanism stands with its system.
        if self._moves and mechanism is not None and mechanism.name == library.label(system.name):
            self.found.systems.append(card_of(system, mechanism))

    def _load(self, system: SystemProgress, sampled: int) -> Inquiry[None]:
        """The mechanism of a system, with the points of its sample in the cache, and the models that its subjects read."""
        library, name, stand_ins = self.settings.library, system.name, self.settings.stand_ins
        expectations = self._expectations[ACCELERATIONS]
        # Before anything that takes long: a file that was named and cannot be used ends the run.
        for model_format, path in stand_ins.items():
            outcome = yield from ask(call, read_model, path, model_format, affinity=name)
            if failure := self._failure_of(system, model_format, outcome, path):
                raise self.problems[-1]
            system.models[model_format] = outcome.value
        subjects = [pair.subject for pair in system.pairs.values()]
        paths = {
            model_format: path
            for model_format, path in library.validated_models(name).items()
            if model_format not in stand_ins
            and any(one.format == model_format and not why_no_model(self.settings, expectations, name, one) for one in subjects)
        }
        wanted = [Task(None, call, (derive_and_sample, library, name, sampled, self.settings.seed), name)]
        derived, *read = yield [*wanted, *(Task(None, call, (read_model, path, form), name) for form, path in paths.items())]
        if failure := self._failure_of(system, None, derived, library.system_path(name)):
            # Of one robot's file nothing else is to be told.
            if library.reads_files and self.names == [name] and isinstance(derived.exception, InvalidInput):
                raise derived.exception
            system.fail(failure)
        system.mechanism = derived.value
        for (model_format, path), outcome in zip(paths.items(), read, strict=True):
            system.models[model_format] = self._failure_of(system, model_format, outcome, path) or outcome.value

    def _failure_of(self, system: SystemProgress, what: str | None, outcome: Outcome, path: Any) -> str:
        """Why a file could not be loaded; whatever it makes the harness do, it is the file that has to be mended."""
        failure = self.failure(outcome)
        if outcome.crash is not None:
            self.crashes.add((system.name, what))
        if failure and not isinstance(outcome.exception, InvalidInput):
            self.report(InvalidInput(path, None, failure))
        return failure

    def _asked_at(self, system: SystemProgress, states: States) -> Inquiry[None]:
        """Ask every subject at a batch of states, and take what it answers."""
        pairs = answering(system.pairs.values())
        # A state that was named is asked as it is.
        compared = compare_all if self.settings.state is None else partial(compare_all, share=0.0)
        found = yield from self._together(system, pairs, "the reference", compared, states)
        if found is None:
            return
        seconds, compilation_seconds, answers = found
        for pair in pairs:
            if pair.key in answers and not pair.failure:
                self._take(pair, answers[pair.key], states)
        system.seconds.append(seconds)
        system.compilation_seconds = max(system.compilation_seconds or 0.0, compilation_seconds)

    def _take(self, pair: Pair, answers: Answers, states: States | None = None) -> None:
        if answers.problem is not None:
            self.report(answers.problem)
        if answers.failure:
            pair.fail(answers.failure, answers.unsupported, refused=answers.problem is not None, misread=answers.misread)
        if answers.remark and f"{answers.remark}." not in pair.remarks:
            pair.remarks.append(f"{answers.remark}.")
        if answers.comparison is not None and states is not None:
            # What is stored stands before the sample, in the first batch.
            pair.add(
                states if answers.states is None else answers.states, answers.comparison, slice(0 if pair.counts else pair.stored, None)
            )
            pair.seconds += answers.seconds
            pair.from_rigid += [answers.from_rigid] if len(answers.from_rigid) else []

    def _together(self, system: SystemProgress, pairs: Pairs, what: str, function: Callable[..., Any], *rest: Any) -> Inquiry[Any]:
        """The value of one task for several pairs; without those that it dies of, which fail. None where nobody is left.

        Where its process dies, the culprit is the one that the task's note names, and the state it died at is looked for. Where there is
        none, all fail. Of several that the note names each is asked by itself, and all of them fail where it does not die again.
        """
        died: dict[str, str] = {}
        while pairs:
            outcome = yield from ask(function, [pair.assignment for pair in pairs], *rest, affinity=system.name)
            failure = self.failure(outcome)
            if not failure:
                for pair in map(system.pairs.__getitem__, died):
                    pair.fail(f"{died[pair.key]}, when several answers were asked for in one request, and not when each was")
                    self.crashes.add((system.name, str(pair.subject)))
                return outcome.value
            note = json.loads(outcome.crash.note) if outcome.crash is not None and outcome.crash.note else {}
            if TOGETHER in note:
                function, died = partial(function, each=True), dict.fromkeys(note[TOGETHER], failure)
                continue
            died = {}
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
                return None
            culprit.fail(failure)
            known = [States.at(**note["states"])] if "states" in note else [one for one in rest if isinstance(one, States)]
            if known and culprit.failed_at is None:
                outcome = yield from ask(ask_one_by_one, culprit.assignment, known[0], affinity=system.name)
                if outcome.crash is not None and outcome.crash.note:
                    culprit.failed_at = json.loads(outcome.crash.note)
            pairs = answering(pairs)
        return None

    def _explain(self, system: SystemProgress, pair: Pair) -> Inquiry[None]:
        """Side tasks: the one number that lost digits, or a disagreement in another quantity, come from, and a componentwise error."""
        moves, of_file = not quantity_words(pair.quantity), self.settings.library.reads_files
        # As long as no readings are known: one that is misread may lose digits, too, or have a number wrong.
        judged = pair.verdict
        has_readings = judged != Verdict.AGREES if of_file else judged in (Verdict.MISREADS, Verdict.EXPLAINED)
        if has_readings and pair.assignment is not None and not pair.failure.startswith(NOT_OFFERED):
            failure = pair.failure if of_file else ""
            outcome = yield from ask(call, readings_and_refusal, pair.assignment, self.settings.seed, failure, affinity=system.name)
            pair.readings, pair.rest = outcome.value or ([], [])
            if failure := self.failure(outcome):
                pair.remarks.append(f"What the readings do is not known: {failure}.")
        if judged == (Verdict.UNSTABLE if moves else Verdict.DISAGREES) or (of_file and judged == Verdict.DISAGREES):
            # A run in which all is well imports nothing of it.
            from harness.crosscheck.explanation import explain

            assert pair.shown is not None
            outcome = yield from ask(explain, pair.assignment, self.settings.seed, pair.shown[0], affinity=system.name)
            if failure := self.failure(outcome):
                pair.remarks.append(f"Whether one number explains the errors is not known: {failure}.")
            elif of_file and judged == Verdict.DISAGREES:
                pair.rest = list(filter(None, [outcome.value]))
            else:
                pair.explained = outcome.value or ""
        # It changes no verdict: at the worst state that any task has found.
        # Where the share is granted the answer moves by more than its inputs say, componentwise too.
        shown = pair.shown
        if moves and not pair.failure and shown is not None and not (np.isnan(shown[1].backward_error) | shown[1].granted)[LARGEST]:
            beyond = 0.0 if self.settings.componentwise else AGREEMENT
            state = shown[0][[LARGEST]]
            outcome = yield from ask(call, measure_componentwise, pair.assignment, state, beyond, affinity=system.name)
            pair.componentwise = outcome.value
        if self.settings.worlds and not pair.failure:
            # A run that is about no worlds imports nothing of it.
            from harness.crosscheck.worlds import equal_worlds

            outcome = yield from ask(call, equal_worlds, pair.assignment, self.settings.worlds, self.settings.seed, affinity=system.name)
            failure = self.failure(outcome)
            pair.unequal_worlds, said = outcome.value or (None, f"Whether equal worlds answer alike is not known: {failure}")
            pair.remarks.append(f"{said}.")
