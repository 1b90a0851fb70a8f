"""The report as Markdown whose text stays the same while the results do.

Everything that differs between two runs with the same results stands in the last section.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

from harness.report import benchmarks, hard_cases
from harness.report.benchmarks import BenchmarkSummary
from harness.report.hard_cases import HardSummary
from harness.report.summary import Summary, changes_table, states_of, worst
from harness.results.records import Record, Records
from harness.results.table import Cell, Column, Table, error_text, grouped, markdown_cell, markdown_line, printable
from harness.results.trend import trend_changes_table
from harness.verdict import AGREEMENT

if TYPE_CHECKING:
    from harness.results.cross_check import Cause, SuperfluousPart

VOLATILE = "## This run (differs from run to run)"


def render_markdown(summary: Summary | None, benchmark: BenchmarkSummary | None, hard: HardSummary | None) -> str:
    """The whole ``report.md``."""
    sections = [
        *(_stable(summary) if summary else ["# Rigid-body engines"]),
        *(_stable_hard(hard) if hard else ()),
        *(_stable_benchmark(benchmark) if benchmark else ()),
        VOLATILE,
        *(_volatile(summary) if summary else ()),
        *(_volatile_hard(hard) if hard else ()),
        *(_volatile_benchmark(benchmark) if benchmark else ()),
    ]
    return "\n\n".join(filter(None, sections)) + "\n"


def _stable(summary: Summary) -> Iterator[str]:
    yield "# Rigid-body engines against certified truth"
    yield "## Result"
    yield summary.sentence
    yield _bullets(f"**{_pair(r)}: {r.verdict}**, expected {r.expected}" for r in summary.unexpected)
    yield _bullets(f"**superfluous**, {_pair(finding)}: {markdown_line(str(finding))}" for finding in summary.superfluous)
    yield _bullets(f"**not held alike**, {markdown_line(str(finding))}" for finding in summary.differs)
    yield from summary.remarks
    yield "## Verdicts and worst backward errors"
    yield f"A backward error is an error in units of data roundoff; up to {AGREEMENT:g} agrees."
    yield _matrix(summary).markdown()
    yield "## Expected to differ"
    yield _bullets(_listed(record) for record in summary.listed) or "None."
    yield "## Worst backward error per engine"
    # An engine is a subject without its model format.
    by_engine = grouped((record.subject.partition("/")[0], record) for record in summary.records)
    found = [(name, worst(records)) for name, records in sorted(by_engine.items())]
    engines = [
        [name, r.backward_error, r.verdict, r.system, r.subject] if r else [name, None, "nothing compared", "", ""] for name, r in found
    ]
    error = Column("backward error", "error")
    yield Table(["engine", error, "verdict", "system", "subject"], engines).markdown()
    for subject, cases in summary.worst_cases.items():
        yield f"### Worst cases of {markdown_cell(subject)}"
        yield Table(["system", "verdict", error], [[c.system, c.verdict, c.backward_error] for c in cases]).markdown()
    yield "## Versions"
    yield _about("package", "version", dict(sorted(summary.run.versions.items())))
    yield "## Systems"
    for system in summary.systems:
        yield f"### {markdown_cell(system)}"
        if card := summary.cards.get(system):
            yield markdown_line(card.description)
            yield markdown_line(f"Source: {card.source}") if card.source else ""
        records = summary.of_system(system)
        errors = "worst backward error", "median backward error"
        yield records.table().only("subject", "verdict", "expected", "states", "states by verdict", *errors).markdown()
        yield _quantities_on(summary, system).markdown()
        for record in [*records, *(one for one in summary.further if one.system == system and one.is_noteworthy)]:
            if record.message:
                yield f"{markdown_line(record.asked)}, {record.verdict}:\n\n{_fenced(record.message)}"
            if not record.is_further and (cause := summary.causes.get((system, record.subject))):
                yield from _diagnosis(cause)


def _quantities_on(summary: Summary, system: str) -> Table:
    """The verdicts of ``system`` in other quantities than accelerations, with the worst backward errors; no row without any."""
    records = Records(record for record in summary.further if record.system == system)
    return records.table().only("subject", "quantity", "verdict", "worst backward error") if records else Table(["quantity"], [])


def _matrix(summary: Summary) -> Table:
    """System by subject: verdict and worst backward error."""
    cells = dict.fromkeys(summary.missing, Cell("not run")) | {pair: _verdict_cell(found) for pair, found in summary.cells.items()}
    rows = [[system, *(cells.get((system, subject), "not asked") for subject in summary.subjects)] for system in summary.systems]
    return Table(["system", *summary.subjects], rows)


def _verdict_cell(records: Sequence[Record]) -> Cell:
    """The records of one pair, nearly always one."""
    notes = []
    for record in records:
        expected = "as expected" if record.as_expected else f"expected: {record.expected}"
        notes += [error_text(record.backward_error), *([expected] if not record.as_expected or record.expected != "agrees" else [])]
    mark = "" if all(record.as_expected for record in records) else "✗ "
    return Cell(mark + "; ".join(record.verdict for record in records), notes)


def _diagnosis(cause: Cause) -> Iterator[str]:
    yield f"Diagnosis of {markdown_cell(cause.subject)}: {markdown_cell(cause.inference)}"
    if cause.is_shared:
        yield f"As {markdown_cell(cause.diagnosed)}, which reads the same file."
    else:
        yield _fenced("\n".join(cause.lines))


def _volatile(summary: Summary) -> Iterator[str]:
    run = summary.run
    about = {"started": run.started, "library": run.library, "profile": run.profile, "seed": str(run.seed)}
    yield _about(
        "what", "value", about | {"states per system": str(run.states), "command": run.command} | dict(sorted(run.machine.items()))
    )
    if summary.earlier:
        yield "### Changed since the last run"
        changes = [*summary.changed_verdicts(), *summary.changed_versions()]
        yield changes_table("what", changes).markdown() or "Neither a verdict nor a version."
        yield "### Changed in the trend"
        yield trend_changes_table(summary.changes_of_this_run()).markdown() or "No number."
    yield "### Cost and relative error"
    yield summary.records.table().only("system", "subject", "time per state", "fastest", "relative error there").markdown()
    yield "### Time to derive and to compile"
    costs = [[card.name, card.derivation_seconds, card.compilation_seconds] for _, card in sorted(summary.cards.items())]
    yield Table(["system", Column("derivation", "seconds"), Column("compilation", "seconds")], costs).markdown()
    yield "### Worst states"
    for record in summary.records:
        for what, *lines in states_of(record):
            yield f"{what} {_pair(record)}:\n\n{_fenced(chr(10).join(filter(None, lines)))}"


def _stable_benchmark(benchmark: BenchmarkSummary) -> Iterator[str]:
    yield "## Speed against error"
    yield _troubles(benchmark)
    yield benchmarks.findings(benchmark.benchmark.findings).without("finding").markdown()
    yield benchmarks.figures(benchmark.benchmark.figures).without("computed", "true motion").markdown()
    # Measured orders vary from run to run.
    yield benchmarks.orders(benchmark, lambda order: Cell(order.verdict)).markdown()


def _volatile_benchmark(benchmark: BenchmarkSummary) -> Iterator[str]:
    yield "### Benchmark"
    run = benchmark.run
    yield _about("what", "value", {"started": run.started, "profile": run.profile, "seed": str(run.seed), "command": run.command})
    for kind in benchmarks.KINDS:
        if ways := benchmarks.cheapest(benchmark, kind).markdown():
            yield f"#### The cheapest way: {kind}"
            yield ways
    yield _bullets(f"{markdown_line(f'{one.method} on {one.system}: {one.statement}')}" for one in benchmark.benchmark.findings)
    reasons = benchmark.explanations(["as expected", "differs"])
    yield _bullets(f"{markdown_line(text)} ({markdown_cell('; '.join(places))})" for text, places in reasons.items())
    yield benchmarks.growth(benchmark.benchmark.growth).without("bodies").markdown()


def _stable_hard(hard: HardSummary) -> Iterator[str]:
    yield "## Hard cases"
    yield hard.sentence
    yield _troubles(hard)
    yield hard_cases.verdicts(hard).markdown()
    yield _bullets(
        markdown_line(f"{family.name}, {', '.join(subjects)}, {reason.verdict}: {reason.reason}; {reason.remedy} ({reason.link})")
        for family in hard.families
        for subjects, reason in family.reasons
    )  # fmt: skip
    yield hard_cases.partings(hard).only("motion", "integrator", "verdict").markdown()
    yield hard_cases.stable_steps(hard).only("integrator", "theory", "verdict").markdown()


def _volatile_hard(hard: HardSummary) -> Iterator[str]:
    yield "### Hard cases"
    yield _about("what", "value", {"started": hard.run.started, "command": hard.run.command})
    yield hard_cases.rows_of(hard).only("family", "subject", "largest backward error", "slope", "theory", "time").markdown()
    yield hard_cases.partings(hard).only("motion", "integrator", "parted", "rate over the expected one", "soonest").markdown()
    yield hard_cases.stable_steps(hard).only("integrator", "measured").markdown()


def _troubles(part: BenchmarkSummary | HardSummary) -> str:
    return _bullets(
        f"**{what}**: {markdown_line(sentence)}"
        for what, sentences in (("not as expected", part.unexpected), ("not measured", part.problems))
        for sentence in sentences
    )


def _about(what: str, value: str, known: Mapping[str, str]) -> str:
    return Table([what, value], list(known.items())).markdown()


def _bullets(items: Iterable[str]) -> str:
    return "\n".join(f"- {item}" for item in items)


def _fenced(text: str) -> str:
    """``text`` as it is, whatever it holds, but for control characters."""
    return fenced(map(printable, text.expandtabs().splitlines()), "text")


def fenced(lines: Iterable[str], language: str) -> str:
    """Lines in a block that none of them ends."""
    text = "\n".join(lines)
    fence = "`" * max(3, 1 + max(map(len, re.findall("`+", text)), default=0))
    return f"{fence}{language}\n{text}\n{fence}"


def _pair(named: Record | SuperfluousPart) -> str:
    return markdown_line(f"{named.system}, {named.asked if isinstance(named, Record) else named.subject}")


def _listed(record: Record) -> str:
    where = f" ({markdown_line(record.expected_link)})" if record.expected_link else ""
    found = "" if record.as_expected else f"; found {record.verdict}"
    reason = markdown_line(record.expected_reason) or "no reason given"
    return f"{_pair(record)}: {record.expected}{found}. {reason}{where}"
