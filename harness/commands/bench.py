"""``harness bench``."""

from __future__ import annotations

import click

from harness.commands._bracket import Bracket, computing
from harness.commands._page import write_page


@click.command("bench")
@click.argument("names", nargs=-1, metavar="[NAME]...")
@click.option("--methods", multiple=True, metavar="NAME", help="Only this way of computing accelerations or motion; repeatable.")
@click.option("--motion", is_flag=True, help="Measure integrators too.")
@click.option("--profile", type=click.Choice(["quick", "nightly"]), default="quick", show_default=True, help="How thorough.")
@computing(directory=True)
def command(bracket: Bracket, names: tuple[str, ...], methods: tuple[str, ...], motion: bool, profile: str) -> None:
    """Measure cost against error of every method.

    Measures every mechanism unless NAMEs are given, and adds the result to the report.

    Example: harness bench cart_pendulum --motion
    """
    from harness.bench.parts import BenchmarkSettings
    from harness.bench.study import BenchmarkStudy
    from harness.commands._benchmark_tables import print_benchmark
    from harness.report.benchmarks import unexpected
    from harness.results.benchmark import Benchmark
    from harness.results.pareto import with_cheapest

    settings = BenchmarkSettings(library=bracket.library, names=names, methods=methods, motion=motion, profile=profile, seed=bracket.seed)
    study = BenchmarkStudy(settings)
    bracket.time_limit = study.thoroughness.time_limit
    run, measured = bracket.begin(study.thoroughness.states, profile, Benchmark), study.result()
    bracket.complete(study, lambda: {"benchmark": (run, with_cheapest(measured))})
    print_benchmark(run, measured)
    write_page(bracket.directory, bracket.history, bracket.library.name)
    bracket.finish(study.problems, study.crashed, not (measured.problems or any(unexpected(measured))))
