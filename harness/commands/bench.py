"""``harness bench``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import click

from harness.commands import STUDIES
from harness.commands.frame.bracket import Bracket, computing
from harness.commands.frame.options import quantities_option, takes, time_limit_option
from harness.commands.frame.pages import write_page
from harness.commands.frame.terminal import print_sentences, print_titled, say
from harness.errors import require
from harness.results.check_conclusion import MOST_ROWS
from harness.results.detail import Detail
from harness.results.table import grouped

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from harness.report.benchmarks import BenchmarkSummary
    from harness.results.benchmark import AccelerationCost, SolverCost


SECTION = STUDIES


@dataclass(frozen=True, kw_only=True)
class BenchOptions:
    """Measurements that are asked for."""

    names: Annotated[tuple[str, ...], click.argument("names", nargs=-1, metavar="[NAME|FILE]...")]
    methods: Annotated[
        tuple[str, ...],
        click.option(
            "--methods",
            multiple=True,
            metavar="NAME",
            help="Only this way of computing accelerations or motion, or this subject of other quantities; repeatable. "
            "harness list methods and harness list integrators have them.",
        ),
    ]
    quantities: Annotated[tuple[str, ...], quantities_option("accelerations")]
    motion: Annotated[bool, click.option("--motion", is_flag=True, help="Measure integrators too.")]
    derivatives: Annotated[
        bool, click.option("--derivatives", is_flag=True, help="Measure derivatives by q and v too, finite differences over their steps.")
    ]
    solvers: Annotated[
        bool,
        click.option(
            "--solvers", is_flag=True, help="Measure too how near each solver of constraints comes to the optimum on a robot's FILE."
        ),
    ]
    profile: Annotated[
        str, click.option("--profile", type=click.Choice(["quick", "nightly"]), default="quick", show_default=True, help="How thorough.")
    ]


@click.command("bench")
@takes(BenchOptions)
@time_limit_option(None, shown="300, with --profile nightly 3600")
@computing(directory=True, detail=True, floating_base=True, aided=True)
def command(bracket: Bracket, asked: BenchOptions) -> None:
    """Measure the cost and the error of every method.

    All mechanisms are measured unless some are named, and the results go into the report. For a robot's FILE the command measures the
    engines that read it, called as a user calls them; with --motion they are given what their readers leave out. The report stays as it is.

    \b
    Examples:
      harness bench
      harness bench cart_pendulum --motion
      harness bench arm_3r --derivatives
      harness bench arm_3r --quantity mass_matrix --quantity reactions
      harness bench double_pendulum --methods "pinocchio aba"
      harness bench robot.urdf
      harness bench robot.xml --solvers
    """
    from harness.bench.parts import BenchmarkSettings
    from harness.bench.study import BenchmarkStudy
    from harness.library import ROBOTS
    from harness.report.benchmarks import BenchmarkSummary
    from harness.results.benchmark import Benchmark
    from harness.results.pareto import with_cheapest

    bracket.choose_library(asked.names)
    settings = BenchmarkSettings(library=bracket.library, seed=bracket.seed, **vars(asked))
    study = BenchmarkStudy(settings)
    bracket.time_limit = bracket.time_limit or settings.thoroughness.time_limit
    # The report is that of a library of mechanisms, whose page a robot would take the place of.
    kept = None if ROBOTS in bracket.library.kinds else Benchmark
    require("a benchmark takes charts and machine code", *(["bokeh", "heyoka"] if kept is not None else ["heyoka"] if asked.motion else []))
    run, measured = bracket.begin(settings.thoroughness.states, asked.profile, kept), study.result()
    bracket.complete(study, lambda: {"benchmark": {"run": run} | vars(with_cheapest(measured))})
    summary = BenchmarkSummary(run, measured)
    _print_benchmark(summary, bracket.detail)
    if study.left_out:
        say("", f"left out, because a robot's file holds no energies: {', '.join(study.left_out)}, and energies along motions")
    if study.constrained:
        say("", f"stationary action is left out, because variations would have to keep constraints: {', '.join(study.constrained)}")
    if kept is not None:
        write_page(bracket)
    bracket.finish(study.problems, study.crashed, summary.is_good)


def _print_benchmark(summary: BenchmarkSummary, detail: Detail = Detail.BRIEF) -> None:
    """The answer, what is not as expected, the cheapest ways, and a table for each part that was measured."""
    from harness.report import benchmarks as tables

    say(summary.sentence)
    print_sentences(summary)
    for kind in tables.KINDS:
        print_titled(f"the cheapest way: {kind}", tables.cheapest(summary, kind))
    costs = [cost for system in summary.systems for cost in summary.accelerations[system]]
    if len(costs) > MOST_ROWS and detail < Detail.ALL:
        say("", f"--all shows the cost and error of {len(costs)} ways to accelerations")
        costs = []
    unused = () if any(cost.from_rigid is not None for cost in costs) else ("distance from rigid",)
    unused = unused if detail == Detail.VERBOSE else ("fastest", *unused)
    print_titled("accelerations", tables.accelerations(costs).without("slowest", "timed", "states", "remark", *unused))
    if costs and detail == Detail.VERBOSE:
        say(f"times: median and fastest call; where Python loops over the states, they hold its calls; {summary.run.load}")
    _print_remarks((cost.method, cost) for cost in costs)
    further = [cost for system in summary.systems for own in summary.quantities(system).values() for cost in own]
    answered = tables.quantities(cost for cost in further if cost.seconds_per_state is not None)
    print_titled("other quantities", answered.without("slowest", "timed", "remark"))
    _print_remarks((f"{cost.quantity} of {cost.method}", cost) for cost in further)
    for finding in summary.benchmark.findings:
        say("", f"finding: {finding.method} on {finding.system}: {finding.statement}")
        say(*(f"    {line}" for line in finding.reproducer.splitlines()))
    print_titled("derivatives by q and v", tables.derivatives(summary.benchmark.derivatives).without("remark"))
    _print_solvers(summary.benchmark.solvers, detail)
    print_titled("growth: exponent of the cost over the number of bodies", tables.growth(summary.benchmark.growth))
    print_titled("true motion", tables.truths(summary.benchmark.truths).without("cost", "start"))
    gaps = [*(one.gap for one in summary.benchmark.motion), *(one.gap for one in summary.benchmark.drifts)]
    gap = () if any(one is not None for one in gaps) else ("constraints open by",)
    print_titled("motion", tables.best_motions(summary).without(*gap))
    print_titled(
        "energy over long runs",
        tables.drifts(drift for system in sorted(summary.drifts) for drift in summary.drifts[system]).without(
            "grows as time to the", "time", *gap
        ),
    )
    print_titled("stationary action", tables.paths(summary.benchmark.stationarity))
    print_titled("figures of the text", tables.figures(summary.benchmark.figures))
    for text, places in summary.explanations(["as expected", "differs"]).items():
        say("", text, f"  {'; '.join(places)}")


def _print_solvers(costs: Sequence[SolverCost], detail: Detail) -> None:
    """Print what the file says and what each method needs in the end; more iterations with more detail."""
    from harness.report import benchmarks as tables

    asked = [cost for cost in costs if cost.states]
    last = {(cost.system, cost.engine, cost.method, cost.iterations is None): cost for cost in asked}
    shown = asked if detail >= Detail.ALL else list(last.values())
    one = ["file"] if len({cost.system for cost in shown}) == 1 else []
    print_titled("solvers of constraints", tables.solvers(shown).without("remark", *one))
    if len(shown) < len(asked):
        say(f"--all shows {len(asked) - len(shown)} rows with fewer iterations")
    for cost in (cost for cost in costs if cost.note):
        say("", f"solvers of {cost.engine} on {cost.system}: {cost.note}")


def _print_remarks(costs: Iterable[tuple[str, AccelerationCost]]) -> None:
    """A line for each note, of what is named and the systems where it holds."""
    for (note, name), systems in grouped(((cost.note, name), cost.system) for name, cost in costs if cost.note).items():
        say(f"  {name} on {', '.join(dict.fromkeys(systems))}: {note}")
