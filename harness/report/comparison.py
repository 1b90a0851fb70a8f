"""A comparison of robots' files in sections, for the terminal and for a page; it computes nothing."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field

from harness.files.findings import LeftOut
from harness.results.comparison import (
    FileRecord,
    FilesComparison,
    SubjectRecord,
    names_apart,
)
from harness.results.conclusion import MORE, conclude
from harness.results.detail import Detail
from harness.results.gap import Gaps
from harness.results.pair_conclusion import conclusions
from harness.results.readings import MOST_LINES, by_effect, lines_text, reading_line
from harness.results.run import Run
from harness.results.switched_on import switched_on_text, with_those_on
from harness.results.table import Table, TableOf, counted, counted_nouns, error_text, grouped, markdown_cell
from harness.verdict import AGREEMENT

# Said where every engine was asked and answered, and nothing is left to explain.
NOTHING = "nothing: every answer agrees with the file, or with what the readings make of it"

_subjects = TableOf(
    SubjectRecord,
    "subject kind marked_outcome backward_error relative_error left dominating",
    f"Engines against the certified accelerations of the file; errors in data roundoffs, of which up to {AGREEMENT:g} agree; the largest "
    "over all states.",
)


@dataclass(frozen=True)
class Section:
    """A heading with what stands below it: lines of text, the further ones of a paragraph indented, and tables.

    ``anchor`` is its place on a page. ``is_answer``: the heading is the sentence that answers what was asked.
    """

    title: str
    parts: Sequence[str | Table] = field(default_factory=list)
    anchor: str = ""
    is_answer: bool = False

    def __str__(self) -> str:
        return "\n".join([self.title, *(str(part) if isinstance(part, Table) else f"  {part.rstrip()}" for part in self.parts)])


def answers(found: FilesComparison, detail: Detail = Detail.BRIEF) -> Iterator[Section]:
    """Answer to each question in a sentence, with the rows that matter."""
    for one in conclusions(found, detail):
        yield Section(one.sentence, one.rows, is_answer=True)


def told(found: FilesComparison, detail: Detail) -> Iterator[Section]:
    """The answers, and where the rest is; with ``Detail.VERBOSE`` that follows."""
    yield from answers(found, detail)
    if detail == Detail.VERBOSE:
        yield from sections(found)
    elif found.subjects or found.pairs:
        yield Section(MORE)


def sections(found: FilesComparison) -> Iterator[Section]:
    """All that is known of each file and each engine, in the order in which a person asks."""
    yield from file_sections(found)
    names = names_apart(file.path for file in found.files)
    for file in found.files:
        own = found.of(file.path)
        if own:
            yield Section(f"3. The engines on {names[file.path]}", [_subjects(own), *_readings(own), *_switched_on(found, file)])
    yield Section("4. The rest", rest(found) or [NOTHING])


def file_sections(found: FilesComparison) -> Iterator[Section]:
    """The files as they are, without any engine."""
    yield Section("1. What the file is" if len(found.files) == 1 else "1. What the files are", [*_descriptions(found.files)])
    if any(not file.problem for file in found.files):
        nothing = "nothing: every inertia is one that a body can have"
        yield Section("2. What no body can have", [*_impossible(found)] or [nothing])


def gap_sections(found: Gaps, detail: Detail = Detail.BRIEF) -> Iterator[Section]:
    """The gap between two motions, who computed them, and what it is made of."""
    for gap in found.gaps:
        yield Section(gap.sentence, is_answer=True)
        movers = [part for mover in (gap.first, gap.second) for part in (mover.title, *(f"  {reading}" for reading in mover.readings))]
        yield Section("The motions", movers)
        table, others = gap.table(detail)
        drift = "harness drift does so with controls, contacts, limits and friction on"
        yield Section("What the gap is made of", [*gap.remarks, table, *filter(None, [others]), drift])


def robot_sections(found: FilesComparison, file: FileRecord) -> Iterator[Section]:
    """One robot of a survey."""
    own = found.of(file.path)
    impossible = [*_impossible(FilesComparison(files=[file], subjects=own))]
    answer = conclude(found, file, Detail.ALL)
    yield Section(answer.sentence, answer.rows, is_answer=True)
    yield Section("What the file is", [*_descriptions([file])], "file")
    if impossible:
        yield Section("What no body can have", impossible, "impossible")
    if own:
        yield Section("Engines", [_subjects(own), *_readings(own), *_switched_on(found, file)], "engines")


def render(run: Run, title: str, parts: Iterable[Section]) -> str:
    """One offline page."""
    from harness.report.html import environment

    return environment().get_template("comparison.html").render(run=run, title=title, sections=list(parts), charts=[])


def html_of(parts: Iterable[Section]) -> str:
    """Sections as a part of a page."""
    from harness.report.html import environment

    return environment().get_template("sections.html").render(sections=list(parts))


def markdown_of(parts: Iterable[Section]) -> str:
    """Sections in Markdown: rows as lists, of which the further in stand below the others, and tables of pipes."""
    blocks = []
    for section in parts:
        blocks.append(f"**{markdown_cell(section.title)}**" if section.is_answer else f"### {markdown_cell(section.title)}")
        for part in section.parts:
            if isinstance(part, Table):
                blocks.append(part.markdown())
            else:
                row = f"{part[: len(part) - len(part.lstrip())]}- {markdown_cell(part)}"
                blocks.append(f"{blocks.pop()}\n{row}" if blocks[-1].lstrip().startswith("- ") else row)
    return "\n\n".join(filter(None, blocks)) + "\n"


def _descriptions(files: Sequence[FileRecord]) -> Iterator[str]:
    for file in files:
        yield from [f"{file.path}: {file.problem}"] if file.problem else filter(None, _description(file))


def _description(file: FileRecord) -> list[str]:
    followers = f" ({file.followers} of them mimic another)" if file.followers else ""
    gravity = " ".join(f"{component:g}" for component in file.gravity)
    undecided = f", of which {file.undecided} have none: M is singular or not positive definite there" if file.undecided else ""
    certified = f"  certified accelerations at {counted(file.states, 'state')}{undecided}" if file.degrees_of_freedom else ""
    meshes = f"{len(file.meshes)} mesh{'es' if len(file.meshes) > 1 else ''}"
    return [
        f"{file.path}: {file.format.upper()}, {counted_nouns(file.bodies, 'bodies')}, {counted(file.joints, 'joint')}"
        f"{followers}, {counted_nouns(file.degrees_of_freedom, 'degrees of freedom')}, {file.total_mass:.6g} kg, gravity {gravity} m/s^2",
        f"  {file.base}" if file.base else "",
        f"  {file.remark}" if file.remark else certified,
        f"  inertia of {meshes} as MuJoCo compiled it ({lines_text(file.meshes)}): not judged" if file.meshes else "",
        *map(_left_out, file.left_out),
    ]


def _left_out(part: LeftOut) -> str:
    bearing = "moves it where an engine has it on" if part.bears_on_motion else "bears on no acceleration at given tau"
    return f"  left out: {part.what}, {len(part.lines)} ({lines_text(part.lines)}): {'; '.join([bearing, *part.beside_tau])}"


def _impossible(found: FilesComparison) -> Iterator[str]:
    names = names_apart(file.path for file in found.files)
    for file in found.files:
        for one in file.impossible:
            numbers, nearest = (" ".join(f"{value:.6g}" for value in values) for values in (one.found, one.nearest))
            by = f" by {one.by_how_much:.2g} of the largest" if one.by_how_much else ""
            possible = f"; nearest that a body can have: {nearest}" if nearest else ""
            yield f"{one.file or names[file.path]}:{one.line}: {one.body}: {one.what}{by}: {numbers}{possible}"
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
    told = [(f"  {reading_line(one, MOST_LINES)}", f"    {one.source}", f"    documentation: findings/{one.page}") for one in readings]
    these = "these readings" if len(readings) > 1 else "this reading"
    return [
        f"  {'it says: ' if is_refused else ''}{subject.message}" if subject.message else "",
        *(f"  {sentence}" for sentence in subject.rest[: MOST_LINES if is_refused else 0]),
        *(f"  {note}" for note in subject.notes),
        f"  {subject.another_robot}" if subject.another_robot else "",
        *(line for lines in told for line in lines),
        f"  with {these} {error_text(subject.left)} data roundoffs are left" if readings and subject.left is not None else "",
        "  together they cancel: the answer is that of the file" if subject.cancels else "",
        f"  {subject.lost_digits}" if subject.lost_digits else "",
    ]


def _switched_on(found: FilesComparison, file: FileRecord) -> Iterator[str]:
    """Lines on what each engine makes of a file with all on that is judged, and of each element alone."""
    for one in found.switched_on_of(file.path):
        yield f"{one.subject}: {with_those_on(one)}{switched_on_text(one)}"
        if one.shapes is not None and not one.shapes.rest:
            yield f"{one.subject}: {one.shapes.text}"
        yield from (f"  {reading_line(reading, MOST_LINES)}" for reading in by_effect(one.readings))
        for (_, kind, why_not), alike in grouped(((part.what, part.kind, part.why_not), part) for part in one.parts).items():
            most = max(alike, key=lambda part: part.alone or 0.0)
            told = [f"{kind}, {len(alike)}, {lines_text([part.line for part in alike])}", f"not judged: it {why_not}" if why_not else ""]
            yield "  " + "; ".join(filter(None, [*told, most.moves and f"{'at most, ' if len(alike) > 1 else ''}{most.moves}"]))


def subject_lines(subject: SubjectRecord) -> list[str]:
    """All that is known of one subject."""
    return [*_readings([subject]), *_unexplained(FilesComparison(subjects=[subject]))]


def rest(found: FilesComparison, whole: bool = True) -> list[str]:
    """Errors that no reading explains, and, where the ``whole`` is asked for, who gave no answer."""
    if not whole:
        return [*_unexplained(found)]
    names = names_apart(file.path for file in found.files)
    said = {"refused": "refuses", "undecided": "is not judged on", "another robot": "reads another robot from"}
    silent = [one for one in found.subjects if one.explained and one.outcome in said]
    lines = [
        f"no answer: {one.subject}, {one.kind}, {said[one.outcome]} {names[one.path]}" + (f"; {one.marked}" if one.expected else "")
        for one in silent
    ]
    whys = {file.path: file.remark and f": {file.remark}" for file in found.unasked}
    lines += [f"no answer: no engine was asked about {names[path]}{why}" for path, why in whys.items()]
    return [*_unexplained(found), *lines]


def _unexplained(found: FilesComparison) -> Iterator[str]:
    names = names_apart([*(one.path for one in found.switched_on), *(one.path for one in found.subjects)])
    for record in found.switched_on:
        if not record.explained:
            yield f"{names[record.path]} {record.subject}: {with_those_on(record)}{switched_on_text(record)}"
            yield from (f"  {sentence}" for sentence in record.rest)
    for subject in found.subjects:
        if not subject.explained:
            message = "" if subject.rest else f": {subject.message}"
            yield f"{names[subject.path]} {subject.subject}, {subject.kind}: {subject.outcome}{message}"
            yield from (f"  {sentence}" for sentence in subject.rest)
