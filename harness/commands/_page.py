"""The page of a report folder, from its history."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from harness.history import History


def write_page(directory: Path, history: History, library: str, run_id: int | None = None) -> None:
    """Write the report of a run, by default the latest of ``library``, with the latest benchmark of that library.

    Without a run, the page holds the benchmark alone; without either, none is written.
    """
    from harness.report import build, build_benchmark, write

    benchmark = history.latest_benchmark(library)
    number = history.latest_run(library) if run_id is None else run_id
    if number is not None:
        run = dict(history.runs(-1))[number]
        records, cards, findings = history.records(number), history.systems(number), history.findings(number)
        files = build(run, cards, records, history.earlier(number), findings, benchmark)
    elif benchmark is not None:
        files = build_benchmark(*benchmark)
    else:
        return
    write(directory, files)
    click.echo(f"report: {click.format_filename(directory / 'index.html')}")
