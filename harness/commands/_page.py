"""The page of a report folder, from its history."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from harness.results.history import History


def write_page(directory: Path, history: History, library: str, run_id: int | None = None) -> None:
    """Write the report of a run, by default the latest of ``library``, with the latest benchmark and atlas of that library.

    Without a run, the page holds benchmark and atlas alone; without any of them, none is written.
    """
    from harness.report import build, build_measured, write

    benchmark, atlas = history.latest_benchmark(library), history.latest_atlas(library)
    number = history.latest_run(library) if run_id is None else run_id
    if number is not None:
        run = dict(history.runs(-1))[number]
        records, cards, findings = history.records(number), history.systems(number), history.findings(number)
        found = findings, benchmark, atlas, history.worst_cases(number), history.causes(number)
        files = build(run, cards, records, history.earlier(number), *found)
    elif benchmark is not None or atlas is not None:
        files = build_measured(benchmark, atlas)
    else:
        return
    write(directory, files)
    click.echo(f"report: {click.format_filename(directory / 'index.html')}")
