"""Everything one cross-check found: records, its systems, parts that scenes do not need, and the causes of what is wrong."""

from __future__ import annotations

import itertools
from collections.abc import Collection
from dataclasses import dataclass, field
from operator import attrgetter
from typing import Any

from harness.results.check_conclusion import conclusion, was_compared, with_short_names, worlds_text
from harness.results.detail import Detail
from harness.results.hard_states import RankedCase
from harness.results.records import ACCELERATIONS, Record
from harness.results.run import StudyResult
from harness.results.table import Column, Table, counted, plural

SUPERFLUOUS = "superfluous part"


@dataclass(frozen=True, kw_only=True)
class SystemCard:
    """One system as a report shows it.

    Attributes:
        description: first line of the system file's docstring; source: its reference.
        coordinates: {"name", "joint"} each; parameters: {"name", "value", "unit"} each.
        equations_mathml: one or more presentation ``<math>`` elements; equations_text: the same in words
            of SymPy. Both are "" where they are too long to be read; then ``energies_text`` has the energies they follow from.
        operations: number of operations of one evaluation.
        derivation_seconds, reference_seconds_per_state: cost of the equations and of certified truth.
        compilation_seconds: of the certified kernel, where a process compiles it for the first time.
    """

    name: str
    description: str
    source: str
    coordinates: list[dict[str, str]]
    parameters: list[dict[str, Any]]
    equations_mathml: str
    equations_text: str
    operations: int
    derivation_seconds: float | None = None
    reference_seconds_per_state: float | None = None
    compilation_seconds: float | None = None
    energies_text: str = ""

    def tables(self) -> tuple[Table, Table]:
        """Coordinates with their joints, and parameters with their values."""
        coordinates = Table(["coordinate", "joint"], [[entry["name"], entry["joint"]] for entry in self.coordinates], "Coordinates")
        rows = [[entry["name"], entry["value"], entry["unit"]] for entry in self.parameters]
        return coordinates, Table(["parameter", Column("value", "plain"), "unit"], rows, "Parameters")


@dataclass(frozen=True)
class SuperfluousPart:
    """A part of a model that its scene does not need.

    ``attribute`` is "" where the element itself is meant, whose name is then the value, and "text" for what
    stands between its tags. It ``fails`` the check in the built-in library, and is a warning elsewhere.
    """

    system: str
    subject: str
    path: str
    line: int
    element: str
    attribute: str
    value: str
    why: str
    fails: bool = True

    def __str__(self) -> str:
        part = {
            "": f"<{self.element} {self.value}>" if self.value else f"<{self.element}>",
            "text": f"<{self.element}>{self.value}</{self.element}>",
        }.get(self.attribute, f'<{self.element} {self.attribute}="{self.value}">')
        return f"{self.path}:{self.line}: {part} {self.why}"


@dataclass(frozen=True, kw_only=True)
class HeldDifference:
    """A quantity that subjects of one system do not hold alike after loading, felt by its motion or not.

    Attributes:
        quantity, joint: what differs, and the joint that it belongs to; "" for none.
        subjects: those that hold it otherwise than most. statement: the values, and how far apart they are.
        places: of the model files, as "path:line".
        reason: why it is expected; "" where it is not, and ``fails`` the check.
    """

    system: str
    quantity: str
    joint: str
    subjects: list[str]
    statement: str
    places: list[str]
    reason: str = ""

    @property
    def fails(self) -> bool:
        return not self.reason

    def __str__(self) -> str:
        expected = f"expected because {self.reason}" if self.reason else ""
        return f"{self.system}: {'; '.join(filter(None, [self.statement, *self.places, expected]))}"


@dataclass(frozen=True, kw_only=True)
class Picture:
    """A system as an ``<svg>`` element."""

    system: str
    svg: str


