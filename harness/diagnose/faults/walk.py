"""The smallest change of each number of a model file that turns the check red, beside what theory promises.

A relative change epsilon of a number moves the accelerations by epsilon |D|, D their derivative by its
logarithm. The check is red from AGREEMENT data roundoffs on, so at one state theory promises

    epsilon = AGREEMENT * data roundoff / |D|,

and over many states the least of these. D is taken from the engine itself, by central differences; the
change that is really caught is searched for by planting it in the file. A state at which the engine lost digits
before anything was planted shows nothing, and is left out of both.

Source: Higham, Accuracy and Stability of Numerical Algorithms, 2nd ed., section 1.6.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.certify.compare import compare
from harness.certify.reference import Reference, ReferenceKernel, energy_norm
from harness.certify.sampling import sample
from harness.check.expected import Expectation, load_expectations
from harness.check.superfluous import CHANGE, NOISE
from harness.diagnose.perturbation import DIFFERENCE, derivative, watch
from harness.engines import EQUATIONS, Subject, linear_velocity_in_body, load_engine, select_subjects
from harness.equations.derivation import load_mechanism
from harness.errors import InvalidInput
from harness.library import Library
from harness.models.model_file import ModelFile, read_model
from harness.models.text import Number, Watch, find_elements, scaled
from harness.verdict import AGREEMENT, Verdict, gravest

# Two neighbours in the search for the smallest change that is caught are this far apart.
RESOLUTION = 2.0**0.25
# Beyond this ratio to theory, digits are lost on the way from the engine to the verdict.
MOST_ABOVE_THEORY = 10.0
# The search gives up this far above theory, and stops this far below it.
FURTHEST = 2.0**20

# A text of a model by the relative size of the change in it.
Text = Callable[[float], str]


def expectations(library: Library) -> Mapping[tuple[str, str], Expectation]:
    """Verdicts of the library that are expected to be other than ``agrees``, by (system, subject)."""
    return load_expectations(library, [str(subject) for subject in select_subjects(library, ())])


@dataclass(frozen=True)
class Baseline:
    """What the answers to changed texts of a model are judged by: n certified states, and where the sound text agrees with them.

    Attributes:
        reference: certified accelerations.
        sound: (n,) bool; whether the subject agrees on the sound text. A state at which it does not can show no change.
    """

    reference: Reference
    sound: np.ndarray[Any, np.dtype[np.bool_]]

    @classmethod
    def of(cls, reference: Reference, healthy: Array) -> Baseline:
        """The baseline of a subject that answers ``healthy``, (n, nv), to the sound text."""
        return cls(reference, compare(reference, healthy).verdicts == Verdict.AGREES.value)

    def verdict(self, accelerations: Array) -> str:
        """The gravest of all states at which the sound text agrees, of answers (n, nv)."""
        return gravest(compare(self.reference, accelerations).verdicts[self.sound].tolist())

    def is_red(self, accelerations: Array) -> bool:
        """Whether answers, (n, nv), disagree where those to the sound text did not."""
        return self.verdict(accelerations) != Verdict.AGREES.value

    def promised(self, slope: Array | None) -> float:
        """The least size of a fault that theory says is caught, by the accelerations' derivative by its size, (n, nv)."""
        return math.inf if slope is None else promised(self.reference[self.sound], slope[self.sound])


def require_sound(path: Path, system: str, subject: Subject, reference: Reference, healthy: Array, expected: Expectation) -> None:
    """Refuse a subject whose answers to the sound model, (n, nv), are wrong; those that lost digits as expected are right.

    Raises:
        InvalidInput: it disagrees, answers nothing finite, or agrees nowhere; ``path`` is the file to blame.
    """
    comparison = compare(reference, healthy)
    verdict = gravest(comparison.verdicts.tolist())
    error = float(np.nanmax(comparison.backward_error, initial=0.0))
    lost_digits = verdict == expected.verdict == Verdict.UNSTABLE.value and error <= expected.backward_error
    if verdict != Verdict.AGREES.value and not lost_digits:
        problem = f"the verdict on {subject} is {verdict!r} before any fault is planted (backward error up to {error:.3g})"
        raise InvalidInput(path, None, f"{problem}, so that it can show none; make 'harness check {system}' green first")
    if not (comparison.verdicts == Verdict.AGREES.value).any():
        raise InvalidInput(
            path, None, f"{subject} agrees at none of {len(reference)} states before any fault is planted; give more --states"
        )


