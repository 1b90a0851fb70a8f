"""``harness bench``."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from harness.commands._options import (
    AS_EXPECTED,
    CRASHED,
    NOT_AS_EXPECTED,
    directory_option,
    json_option,
    library_option,
    make_folder,
    seed_option,
    tell,
    told,
    workers_option,
)
from harness.commands._page import write_page


@click.command("bench")
@click.argument("names", nargs=-1, metavar="[NAME]...")
@click.option("--methods", multiple=True, metavar="NAME", help="Only this way of computing accelerations or motion; repeatable.")
@click.option("--motion", is_flag=True, help="Measure integrators too.")
@click.option("--profile", type=click.Choice(["quick", "nightly"]), default="quick", show_default=True, help="How thorough.")
@directory_option
@seed_option
@library_option
@json_option
@workers_option
@told
def command(
    names: tuple[str, ...],
    methods: tuple[str, ...],
    motion: bool,
    profile: str,
    directory: Path,
    seed: int,
    library_path: str | None,
    json_path: str | None,
    workers: int | None,
) -> None:
    """Measure speed against error on NAMEs, or on every mechanism, and add it to the report."""
    from harness.bench.parts import Settings
    from harness.bench.study import Bench
    from harness.check.description import describe_run
    from harness.commands._benchmark_tables import print_benchmark
    from harness.commands._terminal import progress
    from harness.library import Library
    from harness.report.benchmarks import unexpected
    from harness.results.benchmark import Benchmark
    from harness.results.history import History
    from harness.results.pareto import with_cheapest
    from harness.results.records import write_json

    settings = Settings(library=Library.at(library_path), names=names, methods=methods, motion=motion, profile=profile, seed=seed)
    bench = Bench(settings)
    make_folder(directory)
    run = describe_run(settings.library, bench.profile.states, seed, profile, ["harness", *sys.argv[1:]])
    measured = Benchmark()
    with History(directory / "history.sqlite") as history:
        identifier = history.begin(run, Benchmark)
        with progress(bench.expected_parts, "benchmark") as advance:
            for part, found in bench.parts(workers):
                history.append(identifier, found)
                measured.extend(found)
                if json_path:
                    write_json(json_path, run, [], benchmark=(run, with_cheapest(measured)))
                advance(part)
        print_benchmark(run, measured)
        write_page(directory, history, settings.library.name)
    tell(bench.problems)
    if bench.crashed:
        sys.exit(CRASHED)
    sys.exit(NOT_AS_EXPECTED if measured.problems or any(unexpected(measured)) else AS_EXPECTED)