@dataclass(frozen=True, kw_only=True)
class Cause:
    """The reason why one subject is wrong on one system.

    Attributes:
        system, subject: names.
        inference: what the verdicts of all subjects say together.
        first_line: the answer in one line.
        diagnosed: the subject that was examined: of those that a wrong model makes wrong, its format's own engine.
        found: ``SubjectDiagnosis.as_json``; None without a diagnosis.
    """

    system: str
    subject: str
    inference: str
    first_line: str
    diagnosed: str = ""
    found: dict[str, Any] | None = None

    @property
    def is_shared(self) -> bool:
        """True where the diagnosis is that of another subject, which reads the same file."""
        return self.diagnosed not in ("", self.subject)

    @property
    def terms(self) -> list[str]:
        """A sentence for each term that is wrong."""
        return list(self.found["terms"]["sentences"]) if self.found else []

    @property
    def sides(self) -> list[list[str]]:
        """The diagnosis on the side of the model, where there is one, and on that of the textbook, in lines; or why there is none."""
        if not self.found:
            return [[self.first_line]]
        return [list(side["text"]) for side in (self.found["model"], self.found["textbook"]) if side]

    @property
    def remarks(self) -> list[str]:
        """The lines of the sides that are no part of the answer: runners-up, and what the file's numbers determine."""
        sides = (self.found["model"], self.found["textbook"]) if self.found else ()
        return [line for side in sides if side for line in side.get("remarks", ())]

    @property
    def lines(self) -> list[str]:
        """All of it."""
        return [*self.terms, *(line for side in self.sides for line in side)]

    @property
    def told(self) -> list[str]:
        """The wrong terms and the first line of the diagnosis, below the name of the subject."""
        lines = [*self.terms, *([self.first_line] if self.first_line != self.inference else [])]
        return [f"  {self.subject}: {line}" for line in ([f"as {self.diagnosed}"] if self.is_shared else lines)]

    def told_in_full(self, detail: Detail) -> list[str]:
        """The whole diagnosis below the name of the subject, its remarks where all is told."""
        kept = [line for line in self.lines if detail == Detail.VERBOSE or line not in self.remarks]
        lines = [f"as {self.diagnosed}, which reads the same file"] if self.is_shared else kept
        return ["", self.subject, *(f"  {line}" for line in lines)]


class Causes(list[Cause]):
    """Causes of the records of a cross-check; they print as ``harness check`` tells them."""

    def told(self) -> list[str]:
        """The party at fault in each system, and why each wrong subject is wrong: the wrong terms and the first line of the diagnosis."""
        lines = list[str]()
        for (system, inference), own in itertools.groupby(self, key=attrgetter("system", "inference")):
            lines += ["", f"{system}: {inference}"]
            for cause in own:
                lines += cause.told
        return lines

    def __repr__(self) -> str:
        return "\n".join(self.told()[1:]) or "nothing to explain: every record is as expected"

    __str__ = __repr__


@dataclass(kw_only=True)
class CrossCheckResult(StudyResult):
    """The records of a cross-check with what belongs to them.

    Attributes:
        records: one for each pair of system and subject; systems: what a report shows of each system.
        superfluous: parts of models that their scenes do not need. differs: what subjects do not hold alike after loading.
        causes: why records that are not as expected are wrong.
        worst_cases: of each subject, the worst first.
        pictures: of the systems that an engine can place.
    """

    STUDY = "cross-check"

    records: list[Record] = field(default_factory=list)
    systems: list[SystemCard] = field(default_factory=list)
    superfluous: list[SuperfluousPart] = field(default_factory=list)
    differs: list[HeldDifference] = field(default_factory=list)
    causes: list[Cause] = field(default_factory=list)
    worst_cases: list[RankedCase] = field(default_factory=list)
    pictures: list[Picture] = field(default_factory=list)

    @property
    def as_expected(self) -> bool:
        """True where something was compared, every verdict is the expected one, and nothing of ``faults_of_models`` is found."""
        return was_compared(self.records) and all(record.as_expected for record in self.records) and not self.faults_of_models

    @property
    def faults_of_models(self) -> list[str]:
        """The numbers of superfluous parts and of differences after loading that fail the check, in words."""
        failing, apart = (sum(one.fails for one in found) for found in (self.superfluous, self.differs))
        parts = [counted(failing, SUPERFLUOUS)] if failing else []
        return [*parts, f"{counted(apart, 'difference')} after loading"] if apart else parts

    def conclusion(self, quantities: Collection[str] = (ACCELERATIONS,)) -> str:
        """The findings in one sentence; answers for other quantities than those that were asked for are counted by themselves."""
        others = [one for one in self.records if one.quantity not in quantities and was_compared([one])]
        wrong, warnings = sum(not one.as_expected for one in others), sum(not part.fails for part in self.superfluous)
        further = f"{wrong} of {len(others)} answers for further quantities {plural(wrong, 'differs', 'differ')} unexpectedly"
        parts = [conclusion(with_short_names(one for one in self.records if one.quantity in quantities))]
        parts += filter(None, [worlds_text(self.records)])
        parts += [further if wrong else f"{counted(len(others), 'answer')} for further quantities as expected"] if others else []
        parts += [f"not as expected: {' and '.join(self.faults_of_models)}"] if self.faults_of_models else []
        parts += [f"{counted(warnings, SUPERFLUOUS)} {plural(warnings, 'is a warning', 'are warnings')}"] if warnings else []
        return f"{'; '.join(parts)}."
