"""Changes that a new version of an engine makes, as plain data, and in sentences: whether it changes anybody's robot comes first."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import Annotated

from harness.files.findings import LeftOut
from harness.results.comparison import names_apart
from harness.results.detail import Detail, telling
from harness.results.readings import share_text
from harness.results.records import Record
from harness.results.table import Column, TableOf, counted, error_text, first_of, grouped, number_text
from harness.results.trend import MESSAGE, TIME, RunChange
from harness.results.trend_numbers import MEDIAN, PERCENTILE_99, WORST
from harness.verdict import AGREEMENT, DEPARTS, SOUND, Verdict

ACCELERATIONS, READING, TERMS, NUMBERS = "accelerations", "reading", "terms", "compiled numbers"
# Of contacts: where they are; which forces belong to them; and how near to these the solver ends.
CONTACT_POINTS, CONTACT_LAW, CONTACT_SOLVER = "contact points", "law of contacts", "solver of contacts"
_OF_CONTACTS = (CONTACT_POINTS, CONTACT_LAW, CONTACT_SOLVER)
# Kinds of changes that say nothing of a motion by themselves.
_ERRORS, _MINOR = (MEDIAN, PERCENTILE_99, WORST), (TIME, WORST, MESSAGE)
# Objects, lines and systems that are named; the others are counted.
_MOST_NAMED, _MOST_ROWS = 4, 8
# What is asked about.
FILE, MECHANISM = "file", "mechanism"


@dataclass(frozen=True, kw_only=True)
class CompiledChange:
    """A number that two versions of an engine hold otherwise after loading the same file.

    Attributes:
        quantity, part: the engine's own names, as "actuator_biasprm" and "[2]". owners: the objects of which all this is so.
        before, now: None where a version has no such object. size: of the difference, relative to the larger, or to the length of what
            it is a component of; infinite where a word changed, or an object came or went.
        felt: whether the accelerations that are compared may feel it.
    """

    system: str
    subject: str
    quantity: str
    part: str
    owners: list[str]
    before: float | str | None
    now: float | str | None
    size: float
    felt: bool

    @property
    def name(self) -> Annotated[str, Column("compiled number")]:
        """The quantity with its part and its owners."""
        return " ".join(filter(None, [f"{self.quantity}{self.part}", "of" * any(self.owners), _named(self.owners)]))

    @property
    def old(self) -> Annotated[str, Column("before", "plain")]:
        return self._text(self.before)

    @property
    def new(self) -> Annotated[str, Column("now", "plain")]:
        return self._text(self.now)

    @property
    def change(self) -> Annotated[str, Column("change", "plain")]:
        return share_text(self.size) if math.isfinite(self.size) else ""

    def _text(self, value: float | str | None) -> str:
        """A value with as many digits as show the change."""
        if not isinstance(value, float):
            return value or "nothing"
        digits = 3 - math.floor(math.log10(self.size)) if 0 < self.size < 1 else 3
        return min(number_text(value), f"{value:.{digits}g}", key=len)


_named = partial(first_of, most=_MOST_NAMED)
compiled_table = TableOf(CompiledChange, "name old new change", "Compiled numbers")


def _by_up_to(size: float) -> str:
    return f"by up to {share_text(size)}"


@dataclass(frozen=True, kw_only=True)
class Asked:
    """One mechanism or file in one format, as both versions answer for it.

    Attributes:
        before, now: the records of the versions. changes, numbers: from the one to the other. left_out: what of the file no version was
            asked about. actuators: of the file, how many were on. has_numbers: whether the numbers that both hold are known.
    """

    before: Record
    now: Record
    changes: Sequence[RunChange] = ()
    numbers: Sequence[CompiledChange] = ()
    left_out: Sequence[LeftOut] = ()
    actuators: int = 0
    has_numbers: bool = False

    @property
    def is_compared(self) -> bool:
        """True where a version answered."""
        return any(one.verdict not in (Verdict.UNSUPPORTED, Verdict.ERROR) for one in (self.before, self.now))

    @cached_property
    def _felt(self) -> Sequence[RunChange]:
        """The changes that are more than cost, words and rounding: errors of answers that agree before and now are that."""
        agrees = self.before.verdict == self.now.verdict and self.now.verdict in SOUND
        return [change for change in self.changes if change.what not in (*_MINOR, *(_ERRORS if agrees else ()))]

    @property
    def rounding(self) -> Sequence[RunChange]:
        """Changes of the median error of answers that agree before and now."""
        return [change for change in self.changes if change.what == MEDIAN and change not in self._felt]

    @property
    def is_worse(self) -> bool:
        return any(change.is_worse for change in self._felt)

    @property
    def is_better(self) -> bool:
        """True where what the accelerations feel became better, and nothing became worse."""
        return not self.is_worse and any(change.is_better for change in self._felt)

    @property
    def is_changed(self) -> bool:
        return bool(self.numbers or self._felt)

    @property
    def is_open(self) -> bool:
        """True where something changed of which no truth says whether it is right now."""
        unjudged = any(not number.felt for number in self.numbers)
        return unjudged or (self.is_changed and not self.is_worse and not self.is_better)

    @property
    def moved(self) -> float:
        """The largest relative change of accelerations; 0 where they are the same to rounding."""
        return max((change.size or 0.0 for change in self.changes if change.what == ACCELERATIONS), default=0.0)

    @property
    def size(self) -> float:
        """By which pairs are sorted: the largest relative change of anything."""
        return max([self.moved, *(number.size for number in self.numbers if math.isfinite(number.size))], default=0.0)


@dataclass(kw_only=True)
class Upgraded:
    """Two versions of an engine on the same mechanisms or files.

    Attributes:
        engine: as its authors write it. before, now: the versions. noun: ``FILE`` or ``MECHANISM``. asked: by
            system and format.
    """

    engine: str
    before: str
    now: str
    noun: str
    asked: Sequence[Asked] = field(default_factory=list)

    @cached_property
    def _names(self) -> Mapping[str, str]:
        return names_apart(one.now.system for one in self.asked)

    @property
    def left_out(self) -> Mapping[str, Sequence[tuple[str, LeftOut]]]:
        """Parts that bear on motion and were not asked about, with the name of each file that has them."""
        found = dict.fromkeys((self._names[one.now.system], part) for one in self._compared for part in one.left_out)
        return grouped((part.what, (name, part)) for name, part in found)

    def is_fine(self, allows_left_out: bool) -> bool:
        """True where something was compared, nothing became worse or otherwise without a judge, and nothing was left out unasked."""
        changed = any(one.is_worse or one.is_open for one in self.asked)
        return bool(self._compared) and not changed and (allows_left_out or not self.not_compared)

    @cached_property
    def _compared(self) -> Sequence[Asked]:
        return [one for one in self.asked if one.is_compared]

    @property
    def plain(self) -> dict[str, object]:
        """The answer as plain data, for a JSON file."""
        left_out = [{"name": name, "what": part.what, "lines": part.lines} for those in self.left_out.values() for name, part in those]
        numbers = [number for one in self.asked for number in one.numbers]
        return {"summary": self.headline, "compiled": numbers, "not_compared": left_out}

    @property
    def headline(self) -> str:
        """Answer whether the new version changes what was asked about, in a sentence."""
        compared, engine = self._compared, f"{self.engine} {self.now}"
        if not compared:
            about = _named(self._unanswered)
            return f"Nothing was compared: neither {self.engine} {self.before} nor {self.now} answers about {about}"
        of = grouped((one.now.system, one) for one in compared)
        changed = {system: those for system, those in of.items() if any(one.is_changed for one in those)}
        if not changed:
            known = {one.has_numbers for one in compared}
            same = "accelerations and compiled numbers are" if known == {True} else "accelerations are"
            same = "accelerations, and compiled numbers where both versions read the file, are" if len(known) > 1 else same
            none = f"does not change {self._names[next(iter(of))]}" if len(of) == 1 else f"changes none of {counted(len(of), self.noun)}"
            return f"No: {engine} {none} against {self.before}{self._on}; {same} the same to rounding"
        those = [one for found in changed.values() for one in found]
        better = all(one.is_better and not one.is_open for one in those)
        how = ", for the worse" if any(one.is_worse for one in those) else ", for the better" if better else ""
        names = _named([self._names[system] for system in changed])
        which = f"{names} against {self.before}"
        if len(of) > 1:
            which = f"{len(changed)} of {counted(len(of), self.noun)} against {self.before} ({names})"
        return f"Yes{how}: {engine} changes {which}{self._on}: {self._what(those)}"

    @property
    def _on(self) -> str:
        """A clause on elements that act besides the equations of motion; "" where none does."""
        numbers = {one.now.system: one.actuators for one in self._compared if one.actuators}
        of = "" if self._is_of_one else f" of {counted(len(numbers), self.noun)}"
        return f", with {counted(sum(numbers.values()), 'actuator')}{of} on" if numbers else ""

    @property
    def _unanswered(self) -> list[str]:
        """The names of those about which neither version answers in any format."""
        answered = {one.now.system for one in self._compared}
        return list(dict.fromkeys(self._names[one.now.system] for one in self.asked if one.now.system not in answered))

    def _what(self, changed: Sequence[Asked]) -> str:
        """The changes, the largest of each kind."""
        moved = max(one.moved for one in changed)
        numbers = [number for one in changed for number in one.numbers]
        parts = [f"accelerations {_by_up_to(moved)}"] if moved else []
        if numbers:
            numbers = telling(sorted(numbers, key=lambda one: -one.size), lambda one: one.size)[0]
            by = f" {_by_up_to(numbers[0].size)}" if math.isfinite(numbers[0].size) else ""
            parts.append(f"compiled numbers{by} ({_named(list(dict.fromkeys(one.quantity for one in numbers)))})")
        touching = [change for one in changed for change in one.changes if change.what in _OF_CONTACTS]
        for what in _OF_CONTACTS:
            if own := [change for change in touching if change.what == what]:
                parts.append(f"{what} ({max(own, key=lambda change: change.size or 0.0).now})")
        others = [one for one in changed if one.before.verdict != one.now.verdict and not one.moved]
        verdicts = [f"from {old} to {new}" for old, new in dict.fromkeys((one.before.verdict, one.now.verdict) for one in others)]
        parts += [_named(verdicts)] if verdicts else []
        unfelt = "; the accelerations that are compared are the same to rounding"
        return f"{' and '.join(parts) or 'what stands below'}{unfelt if numbers and not moved and not others and not touching else ''}"

    @property
    def not_compared(self) -> str:
        """Parts that no version was asked about, in a sentence; "" where there are none."""
        parts = []
        for what, where in self.left_out.items():
            if self._is_of_one:
                lines = sorted(line for _, part in where for line in part.lines)
                parts.append(f"{what}, {'line' if len(lines) == 1 else 'lines'} {_named([str(line) for line in lines])}")
            else:
                parts.append(f"{what} of {counted(len({name for name, _ in where}), self.noun)}")
        # Of a library's mechanisms it says itself which an engine cannot express.
        if self._unanswered and self._compared and self.noun == FILE:
            parts.append(f"neither version answers about {_named(self._unanswered)}")
        return f"not compared: {'; '.join(parts)}" if parts else ""

    @property
    def _is_of_one(self) -> bool:
        return len(self._names) == 1

    def lines(self, allows_left_out: bool, detail: Detail = Detail.BRIEF) -> Iterator[str]:
        """The whole answer: whether anything changed, what was not compared, and each change, what became worse first."""
        yield self.headline
        if self.not_compared:
            exit_status = "" if allows_left_out else " (exit status 1; --allow-uncompared accepts it)"
            yield f"{self.not_compared}{exit_status}"
        told = [one for one in self.asked if one.is_changed or (detail > Detail.BRIEF and one.changes)]
        told.sort(key=lambda one: (not one.is_worse, not one.is_open, -one.size, one.now.system))
        said_of = grouped(((one.now.subject, *self._of(one, detail)), self._names[one.now.system]) for one in told)
        for (subject, *lines), names in said_of.items():
            yield from ("", f"{_named(names)}, {subject}: {lines[0]}", *lines[1:])
        grown = [change for one in self.asked for change in one.rounding if change.is_worse]
        if grown:
            most = max(grown, key=lambda change: float(change.now))
            said = f"{self._names[most.system]} from {most.before} to {most.now} data roundoffs; up to {AGREEMENT:g} agrees"
            yield from ("", f"rounding: the median error of {len(grown)} of {len(self.asked)} grew, the largest that of {said}")

    def _of(self, one: Asked, detail: Detail) -> Iterator[str]:
        """Lines on one, of which the first is a word."""
        yield "worse" if one.is_worse else "changed" if one.is_open else "better" if one.is_better else "unchanged"
        if one.before.verdict != one.now.verdict or one.before.verdict not in SOUND:
            yield f"  {self.now} {_outcome(one.now)}; {self.before} {_outcome(one.before)}"
        yield from (f"  {line}" for change in one.changes for line in self._told(change, detail))
        if one.numbers:
            rows = sorted(one.numbers, key=lambda row: -row.size)
            if detail == Detail.BRIEF:
                # Of an object the part that changed most stands for the others.
                most = [those[0] for those in grouped(((row.quantity, *row.owners), row) for row in rows).values()]
                kept = [telling([row for row in most if row.felt == felt], lambda row: row.size)[0] for felt in (True, False)]
                rows = sorted(itertools.chain(*kept), key=lambda row: -row.size)[:_MOST_ROWS]
            yield from (f"  {line}" for line in str(compiled_table(rows)).split("\n"))
            if fewer := len(one.numbers) - len(rows):
                yield f"  {fewer} more that changed less (--all)"

    def _told(self, change: RunChange, detail: Detail) -> Iterator[str]:
        if change.what == ACCELERATIONS:
            yield f"accelerations move by up to {change.now}"
        elif change.what == NUMBERS:
            yield f"{change.what} {change.now}"
        elif change.what in _OF_CONTACTS:
            yield f"{change.what} changed: {change.now}"
        elif change.what in (READING, TERMS) and change.is_better:
            yield f"no longer: {change.before}"
        elif change.what in (READING, TERMS):
            yield f"new: {change.now}"
        elif (change.what == TIME and detail == Detail.VERBOSE) or (change.what in (*_ERRORS, MESSAGE) and detail > Detail.BRIEF):
            yield f"{change.what}: {change.now}, it was {change.before}"


def _outcome(record: Record) -> str:
    """Outcome of a version, in a few words."""
    error = f" by up to {error_text(record.backward_error)} data roundoffs" if record.backward_error is not None else ""
    said = {
        Verdict.AGREES: f"agrees (worst {error_text(record.backward_error)} data roundoffs)" if error else "agrees",
        Verdict.UNSTABLE: f"loses digits{error}",
        Verdict.DISAGREES: f"is off{error}",
        Verdict.EXPLAINED: DEPARTS if record.outcome == DEPARTS else "answers as its reader reads the file, not as the file says",
        Verdict.UNDECIDED: "answers, and the truth is undecided",
        Verdict.UNSUPPORTED: f"refuses it: {record.message}",
        Verdict.ERROR: f"fails: {record.message}",
    }
    return said.get(Verdict(record.verdict), f"{record.verdict}{error}")
