"""The report as Markdown whose text stays the same while the results do.

Everything that differs between two runs with the same results stands in the last section.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

from harness.report import benchmarks, hard_cases
from harness.report.benchmarks import BenchmarkSummary
from harness.report.hard_cases import HardSummary
from harness.report.site_tables import expectation
from harness.report.summary import Summary, changes_table, states_of, worst
from harness.results.records import Record, Records
from harness.results.table import Cell, Column, Table, error_text, grouped, markdown_cell, markdown_line, printable
from harness.results.trend import trend_changes_table
from harness.verdict import AGREEMENT

if TYPE_CHECKING:
    from harness.results.cross_check import Cause, SuperfluousPart
    from harness.results.hard_states import RankedCase

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


def _stable(summary: Summary) -> list[str]:
    # An engine is a subject without its model format.
    by_engine = grouped((record.subject.partition("/")[0], record) for record in summary.records)
    worst_of = [(engine, worst(records)) for engine, records in sorted(by_engine.items())]
    engines = [
        [name, r.backward_error, r.verdict, r.system, r.subject] if r else [name, None, "nothing compared", "", ""] for name, r in worst_of
    ]
    error = Column("backward error", "error")
    return [
        "# Rigid-body engines against certified truth",
        "## Result",
        summary.sentence,
        _bullets(f"**{_pair(r)}: {r.verdict}**, expected {r.expected}" for r in summary.unexpected),
        _bullets(f"**superfluous**, {_pair(finding)}: {markdown_line(str(finding))}" for finding in summary.superfluous),
        _bullets(f"**not held alike**, {markdown_line(str(finding))}" for finding in summary.differs),
        *summary.remarks,
        "## Verdicts and worst backward errors",
        f"A backward error is an error in units of data roundoff; up to {AGREEMENT:g} agrees.",
        _matrix(summary).markdown(),
        "## Expected to differ",
        _bullets(_listed(record) for record in summary.listed) or "None.",
        "## Worst backward error per engine",
        Table(["engine", error, "verdict", "system", "subject"], engines).markdown(),
        *(part for subject, cases in summary.worst_cases.items() for part in _worst_cases(subject, cases, error)),
        "## Versions",
        _about("package", "version", dict(sorted(summary.run.versions.items()))),
        "## Systems",
        *(part for system in summary.systems for part in _system(summary, system)),
    ]


def _worst_cases(subject: str, cases: Sequence[RankedCase], error: Column) -> list[str]:
    table = Table(["system", "verdict", error], [[case.system, case.verdict, case.backward_error] for case in cases])
    return [f"### Worst cases of {markdown_cell(subject)}", table.markdown()]


def _system(summary: Summary, system: str) -> list[str]:
    """A system, its verdicts, those in other quantities than accelerations, and what is said of them."""
    card, records = summary.cards.get(system), summary.of_system(system)
    further = Records(record for record in summary.further if record.system == system)
    errors = "worst backward error", "median backward error"
    return [
        f"### {markdown_cell(system)}",
        markdown_line(card.description) if card else "",
        markdown_line(f"Source: {card.source}") if card and card.source else "",
        records.table().only("subject", "verdict", "expected", "states", "states by verdict", *errors).markdown(),
        further.table().only("subject", "quantity", "verdict", "worst backward error").markdown() if further else "",
        *(part for record in records for part in (_message(record), *_diagnosis(summary.causes.get((system, record.subject))))),
        *(_message(record) for record in further if record.is_noteworthy),
    ]


def _message(record: Record) -> str:
    return f"{markdown_line(record.asked)}, {record.verdict}:\n\n{_fenced(record.message)}" if record.message else ""


def _matrix(summary: Summary) -> Table:
    """System by subject: verdict and worst backward error."""
    cells = dict.fromkeys(summary.missing, Cell("not run")) | {pair: _verdict_cell(found) for pair, found in summary.cells.items()}
    rows = [[system, *(cells.get((system, subject), "not asked") for subject in summary.subjects)] for system in summary.systems]
    return Table(["system", *summary.subjects], rows)


def _verdict_cell(records: Sequence[Record]) -> Cell:
    """The records of one pair, nearly always one."""
    notes = [note for record in records for note in (error_text(record.backward_error), *expectation(record))]
    mark = "" if all(record.as_expected for record in records) else "✗ "
    return Cell(mark + "; ".join(record.verdict for record in records), notes)


def _diagnosis(cause: Cause | None) -> list[str]:
    if cause is None:
        return []
    shared = f"As {markdown_cell(cause.diagnosed)}, which reads the same file."
    told = shared if cause.is_shared else _fenced("\n".join(cause.lines))
    return [f"Diagnosis of {markdown_cell(cause.subject)}: {markdown_cell(cause.inference)}", told]


def _volatile(summary: Summary) -> list[str]:
    run = summary.run
    about = {"started": run.started, "library": run.library, "profile": run.profile, "seed": str(run.seed)}
    about |= {"states per system": str(run.states), "command": run.command} | dict(sorted(run.machine.items()))
    costs = [[card.name, card.derivation_seconds, card.compilation_seconds] for _, card in sorted(summary.cards.items())]
    states = [(record, what, lines) for record in summary.records for what, *lines in states_of(record)]
    return [
        _about("what", "value", about),
        *(_changes(summary) if summary.earlier else ()),
        "### Cost and relative error",
        summary.records.table().only("system", "subject", "time per state", "fastest", "relative error there").markdown(),
        "### Time to derive and to compile",
        Table(["system", Column("derivation", "seconds"), Column("compilation", "seconds")], costs).markdown(),
        "### Worst states",
        *(f"{what} {_pair(record)}:\n\n{_fenced(chr(10).join(filter(None, lines)))}" for record, what, lines in states),
    ]


def _changes(summary: Summary) -> list[str]:
    return [
        "### Changed since the last run",
        changes_table("what", [*summary.changed_verdicts(), *summary.changed_versions()]).markdown() or "Neither a verdict nor a version.",
        "### Changed in the trend",
        trend_changes_table(summary.changes_of_this_run()).markdown() or "No number.",
    ]


def _stable_benchmark(benchmark: BenchmarkSummary) -> list[str]:
    return [
        "## Speed against error",
        _troubles(benchmark),
        benchmarks.findings(benchmark.benchmark.findings).without("finding").markdown(),
        benchmarks.figures(benchmark.benchmark.figures).without("computed", "true motion").markdown(),
        # Measured orders vary from run to run.
        benchmarks.orders(benchmark, lambda order: Cell(order.verdict)).markdown(),
    ]


def _volatile_benchmark(benchmark: BenchmarkSummary) -> list[str]:
    run = benchmark.run
    ways = {kind: benchmarks.cheapest(benchmark, kind).markdown() for kind in benchmarks.KINDS}
    reasons = benchmark.explanations(["as expected", "differs"])
    return [
        "### Benchmark",
        _about("what", "value", {"started": run.started, "profile": run.profile, "seed": str(run.seed), "command": run.command}),
        *(part for kind, table in ways.items() if table for part in (f"#### The cheapest way: {kind}", table)),
        _bullets(markdown_line(f"{one.method} on {one.system}: {one.statement}") for one in benchmark.benchmark.findings),
        _bullets(f"{markdown_line(text)} ({markdown_cell('; '.join(places))})" for text, places in reasons.items()),
        benchmarks.growth(benchmark.benchmark.growth).without("bodies").markdown(),
    ]


def _stable_hard(hard: HardSummary) -> list[str]:
    reasons = [(family.name, *reason) for family in hard.families for reason in family.reasons]
    return [
        "## Hard cases",
        hard.sentence,
        _troubles(hard),
        hard_cases.verdicts(hard).markdown(),
        _bullets(
            markdown_line(f"{name}, {', '.join(subjects)}, {why.verdict}: {why.reason}; {why.remedy} ({why.link})")
            for name, subjects, why in reasons
        ),
        hard_cases.partings(hard).only("motion", "integrator", "verdict").markdown(),
        hard_cases.stable_steps(hard).only("integrator", "theory", "verdict").markdown(),
    ]


def _volatile_hard(hard: HardSummary) -> list[str]:
    return [
        "### Hard cases",
        _about("what", "value", {"started": hard.run.started, "command": hard.run.command}),
        hard_cases.rows_of(hard).only("family", "subject", "largest backward error", "slope", "theory", "time").markdown(),
        hard_cases.partings(hard).only("motion", "integrator", "parted", "rate over the expected one", "soonest").markdown(),
        hard_cases.stable_steps(hard).only("integrator", "measured").markdown(),
    ]


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
