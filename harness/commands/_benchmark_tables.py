"""Terminal output of ``harness bench``."""

from __future__ import annotations

import click

from harness.commands._terminal import print_titled
from harness.report import benchmark_tables as tables
from harness.report.benchmarks import BenchmarkSummary
from harness.results.benchmark import AccelerationCost, Benchmark
from harness.results.pareto import with_cheapest
from harness.results.records import Run


def print_benchmark(run: Run, benchmark: Benchmark) -> None:
    """A table for each part that was measured, what is not as expected, and the cheapest ways."""
    summary = BenchmarkSummary(run, with_cheapest(benchmark))
    costs = [cost for system in summary.systems for cost in summary.accelerations(system)]
    print_titled("accelerations", tables.accelerations(costs).without("fastest", "slowest", "timed", "states", "remark"))
    _print_remarks(costs)
    print_titled("growth: exponent of the cost over the number of bodies", tables.growth(summary))
    print_titled("true motion", tables.truths(summary).without("cost", "start"))
    print_titled("motion", tables.best_motions(summary))
    print_titled("energy over long runs", tables.drifts(summary.drifts()).without("grows as time to the", "time"))
    print_titled("stationary action", tables.paths(summary.benchmark.stationarity))
    print_titled("figures of the text", tables.figures(summary))
    for kind in tables.KINDS:
        print_titled(f"the cheapest way: {kind}", tables.cheapest(summary, kind))
    for explanation in summary.explanations(["as expected", "differs"]):
        click.echo(f"\n{explanation.text}\n  {'; '.join(explanation.places)}")
    for problem in benchmark.problems:
        click.echo(f"\nnot measured: {problem}")
    for sentence in summary.unexpected:
        click.echo(f"\nnot as expected: {sentence}")


def _print_remarks(costs: list[AccelerationCost]) -> None:
    remarks: dict[tuple[str, str], list[str]] = {}
    for cost in costs:
        if cost.note:
            remarks.setdefault((cost.note, cost.method), []).append(cost.system)
    for (note, method), systems in remarks.items():
        click.echo(f"  {method} on {', '.join(systems)}: {note}")
