"""The answer of a comparison: a sentence, the few rows that matter, and where the rest is.

Terminal, page, JSON and notebook have it from here; it is made of records alone.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TypeVar

from harness.results.comparison import FileRecord, FilesComparison, SubjectRecord, names_apart
from harness.results.detail import Detail
from harness.results.readings import FELT, FEW_LINES, Effect, by_effect, explanation, lines_text, reading_lines, share_of_qdd, share_text
from harness.results.switched_on import SwitchedOnRecord, parts_of_judged_kinds, stays_off, switched_on_sentences
from harness.results.table import Table, counted, counted_nouns, error_text, grouped, joined
from harness.verdict import AGREEMENT, Verdict

# Rows of a file, and of each of several files; further ones are counted.
MOST_ROWS, MOST_ROWS_OF_SEVERAL = 11, 3
# Subjects of which the first sentence says why, letters of an engine's message, and inertias in a row.
MOST_REASONS, MOST_LETTERS, MOST_IMPOSSIBLE = 3, 160, 4
_Row = TypeVar("_Row")
MORE = "More: --verbose (sources, lines, every number), --all (every row), --html FILE, --json FILE"


@dataclass(frozen=True)
class Conclusion:
    """The answer to what a command was asked.

    Attributes:
        sentence: the answer. rows: what it rests on, a sentence each, the weightiest first.
    """

    sentence: str
    rows: Sequence[str | Table] = ()


def conclude(found: FilesComparison, file: FileRecord, detail: Detail = Detail.BRIEF) -> Conclusion:
    """Answer of a comparison of a file, with at most ``MOST_ROWS`` rows unless all are asked for."""
    [conclusion] = conclude_alike(found, [file], detail, MOST_ROWS)
    return conclusion


def conclude_alike(found: FilesComparison, files: Sequence[FileRecord], detail: Detail, most: int) -> list[Conclusion]:
    """The same of several files, with at most ``most`` rows; those of which the same is to be said have one conclusion."""
    names = names_apart(one.path for one in found.files)
    told = grouped((_told(found, file, detail, most), names[file.path]) for file in files)
    return [Conclusion(f"{joined(own)}{sentence}", rows) for (sentence, rows), own in told.items()]


def _told(found: FilesComparison, file: FileRecord, detail: Detail, most: int) -> tuple[str, tuple[str, ...]]:
    """The sentence on a file without its name, and the rows."""
    if file.problem:
        return f" cannot be read: {file.problem}.", ()
    subjects = [one for one in found.of(file.path) if not one.aided]
    if not subjects:
        return f": no engine was asked{file.remark and f', for {file.remark}'}.", tuple(_facts(file, (), detail))
    held = found.switched_on_of(file.path)
    subjects = sorted(subjects, key=lambda one: -_weight(one))
    on, left = switched_on_sentences(held, MOST_REASONS)
    reasons = [*(_of_reading(one) for one in _of_what_is_on(held)), *filter(None, (_reason(one, file) for one in subjects))]
    answers = [*on, f"{'With all of it off ' if on else ''}{_who_agrees(subjects)}"]
    off = stays_off(file.left_out, parts_of_judged_kinds(held))
    sentences = [*answers, *([f"Off: {joined(off)}"] if off else []), *_with_remedy(reasons[:MOST_REASONS])]
    rows = [*_rows(found.of(file.path), held, file, detail), *left, *_facts(file, held, detail)]
    shown, others = at_most(rows, detail, most) if most else ([], "")
    return f": {'. '.join(sentences)}.", (*shown, *filter(None, [others]))


def reasons_text(readings: Iterable[Effect]) -> list[str]:
    """A sentence on each of some readings, the largest first and each once, with its share and what to do about the first."""
    once = {one.sentence: one for one in by_effect(readings)}
    return [*_with_remedy([_of_reading(one) for one in once.values()][:MOST_REASONS])]


@dataclass(frozen=True)
class _Reason:
    """Why a subject's answer is not that of the file, in a clause; how much of qdd it is, "" where there is no number; a remedy."""

    clause: str
    share: str = ""
    remedy: str = ""


def _with_remedy(reasons: Sequence[_Reason]) -> Iterator[str]:
    """A sentence for each; the first number says of what it is a part, and the first remedy is told."""
    is_first, is_told = True, False
    for one in reasons:
        share = f" ({share_of_qdd(one.share) if is_first else one.share})" if one.share else ""
        is_first = is_first and not one.share
        yield f"{one.clause}{share}" + (f": {one.remedy}" if one.remedy and not is_told else "")
        is_told = is_told or bool(one.remedy)


