"""The report as Markdown: one screen, whose text stays the same while the results do.

Everything that differs between two runs with the same results stands in the last section. The pages and ``report.json`` have all of it.
"""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterable, Iterator, Mapping, Sequence

from harness.report.benchmarks import BenchmarkSummary
from harness.report.hard_cases import HardSummary
from harness.report.summary import Summary
from harness.results.records import Record
from harness.results.table import error_text, grouped, markdown_cell, markdown_line
from harness.verdict import AGREEMENT

VOLATILE = "## This run (differs from run to run)"
# Lines of the whole report, and of each list in it; the rest of a list is counted.
MOST_LINES = 60
_MOST_ENGINES, _MOST_UNEXPECTED, _MOST_EXPECTED, _MOST_TROUBLES, _MOST_CHANGES = 5, 6, 14, 2, 6
# Letters of what an engine raised.
_MOST_LETTERS = 300


def render_markdown(
    summary: Summary | None, benchmark: BenchmarkSummary | None, hard: HardSummary | None, engines: Mapping[str, str] | None = None
) -> str:
    """The whole ``report.md``; ``engines`` maps what each is called to what was found of it."""
    parts = [part for part in (summary, benchmark, hard) if part]
    sections = [
        "# Rigid-body engines against certified truth",
        _bullets((f"**{markdown_line(name)}**: {markdown_line(line)}" for name, line in (engines or {}).items()), _MOST_ENGINES),
        *(_cross_check(summary) if summary else ()),
        *(_troubled("## Speed against error", "Nothing is other than expected.", benchmark) if benchmark else ()),
        *(_troubled("## Hard cases", hard.sentence, hard) if hard else ()),
        VOLATILE,
        "; ".join(f"started {part.run.started}, seed {part.run.seed}: {markdown_line(part.run.command)}" for part in parts),
        _changes(summary) if summary and summary.earlier else "",
    ]
    return "\n\n".join(filter(None, sections)) + "\n"


def _cross_check(summary: Summary) -> Iterator[str]:
    versions = ", ".join(f"{name} {version}" for name, version in sorted(summary.run.versions.items()))
    told = " ".join([summary.sentence, *summary.remarks])
    yield f"{markdown_line(told)} A backward error counts data roundoffs; up to {AGREEMENT:g} agrees."
    wrong = [
        *(_unexpected(summary, record) for record in summary.unexpected),
        *(f"**superfluous**, {_pair(part.system, part.subject)}: {markdown_line(str(part))}" for part in summary.superfluous),
        *(f"**not held alike**, {markdown_line(str(finding))}" for finding in summary.differs),
    ]
    if wrong:
        yield "## To be looked at"
        yield _bullets(wrong, _MOST_UNEXPECTED)
    if expected := summary.expectations(False):
        yield "## Expected to differ"
        yield _bullets((_listed(*known, records) for known, records in expected.items()), _MOST_EXPECTED)
    yield f"Versions: {markdown_cell(versions)}."


def _unexpected(summary: Summary, record: Record) -> str:
    """A record, what was said of it, and why it is so where that was looked for."""
    cause = summary.causes.get((record.system, record.subject)) if not record.is_further else None
    shared = f"as {cause.diagnosed}, which reads the same file" if cause and cause.is_shared else cause.first_line if cause else ""
    why = [cause.inference, shared] if cause else []
    error = f"backward error {error_text(record.backward_error)}" if record.backward_error is not None else ""
    told = [f"expected {record.expected}", error, textwrap.shorten(record.message, _MOST_LETTERS), *why]
    return f"**{_pair(record.system, record.asked)}: {record.verdict}**, {markdown_line('; '.join(filter(None, told)))}"


def _listed(verdict: str, reason: str, link: str, records: Sequence[Record]) -> str:
    """Pairs that are expected to have a verdict for one reason, with the largest error of any."""
    found = grouped((record.system, f"{record.subject}{_size(record)}") for record in records)
    pairs = "; ".join(markdown_line(f"{system}, {', '.join(subjects)}") for system, subjects in found.items())
    where = f" ({markdown_line(link)})" if link else ""
    return f"**{verdict}**: {pairs}: {markdown_line(reason) or 'no reason is given'}{where}"


def _size(record: Record) -> str:
    """The backward error, and the verdict where it is not the expected one."""
    error = "" if record.backward_error is None else f" {error_text(record.backward_error)}"
    return error if record.as_expected else f"{error}, found {record.verdict}"


def _troubled(title: str, sentence: str, part: BenchmarkSummary | HardSummary) -> Iterator[str]:
    kinds = (("not as expected", part.unexpected), ("not measured", part.problems))
    troubles = [f"**{what}**: {markdown_line(one)}" for what, sentences in kinds for one in sentences]
    yield title
    yield _bullets(troubles, _MOST_TROUBLES) or sentence


def _changes(summary: Summary) -> str:
    """Differences from the run before, in one paragraph."""
    changed = [*summary.changed_verdicts(), *summary.changed_versions()]
    told = [f"{name}: {before}, now {now}" for name, before, now in changed]
    told += [
        f"{one.system}, {one.subject}: {one.number} {error_text(one.before)}, now {error_text(one.now)} ({one.found_by})"
        for one in summary.changes_of_this_run()
    ]
    more = [f"and {len(told) - _MOST_CHANGES} more"] if len(told) > _MOST_CHANGES else []
    return f"Changed since the last run: {markdown_line('; '.join([*told[:_MOST_CHANGES], *more])) or 'no verdict, version or trend'}."


def _bullets(items: Iterable[str], most: int) -> str:
    """A line for each item, and one that counts those beyond ``most``."""
    lines = list(items)
    more = [f"{len(lines) - most} more, in report.json and on the pages"] if len(lines) > most else []
    return "\n".join(f"- {line}" for line in [*lines[:most], *more])


def fenced(lines: Iterable[str], language: str) -> str:
    """Lines in a block that none of them ends."""
    text = "\n".join(lines)
    fence = "`" * max(3, 1 + max(map(len, re.findall("`+", text)), default=0))
    return f"{fence}{language}\n{text}\n{fence}"


def _pair(system: str, subject: str) -> str:
    return markdown_cell(f"{system}, {subject}")
