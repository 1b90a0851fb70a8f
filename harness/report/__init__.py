"""Reports: a pure function of records, which runs nothing.

``index.html`` is one offline page, ``report.md`` is made to be compared from night to night, and
``report.json`` is for programs.

Imports nothing that computes. May use ``results`` and what is below it.

Start with ``build``; ``summary`` says what the pages say, ``html`` and ``markdown`` draw it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from harness.errors import InvalidInput
from harness.report.benchmarks import BenchmarkSummary
from harness.report.hard_cases import HardSummary
from harness.report.html import render_html, render_measured
from harness.report.markdown import render_markdown, render_measured_markdown
from harness.report.summary import Earlier, Summary
from harness.results.atlas import Atlas
from harness.results.benchmark import Benchmark
from harness.results.cross_check import CrossCheckResult
from harness.results.records import Run, to_json
from harness.storage import write_atomically

__all__ = ["Earlier", "build", "build_measured", "write"]


def build(
    run: Run,
    found: CrossCheckResult,
    history: Sequence[Earlier] = (),
    benchmark: tuple[Run, Benchmark] | None = None,
    atlas: tuple[Run, Atlas] | None = None,
) -> dict[str, str]:
    """File name to text of every file of the report.

    ``history`` holds earlier (run, records) pairs in any order, as ``History.earlier`` returns them; ``benchmark`` and
    ``atlas`` what ``History.latest`` returns. The Markdown and the JSON are the same for the same arguments; Bokeh
    numbers its plots anew on every call.
    """
    summary = Summary(run, found, history)
    measured, hard = _summaries(benchmark, atlas)
    told, further = _plain(measured, hard)
    if found.worst_cases:
        further["worst_cases"] = found.worst_cases
    if summary.causes:
        further["causes"] = [cause for _, cause in sorted(summary.causes.items())]
    cards = sorted(found.systems, key=lambda card: card.name)
    return {
        "index.html": render_html(summary, measured, hard),
        "report.md": render_markdown(summary, measured, hard),
        "report.json": to_json(run, summary.records, cards, summary.superfluous, told, further),
    }


def build_measured(benchmark: tuple[Run, Benchmark] | None, atlas: tuple[Run, Atlas] | None = None) -> dict[str, str]:
    """File name to text of a report of nothing but a benchmark, an atlas or both.

    Raises:
        ValueError: there is neither.
    """
    measured, hard = _summaries(benchmark, atlas)
    newest = max((part.run for part in (measured, hard) if part is not None), key=lambda run: run.started)
    told, further = _plain(measured, hard)
    return {
        "index.html": render_measured(newest, measured, hard),
        "report.md": render_measured_markdown(measured, hard),
        "report.json": to_json(newest, [], benchmark=told, further=further),
    }


def _summaries(
    benchmark: tuple[Run, Benchmark] | None, atlas: tuple[Run, Atlas] | None
) -> tuple[BenchmarkSummary | None, HardSummary | None]:
    return BenchmarkSummary(*benchmark) if benchmark else None, HardSummary(*atlas) if atlas else None


def _plain(measured: BenchmarkSummary | None, hard: HardSummary | None) -> tuple[tuple[Run, Benchmark] | None, dict[str, Any]]:
    """Their share of the JSON file."""
    told = (measured.run, measured.benchmark) if measured else None
    return told, {"atlas": {"run": hard.run} | vars(hard.atlas)} if hard else {}


def write(directory: Path | str, files: Mapping[str, str]) -> list[Path]:
    """Write what ``build`` returned into ``directory``, made if it is missing, each file whole or not at all; their paths.

    Raises:
        InvalidInput: the directory or a file cannot be written.
    """
    folder = Path(directory)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InvalidInput(folder, None, f"cannot hold a report ({error.strerror}); name a folder that is writable") from error
    paths = []
    for name, text in files.items():
        write_atomically(folder / name, text)
        paths.append(folder / name)
    return paths