def answer_to(watch: Watch, text: Text, size: float) -> Array | None:
    """The accelerations (n, nv) with a change of a size, in the other direction where that is refused; None where both are."""
    answers = watch.accelerations(text(size))
    return watch.accelerations(text(-size)) if answers is None else answers


def is_caught(readers: Iterable[tuple[Watch, Baseline]], text: Text, size: float) -> bool:
    """Whether a change of a size turns the answers of any reader red."""
    answers = ((baseline, answer_to(watched, text, size)) for watched, baseline in readers)
    return any(answer is not None and baseline.is_red(answer) for baseline, answer in answers)


@dataclass(frozen=True, kw_only=True)
class Caught:
    """A live number of a model file, and the smallest relative change of it that is caught.

    Attributes:
        system, subject, file: names.
        number: its value and where it stands.
        changed: the numbers that change together: itself, or all of its element where physics forbids it to change alone.
        smallest: relative change; inf where none up to ``FURTHEST`` times theory is caught.
        theory: what ``AGREEMENT`` data roundoffs divided by the number's share of them promise.
    """

    system: str
    subject: str
    file: str
    number: Number
    changed: tuple[Number, ...]
    smallest: float
    theory: float

    @property
    def ratio(self) -> float:
        """How far above theory."""
        return self.smallest / self.theory

    @property
    def as_promised(self) -> bool:
        """Whether theory is kept."""
        return self.ratio <= MOST_ABOVE_THEORY

    def as_json(self) -> dict[str, Any]:
        """Plain data: where the number stands, its value, and both changes."""
        number = self.number
        return {
            "system": self.system,
            "subject": self.subject,
            "file": self.file,
            "line": number.line,
            "element": number.element,
            "attribute": number.attribute,
            "value": number.value,
            "smallest": self.smallest,
            "theory": self.theory,
        }


@dataclass
class FaultWalk:
    """One model in one engine, its certified reference, and its live numbers.

    Attributes:
        library, name, subject: what is walked.
        states: number of sampled states at which a change may show; seed: of them.

    Raises:
        harness.errors.InvalidInput: the system or its model cannot be used, or the sound model does not agree.
        harness.engines.Unsupported: the engine cannot express the mechanism; ValueError: it refuses the model.
    """

    library: Library
    name: str
    subject: Subject
    states: int
    seed: int = 0
    model: ModelFile = field(init=False)
    _baseline: Baseline = field(init=False)
    _watch: Watch = field(init=False)

    def __post_init__(self) -> None:
        mechanism = load_mechanism(self.library, self.name)
        self.model = read_model(self.library.model_path(self.name, self.subject.format), self.subject.format)
        engine = load_engine(self.library, self.subject.engine)
        states = sample(mechanism, self.states, self.seed)
        reference = ReferenceKernel(mechanism, linear_velocity_in_body(engine)).evaluate(states)
        self._watch = watch(engine, mechanism, self.model, states)
        expected = expectations(self.library).get((self.name, str(self.subject)), Expectation())
        require_sound(self.model.path, self.name, self.subject, reference, self._watch.healthy, expected)
        self._baseline = Baseline.of(reference, self._watch.healthy)

    def caught(self) -> Iterator[Caught]:
        """Every live number, in the order of the file."""
        for element in find_elements(self.model.text, self.subject.format):
            numbers = [number for attribute in element.attributes for number in attribute.numbers if number.value != 0]
            for number in numbers:
                changed = self._changed_with(number, numbers)
                if changed is not None:
                    yield self._look_for(number, changed)

    def _changed_with(self, number: Number, neighbours: Sequence[Number]) -> Sequence[Number] | None:
        """The numbers that change when ``number`` does; None where no acceleration feels it."""
        for numbers in ([number], neighbours):
            movement = self._watch.movement(scaled(self.model.text, numbers, 1 + CHANGE))
            if movement is not None:
                return numbers if movement > NOISE else None
        return None

    def _look_for(self, number: Number, changed: Sequence[Number]) -> Caught:
        def text(change: float) -> str:
            return scaled(self.model.text, changed, 1 + change)

        theory = self._baseline.promised(derivative(self._watch, text, 0.0, DIFFERENCE))
        return Caught(
            system=self.name,
            subject=str(self.subject),
            file=self.model.path.name,
            number=number,
            changed=tuple(changed),
            smallest=smallest_caught(theory, lambda change: is_caught([(self._watch, self._baseline)], text, change)),
            theory=theory,
        )


