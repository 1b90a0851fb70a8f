"""The report as Markdown whose text stays the same while the results do.

Everything that differs between two runs with the same results stands in the last section.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence

from harness.records import Record
from harness.report.benchmarks import BenchmarkSummary
from harness.report.summary import Summary, error_text, seconds_text, state_lines
from harness.verdict import AGREEMENT

VOLATILE = "## This run (differs from run to run)"


def render_markdown(summary: Summary, benchmark: BenchmarkSummary | None = None) -> str:
    """The whole ``report.md`` of a run, with a benchmark where there is one."""
    return _joined([*_stable(summary), *_stable_benchmark(benchmark), *_volatile(summary), *_volatile_benchmark(benchmark)])


def render_benchmark_markdown(benchmark: BenchmarkSummary) -> str:
    """The whole ``report.md`` where nothing but a benchmark has run."""
    title = "# Rigid-body engines"
    return _joined([title, *_stable_benchmark(benchmark), VOLATILE, *_volatile_benchmark(benchmark)])


def _joined(sections: Iterable[str]) -> str:
    return "\n\n".join(section for section in sections if section) + "\n"


def _stable(summary: Summary) -> Iterator[str]:
    yield "# Rigid-body engines against certified truth"
    yield "## Result"
    yield summary.sentence
    yield _bullets(f"**{_cell(r.system)}, {_cell(r.subject)}: {r.verdict}**, expected {r.expected}" for r in summary.unexpected)
    yield _bullets(
        f"**superfluous**, {_cell(finding.system)}, {_cell(finding.subject)}: {_text(str(finding))}" for finding in summary.superfluous
    )
    yield from summary.remarks
    yield "## Verdicts and worst backward errors"
    yield f"A backward error is an error in units of data roundoff; up to {AGREEMENT:g} agrees."
    rows = [[system, *(_verdicts(summary.cells.get((system, subject), [])) for subject in summary.subjects)] for system in summary.systems]
    yield _table(["system", *summary.subjects], rows)
    yield "## Expected to differ"
    yield _bullets(_listed(record) for record in summary.listed) or "None."
    yield "## Worst backward error per engine"
    yield _table(["engine", "backward error", "verdict", "system", "subject"], [_engine(*entry) for entry in summary.worst_per_engine()])
    yield "## Versions"
    yield _table(["package", "version"], [list(pair) for pair in sorted(summary.run.versions.items())])
    yield "## Systems"
    for system in summary.systems:
        yield f"### {_cell(system)}"
        if card := summary.cards.get(system):
            yield _text(card.description)
            yield _text(f"Source: {card.source}") if card.source else ""
        records = summary.of_system(system)
        heads = ["subject", "verdict", "expected", "states", "worst backward error", "median backward error"]
        yield _table(heads, [_row(record) for record in records])
        for record in records:
            if record.message:
                yield f"{_cell(record.subject)}, {record.verdict}:\n\n{_fenced(record.message)}"


def _volatile(summary: Summary) -> Iterator[str]:
    run = summary.run
    yield VOLATILE
    about = {"started": run.started, "library": run.library, "profile": run.profile, "seed": str(run.seed)}
    about |= {"states per system": str(run.states), "command": run.command} | dict(sorted(run.machine.items()))
    yield _table(["what", "value"], [list(pair) for pair in about.items()])
    if summary.earlier:
        yield "### Changed since the last run"
        changes = [*summary.changed_verdicts(), *summary.changed_versions()]
        yield _table(["what", "before", "now"], [[c.what, c.before, c.after] for c in changes]) or "Neither a verdict nor a version."
    yield "### Cost and relative error"
    costs = [[r.system, r.subject, seconds_text(r.seconds_per_state), error_text(r.relative_error)] for r in summary.records]
    yield _table(["system", "subject", "time per state", "worst relative error"], costs)
    yield "### Time to derive and to compile"
    compiled = [
        [card.name, seconds_text(card.derivation_seconds), seconds_text(card.compilation_seconds)] for card in summary.cards.values()
    ]
    yield _table(["system", "derivation", "compilation"], sorted(compiled))
    yield "### Worst states"
    for record in summary.records:
        if lines := "\n".join(filter(None, [state_lines(record), record.replay])):
            yield f"{_cell(record.system)}, {_cell(record.subject)}:\n\n{_fenced(lines)}"


def _stable_benchmark(benchmark: BenchmarkSummary | None) -> Iterator[str]:
    if benchmark is None:
        return
    yield "## Speed against error"
    yield _bullets(f"**not as expected**: {_text(sentence)}" for sentence in benchmark.unexpected)
    yield _bullets(f"**not measured**: {_text(problem)}" for problem in benchmark.problems)
    figures = benchmark.benchmark.figures
    rows = [[f.system, f.what, f"{f.printed:g} {f.unit}", "yes" if f.reproduced else f"no. {f.remark}"] for f in figures]
    yield _table(["system", "what", "printed", "reproduced"], rows)
    columns, lines = benchmark.order_table()
    verdicts = [[system, *("-" if order is None else order.verdict for order in orders)] for system, orders in lines]
    heads = [f"{name} (order {'any' if expected is None else f'{expected:g}'})" for name, expected in columns]
    yield _table(["system", *heads], verdicts)


def _volatile_benchmark(benchmark: BenchmarkSummary | None) -> Iterator[str]:
    if benchmark is None:
        return
    yield "### Benchmark"
    run = benchmark.run
    yield _table(["what", "value"], [["started", run.started], ["profile", run.profile], ["seed", str(run.seed)], ["command", run.command]])
    for kind, unit in (("accelerations", "per state"), ("motion", "per second of motion")):
        table = benchmark.cheapest(kind)
        if table:
            yield f"#### The cheapest way: {kind}"
            heads = [f"error at most {entry.error:g}" for entry in table[0][1]]
            ways = [[f"{e.way}: {seconds_text(e.cost)} {unit}" if e.way else "none" for e in entries] for _, entries in table]
            yield _table(["system", *heads], [[system, *row] for (system, _), row in zip(table, ways, strict=True)])
    yield _bullets(
        f"{_text(explanation.text)} ({'; '.join(explanation.places)})" for explanation in benchmark.explanations(["as expected", "differs"])
    )
    growth = [[g.method, "-" if g.exponent is None else f"{g.exponent:.2f}", g.expected] for g in benchmark.benchmark.growth]
    yield _table(["method", "exponent of cost over bodies", "expected"], growth)


def _verdicts(records: Sequence[Record]) -> str:
    marks = (f"{r.verdict} {error_text(r.backward_error)}{'' if r.as_expected else f' (expected {r.expected})'}" for r in records)
    return "; ".join(marks) or "not run"


def _listed(record: Record) -> str:
    where = f" ({_text(record.expected_link)})" if record.expected_link else ""
    found = "" if record.as_expected else f"; found {record.verdict}"
    reason = _text(record.expected_reason) or "no reason given"
    return f"{_cell(record.system)}, {_cell(record.subject)}: {record.expected}{found}. {reason}{where}"


def _engine(engine: str, record: Record | None) -> list[str]:
    if record is None:
        return [engine, error_text(None), "nothing compared", "", ""]
    return [engine, error_text(record.backward_error), record.verdict, record.system, record.subject]


def _row(record: Record) -> list[str]:
    counts = ", ".join(f"{verdict} {count}" for verdict, count in sorted(record.verdict_counts.items()))
    states = f"{record.states}{f' ({counts})' if len(record.verdict_counts) > 1 else ''}"
    errors = [error_text(record.backward_error), error_text(record.median_backward_error)]
    return [record.subject, record.verdict, record.expected, states, *errors]


def _table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    if not rows:
        return ""
    lines = [heads, ["---"] * len(heads), *rows]
    return "\n".join("| " + " | ".join(map(_cell, line)) + " |" for line in lines)


def _bullets(items: Iterable[str]) -> str:
    return "\n".join(f"- {item}" for item in items)


def _text(text: str) -> str:
    return " ".join(text.split()).replace("<", "&lt;")


def _cell(text: str) -> str:
    return _text(text).replace("|", "\\|")


def _fenced(text: str) -> str:
    fence = "`" * max(3, 1 + max(map(len, re.findall("`+", text)), default=0))
    return f"{fence}text\n{text}\n{fence}"
