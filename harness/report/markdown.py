"""The report as Markdown whose text stays the same while the results do.

Everything that differs between two runs with the same results stands in the last section.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING

from harness.report.benchmarks import BenchmarkSummary
from harness.report.hard_cases import HardSummary
from harness.report.hard_markdown import stable_hard, volatile_hard
from harness.report.markdown_parts import bullets, cell, fenced, plain, table
from harness.report.summary import Summary, error_text, seconds_text, state_lines
from harness.results.records import Record
from harness.verdict import AGREEMENT

if TYPE_CHECKING:
    from harness.results.causes import Cause

VOLATILE = "## This run (differs from run to run)"


def render_markdown(summary: Summary, benchmark: BenchmarkSummary | None = None, hard: HardSummary | None = None) -> str:
    """The whole ``report.md`` of a run, with a benchmark and an atlas where there are."""
    stable = [*_stable(summary), *stable_hard(hard), *_stable_benchmark(benchmark)]
    return _joined([*stable, *_volatile(summary), *volatile_hard(hard), *_volatile_benchmark(benchmark)])


def render_measured_markdown(benchmark: BenchmarkSummary | None, hard: HardSummary | None = None) -> str:
    """The whole ``report.md`` where nothing but a benchmark or an atlas has run."""
    title = "# Rigid-body engines"
    stable = [title, *stable_hard(hard), *_stable_benchmark(benchmark)]
    return _joined([*stable, VOLATILE, *volatile_hard(hard), *_volatile_benchmark(benchmark)])


def _joined(sections: Iterable[str]) -> str:
    return "\n\n".join(section for section in sections if section) + "\n"


def _stable(summary: Summary) -> Iterator[str]:
    yield "# Rigid-body engines against certified truth"
    yield "## Result"
    yield summary.sentence
    yield bullets(f"**{cell(r.system)}, {cell(r.subject)}: {r.verdict}**, expected {r.expected}" for r in summary.unexpected)
    yield bullets(
        f"**superfluous**, {cell(finding.system)}, {cell(finding.subject)}: {plain(str(finding))}" for finding in summary.superfluous
    )
    yield from summary.remarks
    yield "## Verdicts and worst backward errors"
    yield f"A backward error is an error in units of data roundoff; up to {AGREEMENT:g} agrees."
    rows = [[system, *(_verdicts(summary.cells.get((system, subject), [])) for subject in summary.subjects)] for system in summary.systems]
    yield table(["system", *summary.subjects], rows)
    yield "## Expected to differ"
    yield bullets(_listed(record) for record in summary.listed) or "None."
    yield "## Worst backward error per engine"
    yield table(["engine", "backward error", "verdict", "system", "subject"], [_engine(*entry) for entry in summary.worst_per_engine()])
    for subject, cases in summary.worst_cases.items():
        yield f"### Worst cases of {cell(subject)}"
        yield table(["system", "verdict", "backward error"], [[c.system, c.verdict, error_text(c.backward_error)] for c in cases])
    yield "## Versions"
    yield table(["package", "version"], [list(pair) for pair in sorted(summary.run.versions.items())])
    yield "## Systems"
    for system in summary.systems:
        yield f"### {cell(system)}"
        if card := summary.cards.get(system):
            yield plain(card.description)
            yield plain(f"Source: {card.source}") if card.source else ""
        records = summary.of_system(system)
        heads = ["subject", "verdict", "expected", "states", "worst backward error", "median backward error"]
        yield table(heads, [_row(record) for record in records])
        for record in records:
            if record.message:
                yield f"{cell(record.subject)}, {record.verdict}:\n\n{fenced(record.message)}"
            if cause := summary.causes.get((system, record.subject)):
                yield from _diagnosis(cause)


def _diagnosis(cause: Cause) -> Iterator[str]:
    yield f"Diagnosis of {cell(cause.subject)}: {plain(cause.inference)}"
    if cause.is_shared:
        yield f"As {cell(cause.diagnosed)}, which reads the same file."
    else:
        yield fenced("\n".join([*cause.terms, *itertools.chain.from_iterable(cause.sides)]))


def _volatile(summary: Summary) -> Iterator[str]:
    run = summary.run
    yield VOLATILE
    about = {"started": run.started, "library": run.library, "profile": run.profile, "seed": str(run.seed)}
    about |= {"states per system": str(run.states), "command": run.command} | dict(sorted(run.machine.items()))
    yield table(["what", "value"], [list(pair) for pair in about.items()])
    if summary.earlier:
        yield "### Changed since the last run"
        changes = [*summary.changed_verdicts(), *summary.changed_versions()]
        yield table(["what", "before", "now"], [[c.what, c.before, c.after] for c in changes]) or "Neither a verdict nor a version."
    yield "### Cost and relative error"
    costs = [[r.system, r.subject, seconds_text(r.seconds_per_state), error_text(r.relative_error)] for r in summary.records]
    yield table(["system", "subject", "time per state", "worst relative error"], costs)
    yield "### Time to derive and to compile"
    timed = summary.cards.values()
    compiled = [[card.name, seconds_text(card.derivation_seconds), seconds_text(card.compilation_seconds)] for card in timed]
    yield table(["system", "derivation", "compilation"], sorted(compiled))
    yield "### Worst states"
    for record in summary.records:
        if lines := "\n".join(filter(None, [state_lines(record.worst_state), record.replay])):
            yield f"{cell(record.system)}, {cell(record.subject)}:\n\n{fenced(lines)}"


def _stable_benchmark(benchmark: BenchmarkSummary | None) -> Iterator[str]:
    if benchmark is None:
        return
    yield "## Speed against error"
    yield bullets(f"**not as expected**: {plain(sentence)}" for sentence in benchmark.unexpected)
    yield bullets(f"**not measured**: {plain(problem)}" for problem in benchmark.problems)
    figures = benchmark.benchmark.figures
    rows = [[f.system, f.what, f"{f.printed:g} {f.unit}", "yes" if f.reproduced else f"no. {f.remark}"] for f in figures]
    yield table(["system", "what", "printed", "reproduced"], rows)
    columns, lines = benchmark.order_table()
    verdicts = [[system, *("-" if order is None else order.verdict for order in orders)] for system, orders in lines]
    heads = [f"{name} (order {'any' if expected is None else f'{expected:g}'})" for name, expected in columns]
    yield table(["system", *heads], verdicts)


def _volatile_benchmark(benchmark: BenchmarkSummary | None) -> Iterator[str]:
    if benchmark is None:
        return
    yield "### Benchmark"
    run = benchmark.run
    yield table(["what", "value"], [["started", run.started], ["profile", run.profile], ["seed", str(run.seed)], ["command", run.command]])
    for kind, unit in (("accelerations", "per state"), ("motion", "per second of motion")):
        found = benchmark.cheapest(kind)
        if found:
            yield f"#### The cheapest way: {kind}"
            heads = [f"error at most {entry.error:g}" for entry in found[0][1]]
            ways = [[f"{e.way}: {seconds_text(e.cost)} {unit}" if e.way else "none" for e in entries] for _, entries in found]
            yield table(["system", *heads], [[system, *row] for (system, _), row in zip(found, ways, strict=True)])
    yield bullets(
        f"{plain(explanation.text)} ({'; '.join(explanation.places)})" for explanation in benchmark.explanations(["as expected", "differs"])
    )
    growth = [[g.method, "-" if g.exponent is None else f"{g.exponent:.2f}", g.expected] for g in benchmark.benchmark.growth]
    yield table(["method", "exponent of cost over bodies", "expected"], growth)


def _verdicts(records: Sequence[Record]) -> str:
    marks = (f"{r.verdict} {error_text(r.backward_error)}{'' if r.as_expected else f' (expected {r.expected})'}" for r in records)
    return "; ".join(marks) or "not run"


def _listed(record: Record) -> str:
    where = f" ({plain(record.expected_link)})" if record.expected_link else ""
    found = "" if record.as_expected else f"; found {record.verdict}"
    reason = plain(record.expected_reason) or "no reason given"
    return f"{cell(record.system)}, {cell(record.subject)}: {record.expected}{found}. {reason}{where}"


def _engine(engine: str, record: Record | None) -> list[str]:
    if record is None:
        return [engine, error_text(None), "nothing compared", "", ""]
    return [engine, error_text(record.backward_error), record.verdict, record.system, record.subject]


def _row(record: Record) -> list[str]:
    counts = ", ".join(f"{verdict} {count}" for verdict, count in sorted(record.verdict_counts.items()))
    states = f"{record.states}{f' ({counts})' if len(record.verdict_counts) > 1 else ''}"
    errors = [error_text(record.backward_error), error_text(record.median_backward_error)]
    return [record.subject, record.verdict, record.expected, states, *errors]
