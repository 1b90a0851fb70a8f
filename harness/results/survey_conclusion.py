"""The answer of a survey: how many robots every engine agrees on, a line for each engine, and what changed since earlier surveys."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence

from harness.results.comparison import FileRecord, FilesComparison, PairRecord, SubjectRecord
from harness.results.conclusion import Conclusion
from harness.results.pair_conclusion import conclude_pair
from harness.results.readings import MOST_IN_CELL, explanation, names_of, share_of_qdd, share_text
from harness.results.switched_on import SwitchedOnRecord, names_off, parts_of_judged_kinds
from harness.results.table import counted, first_of, grouped, joined
from harness.verdict import Verdict

# Reasons in the line of an engine.
MOST_COUNTED = 4
# A relative change of accelerations that matters to users.
MOVED = 0.01
# What is said of so many robots, the gravest first; of one, and of several.
_UNREAD, _UNEXPLAINED, _REFUSED, _UNASKED, _OTHERWISE, _STILL, _AGREES = (
    ("{} cannot be read", "{} cannot be read"),
    ("{} has an answer that no known reading explains", "{} have an answer that no known reading explains"),
    ("{} is not answered by every engine", "{} are not answered by every engine"),
    ("no engine of the run reads {}", "no engine of the run reads {}"),
    ("on {} an engine differs from the file for a known reason", "on {} an engine differs from the file for a known reason"),
    ("{} holds nothing that moves", "{} hold nothing that moves"),
    ("every engine agrees on {}", "every engine agrees on {}"),
)
_ORDER = (_UNREAD, _UNEXPLAINED, _REFUSED, _UNASKED, _OTHERWISE, _STILL, _AGREES)


def conclude_survey(found: FilesComparison) -> Conclusion:
    """Answer of a survey of many robots, and a line for each engine."""
    counts = Counter(_state(found, file) for file in found.files)
    parts = [state[counts[state] > 1].format(counts[state]) for state in _ORDER if counts[state]]
    sentences = [f"{counted(len(found.files), 'robot')}: {'; '.join(parts) or 'no file is one'}", *_switched_on(found)]
    return Conclusion(f"{'. '.join(sentences)}.", [*_engines(found)])


def _switched_on(found: FilesComparison) -> Iterator[str]:
    """Sentences on the answers with all on that is judged, and on what stays off, with the number of robots that have it."""
    held = [one for one in found.switched_on if one.verdict]
    if held:
        whats = joined(list(dict.fromkeys(what for one in held for what in one.judged)))
        moved = len({one.path for one in held if (one.together or 0.0) > MOVED})
        by = f"they move qdd by more than {share_text(MOVED)} on {counted(moved, 'robot')}"
        yield f"With {whats} on, {', '.join(_of_what_is_held(held))}; {by}"
    off = Counter(what for file in found.files for what in names_off(file.left_out, parts_of_judged_kinds(found.switched_on_of(file.path))))
    if off:
        yield f"Off: {', '.join(f'{what} ({count})' for what, count in off.most_common())}"


def _of_what_is_held(held: Sequence[SwitchedOnRecord]) -> Iterator[str]:
    """Counts of the answers with all on: of those that agree with the engine's documentation, and of the others by what becomes of them."""
    stopping = [one for one in held if one.explained and one.misses_optimum]
    departing = [one for one in held if one.explained and one.departures and not one.misses_optimum]
    unexplained = [one for one in held if not one.explained]
    agreeing = len(held) - len(stopping) - len(departing) - len(unexplained)
    yield f"{agreeing} of {len(held)} answers agree with the documentation of the engine"
    if stopping:
        most = share_of_qdd(share_text(max(one.relative_error or 0.0 for one in stopping)))
        yield f"{len(stopping)} {'ends' if len(stopping) == 1 else 'end'} where the solver stops before its solution, up to {most} from it"
    if departing:
        yield f"{len(departing)} {'departs' if len(departing) == 1 else 'depart'} from it for a known reason"
    if unexplained:
        yield f"{len(unexplained)} {'is' if len(unexplained) == 1 else 'are'} unexplained"


def survey_summary(found: FilesComparison) -> str:
    return conclude_survey(found).sentence


def is_agreed(found: FilesComparison, file: FileRecord) -> bool:
    """True where every engine that was asked agrees with a file in which nothing is impossible."""
    return _state(found, file) == _AGREES and not file.impossible


def outcome_text(subject: SubjectRecord) -> str:
    """The outcome of a subject in a cell: "agrees", "explained: joint damping 47 %, mimic joints 14 %", "unexplained 6 %"."""
    if subject.explained and subject.readings and subject.verdict != Verdict.AGREES:
        return f"{subject.outcome}: {explanation(subject.readings, MOST_IN_CELL)}".removesuffix(": ")
    is_sized = subject.outcome in ("unexplained", "lost digits") and subject.relative_error is not None
    return f"{subject.outcome} {share_text(subject.relative_error)}" if is_sized else subject.outcome


