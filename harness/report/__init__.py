"""Reports: a pure function of records, which runs nothing.

``index.html`` is one offline page, ``report.md`` is made to be compared from night to night, and
``report.json`` is for programs.

Imports nothing that computes. May use ``results`` and what is below it.

Start with ``build``; ``summary`` says what the pages say, ``html`` and ``markdown`` draw it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from harness.errors import InvalidInput
from harness.report.benchmarks import BenchmarkSummary
from harness.report.hard_cases import HardSummary
from harness.report.html import render_html, render_measured
from harness.report.markdown import render_markdown, render_measured_markdown
from harness.report.summary import Earlier, Summary
from harness.results.atlas import Atlas
from harness.results.benchmark import Benchmark
from harness.results.records import Record, Run, SystemCard, to_json
from harness.storage import write_atomically

if TYPE_CHECKING:
    from harness.results.causes import Cause
    from harness.results.hard_states import RankedCase
    from harness.results.superfluous import SuperfluousPart

__all__ = ["Earlier", "build", "build_measured", "write"]


def build(
    run: Run,
    cards: Sequence[SystemCard],
    records: Sequence[Record],
    history: Sequence[Earlier] = (),
    superfluous: Sequence[SuperfluousPart] = (),
    benchmark: tuple[Run, Benchmark] | None = None,
    atlas: tuple[Run, Atlas] | None = None,
    worst_cases: Sequence[RankedCase] = (),
    causes: Sequence[Cause] = (),
) -> dict[str, str]:
    """File name to text of every file of the report.

    ``history`` holds earlier (run, records) pairs in any order, as ``History.earlier`` returns them;
    ``benchmark``, ``atlas``, ``worst_cases`` and ``causes`` what ``History.latest_benchmark``, ``latest_atlas``,
    ``worst_cases`` and ``causes`` return. The Markdown and the JSON are the same for the same arguments; Bokeh
    numbers its plots anew on every call.
    """
    summary = Summary(run, cards, records, history, superfluous, worst_cases, causes)
    measured = BenchmarkSummary(*benchmark) if benchmark else None
    hard = HardSummary(*atlas) if atlas else None
    ordered_cards = sorted(cards, key=lambda card: card.name)
    told, further = _plain(measured, hard)
    if worst_cases:
        further["worst_cases"] = [asdict(case) for case in worst_cases]
    if summary.causes:
        further["causes"] = [cause.as_json() for _, cause in sorted(summary.causes.items())]
    return {
        "index.html": render_html(summary, measured, hard),
        "report.md": render_markdown(summary, measured, hard),
        "report.json": to_json(run, summary.records, ordered_cards, summary.superfluous, told, further),
    }


def build_measured(benchmark: tuple[Run, Benchmark] | None, atlas: tuple[Run, Atlas] | None = None) -> dict[str, str]:
    """File name to text of a report of nothing but a benchmark, an atlas or both.

    Raises:
        ValueError: there is neither.
    """
    measured = BenchmarkSummary(*benchmark) if benchmark else None
    hard = HardSummary(*atlas) if atlas else None
    newest = max((part.run for part in (measured, hard) if part is not None), key=lambda run: run.started)
    told, further = _plain(measured, hard)
    return {
        "index.html": render_measured(newest, measured, hard),
        "report.md": render_measured_markdown(measured, hard),
        "report.json": to_json(newest, [], benchmark=told, further=further),
    }


def _plain(measured: BenchmarkSummary | None, hard: HardSummary | None) -> tuple[tuple[Run, Benchmark] | None, dict[str, Any]]:
    """What the JSON file says of them."""
    told = (measured.run, measured.benchmark) if measured else None
    return told, {"atlas": {"run": asdict(hard.run)} | asdict(hard.atlas)} if hard else {}


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
