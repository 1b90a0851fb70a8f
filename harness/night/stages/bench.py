"""The benchmark, system by system; the members of a family are one unit, because their growth is measured over all of them."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import groupby

from harness.bench.parts import THOROUGHNESS, BenchmarkSettings
from harness.bench.study import BenchmarkStudy
from harness.library import member_of
from harness.night.stages import NightChoice, Stage, TrendNumbers, cases_about, one_study
from harness.results.benchmark import Benchmark
from harness.results.night import BROKEN, LEFT_OUT, Case
from harness.results.pareto import way_of
from harness.results.trend import readings_of_costs

NAME = "bench"


def _families(choice: NightChoice) -> dict[str, list[str]]:
    """Stem of a system file to the systems in it that are asked for."""
    library, named = choice.library, choice.mechanisms
    names = library.select(named or ()) if named != [] else []

    def stem(name: str) -> str:
        member = member_of(library.system_path(name))
        return name if member is None else member[0].stem

    return {one: list(own) for one, own in groupby(sorted(names, key=stem), key=stem)}


def _study(choice: NightChoice, unit: str) -> BenchmarkStudy:
    asked = choice.settings
    settings = BenchmarkSettings(
        library=choice.library,
        names=_families(choice)[unit],
        motion=asked.motion,
        derivatives=asked.motion,
        profile=asked.profile,
        seed=asked.seed,
    )
    return BenchmarkStudy(settings)


def _cases(found: Benchmark) -> Iterator[Case]:
    for cost in found.accelerations:
        if cost.seconds_per_state is None and not cost.failed:
            yield Case(stage=NAME, group=cost.system, name=way_of(cost), outcome=LEFT_OUT, message=cost.note)
            continue
        replay, wrong = f"harness bench {cost.system} --methods '{cost.method}'", [cost.note] if cost.failed else []
        seconds = cost.states * (cost.seconds_per_state or 0.0)
        yield Case.of((NAME, cost.system, way_of(cost)), wrong, outcome=BROKEN, replay=replay, seconds=seconds)
    own = {f"{cost.system}, {cost.method}: {cost.note}" for cost in found.accelerations if cost.failed}
    yield from cases_about(NAME, "not measured", (problem for problem in found.problems if problem not in own), BROKEN)
    yield from cases_about(NAME, "theory", found.unexpected)


STAGE = Stage(
    name=NAME,
    place=4,
    kind=Benchmark,
    # Of its own parts only what hangs takes so long; motion in the profile nightly may take an hour.
    time_limit=max(one.time_limit for one in THOROUGHNESS.values()),
    units=lambda choice: list(_families(choice)),
    steps=one_study(_study),
    cases=_cases,
    profile=lambda choice: choice.settings.profile,
    states=lambda choice: THOROUGHNESS[choice.settings.profile].states,
    is_timed=True,
    numbers=TrendNumbers(part="%", readings=readings_of_costs),
)
