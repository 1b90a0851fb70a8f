"""The smallest change of each number of a model file that turns the check red, beside what theory promises.

A relative change epsilon of a number moves the accelerations by epsilon |D|, D their derivative by its
logarithm. The check is red from AGREEMENT data roundoffs on, so at one state theory promises

    epsilon = AGREEMENT * data roundoff / |D|,

and over many states the least of these. D is taken from the engine itself, by central differences; the
change that is really caught is searched for by planting it in the file.

Source: DESIGN's numerics; Higham, Accuracy and Stability of Numerical Algorithms, 2nd ed., section 1.6.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from harness.attributes import Number, Watch, find_elements, scaled
from harness.compare import compare
from harness.derivation import load_mechanism
from harness.engines import EQUATIONS, Subject, linear_velocity_in_body, load_engine, select_subjects
from harness.expected import load_expectations, why_no_model
from harness.kernels import Array
from harness.library import Library
from harness.minimal import CHANGE, NOISE
from harness.models import ModelFile, read_model
from harness.perturbation import DIFFERENCE, derivative, watch
from harness.reference import Reference, ReferenceKernel, energy_norm
from harness.states import sample
from harness.verdict import AGREEMENT, Verdict

# Two neighbours in the search for the smallest change that is caught are this far apart.
RESOLUTION = 2.0**0.25
# Beyond this ratio to theory, digits are lost on the way from the engine to the verdict.
MOST_ABOVE_THEORY = 10.0
# The search gives up this far above theory.
FURTHEST = 2.0**20


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
        harness.errors.InvalidInput: the system or its model cannot be used.
        harness.engines.Unsupported: the engine cannot express the mechanism; ValueError: it refuses the model.
    """

    library: Library
    name: str
    subject: Subject
    states: int
    seed: int = 0
    model: ModelFile = field(init=False)
    _reference: Reference = field(init=False)
    _watch: Watch = field(init=False)

    def __post_init__(self) -> None:
        mechanism = load_mechanism(self.library, self.name)
        self.model = read_model(self.library.model_path(self.name, self.subject.format), self.subject.format)
        engine = load_engine(self.library, self.subject.engine)
        states = sample(mechanism, self.states, self.seed)
        self._reference = ReferenceKernel(mechanism, linear_velocity_in_body(engine)).evaluate(states)
        self._watch = watch(engine, mechanism, self.model, states)

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

        theory = promised(self._reference, derivative(self._watch, text, 0.0, DIFFERENCE))
        return Caught(
            system=self.name,
            subject=str(self.subject),
            file=self.model.path.name,
            number=number,
            changed=tuple(changed),
            smallest=smallest_caught(theory, lambda change: self._is_caught(changed, change)),
            theory=theory,
        )

    def _is_caught(self, changed: Sequence[Number], change: float) -> bool:
        moved = None
        for factor in (1 + change, 1 - change):
            if moved is None:
                moved = self._watch.accelerations(scaled(self.model.text, changed, factor))
        return moved is not None and bool((compare(self._reference, moved).verdicts != Verdict.AGREES.value).any())


def promised(reference: Reference, slope: Array | None) -> float:
    """The least size of a fault that theory says is caught at some state, by the accelerations' derivative by its size, (n, nv)."""
    if slope is None:
        return math.inf
    with np.errstate(all="ignore"):
        sizes = AGREEMENT * reference.data_roundoff / energy_norm(reference.norm_factor, slope)
    return float(np.nanmin(sizes))


def smallest_caught(theory: float, is_caught: Callable[[float], bool]) -> float:
    """The smallest size that is caught, searched for from what ``theory`` promises; inf where none up to ``FURTHEST`` times that is."""
    if not 0 < theory < math.inf:
        return math.inf
    low, high = theory, theory
    while high < FURTHEST * theory and not is_caught(high):
        low, high = high, 2 * high
    while low == high and is_caught(low / 2):
        low, high = low / 2, low / 2
    if low == high:
        low /= 2
    while high / low > RESOLUTION:
        middle = math.sqrt(low * high)
        low, high = (low, middle) if is_caught(middle) else (middle, high)
    return high if high < FURTHEST * theory else math.inf


def walkable(library: Library, names: Sequence[str], subjects: Sequence[str]) -> list[tuple[str, Subject]]:
    """(system, subject) of all pairs asked for; families by their smallest member, whose numbers are those of all.

    Left out are subjects that read no model, and those of which it is known that no model exists.

    Raises:
        harness.errors.InvalidRequest: a system or subject that does not exist.
    """
    # A file's numbers are one file's: its native subject walks them, unless another is asked for.
    chosen = select_subjects(library, subjects, native_only=True)
    smallest = [members[0] for path in sorted(library.systems.glob("*.py")) if (members := library.names_in(path))]
    systems = library.select(names) if names else smallest
    known = load_expectations(library, [str(subject) for subject in select_subjects(library, ())])
    pairs = [(name, subject) for name in systems for subject in chosen if subject.format != EQUATIONS]
    return [(name, subject) for name, subject in pairs if not why_no_model(library, name, str(subject), subject.format, known)]


def walk(library: Library, name: str, subject: Subject, states: int, seed: int, note: Callable[[str], None]) -> list[Caught]:
    """Every live number of one model, as a task for ``harness.workers``."""
    return list(FaultWalk(library, name, subject, states, seed).caught())
