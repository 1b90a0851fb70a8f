"""The loading of a cross-check: the equations of each system, its model files, its states, and what each subject is asked with."""

from __future__ import annotations

import itertools
from abc import abstractmethod
from collections.abc import Iterator
from pathlib import Path

from harness.certify.sampling import sample_in_blocks
from harness.crosscheck import tasks
from harness.crosscheck.expected import Expectations, load_expectations
from harness.crosscheck.progress import Asking, Pair, Pairs, System, answering
from harness.crosscheck.settings import Settings, stored_states
from harness.crosscheck.static_audit import load_expected_differences
from harness.crosscheck.tasks import Assignment
from harness.engines import Subject, asked_of, engine_files, select_subjects
from harness.equations.mechanism import Mechanism
from harness.equations.states import States
from harness.errors import InvalidInput, InvalidModel, InvalidRequest
from harness.library import Library
from harness.workers import Outcome


def orphans(library: Library) -> Iterator[InvalidModel]:
    """A problem for each model file that no system stands behind."""
    for path in library.orphaned_models():
        yield InvalidModel(path, None, f"has no system; expected systems/{library.system_of(path.stem)}.py beside it")


class Loading(Asking):
    """What comes before the first batch of states.

    Attributes:
        names: of the systems and variants. subjects: those asked for.

    Raises:
        InvalidInput: the library or its expected verdicts cannot be used at all; from ``take``, a stand-in cannot.
        InvalidRequest: a system or subject that does not exist.
    """

    def __init__(self, settings: Settings) -> None:
        super().__init__(settings)
        self.names = settings.library.select(settings.names, with_variants=True)
        self.subjects = select_subjects(settings.library, settings.subjects)
        self.expectations = self._expectations()
        self.expected_differences = load_expected_differences(settings.library)
        if settings.stand_ins and len(self.names) != 1:
            raise InvalidRequest("--mjcf and --urdf stand in for one system's models; name exactly one system")
        if settings.stand_ins and settings.library.is_of_robots:
            raise InvalidRequest(f"nothing stands in for {self.names[0]}, which is the truth here; {settings.held_against(self.names[0])}")
        if settings.state is not None and len(self.names) != 1:
            raise InvalidRequest("--state belongs to one system; name exactly one system")
        if not settings.names:
            for orphan in orphans(settings.library):
                self.report(orphan)
        self._systems = {name: System(name, {pair.key: pair for pair in self._pairs_of(name)}) for name in self.names}
        self.steps = sum(len(system.pairs) for system in self._systems.values())
        if not self.steps:
            formats = " and ".join(settings.library.formats_of(self.names[0]))
            raise InvalidRequest(
                f"{self.names[0]} has a model in {formats} alone, which {', '.join(map(str, self.subjects))} does not read"
            )
        for subject in self.subjects:
            if failure := self.failure(engine_files(settings.library)[subject.engine].outcome):
                for name, system in self._systems.items():
                    for pair in system.pairs.values():
                        if pair.subject == subject:
                            pair.fail(failure)
                            self.crashes.add((name, str(subject)))
        for system in self._systems.values():
            self._load(system)

    def _expectations(self) -> Expectations:
        return load_expectations(self.settings.library)

    def subjects_of(self, name: str) -> list[Subject]:
        """The subjects that are asked of a system or of a variant."""
        return asked_of(self.settings.library, name, self.subjects, more=self.settings.stand_ins)

    def _pairs_of(self, name: str) -> list[Pair]:
        """What is asked of a system or of a variant."""
        return [Pair(subject=subject) for subject in self.subjects_of(name)]

    def _load(self, system: System) -> None:
        library, name, pairs = self.settings.library, system.name, list(system.pairs.values())
        stand_ins = self.settings.stand_ins
        # Before anything that takes long: a file that was named and cannot be used ends the run.
        for model_format, path in stand_ins.items():
            self._ask(self._loaded, system, pairs, tasks.read, path, model_format, about=(model_format, path))
        sampled = 0 if self.settings.state is not None else self._sampled_of(system)
        wanted = library, name, sampled, self.settings.seed
        self._ask(self._loaded, system, pairs, tasks.derive_and_sample, *wanted, about=(None, library.system_path(name)))
        subjects = [pair.subject for pair in pairs]
        for model_format, path in library.validated_models(name).items():
            needed = any(subject.format == model_format and not self._why_no_model(name, subject) for subject in subjects)
            if needed and model_format not in stand_ins:
                self._ask(self._loaded, system, pairs, tasks.read, path, model_format, about=(model_format, path))

    def _loaded(self, outcome: Outcome, system: System, pairs: Pairs, about: tuple[str | None, Path]) -> None:
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
                pair.fail(failure, refused=True)
        else:
            system.mechanism = outcome.value
        if system.mechanism is not None and not any(pair.pending for pair in pairs):
            self._begin(system, system.mechanism)

    def _begin(self, system: System, mechanism: Mechanism) -> None:
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
                pair.fail(str(error), refused=True)
            return
        for pair in system.pairs.values():
            self._assign(system, mechanism, pair)
        pairs = answering(system.pairs.values())
        stand_ins = [pair.assignment for pair in pairs if pair.subject.format in self.settings.stand_ins]
        if stand_ins:
            self._ask(self._accepted, system, pairs, tasks.accept, stand_ins)
        else:
            self._compare(system, next(system.batches), pairs)

    def _accepted(self, outcome: Outcome, system: System, pairs: Pairs, about: None) -> None:
        if isinstance(outcome.exception, InvalidInput):
            raise outcome.exception
        # Whatever else an engine does there it does again, and it costs its own record.
        self._compare(system, next(system.batches), pairs)

    def _states(self, system: System, mechanism: Mechanism) -> Iterator[States]:
        """Batch by batch; what is stored stands before the first block of the sample."""
        if self.settings.state is not None:
            return iter([self.settings.state])
        sampled = sample_in_blocks(mechanism, self._sampled_of(system), self.settings.seed)
        stored = stored_states(self.settings.library, mechanism)
        if stored is None:
            return sampled
        for pair in system.pairs.values():
            pair.stored = len(stored)
        return itertools.chain([States.concatenate([stored, next(sampled)])], sampled)

    def _sampled_of(self, system: System) -> int:
        return self.settings.states - self._searched_of(system)

    def _searched_of(self, system: System) -> int:
        """How many states are searched for: none for a variant, which is there for what readers make of it, as any state shows."""
        return 0 if self.settings.library.is_variant(system.name) else self.settings.searched

    def _assign(self, system: System, mechanism: Mechanism, pair: Pair) -> None:
        """Give a pair what it is asked with, or the reason why it cannot be asked."""
        file = engine_files(self.settings.library)[pair.subject.engine]
        model = system.models.get(pair.subject.format)
        if reason := self._why_no_model(system.name, pair.subject):
            pair.fail(reason, unsupported=True)
        elif isinstance(model, str):
            pair.fail(model, refused=True)
        elif file.version is None:
            pair.fail(f"{file.requires[1]} is not installed", unsupported=True)
        elif file.elsewhere and (reason := file.too_old(file.version, pair.subject.format)):
            pair.fail(reason, unsupported=True)
        else:
            pair.assignment = Assignment(self.settings.library, pair.subject, mechanism, model)

    def _why_no_model(self, name: str, subject: Subject) -> str:
        """The reason of the entry that excuses a missing model; a stand-in is a model."""
        if subject.format in self.settings.stand_ins:
            return ""
        return self.expectations.why_no_model(self.settings.library, name, subject)

    @abstractmethod
    def _compare(self, system: System, states: States, pairs: Pairs) -> None:
        """Ask for the comparison of a batch of states."""
