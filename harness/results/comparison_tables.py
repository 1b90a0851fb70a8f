"""The tables of a comparison of robots' files, for the terminal and for the report."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

from harness.results.comparison import FilesComparison, PairRecord, SubjectRecord
from harness.results.table import Cell, Column, Table, TableOf, counted
from harness.verdict import AGREEMENT, Verdict

subjects_table = TableOf(
    SubjectRecord,
    "subject kind marked_outcome backward_error relative_error left dominating",
    f"Engines against the certified accelerations of the file; errors in data roundoffs, of which up to {AGREEMENT:g} agree; the largest "
    "over all states.",
)


def short_names(found: FilesComparison) -> dict[str, str]:
    """Path of each file in the folder that all share, by its whole path."""
    shared = Path(os.path.commonpath([Path(file.path).parent for file in found.files])) if found.files else Path()
    return {file.path: str(Path(file.path).relative_to(shared)) for file in found.files}


def survey_table(found: FilesComparison, pages: Mapping[str, str]) -> Table:
    """A row for each robot, a column for each subject; ``pages`` are those of the robots, by path."""
    engines = sorted({subject.engine for subject in found.subjects})
    rows = []
    names = short_names(found)
    for file in found.files:
        cells: list[object] = [names[file.path], file.degrees_of_freedom if not file.problem else None]
        for engine in engines:
            for aided in (False, True):
                own = next((one for one in found.of(file.path) if one.engine == engine and one.aided == aided), None)
                cells.append(_survey_cell(own, pages.get(file.path, "")) if own is not None else Cell(""))
        cells += [counted(len(file.impossible), "link") if file.impossible else "", file.problem]
        rows.append(cells)
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


def pair_table(pair: PairRecord) -> Table:
    """The differences of two files, the one with the largest effect first."""
    return Table.of(
        pair.differences,
        {
            "what": "what",
            Path(pair.first).name: lambda one: Cell(one.first, [one.first_place] if one.first_place else []),
            Path(pair.second).name: lambda one: Cell(one.second, [one.second_place] if one.second_place else []),
            Column("alone it moves qdd by", "error"): "alone",
        },
        "Differences, the one that moves the accelerations most first.",
    )
