"""One model under test with all subjects that read it: the verdicts once its text is changed.

Where an engine declares that its constraints give, the law that a changed file declares is the truth of that file, as in a check: MuJoCo
takes the weights of its rows from the masses and inertias of the file, and a number that is felt in these alone makes no other mechanism.

Source: Reiter, A theory of diagnosis from first principles, Artificial Intelligence 32 (1987), on whom to blame.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.crosscheck.assignment import Assignment, acceleration_truth_of
from harness.crosscheck.examination import CHANGE, NOISE
from harness.crosscheck.expected import load_expectations
from harness.diagnosis.faults.reader import MOST_ABOVE_THEORY, RED, Reader, least_that, require_sound, smallest_caught
from harness.engines import (
    EQUATIONS,
    Engine,
    Model,
    Subject,
    Unsupported,
    accelerations,
    accelerations_and_gaps,
    engine_files,
    gaps_of,
    load_engine,
    select_subjects,
    subjects_beside,
)
from harness.engines.interface import acting_as, audit, require_bounds
from harness.errors import InvalidInput, InvalidModel, not_installed
from harness.explain.as_read import misread_by
from harness.explain.changes import Change
from harness.explain.columns import DIFFERENCE, beside_law, derivative, diagnostic_states, watch
from harness.explain.pattern import NOTHING, UNDECIDED, infer
from harness.files.model_file import ModelFile, read_model
from harness.lagrange.derivation import load_mechanism
from harness.library import Library
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.states import States
from harness.truth.compare import Flags, compare
from harness.truth.quantities.accelerations import AccelerationTruth, beside_gaps, closing_of, with_gaps
from harness.truth.reference import Reference, ReferenceKernel
from harness.truth.sampling import sample
from harness.verdict import Verdict, gravest

# Stages whose refusal comes before any acceleration.
REFUSED = ("validator", "reader")


@dataclass(frozen=True)
class Answer:
    """The outcome of a changed text: the stage that refused it and the line, or the verdict and movement of each subject."""

    refused_by: str = ""
    refusal: str = ""
    line: int | None = None
    verdicts: Mapping[str, str] = field(default_factory=dict)
    movement: float = 0.0

    @property
    def caught_by(self) -> str:
        if self.refused_by:
            return self.refused_by
        return "check" if set(self.verdicts.values()) & set(RED) else ""

    @property
    def is_live(self) -> bool:
        """True where the accelerations are others, or there are none."""
        return self.refused_by in REFUSED or self.movement > NOISE


class FaultBench:
    """One model of one system, the subjects that read it, and the others, whose verdicts no fault of the file may change.

    ``subjects`` are the names of those that take part; all for none.

    Attributes:
        mechanism, model: as they are in the library. readers: of the file; others: the other subjects and their verdicts.

    Raises:
        harness.errors.InvalidInput: the system or its model cannot be used, or a subject that can express the mechanism refuses its
            model or is wrong before any fault is planted.
    """

    def __init__(self, library: Library, name: str, model_format: str, states: int, seed: int, subjects: Sequence[str] = ()) -> None:
        self._library, self._name = library, name
        self.mechanism: Mechanism = load_mechanism(library, name)
        self.model = acting_as(read_model(library.model_path(name, model_format), model_format), self.mechanism)
        self._sample = {False: sample(self.mechanism, states, seed), True: diagnostic_states(self.mechanism, seed)}
        self._asked: dict[tuple[Subject, bool], States] = {}
        self._closed: dict[Subject, Flags] = {}
        self._expected = load_expectations(library)
        self._references: dict[tuple[ReferenceKernel, bool], Reference] = {}
        self._diagnostic: dict[Subject, tuple[States, Reference]] = {}
        self.readers: list[Reader] = []
        self.others: dict[str, str] = {}
        asked = select_subjects(library, subjects) if subjects else subjects_beside(library)
        unsupported = [reason for subject in asked if (reason := self._join(subject))]
        if not self.readers:
            raise InvalidInput(self.model.path, None, f"no engine can express it: {'; '.join(unsupported)}")

    def _truth(self, subject: Subject, model: ModelFile | None) -> AccelerationTruth:
        return acceleration_truth_of(Assignment(self._library, subject, self.mechanism, model))

    def _states(self, subject: Subject, model: ModelFile | None, diagnostic: bool = False) -> States:
        """The states at which a subject is asked: those of a check, or of a diagnosis."""
        if (subject, diagnostic) not in self._asked:
            self._asked[subject, diagnostic] = self._truth(subject, model).asked_at(self._sample[diagnostic])
        return self._asked[subject, diagnostic]

    def _closing(self, subject: Subject) -> Flags:
        """The states of a check that close the constraints, (n,)."""
        if subject not in self._closed:
            self._closed[subject] = closing_of(self.mechanism, self._states(subject, self.model))
        return self._closed[subject]

    def _reference(self, subject: Subject, engine: Engine, model: ModelFile | None, diagnostic: bool = False) -> Reference:
        """The truth of a subject on an unmodified model, certified once."""
        states = self._states(subject, model, diagnostic)
        reference = self._certified(self._truth(subject, model).kernel, states, diagnostic)
        if model is not self.model:
            return reference
        return beside_gaps(reference, self.mechanism, states, gaps_of(self._load(engine, self.model), states))

    def _certified(self, kernel: ReferenceKernel, states: States, diagnostic: bool = False) -> Reference:
        if (kernel, diagnostic) not in self._references:
            self._references[kernel, diagnostic] = kernel.evaluate(states)
        return self._references[kernel, diagnostic]

    def _join(self, subject: Subject) -> str:
        """Evaluate a subject on the unmodified models; why it is unsupported, "" where it is not."""
        file = engine_files(self._library)[subject.engine]
        if file.version is None:
            return f"{subject}: {not_installed(file.requires[1]) if file.outcome.value else 'its engine file cannot be loaded'}"
        engine = load_engine(self._library, subject.engine)
        model = self.model if subject.format == self.model.format else None
        if model is None and subject.format != EQUATIONS:
            try:
                # A family's writer may make it where there is no file.
                model = acting_as(read_model(self._library.model_path(self._name, subject.format), subject.format), self.mechanism)
            except InvalidModel:
                return ""
        if model is not None and misread_by(model, self.mechanism.gravity, subject.engine, self._library)[1].applied:
            return f"{subject}: its reader makes another mechanism of {model.path.name}"
        path = self._library.system_path(self._name) if model is None else model.path
        try:
            law, states = partial(self._moved_by_law, subject), self._states(subject, model)
            watched = watch(engine, self.mechanism, self.model, states, declared=law) if model is self.model else None
            source = model or Assignment(self._library, subject, self.mechanism, None).in_equations
            answers = watched.healthy if watched else accelerations(self._load(engine, source), states)
        except Unsupported as reason:
            return f"{subject}: {reason}"
        except ValueError as error:
            raise InvalidInput(path, None, f"{subject} refuses it before any fault is planted: {error}") from error
        reference = self._reference(subject, engine, model)
        comparison = compare(reference, answers, engine.factorises_mass_matrix)
        require_sound(path, self._name, subject, comparison, self._expected.of(self._name, subject))
        if watched:
            self.readers.append(Reader(subject, engine, reference, watched))
        else:
            self.others[str(subject)] = gravest(comparison.verdicts.tolist())
        return ""

    def _load(self, engine: Engine, source: ModelFile | Mechanism) -> Model:
        return engine.load(source, self.mechanism.joints, self.mechanism.gravity)

    def _moved_by_law(self, subject: Subject, changed: ModelFile) -> Array:
        """By how much the law that a changed file declares moves the truth, (n, nv).

        Raises:
            InvalidModel: it declares none.
        """
        own, kernel = (self._truth(subject, one).kernel for one in (self.model, changed))
        states = self._states(subject, self.model)
        if kernel is own:
            return np.zeros((len(states), self.mechanism.nv))
        before, (high, low) = self._certified(own, states), kernel.accelerations(states)
        if (is_open := np.isnan(high).any(axis=1)).any():
            # At more bits, and with the data roundoff that costs most.
            after = kernel.evaluate(states[is_open])
            high[is_open], low[is_open] = (np.where(after.certified[:, None], part, np.nan) for part in (after.high, after.low))
        return np.nan_to_num((high - before.high) + (low - before.low), nan=0.0)

    def diagnostic(self, reader: Reader) -> tuple[States, Reference]:
        """The states at which a diagnosis may ask a reader, because it agrees there on the unmodified file, and their reference."""
        if reader.subject not in self._diagnostic:
            reference = self._reference(reader.subject, reader.engine, self.model, diagnostic=True)
            states = self._states(reader.subject, self.model, diagnostic=True)
            healthy = watch(reader.engine, self.mechanism, self.model, states).healthy
            sound = compare(reference, healthy).verdicts == Verdict.AGREES.value
            self._diagnostic[reader.subject] = states[sound], reference[sound]
        return self._diagnostic[reader.subject]

    def ask(self, text: str, through: Callable[[Any], Any] | None = None) -> Answer:
        """The outcome of the model with another text, and of readers that go ``through`` a function, at the states of a check."""
        try:
            model = self.model.with_text(text)
            # Which does not act, and would be taken for a number that nothing feels.
            require_bounds(model, self.mechanism)
        except InvalidModel as error:
            return Answer("validator", str(error), error.line)
        verdicts: dict[str, str] = {}
        movement = 0.0
        refusal: InvalidModel | None = None
        for one in self.readers:
            try:
                loaded = self._load(through(one.engine) if through else one.engine, model)
                states = self._states(one.subject, self.model)
                answers = with_gaps(*accelerations_and_gaps(loaded, states), self._closing(one.subject))
                answers = beside_law(answers, self._moved_by_law(one.subject, model))
            except Unsupported:
                verdicts[str(one.subject)] = Verdict.UNSUPPORTED.value
                continue
            except (InvalidModel, ValueError) as error:
                line = re.search(r"\bline (\d+)", str(error))
                return Answer("reader", str(error), int(line[1]) if line else None)
            try:
                audit(loaded.loaded(), model, self.mechanism)
            except InvalidModel as error:
                refusal = refusal or error
            movement = max(movement, one.movement(answers))
            verdicts[str(one.subject)] = one.verdict(answers)
        said = ("", "", None) if refusal is None else ("audit", str(refusal), refusal.line)
        return Answer(*said, verdicts, movement)

    def ask_sized(self, planted: Change, size: float) -> tuple[Answer, float]:
        """The outcome of a size, and the size with its sign: negative where only that direction is not refused."""
        answer = self.ask(planted.text(size), planted.through)
        if not planted.is_sized or answer.refused_by not in REFUSED:
            return answer, size
        other = self.ask(planted.text(-size))
        return (answer, size) if other.refused_by in REFUSED else (other, -size)

    def smallest(self, planted: Change) -> tuple[float, float, int]:
        """Smallest size that some reader catches, the same by theory, and the order in which the accelerations depend on the size."""
        # Theory holds for one reader: the first that has most states.
        widest = max(self.readers, key=lambda one: int(one.sound.sum()))
        theory, order = widest.theory(derivative(widest.watch.accelerations, planted.text, 0.0, DIFFERENCE)), 1
        if theory > DIFFERENCE:
            # The difference is rounding for the most part.
            theory, order = _by_change(widest, planted.text)
        bar = MOST_ABOVE_THEORY * theory
        if bar < CHANGE and not self._is_felt(planted, bar):
            # A reader rounds it away: theory begins where it does not.
            theory = least_that(lambda size: self._is_felt(planted, size), bar, CHANGE)
        caught = smallest_caught(theory, lambda size: any(one.catches(planted.text, size) for one in self.readers))
        return caught, theory, order

    def _is_felt(self, planted: Change, size: float) -> bool:
        """True where the answers of some reader move by what is caught at least, more than by its rounding, or there are none."""
        answers = ((one, one.answer(planted.text, size)) for one in self.readers)
        return any(answer is None or one.theory(answer - one.watch.healthy) <= 1 for one, answer in answers)

    def blamed(self, answer: Answer) -> str:
        """The sound party that the pattern of agreement blames; the model that has the mistake is not sound."""
        if not answer.verdicts:
            return ""
        party = infer({**self.others, **answer.verdicts}).party
        return "" if party in (f"model {self.model.format}", NOTHING, UNDECIDED) else party


def _by_change(reader: Reader, text: Callable[[float], str]) -> tuple[float, int]:
    """Smallest size that theory says is caught, and the order of the movement, 1 or 2: by how much half of ``CHANGE`` moves less.

    2 and inf where ``CHANGE`` moves nothing or is refused.
    """

    def least(size: float) -> float:
        answers = reader.answer(text, size)
        return math.inf if answers is None else reader.theory(answers - reader.watch.healthy)

    whole, half = least(CHANGE), least(CHANGE / 2)
    order = 1 if half <= 2.0**1.5 * whole < math.inf else 2
    return CHANGE * whole ** (1 / order), order
