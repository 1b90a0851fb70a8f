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
from harness.report.html import render_html
from harness.report.markdown import render_markdown
from harness.report.summary import Earlier, Summary
from harness.results.atlas import Atlas
from harness.results.benchmark import Benchmark
from harness.results.comparison import Comparison
from harness.results.cross_check import CrossCheckResult
from harness.results.records import Run, to_json
from harness.results.table import counted
from harness.storage import write_atomically

__all__ = ["Earlier", "build", "write"]


def build(
    run: Run | None = None,
    found: CrossCheckResult | None = None,
    history: Sequence[Earlier] = (),
    benchmark: tuple[Run, Benchmark] | None = None,
    atlas: tuple[Run, Atlas] | None = None,
    robots: tuple[Run, Comparison] | None = None,
) -> dict[str, str]:
    """File name to text of every file of the report on a cross-check, a benchmark, an atlas, or several of them.

    ``history`` holds earlier (run, records) pairs in any order, as ``History.earlier`` returns them; ``benchmark``, ``atlas``
    and ``robots``, whose page ``robots.html`` the index links, what ``History.latest`` returns. The Markdown and the JSON
    are the same for the same arguments; Bokeh numbers its plots anew on every call.

    Raises:
        ValueError: there is nothing to report.
    """
    summary = Summary(run, found, history) if run and found else None
    measured, hard = BenchmarkSummary(*benchmark) if benchmark else None, HardSummary(*atlas) if atlas else None
    run = summary.run if summary else max((part.run for part in (measured, hard) if part), key=lambda run: run.started)
    parts: dict[str, Any] = {}
    if summary:
        parts |= {"superfluous": summary.superfluous, "differs": summary.differs}
        parts |= {"worst_cases": found.worst_cases} if found and found.worst_cases else {}
        parts |= {"causes": [cause for _, cause in sorted(summary.causes.items())]} if summary.causes else {}
    parts |= {"benchmark": {"run": measured.run} | vars(measured.benchmark)} if measured else {}
    parts |= {"atlas": {"run": hard.run} | vars(hard.atlas)} if hard else {}
    records, cards = (summary.records, summary.cards) if summary else ([], {})
    return {
        "index.html": render_html(run, summary, measured, hard, f"survey of {counted(len(robots[1].files), 'robot')}" if robots else ""),
        "report.md": render_markdown(summary, measured, hard),
        "report.json": to_json(run, records, [card for _, card in sorted(cards.items())], **parts),
    }


def write(directory: Path | str, files: Mapping[str, str]) -> None:
    """Write what ``build`` returned into ``directory``, made if it is missing, each file whole or not at all.

    Raises:
        InvalidInput: the directory or a file cannot be written.
    """
    folder = Path(directory)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InvalidInput(folder, None, f"cannot hold a report ({error.strerror}); name a folder that is writable") from error
    for name, text in files.items():
        write_atomically(folder / name, text)