def _who_agrees(subjects: Sequence[SubjectRecord]) -> str:
    """Who agrees with the file and with whom, of plain engines."""
    agreeing = [one for one in subjects if one.outcome == Verdict.AGREES]
    losing = [one for one in subjects if one.outcome == "lost digits"]
    differing = [one for one in subjects if one.is_compared and one not in agreeing and one not in losing]
    if not differing:
        right = [*agreeing, *losing]
        if not right:
            return "no engine gives an answer that can be judged"
        return f"{_names(right)} agree{_s(right)} with the file {'but for lost digits' if losing else 'to rounding'}"
    if agreeing or losing:
        return f"{_names([*agreeing, *losing])} agree{_s([*agreeing, *losing])} with the file, and {_names(differing)} {_do(differing)} not"
    if len(differing) == 1:
        return f"{_names(differing)} does not agree with the file"
    if all(one.explained and _felt(one) == _felt(differing[0]) for one in differing):
        return f"{_names(differing)} agree with each other, and not with the file"
    return f"{_names(differing)} disagree with each other and with the file"


def _felt(subject: SubjectRecord) -> set[tuple[str, float | None]]:
    """The readings that move something, of which equal ones make equal answers."""
    return {(one.name, one.alone) for one in subject.readings if one.alone is None or one.alone > FELT or (one.beside or 0.0) > FELT}


def _reason(subject: SubjectRecord, file: FileRecord) -> _Reason | None:
    """Why an answer is not that of the file; None where it is."""
    program, message = subject.program, _short(subject.message or "; ".join(subject.rest))
    if subject.verdict == Verdict.UNSUPPORTED:
        return _Reason(f"{program} refuses the file: {message}{_mend(file)}")
    if subject.another_robot:
        # Readings of which nobody can say how much they move are those after which there is nothing to compare.
        for reading in (one for one in subject.readings if one.size is None):
            return _Reason(f"{program} reads another robot ({reading.sentence})", remedy=reading.remedy)
        return _Reason(f"{program} reads another robot: {_short(subject.another_robot)}")
    if subject.verdict == Verdict.ERROR:
        return _Reason(f"{program} fails on the file: {message}{_mend(file)}")
    if subject.verdict == Verdict.UNDECIDED:
        return _Reason(f"{program} cannot be judged: {message}")
    if not subject.explained:
        return _Reason(f"No known reading explains {program}", share_text(subject.relative_error))
    if subject.outcome == "lost digits":
        return _Reason(f"{program} loses digits", share_text(subject.relative_error))
    if subject.verdict == Verdict.AGREES or not subject.readings:
        return None
    return _of_reading(by_effect(subject.readings)[0])


def _mend(file: FileRecord) -> str:
    """Advice on inertias that no body can have, which engines refuse."""
    lines, included = [one.line for one in file.impossible if not one.file], [one.place for one in file.impossible if one.file]
    where = ", ".join([*([lines_text(lines, FEW_LINES)] if lines else []), *included[:FEW_LINES]])
    return f"; write inertias that a body can have ({where})" if where else ""


def _of_reading(reading: Effect) -> _Reason:
    return _Reason(reading.sentence, share_text(reading.size), reading.remedy)


def _of_what_is_on(held: Sequence[SwitchedOnRecord]) -> list[Effect]:
    """The readings of what is on that move accelerations, the largest first and each once."""
    once = {one.sentence: one for one in by_effect(one for record in held for one in record.readings)}
    return [one for one in once.values() if one.size is None or one.size > FELT]


def _rows(subjects: Sequence[SubjectRecord], held: Sequence[SwitchedOnRecord], file: FileRecord, detail: Detail) -> Iterator[str]:
    """Rows on the engines' readings of the file, the largest effect first, and on what no body can have."""
    plain = [one for one in subjects if not one.aided]
    # What was answered is not the user's own file.
    yield from (f"{one.program}: {note.partition(': ')[0]}" for one in plain for note in one.notes)
    # Versions of one engine have readings in common, and those are told once.
    readings = [*(reading for one in plain for reading in one.readings), *(reading for one in held for reading in one.readings)]
    yield from reading_lines({reading.sentence: reading for reading in readings}.values(), detail)
    agreeing = [one for one in plain if one.outcome == Verdict.AGREES and one.backward_error is not None and not one.readings]
    if agreeing:
        worst = error_text(max(one.backward_error or 0.0 for one in agreeing))
        yield f"{_names(agreeing)} agree{_s(agreeing)} to {worst} data roundoffs, of which {AGREEMENT:g} are allowed"
    for one in plain:
        yield from _further(one)
    yield from _when_supplied(subjects)
    yield from _impossible(file, detail)


