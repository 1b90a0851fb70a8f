"""The smallest relative change of each number of a model file that a check catches, beside theory."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

from harness.crosscheck.superfluous import CHANGE
from harness.diagnosis.faults.baseline import MOST_ABOVE_THEORY
from harness.diagnosis.faults.bench import REFUSED, FaultBench
from harness.diagnosis.faults.campaign import number_faults
from harness.engines import Subject
from harness.library import Library
from harness.models.text import Place


@dataclass(frozen=True, kw_only=True)
class SmallestChange:
    """A number of a model file that accelerations depend on, and the smallest relative change of it that is caught.

    Attributes:
        system, subject, file: names.
        place: of the number; statement: what changes with it where physics forbids it to change alone, "" for nothing.
        value: of the number.
        smallest: relative change; inf where none up to ``FURTHEST`` times theory is caught.
        theory: the same from data roundoff and the number's derivative.
    """

    system: str
    subject: str
    file: str
    place: Place
    statement: str
    value: float
    smallest: float
    theory: float

    @property
    def ratio(self) -> float:
        """Ratio of the change that is caught to that of theory."""
        return self.smallest / self.theory

    @property
    def as_in_theory(self) -> bool:
        """True for a ratio of at most ``MOST_ABOVE_THEORY``."""
        return self.ratio <= MOST_ABOVE_THEORY

    @property
    def number(self) -> str:
        """Element and attribute, the place in the attribute, and what changes with it."""
        place = self.place
        index = f"[{place.index}]" if place.index else ""
        return f"{f'{place.element} {place.attribute}'.strip()}{index} {self.statement}".rstrip()

    def as_json(self) -> dict[str, Any]:
        """Plain data: the place of the number, its value, and both changes."""
        about = asdict(self)
        return {**about.pop("place"), **about}


def smallest_changes(
    library: Library, name: str, subject: Subject, states: int, seed: int, note: Callable[[str], None]
) -> list[SmallestChange]:
    """Every number other than 0 of one model, in the order of the file, as a task for ``harness.workers``; raises as ``FaultBench``."""
    bench = FaultBench(library, name, subject.format, states, seed, [str(subject)])
    found = []
    for planted in number_faults(bench.model):
        place = planted.places[0]
        value = float(place.found)
        answer, _ = bench.ask_sized(planted, CHANGE)
        if not value or answer.refused_by in REFUSED or not answer.is_live:
            continue
        smallest, theory, _ = bench.smallest(planted)
        about = {"system": name, "subject": str(subject), "file": bench.model.path.name}
        found.append(SmallestChange(**about, place=place, statement=planted.statement, value=value, smallest=smallest, theory=theory))
    return found
