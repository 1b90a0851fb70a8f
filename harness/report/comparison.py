"""A comparison of robots' files in sections, for the terminal and for a page; it computes nothing."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from harness.report.sparkline import Sparkline
from harness.results.comparison import (
    EqualitiesRecord,
    FileRecord,
    FilesComparison,
    PairRecord,
    SubjectRecord,
    changes,
    names_apart,
    short_names,
    trends,
)
from harness.results.gap import Gaps
from harness.results.readings import MOST_LINES, by_effect, lines_text
from harness.results.records import Run
from harness.results.table import Cell, Column, Table, TableOf, counted, error_text
from harness.verdict import AGREEMENT, Verdict

# Of which a trend is shown, this one among them.
MOST_SURVEYS = 12

_subjects = TableOf(
    SubjectRecord,
    "subject kind marked_outcome backward_error relative_error left dominating",
    f"Engines against the certified accelerations of the file; errors in data roundoffs, of which up to {AGREEMENT:g} agree; the largest "
    "over all states.",
)


@dataclass(frozen=True)
class Section:
    """A heading with what stands below it: lines of text, the further ones of a paragraph indented, and tables.

    ``anchor`` is its place on a page.
    """

    title: str
    parts: Sequence[str | Table] = field(default_factory=list)
    anchor: str = ""

    def __str__(self) -> str:
        return "\n".join([self.title, *(str(part) if isinstance(part, Table) else f"  {part.rstrip()}" for part in self.parts)])


def sections(found: FilesComparison) -> Iterator[Section]:
    """Sections of a comparison, in the order in which a person asks."""
    yield from file_sections(found)
    names = names_apart(file.path for file in found.files)
    for file in found.files:
        own = found.of(file.path)
        if own:
            yield Section(f"3. The engines on {names[file.path]}", [_subjects(own), *_readings(own), *_equalities(found, file)])
    yield Section("4. The rest", _rest(found))
    for section in pair_sections(found):
        yield replace(section, title=f"5. {section.title}")


def file_sections(found: FilesComparison) -> Iterator[Section]:
    """The files as they are, without any engine."""
    yield Section("1. What the file is" if len(found.files) == 1 else "1. What the files are", [*_descriptions(found.files)])
    if any(not file.problem for file in found.files):
        nothing = "nothing: every inertia is one that a body can have"
        yield Section("2. What no body can have", [*_impossible(found)] or [nothing])


def pair_sections(found: FilesComparison) -> Iterator[Section]:
    """The files held against the first of them."""
    for pair in found.pairs:
        yield Section(" and ".join(_names_of(pair)), _pair(pair))


def gap_sections(found: Gaps) -> Iterator[Section]:
    """The gap between two motions: who computed them, and what it is made of."""
    for gap in found.gaps:
        movers = [part for mover in (gap.first, gap.second) for part in (mover.title, *(f"  {reading}" for reading in mover.readings))]
        yield Section("1. The motions", movers)
        yield Section("2. What the gap is made of", [*gap.remarks, gap.table])


def survey_sections(
    found: FilesComparison,
    before: tuple[Run, FilesComparison] | None = None,
    pages: Mapping[str, str] | None = None,
    earlier: Sequence[FilesComparison] = (),
) -> Iterator[Section]:
    """A table of all robots, what is not explained, what is other than in the survey ``before``, and the trend over surveys ``earlier``.

    ``pages`` are those of the robots, by path. The earlier surveys stand oldest first.
    """
    compared = [subject for subject in found.subjects if not subject.aided]
    unread, unmoved = sum(bool(file.problem) for file in found.files), sum(bool(file.remark) for file in found.files)
    others = Counter(subject.outcome for subject in compared if not subject.is_answered)
    losing = sum(bool(subject.lost_digits) for subject in compared)
    count = counted(len(found.files), "file")
    count += f", of which {unread} cannot be read" if unread else ""
    count += f"{' and' if unread else ', of which'} {unmoved} {'holds' if unmoved == 1 else 'hold'} nothing that moves" if unmoved else ""
    count += f"; of {len(compared)} plain answers {len(compared) - others.total()} agree or are explained"
    count += f" ({losing} of them lose digits)" if losing else ""
    count += "".join(f", {number} {'is' if number == 1 else 'are'} {outcome}" for outcome, number in others.items())
    held = [one for one in found.equalities if one.verdict]
    agreeing = sum(one.explained for one in held)
    count += f"; of {counted(len(held), 'answer')} with the file's equalities {agreeing} agree with their engine's optimum" if held else ""
    yield Section("Robots and engines", [count, _survey_table(found, pages or {})])
    yield Section("The rest", _rest(found))
    if before is not None:
        yield Section(f"Since the survey of {before[0].started}", [*changes(before[1], found)] or ["nothing changed"])
    if earlier:
        yield Section("Trend", [_trend_table(earlier, found, pages or {})])


def _survey_table(found: FilesComparison, pages: Mapping[str, str]) -> Table:
    """A row for each robot, a column for each subject."""
    engines = sorted({subject.engine for subject in found.subjects})
    own = {(one.path, one.engine, one.aided): _survey_cell(one, pages.get(one.path, "")) for one in reversed(found.subjects)}
    names, rows = short_names(found), list[list[object]]()
    for file in found.files:
        cells = [own.get((file.path, engine, aided), "") for engine in engines for aided in (False, True)]
        impossible = counted(len(file.impossible), "link") if file.impossible else ""
        rows.append([names[file.path], None if file.problem else file.degrees_of_freedom, *cells, impossible, file.problem])
    heads = [head for engine in engines for head in (engine, f"{engine} aided")]
    caption = (
        "Each engine's verdict, plain and aided; the largest relative error of its accelerations where they differ, and below it the "
        "reading that moves them most."
    )
    return Table(["robot", Column("dof", "count"), *heads, "unphysical", "problem"], rows, caption, "matrix")


def _survey_cell(subject: SubjectRecord, page: str) -> Cell:
    size = f" {subject.relative_error:.2g}" if subject.relative_error and subject.verdict == Verdict.DISAGREES else ""
    notes = [subject.dominating] if subject.dominating and not subject.aided and subject.verdict == Verdict.DISAGREES else []
    return Cell(f"{subject.outcome}{size}", notes, subject.tone, link=page)


def _trend_table(earlier: Sequence[FilesComparison], found: FilesComparison, pages: Mapping[str, str]) -> Table:
    """A row for each robot, a line for each subject."""
    values, names = trends(earlier, found), short_names(found)
    columns = sorted({(subject.engine, subject.aided) for subject in found.subjects})
    rows = []
    for file in found.files:
        own = {(subject.engine, subject.aided): values[subject.path, subject.subject, subject.kind] for subject in found.of(file.path)}
        if any(own.values()):
            lines = [Sparkline(own[column]) if own.get(column) else "" for column in columns]
            rows.append([Cell(names[file.path], link=pages[file.path]), *lines])
    heads = [f"{engine} aided" if aided else engine for engine, aided in columns]
    caption = f"The worst backward error after readings, in data roundoffs, over the last surveys, {len(earlier) + 1} with this one."
    return Table(["robot", *heads], rows, caption)


def robot_sections(found: FilesComparison, file: FileRecord) -> Iterator[Section]:
    """One robot of a survey."""
    own = found.of(file.path)
    impossible = [*_impossible(FilesComparison(files=[file], subjects=own))]
    yield Section("What the file is", [*_descriptions([file])], "file")
    if impossible:
        yield Section("What no body can have", impossible, "impossible")
    if own:
        yield Section("Engines", [_subjects(own), *_readings(own), *_equalities(found, file)], "engines")


def render(run: Run, title: str, parts: Iterable[Section]) -> str:
    """One offline page."""
    from harness.report.html import environment

    return environment().get_template("comparison.html").render(run=run, title=title, sections=list(parts), charts=[])


def html_of(parts: Iterable[Section]) -> str:
    """Sections as a part of a page."""
    from harness.report.html import environment

    return environment().get_template("sections.html").render(sections=list(parts))


def _descriptions(files: Sequence[FileRecord]) -> Iterator[str]:
    for file in files:
        yield from [f"{file.path}: {file.problem}"] if file.problem else filter(None, _description(file))


def _description(file: FileRecord) -> list[str]:
    followers = f" ({file.followers} of them mimic another)" if file.followers else ""
    gravity = " ".join(f"{component:g}" for component in file.gravity)
    undecided = f", of which {file.undecided} have none: M is singular or not positive definite there" if file.undecided else ""
    certified = f"  certified accelerations at {counted(file.states, 'state')}{undecided}" if file.degrees_of_freedom else ""
    meshes = f"{len(file.meshes)} mesh{'es' if len(file.meshes) > 1 else ''}"
    bearing = {True: "would move it, and is off in every engine", False: "bears on no acceleration"}
    return [
        f"{file.path}: {file.format.upper()}, {file.bodies} bodies, {counted(file.joints, 'joint')}"
        f"{followers}, {file.degrees_of_freedom} degrees of freedom, {file.total_mass:.6g} kg, gravity {gravity} m/s^2",
        f"  {file.remark}" if file.remark else certified,
        f"  inertia of {meshes} as MuJoCo compiled it ({lines_text(file.meshes)}): not judged" if file.meshes else "",
        *(f"  left out: {one.what}, {len(one.lines)} ({lines_text(one.lines)}): {bearing[one.bears_on_motion]}" for one in file.left_out),
    ]


def _impossible(found: FilesComparison) -> Iterator[str]:
    names = names_apart(file.path for file in found.files)
    for file in found.files:
        for one in file.impossible:
            numbers, nearest = (" ".join(f"{value:.6g}" for value in values) for values in (one.found, one.nearest))
            by = f" by {one.by_how_much:.2g} of the largest" if one.by_how_much else ""
            possible = f"; nearest that a body can have: {nearest}" if nearest else ""
            yield f"{names[file.path]}:{one.line}: {one.body}: {one.what}{by}: {numbers}{possible}"
        if file.impossible:
            stances = {True: "refuses the file", False: "computes on without a word"}
            plain = [subject for subject in found.of(file.path) if not subject.aided]
            yield "  " + "; ".join(f"{subject.engine} {stances[subject.outcome == 'refused']}" for subject in plain)


def _readings(subjects: Sequence[SubjectRecord]) -> Iterator[str]:
    for subject in subjects:
        if subject.readings or subject.notes or subject.message or subject.lost_digits or not subject.as_expected:
            yield f"{subject.subject}, {subject.kind}: {subject.marked}"
            yield from filter(None, _reading_lines(subject))


def _reading_lines(subject: SubjectRecord) -> list[str]:
    is_refused = subject.outcome == "refused"
    readings = by_effect(subject.readings)
    told = [(f"  {one.statement}", f"    {one.source}") for one in readings]
    these = "these readings" if len(readings) > 1 else "this reading"
    return [
        f"  {'it says: ' if is_refused else ''}{subject.message}" if subject.message else "",
        *(f"  {sentence}" for sentence in subject.rest[: MOST_LINES if is_refused else 0]),
        *(f"  {note}" for note in subject.notes),
        f"  {subject.left_nothing}" if subject.left_nothing else "",
        *(line for lines in told for line in lines),
        f"  with {these} {error_text(subject.left)} data roundoffs are left" if readings and subject.left is not None else "",
        "  together they cancel: the answer is that of the file" if subject.cancels else "",
        f"  {subject.lost_digits}" if subject.lost_digits else "",
    ]


def _equalities(found: FilesComparison, file: FileRecord) -> Iterator[str]:
    """Lines on what each engine makes of the equalities of a file."""
    for one in (record for record in found.equalities if record.path == file.path):
        yield f"{one.subject}, plain, with the file's equalities: {_with_equalities(one)}"
        for kind, why_not in dict.fromkeys((part.kind, part.why_not) for part in one.parts):
            alike = [part for part in one.parts if (part.kind, part.why_not) == (kind, why_not)]
            most = max(alike, key=lambda part: part.alone or 0.0)
            told = [f"{kind}, {len(alike)}, {lines_text([part.line for part in alike])}", f"not judged: it {why_not}" if why_not else ""]
            yield "  " + "; ".join(filter(None, [*told, most.moves and f"{'at most, ' if len(alike) > 1 else ''}{most.moves}"]))


def _with_equalities(one: EqualitiesRecord) -> str:
    """The outcome in words."""
    if not one.verdict or one.backward_error is None:
        return one.message or "not judged"
    outcome = str(one.verdict) if one.explained else "unexplained"
    optimum = f"{error_text(one.backward_error)} data roundoffs from the optimum that its documentation gives"
    return f"{outcome}, {optimum}" + (f", {error_text(one.together)} times the tree's own qdd away from that" if one.together else "")


def subject_lines(subject: SubjectRecord) -> list[str]:
    """All that is known of one subject."""
    return [*_readings([subject]), *_unexplained(FilesComparison(subjects=[subject]))]


def _rest(found: FilesComparison) -> list[str]:
    """What no reading explains, and who gave no answer; "nothing" is said where everybody was asked and answered."""
    names = names_apart(file.path for file in found.files)
    said = {"refused": "refuses", "undecided": "is not judged on", "nothing left": "reads nothing that moves from"}
    silent = [one for one in found.subjects if one.explained and one.outcome in said]
    lines = [
        f"no answer: {one.subject}, {one.kind}, {said[one.outcome]} {names[one.path]}" + (f"; {one.marked}" if one.expected else "")
        for one in silent
    ]
    whys = {file.path: file.remark and f": {file.remark}" for file in found.unasked}
    lines += [f"no answer: no engine was asked about {names[path]}{why}" for path, why in whys.items()]
    return [*_unexplained(found), *lines] or ["nothing: every answer agrees with the file, or with what the readings make of it"]


def _unexplained(found: FilesComparison) -> Iterator[str]:
    names = names_apart([*(one.path for one in found.equalities), *(one.path for one in found.subjects)])
    for record in found.equalities:
        if not record.explained:
            yield f"{names[record.path]} {record.subject}, plain, with the file's equalities: {_with_equalities(record)}"
    for subject in found.subjects:
        if not subject.explained:
            message = "" if subject.rest else f": {subject.message}"
            yield f"{names[subject.path]} {subject.subject}, {subject.kind}: {subject.outcome}{message}"
            yield from (f"  {sentence}" for sentence in subject.rest)


def _names_of(pair: PairRecord) -> tuple[str, str]:
    names = names_apart([pair.first, pair.second])
    return names[pair.first], names[pair.second]


def _pair(pair: PairRecord) -> list[str | Table]:
    if pair.problem:
        return [pair.problem]
    first, second = _names_of(pair)
    columns: dict[Column | str, str | Callable[[Any], object]] = {
        "what": "what",
        first: lambda one: Cell(one.first, [one.first_place] if one.first_place else []),
        second: lambda one: Cell(one.second, [one.second_place] if one.second_place else []),
        Column("alone it moves qdd by", "error"): "alone",
    }
    table = Table.of(pair.differences, columns, "Differences, the one that moves the accelerations most first.")
    return [
        pair.conclusion,
        *(f"  {sentence}" for sentence in pair.standing_still),
        *(["  their numbers differ, and no acceleration feels it"] if pair.equivalent and pair.differences else []),
        *(f"  {remark}" for remark in pair.remarks),
        *([table] if pair.differences else []),
    ]


def published(found: FilesComparison, names: Mapping[str, str] | None = None) -> FilesComparison:
    """A comparison whose files are named from the folder that all share: pages are published, and say nothing of this machine."""
    short = names or short_names(found)
    renamed = {
        part: [replace(one, path=short.get(one.path, one.path)) for one in getattr(found, part)]
        for part in ("files", "subjects", "equalities")
    }
    return FilesComparison(pairs=list(found.pairs), **renamed)