def _state(found: FilesComparison, file: FileRecord) -> tuple[str, str]:
    plain = [one for one in found.of(file.path) if not one.aided]
    if file.problem:
        return _UNREAD
    held = found.switched_on_of(file.path)
    if not all(one.explained for one in plain) or not all(one.explained for one in held):
        return _UNEXPLAINED
    if file.unread and not plain:
        return _UNASKED
    if file.remark and not plain:
        return _STILL
    if any(not one.is_answered for one in plain):
        return _REFUSED
    is_otherwise = any(one.verdict != Verdict.AGREES for one in plain) or any(names_of((*one.readings, *one.departures)) for one in held)
    return _OTHERWISE if is_otherwise else _AGREES


def _engines(found: FilesComparison) -> Iterator[str]:
    """A line for each engine: how often it has which outcome, and the readings that most often matter most."""
    plain = grouped((one.program, one) for one in sorted(found.subjects, key=lambda one: one.program) if not one.aided)
    for program, own in plain.items():
        outcomes = Counter(one.outcome for one in own).most_common()
        said = [f"{outcome} {count}{_reasons([one for one in own if one.outcome == outcome])}" for outcome, count in outcomes]
        yield f"{program}: {'; '.join(said)}"


def _reasons(subjects: Sequence[SubjectRecord]) -> str:
    """The readings that move accelerations most, with the number of robots on which each does."""
    reasons = Counter(one.dominating for one in subjects if one.dominating and one.verdict != Verdict.AGREES)
    named = [f"{name} {count}" for name, count in reasons.most_common(MOST_COUNTED)]
    return f" ({', '.join(named)})" if named else ""


def trends(earlier: Sequence[FilesComparison], now: FilesComparison) -> dict[tuple[str, str, str], list[float]]:
    """``error`` of each subject of now in the surveys ``earlier``, oldest first, and now, by path, subject and kind."""
    found: dict[tuple[str, str, str], list[float]] = {(one.path, one.subject, one.kind): [] for one in now.subjects}
    for survey in (*earlier, now):
        for one in survey.subjects:
            if (values := found.get((one.path, one.subject, one.kind))) is not None and one.error is not None:
                values.append(one.error)
    return found


def changes(before: FilesComparison, now: FilesComparison) -> Iterator[str]:
    """A sentence for each subject whose outcome or dominating reading is another than before, and for each file that came or went."""
    for one, was in _otherwise(before, now):
        yield f"{one.path} {one.subject}, {one.kind}: {outcome_text(one)}; it was: {outcome_text(was)}"
    known, found = ({file.path for file in comparison.files} for comparison in (before, now))
    yield from (f"{path}: new" for path in sorted(found - known))
    yield from (f"{path}: no longer there" for path in sorted(known - found))


def _otherwise(before: FilesComparison, now: FilesComparison) -> Iterator[tuple[SubjectRecord, SubjectRecord]]:
    """Each subject whose outcome or dominating reading is another than before, now and then."""
    earlier = {(one.path, one.subject, one.kind): one for one in before.subjects}
    for one in now.subjects:
        was = earlier.get((one.path, one.subject, one.kind))
        if was is not None and (was.outcome, was.dominating) != (one.outcome, one.dominating):
            yield one, was


def conclude_changes(found: FilesComparison, now: Sequence[str], before: Mapping[str, str], where: str) -> Conclusion:
    """Robots against an earlier state of their files: two rows for each that is another, of its file and of what engines make of it.

    ``found`` has the files ``now``, and those of ``before``, by the file now, that may be another; its pairs hold these against each other.
    ``where`` names the earlier state.
    """
    is_now, was = found.among({path: path for path in now}), found.among({old: path for path, old in before.items()})
    files, old_files = ({file.path: file for file in one.files} for one in (is_now, was))
    pairs, answered = {pair.second: pair for pair in found.pairs}, grouped((one.path, (one, old)) for one, old in _otherwise(was, is_now))
    rows, changed = [], []
    for path in sorted({*now, *before}):
        said = _robot_changed(files.get(path), old_files.get(path), pairs.get(path), path in before)
        own = [f"{one.subject} {outcome_text(one)}, before {outcome_text(old)}" for one, old in answered.get(path, ()) if not one.aided]
        if said or own:
            changed.append(path)
            same = [f"{one.subject} {outcome_text(one)}" for one in is_now.of(path) if not one.aided]
            rows.append(f"{path}: {said or 'the same robot as before.'}")
            if path in files:
                how = "" if own or path not in old_files else "; each outcome is as before"
                rows.append(f"  engines: {'; '.join(own or same) or 'none was asked'}{how}")
    count = counted(len({*now, *before}), "robot")
    if not changed:
        return Conclusion(f"{count}: none differs from {where}.")
    verb = "differs" if len(changed) == 1 else "differ"
    return Conclusion(f"{len(changed)} of {count} {verb} from {where}: {first_of(changed, MOST_COUNTED)}.", rows)


def _robot_changed(now: FileRecord | None, was: FileRecord | None, pair: PairRecord | None, was_there: bool) -> str:
    """The difference of a robot from before, a sentence; "" where it is the same."""
    if now is None:
        return "no longer there."
    if not was_there:
        return f"new; it cannot be read: {now.problem}." if now.problem else "new."
    if was is not None and (now.problem or was.problem) and now.problem != was.problem:
        return f"cannot be read: {now.problem}." if now.problem else f"can be read; before: {was.problem}."
    if pair is not None and (pair.problem or pair.differences or pair.constraints or not pair.same):
        return conclude_pair(pair).sentence
    return ""
