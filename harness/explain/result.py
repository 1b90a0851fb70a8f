"""The result of a diagnosis, as plain data and as sentences.

The same shape serves changes of a model file and of a textbook parameter.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any

from harness.errors import shown_path
from harness.explain.changes import PARAMETER
from harness.files.text.scan import TextPlace


class Finding(StrEnum):
    """The outcome of a diagnosis."""

    SOUND = "nothing to explain"
    EXPLAINED = "explained"
    UNEXPLAINED = "no single change explains it"
    UNSTABLE = "digits lost"
    NOT_FINITE = "not finite"
    UNDECIDED = "undecided"


@dataclass(frozen=True)
class TriedChange:
    """One change and the error that it leaves.

    Attributes:
        hypothesis: its name, "number" for one number of the file and "parameter" for one of the textbook's.
        statement: what it says here, "" where place and value say all. place: what would change.
        value: the value that explains, or explains best; None for a change without a free value.
        tag: how the place is written now, as ``<inertial mass="1.01">``. shown: what would stand there; "" without a value.
        residual: largest backward error left over all states, also those no fit has seen [data roundoffs].
        explains: true where that agrees.
    """

    hypothesis: str
    statement: str
    place: TextPlace
    value: float | None
    tag: str
    shown: str
    residual: float
    explains: bool

    @property
    def change(self) -> str:
        """The text found there and the one that would explain it, as one phrase."""
        remark = f": {self.statement}" if self.statement else ""
        return f"{self.tag} with {self.shown}{remark}" if self.shown else f"{self.tag}{remark}"

    def as_json(self) -> dict[str, Any]:
        """Plain data: where, what is found, what explains it, and what that leaves."""
        about = asdict(self)
        return {**about.pop("place"), **about}


@dataclass(frozen=True)
class Diagnosis:
    """The result of a diagnosis.

    Attributes:
        file: path of the model or system file. finding: how it ended.
        before: largest backward error as the file is [data roundoffs]; inf where an answer is not finite.
        tried: what was tried and made it less, best first; what explains comes before what does not.
        evaluations: the number it was given. stopped: true where the search used them up.
        live, rank: number of numbers of the file that accelerations feel, and of their combinations that these determine; 0
            where the evaluations ran out before they were counted.
        together: the values whose changes together do what a change of the first does, as the file has them.
    """

    file: Path
    finding: Finding
    before: float
    tried: tuple[TriedChange, ...] = ()
    evaluations: int = 0
    stopped: bool = False
    live: int = 0
    rank: int = 0
    together: tuple[str, ...] = ()

    @property
    def first(self) -> TriedChange | None:
        """The best there is, whether it explains or not."""
        return self.tried[0] if self.tried else None

    @property
    def explaining(self) -> tuple[TriedChange, ...]:
        """The changes that explain, which no acceleration distinguishes here."""
        return tuple(explanation for explanation in self.tried if explanation.explains)

    @property
    def runner_up(self) -> TriedChange | None:
        """The best that does not explain, at another place than the first's."""
        others = (other for other in self.tried if other.place.key != self.tried[0].place.key)
        return next((other for other in others if not other.explains), None)

    @property
    def first_line(self) -> str:
        """One sentence: the place and the value, or why there is none."""
        file, first = shown_path(self.file), self.first
        if self.finding == Finding.EXPLAINED and first is not None:
            if first.hypothesis == PARAMETER:
                said = f"behaves as if {first.place.attribute} = {first.shown} instead of {first.place.found}"
            elif first.shown:
                said = ", ".join(filter(None, [f"{first.tag} explains it with {first.shown}", first.statement]))
            else:
                said = f"{first.tag} explains it: {first.statement}"
            return f"{file}:{first.place.line}: {said} (residual {first.residual:.2g} data roundoffs; before {self.before:.2g})"
        reason = {
            Finding.SOUND: f"nothing to explain: it agrees within {self.before:.2g} data roundoffs",
            Finding.UNSTABLE: f"no single change explains it, and {self.before:.2g} data roundoffs are within what an unstable "
            "factorisation loses: the digits are the engine's",
            Finding.NOT_FINITE: "some answers are not finite, which no fit can explain",
            Finding.UNDECIDED: "no state has a certified acceleration, so there is nothing to fit",
        }.get(self.finding, f"no single change explains it{self._best()}")
        spent = f"; {self._spent}" if self.stopped and self.finding == Finding.UNEXPLAINED else ""
        return f"{file}: {reason}{spent}"

    @property
    def _spent(self) -> str:
        return f"stopped after {self.evaluations} evaluations, of which --evaluations allows more"

    def _best(self) -> str:
        if self.first is None:
            return f", nor makes it less than {self.before:.2g} data roundoffs"
        left, place = f"{self.first.residual:.2g} of {self.before:.2g}", f"line {self.first.place.line}, {self.first.change}"
        return f"; the best leaves {left} data roundoffs: {place}"

    @property
    def lines(self) -> tuple[str, ...]:
        """All sentences: the first line, the changes that explain as well, the runner-up, and the file's base parameters."""
        return (self.first_line, *self._class_lines(), *self._remarks())

    def _class_lines(self) -> Iterable[str]:
        of_place: dict[tuple[int, str, str], TriedChange] = {}
        for explanation in self.explaining:
            of_place.setdefault(explanation.place.key, explanation)
        if len(of_place) > 1:
            yield "explain it as well, and no acceleration here tells them apart:"
            others = list(of_place.values())[1:]
            yield from (f"  line {other.place.line}: {other.change}, residual {other.residual:.2g}" for other in others)

    def _remarks(self) -> Iterable[str]:
        runner_up = self.runner_up
        if runner_up is not None:
            yield f"runner-up: line {runner_up.place.line}, {runner_up.change} leaves {runner_up.residual:.2g} data roundoffs"
        if self.together:
            yield f"what {self.tried[0].tag} does, changes of these do together: {', '.join(self.together)}"
        if self.live:
            yield f"accelerations feel {self.live} numbers of this file, in {self.rank} combinations"
        if self.stopped:
            yield f"{self._spent}; what was not tried by then may explain it as well"

    def as_json(self) -> dict[str, Any]:
        """Plain data; infinite numbers as None."""
        return {
            "file": str(self.file),
            "finding": self.finding.value,
            "before": self.before if self.before < float("inf") else None,
            "explaining": [explanation.as_json() for explanation in self.explaining],
            "first": None if self.first is None else self.first.as_json(),
            "runner_up": None if self.runner_up is None else self.runner_up.as_json(),
            "live": self.live,
            "rank": self.rank,
            "together": list(self.together),
            "evaluations": self.evaluations,
            "stopped": self.stopped,
            "text": list(self.lines),
            "remarks": list(self._remarks()),
        }


def digits_of(value: float | None) -> int:
    """The number of decimal digits that a value needs."""
    return 0 if value is None else len(repr(abs(value)).partition("e")[0].replace(".", "").strip("0"))


def to_four_digits(value: float, start: float) -> float:
    """The value with four digits, or as many more as distinguish it from ``start``: further ones mean nothing where it does not explain."""
    return next(
        (short for digits in range(4, 17) if abs((short := float(f"{value:.{digits}g}")) - value) <= 0.01 * abs(value - start)), value
    )
