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
    from harness.results.atlas import Atlas
    from harness.results.benchmark import Benchmark
    from harness.results.cross_check import CrossCheckResult

    benchmark, atlas = history.latest(Benchmark, library), history.latest(Atlas, library)
    runs = history.studies(CrossCheckResult, library)
    number = next((one for one in runs if history.read(one, CrossCheckResult, "records").records), None) if run_id is None else run_id
    if number is not None:
        found = history.read(number, CrossCheckResult)
        files = build(runs[number], found, history.earlier(number), benchmark, atlas)
    elif benchmark is not None or atlas is not None:
        files = build_measured(benchmark, atlas)
    else:
        return
    write(directory, files)
    click.echo(f"report: {click.format_filename(directory / 'index.html')}")