def _further(subject: SubjectRecord) -> Iterator[str]:
    """Rows on a subject besides its readings."""
    program = subject.program
    if subject.verdict in (Verdict.UNSUPPORTED, Verdict.ERROR) and len(subject.message) > MOST_LETTERS:
        yield f"{program} says: {subject.message}"
    if subject.expected:
        yield f"{program}: {subject.marked}"
    # Of a refusal the first sentence is about the body that it names; what is impossible has a row of its own.
    rest = subject.rest[:1] if subject.verdict == Verdict.UNSUPPORTED else subject.rest
    yield from (f"{program}: {sentence}" for sentence in rest)
    if subject.lost_digits:
        yield f"{program}: {subject.lost_digits}"
    if subject.cancels:
        yield f"{program}: {explanation(subject.readings)} cancel one another, and the answer is that of the file"


def _when_supplied(subjects: Sequence[SubjectRecord]) -> Iterator[str]:
    """Rows on how far the readings account for the answers, and on aided engines."""
    accounted = [one for one in subjects if not one.aided and one.explained and one.left is not None and one.verdict != Verdict.AGREES]
    aided = [one for one in subjects if one.aided]
    right = [one for one in aided if one.outcome == Verdict.AGREES]
    if accounted:
        left = error_text(max(one.left or 0.0 for one in accounted))
        same = "they do" if len(right) > 1 else "it does"
        who = same if _names(right) == _names(accounted) else f"{_do(right)} {_names(right)}"
        also = f"; so {who} when supplied with what {'their readers leave' if len(right) > 1 else 'its reader leaves'} out" if right else ""
        yield f"With these readings {_names(accounted)} agree{_s(accounted)} to {left} data roundoffs{also}"
    for one in aided:
        if one not in right and one.outcome not in ("refused", "lost digits"):
            why = explanation(one.readings) or one.message or "; ".join(one.rest)
            yield f"{one.program}, supplied with what its reader leaves out: {one.outcome}{why and f' ({why})'}"


def _impossible(file: FileRecord, detail: Detail) -> Iterator[str]:
    if file.impossible:
        named = [f"{one.body} ({one.what}, {one.place})" for one in file.impossible]
        shown, others = at_most(named, detail, MOST_IMPOSSIBLE)
        yield f"{counted(len(named), 'inertia')} that no body can have: {', '.join([*shown, *filter(None, [others])])}"


def _facts(file: FileRecord, held: Sequence[SwitchedOnRecord], detail: Detail) -> Iterator[str]:
    """Rows on what the file holds, and on what of it was not compared."""
    mimics = f" ({file.followers} of them mimic{'s' * (file.followers == 1)} another)" if file.followers else ""
    freedom = counted_nouns(file.degrees_of_freedom, "degrees of freedom")
    what = f"{counted_nouns(file.bodies, 'bodies')}, {counted(file.joints, 'joint')}{mimics}, {freedom}"
    undecided = f", of which {file.undecided} have no certain accelerations" if file.undecided else ""
    yield f"{what}, {file.total_mass:.6g} kg; {counted(file.states, 'state')}{undecided}"
    if file.base:
        yield file.base
    judged = {what for record in held for what in record.judged}
    left_out = [one for one in file.left_out if one.what not in judged]
    if detail == Detail.ALL:
        for one in left_out:
            bearing = "would move it" if one.bears_on_motion else "no acceleration feels it at given tau"
            yield f"Not compared: {one.what}, {len(one.lines)}, {lines_text(one.lines)}: {'; '.join([bearing, *one.beside_tau])}"
        return
    felt = [f"{one.what} ({len(one.lines)})" for one in left_out if one.bears_on_motion or one.beside_tau]
    others = sum(len(one.lines) for one in left_out if not one.bears_on_motion and not one.beside_tau)
    if felt or others:
        still = f"{counted(others, 'element')} that {'moves' if others == 1 else 'move'} nothing"
        yield f"Not compared: {', '.join([*felt, *([still] if others else [])])}"


def at_most(rows: Sequence[_Row], detail: Detail, most: int) -> tuple[list[_Row], str]:
    """So many rows, and words that count the others; all of them where more is asked for."""
    if detail > Detail.BRIEF or len(rows) <= most:
        return list(rows), ""
    return list(rows[: most - 1]), f"{len(rows) - most + 1} more (--all)"


def _weight(subject: SubjectRecord) -> float:
    """By which subjects are told: what nobody explains first, then by what their readings move."""
    if not subject.explained:
        return math.inf
    return max((one.size or 0.0 for one in subject.readings), default=0.0)


def _names(subjects: Sequence[SubjectRecord]) -> str:
    return joined(sorted(one.program for one in subjects))


def _s(subjects: Sequence[SubjectRecord]) -> str:
    return "s" if len(subjects) == 1 else ""


def _do(subjects: Sequence[SubjectRecord]) -> str:
    return "does" if len(subjects) == 1 else "do"


def _short(message: str) -> str:
    """A message of an engine, as much of it as a sentence bears."""
    return message if len(message) <= MOST_LETTERS else f"{message[:MOST_LETTERS].rsplit(' ', 1)[0].rstrip(',;:')} ..."
