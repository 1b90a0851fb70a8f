"""One model under test with all who are asked about it: what becomes of its text once that is changed.

Source: Reiter, A theory of diagnosis from first principles, Artificial Intelligence 32 (1987), on whom to blame.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from harness.agreement_pattern import NOTHING, UNDECIDED, infer
from harness.attributes import Watch, largest_change
from harness.audit import audit
from harness.compare import compare
from harness.derivation import load_mechanism
from harness.engines import EQUATIONS, Engine, LoadedModel, Subject, Unsupported, linear_velocity_in_body, load_engine, select_subjects
from harness.errors import InvalidModel
from harness.fault_walk import promised, smallest_caught
from harness.hypotheses import Planted
from harness.kernels import Array
from harness.library import Library
from harness.mechanism import Mechanism
from harness.minimal import CHANGE, NOISE
from harness.models import ModelFile, parse_model, read_model
from harness.perturbation import DIFFERENCE, derivative, diagnostic_states, watch
from harness.reference import Reference, ReferenceKernel
from harness.states import sample
from harness.verdict import Verdict, gravest

RED = (Verdict.DISAGREES.value, Verdict.ERROR.value, Verdict.UNSTABLE.value)
# By which the dynamics is never asked.
REFUSED = ("validator", "reader")


@dataclass(frozen=True)
class Answer:
    """What became of a changed text: who refused it and where, or the verdict and movement of each subject."""

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
        """Whether the dynamics is another, or there is none."""
        return self.refused_by in REFUSED or self.movement > NOISE


@dataclass(frozen=True)
class Reader:
    """A subject that reads the file, with its certified reference and its answers to the sound file, (n, nv)."""

    subject: Subject
    engine: Engine
    reference: Reference
    in_body: bool
    healthy: Array


class Bench:
    """One model of one system, the subjects that read it, and those that do not and must stay green.

    Attributes:
        mechanism, model: as they are in the library. readers: of the file; others: the other subjects and their verdicts.
        diagnostic_states: at which diagnoses ask.

    Raises:
        harness.errors.InvalidInput: the system or its model cannot be used.
    """

    def __init__(self, library: Library, name: str, model_format: str, states: int, seed: int) -> None:
        self._library, self._name = library, name
        self.mechanism: Mechanism = load_mechanism(library, name)
        self.model = read_model(library.model_path(name, model_format), model_format)
        self._states = sample(self.mechanism, states, seed)
        self.diagnostic_states = diagnostic_states(self.mechanism, seed)
        self._kernels: dict[bool, ReferenceKernel] = {}
        self._references: dict[tuple[bool, bool], Reference] = {}
        self.readers: list[Reader] = []
        self.others: dict[str, str] = {}
        for subject in select_subjects(library, ()):
            self._join(subject)

    def reference(self, in_body: bool, diagnostic: bool) -> Reference:
        """Certified once: it does not depend on the fault."""
        if in_body not in self._kernels:
            self._kernels[in_body] = ReferenceKernel(self.mechanism, in_body)
        if (in_body, diagnostic) not in self._references:
            states = self.diagnostic_states if diagnostic else self._states
            self._references[in_body, diagnostic] = self._kernels[in_body].evaluate(states)
        return self._references[in_body, diagnostic]

    def _join(self, subject: Subject) -> None:
        engine = load_engine(self._library, subject.engine)
        in_body = linear_velocity_in_body(engine) and bool(self.mechanism.charts_in_body)
        source: Any = self.mechanism if subject.format == EQUATIONS else self.model
        if subject.format not in (EQUATIONS, self.model.format):
            source = _model_or_none(self._library.model_path(self._name, subject.format), subject.format)
        if source is None:
            return
        try:
            answers = self._accelerations(engine, source)
        except (Unsupported, ValueError):
            return
        reference = self.reference(in_body, False)
        if subject.format == self.model.format:
            self.readers.append(Reader(subject, engine, reference, in_body, answers))
        else:
            self.others[str(subject)] = gravest(compare(reference, answers).verdicts.tolist())

    def _accelerations(self, engine: Engine, source: Any) -> Array:
        loaded = engine.load(source, self.mechanism.joints, self.mechanism.gravity)
        return loaded.forward_dynamics(self._states.q, self._states.v, self._states.tau)

    def ask(self, text: str) -> Answer:
        """What becomes of the model with another text, at the states of a check."""
        try:
            model = parse_model(self.model.path, text, self.model.format)
        except InvalidModel as error:
            return Answer("validator", str(error), error.line)
        verdicts: dict[str, str] = {}
        movement = 0.0
        refused: InvalidModel | None = None
        for one in self.readers:
            try:
                loaded = one.engine.load(model, self.mechanism.joints, self.mechanism.gravity)
                answers = loaded.forward_dynamics(self._states.q, self._states.v, self._states.tau)
            except Unsupported:
                verdicts[str(one.subject)] = Verdict.UNSUPPORTED.value
                continue
            except ValueError as error:
                line = re.search(r"\bline (\d+)", str(error))
                return Answer("reader", str(error), int(line[1]) if line else None)
            held = loaded.loaded()
            if held is not None and refused is None:
                refused = _refusal_of(held, model, self.mechanism)
            movement = max(movement, largest_change(one.healthy, answers))
            verdicts[str(one.subject)] = gravest(compare(one.reference, answers).verdicts.tolist())
        said = ("audit", str(refused), refused.line) if refused is not None else ("", "", None)
        return Answer(*said, verdicts, movement)

    def ask_sized(self, planted: Planted, size: float) -> tuple[Answer, float]:
        """In the direction that is not refused, where there is one."""
        answer = self.ask(planted.text(size))
        if not planted.sized or answer.refused_by not in REFUSED:
            return answer, size
        other = self.ask(planted.text(-size))
        return (answer, size) if other.refused_by in REFUSED else (other, -size)

    def smallest(self, planted: Planted) -> tuple[float, float, int]:
        """The least size that some reader catches, the promise of theory, and the order in which the size is felt."""
        watched = [watch(one.engine, self.mechanism, self.model, self._states) for one in self.readers]
        reference = self.readers[0].reference

        def moved(own: Watch, size: float) -> Array | None:
            found = own.accelerations(planted.text(size))
            return own.accelerations(planted.text(-size)) if found is None else found

        def is_caught(size: float) -> bool:
            answers = ((one.reference, moved(own, size)) for one, own in zip(self.readers, watched, strict=True))
            return any(found is not None and _is_red(certified, found) for certified, found in answers)

        theory, order = promised(reference, derivative(watched[0], planted.text, 0.0, DIFFERENCE)), 1
        if theory > DIFFERENCE:
            # The difference saw rounding only: the size is felt by its square.
            answers, order = moved(watched[0], CHANGE), 2
            theory = math.inf if answers is None else CHANGE * math.sqrt(promised(reference, answers - watched[0].healthy))
        return smallest_caught(theory, is_caught), theory, order

    def blamed(self, answer: Answer) -> str:
        """The sound party that the pattern of agreement blames; the model that has the mistake is not sound."""
        if not answer.verdicts:
            return ""
        party = infer({**self.others, **answer.verdicts}).party
        return "" if party in (f"model {self.model.format}", NOTHING, UNDECIDED) else party


def _is_red(reference: Reference, accelerations: Array) -> bool:
    return bool((compare(reference, accelerations).verdicts != Verdict.AGREES.value).any())


def _model_or_none(path: Path, model_format: str) -> ModelFile | None:
    """A model that a family's writer may make; None where there is none."""
    try:
        return read_model(path, model_format)
    except InvalidModel:
        return None


def _refusal_of(held: LoadedModel, model: ModelFile, mechanism: Mechanism) -> InvalidModel | None:
    """What the audit has against a model, if anything."""
    try:
        audit(held, model, mechanism)
    except InvalidModel as error:
        return error
    return None
