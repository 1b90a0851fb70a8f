"""Reports: a pure function of records, which runs nothing.

``index.html`` is one offline page, ``report.md`` is made to be compared from night to night, and
``report.json`` is for programs.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from harness.errors import InvalidInput
from harness.measurements import Benchmark
from harness.records import Record, Run, SystemCard, to_json, write_atomically
from harness.report.benchmarks import BenchmarkSummary
from harness.report.html import render_benchmark, render_html
from harness.report.markdown import render_benchmark_markdown, render_markdown
from harness.report.summary import Earlier, Summary

if TYPE_CHECKING:
    from harness.minimal import Finding

__all__ = ["Earlier", "build", "build_benchmark", "write"]


def build(
    run: Run,
    cards: Sequence[SystemCard],
    records: Sequence[Record],
    history: Sequence[Earlier] = (),
    superfluous: Sequence[Finding] = (),
    benchmark: tuple[Run, Benchmark] | None = None,
) -> dict[str, str]:
    """File name to text of every file of the report.

    ``history`` holds earlier (run, records) pairs in any order, as ``History.earlier`` returns them;
    ``benchmark`` what ``History.latest_benchmark`` returns. The Markdown and the JSON are the same for the
    same arguments; Bokeh numbers its plots anew on every call.
    """
    summary = Summary(run, cards, records, history, superfluous)
    measured = BenchmarkSummary(*benchmark) if benchmark else None
    told = (measured.run, measured.benchmark) if measured else None
    ordered_cards = sorted(cards, key=lambda card: card.name)
    return {
        "index.html": render_html(summary, measured),
        "report.md": render_markdown(summary, measured),
        "report.json": to_json(run, summary.records, ordered_cards, summary.superfluous, told),
    }


def build_benchmark(run: Run, benchmark: Benchmark) -> dict[str, str]:
    """File name to text of a report of nothing but a benchmark."""
    measured = BenchmarkSummary(run, benchmark)
    return {
        "index.html": render_benchmark(measured),
        "report.md": render_benchmark_markdown(measured),
        "report.json": to_json(run, [], benchmark=(run, measured.benchmark)),
    }


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
