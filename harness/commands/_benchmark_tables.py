"""What ``harness bench`` prints."""

from __future__ import annotations

import click

from harness.commands._terminal import print_rows
from harness.report.benchmarks import BenchmarkSummary
from harness.report.summary import error_text, seconds_text
from harness.results.benchmark import Benchmark
from harness.results.pareto import cost_of, error_of, with_cheapest
from harness.results.records import Run


def print_benchmark(run: Run, benchmark: Benchmark) -> None:
    """A table for each part that was measured, what is not as expected, and the cheapest ways."""
    summary = BenchmarkSummary(run, with_cheapest(benchmark))
    _print_accelerations(summary)
    _print_growth(summary)
    _print_motion(summary)
    _print_long_runs(summary)
    _print_paths_and_figures(summary)
    _print_cheapest(summary)
    for explanation in summary.explanations(["as expected", "differs"]):
        click.echo(f"\n{explanation.text}\n  {'; '.join(explanation.places)}")
    for problem in benchmark.problems:
        click.echo(f"\nnot measured: {problem}")
    for sentence in summary.unexpected:
        click.echo(f"\nnot as expected: {sentence}")


def _print_accelerations(summary: BenchmarkSummary) -> None:
    costs = [cost for system in summary.systems for cost in summary.accelerations(system)]
    rows = [
        [cost.system, cost.method, cost.threads, seconds_text(cost.seconds_per_state), error_text(cost.backward_error),
         error_text(cost.median_backward_error), error_text(cost.relative_error)]
        for cost in costs
    ]  # fmt: skip
    print_rows(
        "accelerations",
        ["system", "method", "threads", "time per state", "worst backward error", "median backward error", "worst relative error"],
        rows,
    )
    remarks: dict[str, dict[str, list[str]]] = {}
    for cost in costs:
        if cost.note:
            remarks.setdefault(cost.note, {}).setdefault(cost.method, []).append(cost.system)
    for note, places in remarks.items():
        for method, systems in places.items():
            click.echo(f"  {method} on {', '.join(systems)}: {note}")


def _print_growth(summary: BenchmarkSummary) -> None:
    rows = [
        [growth.family, growth.method, ", ".join(map(str, growth.sizes)), _number(growth.exponent), growth.expected]
        for growth in summary.benchmark.growth
    ]
    print_rows("growth: exponent of the cost over the number of bodies", ["family", "method", "bodies", "exponent", "expected"], rows)


def _print_motion(summary: BenchmarkSummary) -> None:
    truths = [
        [truth.system, f"{truth.horizon:g} s", f"{truth.trusted:.4g} s", error_text(truth.error), truth.precision]
        for truth in summary.benchmark.truths
    ]
    print_rows("true motion", ["system", "length", "trusted", "error", "the two runs"], truths)
    orders = {(order.system, order.integrator): order for order in summary.benchmark.orders}
    rows: list[list[object]] = []
    for system in summary.systems:
        costs = summary.motion(system)
        for integrator in sorted({cost.integrator for cost in costs}):
            order = orders.get((system, integrator))
            known = [(error, cost) for cost in costs if cost.integrator == integrator and (error := error_of(cost)) is not None]
            error, best = min(known, key=lambda entry: entry[0], default=(None, None))
            told = [_number(order.measured), _number(order.expected), order.verdict] if order else ["-", "-", ""]
            rows.append([system, integrator, *told, error_text(error), seconds_text(cost_of(best)) if best else "-"])
    heads = ["system", "integrator", "order", "expected", "verdict", "smallest error", "time per second of motion"]
    print_rows("motion", heads, rows)


def _print_long_runs(summary: BenchmarkSummary) -> None:
    rows = [
        [drift.system, drift.integrator, f"{drift.step:g} s", f"{drift.steps:,}", error_text(drift.largest), drift.verdict, drift.expected]
        for drift in summary.drifts()
    ]
    print_rows("energy over long runs", ["system", "integrator", "step", "steps", "largest error", "energy is", "expected"], rows)


def _print_paths_and_figures(summary: BenchmarkSummary) -> None:
    paths = [
        [entry.system, entry.path, f"{entry.step:g} s", error_text(entry.residual), _number(entry.slope), error_text(entry.first_variation)]
        for entry in summary.benchmark.stationarity
    ]
    print_rows("stationary action", ["system", "path", "step", "residual", "slope", "first variation"], paths)
    figures = [
        [figure.system, figure.what, f"{figure.printed:g} {figure.unit}", f"{figure.computed:.5g}", f"{figure.truth:.5g}",
         "yes" if figure.reproduced else f"no. {figure.remark}"]
        for figure in summary.benchmark.figures
    ]  # fmt: skip
    print_rows("figures of the text", ["system", "what", "printed", "computed", "true motion", "reproduced"], figures)


def _print_cheapest(summary: BenchmarkSummary) -> None:
    for kind, unit in (("accelerations", "per state"), ("motion", "per second of motion")):
        table = summary.cheapest(kind)
        heads = ["system", *(f"error at most {entry.error:g}" for entry in (table[0][1] if table else []))]
        rows = [[system, *(f"{e.way}\n{seconds_text(e.cost)} {unit}" if e.way else "-" for e in entries)] for system, entries in table]
        print_rows(f"the cheapest way: {kind}", heads, rows)


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f}"
