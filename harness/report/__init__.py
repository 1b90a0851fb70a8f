"""Reports: a pure function of records, which runs nothing.

A static site that needs no network, ``index.html`` with a page for each mechanism, robot and engine; ``report.md``, which is made to
be compared from night to night; ``report.json`` for programs, and ``site.json`` with everything the pages tell.

Imports nothing that computes. May use ``results`` and what is below it.

Start with ``build``; ``summary`` says what the pages say, ``pages`` and ``markdown`` draw it.
"""

from __future__ import annotations

import ast
from collections.abc import Mapping, Sequence
from dataclasses import replace
from importlib.resources import files
from pathlib import Path
from typing import Any

from harness.errors import InvalidInput
from harness.report import site_tables
from harness.report.benchmarks import BenchmarkSummary
from harness.report.figures import library
from harness.report.hard_cases import HardSummary
from harness.report.html import asset, badge, style_sheet
from harness.report.markdown import render_markdown
from harness.report.pages import Pages, Survey
from harness.report.site_tables import lines_of_engines
from harness.report.summary import Earlier, Summary
from harness.results.atlas import Atlas
from harness.results.benchmark import Benchmark
from harness.results.cross_check import CrossCheckResult
from harness.results.plain_json import dumps, to_json
from harness.results.run import Run
from harness.results.site import schema
from harness.storage import write_atomically

__all__ = ["Earlier", "Survey", "build", "write"]

# What pages share, beside them as it stands in this folder.
_SHARED = ("site.js", "charts.js")
# Of ``rebuild.py``, each after those that it imports. They use the standard library alone, and no two give one name to different things.
MODULES = (
    "verdict.py", "results/table.py", "results/detail.py", "results/readings.py", "results/site.py", "results/trend_numbers.py",
    "results/engine_lines.py", "report/sparkline.py", "report/site_counts.py", "report/site_tables.py", "report/rebuild.py",
)  # fmt: skip


def build(
    run: Run | None = None,
    found: CrossCheckResult | None = None,
    history: Sequence[Earlier] = (),
    benchmarks: Sequence[tuple[Run, Benchmark]] = (),
    atlas: tuple[Run, Atlas] | None = None,
    robots: Survey | None = None,
) -> dict[str, str]:
    """File name to text of every file of the report on a cross-check, a benchmark, an atlas, a survey of robots, or several of them.

    ``history`` holds earlier (run, records) pairs in any order, ``benchmarks`` the one that is reported and those before it; these and
    ``atlas`` are what ``History`` returns. The Markdown and the JSON are the same for the same arguments; Bokeh numbers its plots anew on
    every call.

    Raises:
        ValueError: there is nothing to report.
    """
    summary = Summary(run, found, history) if run and found else None
    measured, hard = BenchmarkSummary(*benchmarks[0], benchmarks[1:]) if benchmarks else None, HardSummary(*atlas) if atlas else None
    run = summary.run if summary else max((part.run for part in (measured, hard, robots) if part), key=lambda run: run.started)
    parts: dict[str, Any] = {}
    if summary:
        parts |= {"superfluous": summary.superfluous, "differs": summary.differs}
        parts |= {"worst_cases": found.worst_cases} if found and found.worst_cases else {}
        parts |= {"causes": [cause for _, cause in sorted(summary.causes.items())]} if summary.causes else {}
    parts |= {"benchmark": {"run": measured.run} | vars(measured.benchmark)} if measured else {}
    parts |= {"atlas": {"run": hard.run} | vars(hard.atlas)} if hard else {}
    records, cards = ([*summary.records, *summary.further], summary.cards) if summary else ([], {})
    pages = Pages(run, summary, measured, hard, robots)
    return {
        **_site(pages),
        "report.md": render_markdown(summary, measured, hard, lines_of_engines(pages.site)),
        "report.json": to_json(run, records, [card for _, card in sorted(cards.items())], **parts),
    }


def _site(pages: Pages) -> dict[str, str]:
    """Pages, what they share, badges, and their data."""
    texts, tables = {}, []
    for address, drawn in pages.drawn():
        texts[address] = drawn.text
        if drawn.has_charts:
            texts["bokeh.js"] = library()
        tables += [site_tables.shown(address, name, table) for name, table in drawn.tables.items()]
    site = replace(pages.site, tables=tables)
    texts |= {name: asset(name) for name in _SHARED} | {"style.css": style_sheet(), "rebuild.py": standalone()}
    texts |= {count.badge: badge(count) for count in site.counts}
    return texts | {"site.json": dumps(site, indent=1) + "\n", "site.schema.json": schema()}


def standalone() -> str:
    """``rebuild.py`` as one file that needs Python alone: the modules that compute the tables of the site, one below the other."""
    texts = [files("harness").joinpath(name).read_text("utf-8") for name in MODULES]
    about = ast.get_docstring(ast.parse(texts[-1]), clean=False)
    return "\n\n".join([f'"""{about}"""\n\nfrom __future__ import annotations', *map(_alone, texts)]) + "\n"


def _alone(text: str) -> str:
    """A module without its docstring and without what it imports of the harness."""
    lines = text.splitlines()
    for place, node in reversed(list(enumerate(ast.parse(text).body))):
        is_docstring = place == 0 and isinstance(node, ast.Expr)
        is_import = isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] in ("harness", "__future__")
        if is_docstring or is_import:
            del lines[node.lineno - 1 : node.end_lineno]
    return "\n".join(lines).strip("\n")


def write(directory: Path | str, files: Mapping[str, str]) -> None:
    """Write what ``build`` returned into ``directory``, made if it is missing, each file whole or not at all.

    Raises:
        InvalidInput: the directory or a file cannot be written.
    """
    folder = Path(directory)
    try:
        for place in {(folder / name).parent for name in files}:
            place.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InvalidInput(folder, None, f"cannot hold a report ({error.strerror}); name a folder that is writable") from error
    for name, text in files.items():
        write_atomically(folder / name, text)
