"""An engine with all elements of a file on that are judged, as plain data and in sentences."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace

from harness.files.findings import CONTACTS, FRICTION, SWITCHED_OFF, LeftOut
from harness.results.readings import FELT, FEW_LINES, Effect, by_effect, explanation, lines_text, names_of, share_of_qdd, share_text
from harness.results.shapes import ShapesRecord
from harness.results.table import counted_nouns, error_text, grouped, joined, program_name
from harness.verdict import DEPARTS, Verdict


@dataclass(frozen=True, kw_only=True)
class SwitchedOnPart:
    """One element of a file that an engine is asked with.

    Attributes:
        what: as of ``LeftOut``. kind: its tag. why_not: why the engine's answer is not judged with it; "" where it is.
        alone: largest change of qdd where the engine has it on alone, relative in the energy norm; None where nobody asked.
    """

    what: str
    kind: str
    line: int
    why_not: str = ""
    alone: float | None = None

    @property
    def moves(self) -> str:
        """The effect in words, as the engine itself has it."""
        if self.alone is None:
            return ""
        return f"alone it moves the engine's qdd by {share_text(self.alone)}" if self.alone > FELT else "alone it moves no acceleration"


@dataclass(frozen=True, kw_only=True)
class SwitchedOnRecord:
    """An engine on a file with all elements on that are judged; the others are off.

    Attributes:
        verdict: against the law that the engine documents for what its readings make of the file; "" where no answer is judged.
        message: why some or all of it is not judged, where no part says it.
        states, touching: how many are judged, and at how many of them bodies touch and the truth is decided.
        backward_error: [data roundoffs], the worst. relative_error: of qdd there; None where it says nothing.
        together: largest change of qdd by those that are judged.
        departures: where the engine's program leaves the law that it documents, each with what it does; backward errors are then
            against what it is known to compute.
        to_the_end: backward error where the engine's solver goes on until nothing changes, asked where by the file's settings it does
            not agree; None elsewhere. remedy: what its user sets for that. fault: as of ``harness.engines.request.Ending``.
        readings: what the engine's reader makes of these elements otherwise than the file says.
        left: where the solver stops as it is documented to, and nobody can set that: what it leaves, as a share of what it may. None
            elsewhere; ``remedy`` says what its user can do.
        rest: what is known of an answer that nothing explains, a sentence each.
        shapes: the contacts that it finds against those of the file; None where these are not judged.
    """

    path: str
    engine: str
    format: str
    parts: list[SwitchedOnPart]
    verdict: str = ""
    explained: bool = True
    backward_error: float | None = None
    relative_error: float | None = None
    together: float | None = None
    states: int = 0
    touching: int = 0
    message: str = ""
    title: str = ""
    to_the_end: float | None = None
    remedy: str = ""
    fault: str = ""
    left: float | None = None
    departures: list[Effect] = field(default_factory=list)
    readings: list[Effect] = field(default_factory=list)
    rest: list[str] = field(default_factory=list)
    shapes: ShapesRecord | None = None

    @property
    def program(self) -> str:
        return program_name(self.engine, self.title)

    @property
    def subject(self) -> str:
        return f"{self.engine}/{self.format}"

    def with_shapes(self, shapes: ShapesRecord) -> SwitchedOnRecord:
        """The same with its contacts judged, whose verdict is its own where they are not those of the file."""
        found = replace(self, shapes=shapes)
        return replace(found, verdict=shapes.verdict, explained=False, rest=[*self.rest, *shapes.rest]) if shapes.rest else found

    @property
    def judged(self) -> dict[str, list[SwitchedOnPart]]:
        """The elements with which the answer is judged, by what they are."""
        return grouped((part.what, part) for part in self.parts if not part.why_not) if self.verdict else {}

    @property
    def named(self) -> str:
        """ "2 equalities, 6 actuators and contacts", "equality" of one alone."""
        named = joined([counted_parts(len(own), what) for what, own in self.judged.items()])
        return named.removeprefix("1 ").removesuffix(" in 1 place") if self.is_single else named

    @property
    def is_single(self) -> bool:
        return CONTACTS not in self.judged and sum(map(len, self.judged.values())) == 1

    @property
    def misses_optimum(self) -> str:
        """Error that the solver leaves by the file's settings, a clause behind the engine's name; "" where it leaves none."""
        if self.left is not None:
            far, share = error_text(self.backward_error), f"by {share_text(self.left)} of the tolerance that it documents"
            return f"stops its solver {far} data roundoffs before the solution that it documents, {share}"
        if self.to_the_end is None:
            return ""
        left, ended = error_text(self.backward_error), error_text(self.to_the_end)
        if self.fault:
            return f"ends {left} data roundoffs beside the solution that it documents, and {ended} with other settings. {self.fault}"
        return f"stops its solver {left} data roundoffs before the solution that it documents, and {ended} where it goes on to the end"

    @property
    def is_felt(self) -> bool:
        """True for an answer that is another than without what is on, or than the file says, or that nobody explains."""
        moves = (self.together or 0.0) > FELT or self.touching > 0
        return not self.explained or bool(self.departures or names_of(self.readings)) or moves


def counted_parts(number: int, what: str) -> str:
    """ "6 actuators", "dry friction in 2 places", "contacts"."""
    if what == CONTACTS:
        # Of shapes that may touch.
        return what
    return f"{what} in {counted_nouns(number, 'places')}" if what == FRICTION else counted_nouns(number, what)


def switched_on_text(record: SwitchedOnRecord, many: bool = False) -> str:
    """The answer of an engine with all on that is judged, a clause behind its name, or behind those of ``many`` that answer alike."""
    if not record.verdict:
        return "; ".join(filter(None, [record.message, explanation(record.readings)])) or "is not judged"
    if record.shapes is not None and record.shapes.rest:
        return f"{'find' if many else 'finds'} {record.shapes.text}"
    remedy = f": {record.remedy}" if record.remedy else ""
    if record.misses_optimum:
        return f"{record.misses_optimum}{remedy}"
    if record.departures and record.explained:
        first, *more = by_effect(record.departures)
        others = "".join(f", and {one.name} {share_text(one.size)}" for one in more)
        moved = f"by {share_of_qdd(share_text(first.size))} ({first.concerned(FEW_LINES)}{others})"
        return f"{DEPARTS} {moved}. {first.sentence}: {first.remedy}"
    agree, are, their = ("agree", "are", "their") if many else ("agrees", "is", "its")
    if record.verdict == Verdict.ERROR:
        return f"{'give' if many else 'gives'} no finite acceleration at some states, where {their} documentation has one"
    off = "" if record.relative_error is None else f", {share_of_qdd(share_text(record.relative_error))},"
    verb = f"{agree} with" if record.explained else f"{are} {error_text(record.backward_error)} data roundoffs{off} away from"
    what = f"the file as {their} readings have it" if names_of(record.readings) else f"{their} documentation"
    without = f"without {'it' if record.is_single else 'them'}"
    moved = f", {share_of_qdd(share_text(record.together))} away from the file {without}" if (record.together or 0.0) > FELT else ""
    return f"{verb} {what}{moved}{remedy}"


def switched_on_sentences(records: Sequence[SwitchedOnRecord], most: int) -> tuple[list[str], list[str]]:
    """Answers of engines with all on that is judged, where that is felt, those first that nobody explains; and rows on the rest of it.

    At most so many sentences; engines of which the same is to be said have one.
    """
    told = sorted((one for one in records if one.verdict or not one.explained), key=lambda one: one.explained)
    said = grouped(((with_those_on(one), switched_on_text(one)), one) for one in told)
    sentences = [f"{on}{joined([one.program for one in own])} {switched_on_text(own[0], len(own) > 1)}" for (on, _), own in said.items()]
    felt = [any(one.is_felt for one in own) for own in said.values()]
    shown = [one for one, is_felt in zip(sentences, felt, strict=True) if is_felt][:most]
    rest = [f"{one.program}: {sentence}" for one in told for sentence in one.rest]
    return shown, [*(one for one in sentences if one not in shown), *rest]


def with_those_on(record: SwitchedOnRecord) -> str:
    """ "With the file's 6 actuators on "; "" where it is judged with none."""
    return f"With the file's {record.named} on " if record.named else ""


def stays_off(left_out: Sequence[LeftOut], judged: Sequence[SwitchedOnPart]) -> list[str]:
    """Parts of a file that would move it and are off in every answer; of what is judged in part, with lines and reason.

    ``judged``: the elements of all kinds of which some are judged.
    """
    refused = grouped(((part.what, part.why_not), part.line) for part in _refused(judged))
    lines = {key: list(dict.fromkeys(own)) for key, own in refused.items()}
    parts = [f"{counted_parts(len(own), what)} ({lines_text(own, FEW_LINES)}: it {why})" for (what, why), own in lines.items()]
    return [*_whole_kinds(left_out, judged), *parts]


def names_off(left_out: Sequence[LeftOut], judged: Sequence[SwitchedOnPart]) -> list[str]:
    """The same without lines and reasons."""
    return [*_whole_kinds(left_out, judged), *dict.fromkeys(f"some {part.what}" for part in _refused(judged))]


def parts_of_judged_kinds(records: Iterable[SwitchedOnRecord]) -> list[SwitchedOnPart]:
    """The elements of the kinds that each answer is judged with."""
    return [part for record in records for part in record.parts if part.what in record.judged]


def _whole_kinds(left_out: Sequence[LeftOut], judged: Sequence[SwitchedOnPart]) -> list[str]:
    kinds = {part.what for part in judged}
    return [part.what for part in left_out if part.bears_on_motion and part.what not in kinds]


def _refused(judged: Sequence[SwitchedOnPart]) -> list[SwitchedOnPart]:
    return [part for part in judged if part.why_not not in ("", SWITCHED_OFF)]