def promised(reference: Reference, slope: Array | None) -> float:
    """The least size of a fault that theory says is caught at some state, by the accelerations' derivative by its size, (n, nv)."""
    if slope is None:
        return math.inf
    with np.errstate(all="ignore"):
        sizes = AGREEMENT * reference.data_roundoff / energy_norm(reference.norm_factor, slope)
    return float(np.nanmin(sizes))


def smallest_caught(theory: float, catches: Callable[[float], bool]) -> float:
    """The smallest size that is caught, searched for from what ``theory`` promises; inf where none up to ``FURTHEST`` times that is.

    Where all sizes down to ``theory / FURTHEST`` are caught it is that: what is caught below has nothing to do with its size.
    """
    if not np.finfo(np.float64).tiny * FURTHEST < theory < math.inf:
        return math.inf
    low, high = theory, theory
    while high < FURTHEST * theory and not catches(high):
        low, high = high, 2 * high
    if low == high:
        while low > theory / FURTHEST and catches(low / 2):
            low, high = low / 2, low / 2
        if high <= theory / FURTHEST:
            return high
        low /= 2
    while high / low > RESOLUTION:
        middle = math.sqrt(low * high)
        low, high = (low, middle) if catches(middle) else (middle, high)
    return high if high < FURTHEST * theory else math.inf


def walkable(library: Library, names: Sequence[str], subjects: Sequence[str]) -> list[tuple[str, Subject]]:
    """(system, subject) of all pairs asked for; families by their smallest member, whose numbers are those of all.

    Left out are subjects that read no model, and ``unwalkable`` ones.

    Raises:
        harness.errors.InvalidRequest: a system or subject that does not exist.
    """
    excused = unwalkable(library, names, subjects)
    return [pair for pair in _pairs(library, names, subjects) if pair not in excused]


def unwalkable(library: Library, names: Sequence[str], subjects: Sequence[str]) -> dict[tuple[str, Subject], str]:
    """(system, subject) of the pairs asked for that are expected to be ``unsupported``, with the reason of the library; raises as above."""
    known = expectations(library)
    found = {pair: known.get((pair[0], str(pair[1])), Expectation()) for pair in _pairs(library, names, subjects)}
    return {pair: expected.reason for pair, expected in found.items() if expected.verdict == Verdict.UNSUPPORTED}


def _pairs(library: Library, names: Sequence[str], subjects: Sequence[str]) -> list[tuple[str, Subject]]:
    # A file's numbers are one file's: its native subject walks them, unless another is asked for.
    chosen = select_subjects(library, subjects, native_only=True)
    smallest = [members[0] for path in sorted(library.systems.glob("*.py")) if (members := library.names_in(path))]
    systems = library.select(names) if names else smallest
    return [(name, subject) for name in systems for subject in chosen if subject.format != EQUATIONS]


def walk(library: Library, name: str, subject: Subject, states: int, seed: int, note: Callable[[str], None]) -> list[Caught]:
    """Every live number of one model, as a task for ``harness.workers``."""
    return list(FaultWalk(library, name, subject, states, seed).caught())
