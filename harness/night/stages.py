"""The stages of a night, in its order: cross-check, atlas, survey, benchmark and a sample of the fault campaign.

Of a cross-check other quantities than accelerations follow at fewer states where accelerations are as expected.
"""

from __future__ import annotations

import random
import shlex
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import groupby
from operator import attrgetter
from pathlib import Path

from harness.bench.parts import THOROUGHNESS, BenchmarkSettings
from harness.bench.study import BenchmarkStudy
from harness.comparison.collection import find_files
from harness.comparison.study import ComparisonSettings, RobotComparison
from harness.crosscheck.loading import orphans
from harness.crosscheck.run import CrossCheck
from harness.crosscheck.settings import Settings
from harness.diagnosis.faults.campaign import CampaignSettings
from harness.diagnosis.faults.study import FaultStudy, campaign, select_models
from harness.diagnosis.faults.summary import Campaign, Fault, broken_bars
from harness.diagnosis.wanted import wanted_diagnosis
from harness.hard.atlas import MOTION, AtlasStudy
from harness.hard.cases import STATES, hard_cases
from harness.hard.worst_cases import ranked
from harness.library import member_of
from harness.night.stage import NightChoice, Stage, Steps, TrendNumbers, UnitFound, cases_about, one_study
from harness.registry import select
from harness.report.comparison import subject_lines
from harness.results.atlas import Atlas
from harness.results.benchmark import Benchmark
from harness.results.change_points import NightValue
from harness.results.comparison import FilesComparison, survey_profile
from harness.results.cross_check import CrossCheckResult
from harness.results.night import BROKEN, FAILED, LEFT_OUT, Case, case_of
from harness.results.pareto import way_of
from harness.results.trend import Cell, readings_of_costs, readings_of_records
from harness.show.gallery import Gallery
from harness.truth.quantities import further_quantities
from harness.verdict import Verdict

CROSS_CHECK, ATLAS, SURVEY, BENCH, FAULTS = "cross-check", "atlas", "survey", "bench", "faults"
# At which other quantities than accelerations are compared.
QUANTITY_STATES = 128
SURVEY_STATES, FAULT_STATES = 32, 1000
# Sizes of changed numbers of the campaign, and how many faults of each kind in a model are diagnosed.
SIZES, DIAGNOSED = (1e-9, 1e-6, 1e-3, 1.0), 1
# Beside the subjects of a system: what its files hold; beside the cases of the atlas: the motions.
_FILES, _MOTION = "models", "motion"

# The cross-check, system by system: records, causes of what is not as expected, and a picture; then the worst cases of all.


def _cross_check_steps(choice: NightChoice, name: str) -> Steps:
    settings = Settings(
        library=choice.library,
        names=[name],
        subjects=choice.subjects,
        states=choice.settings.states,
        seed=choice.settings.seed,
        # The simplest failing states of an interrupted run would come on top of those that a night has otherwise.
        examples=None,
        componentwise=True,
        replay_options=choice.replay_options,
    )
    study = CrossCheck(settings)
    yield study
    found: CrossCheckResult = study.result()
    problems, faults, crashed = list(study.problems), list(study.faults), study.crashed
    if all(record.as_expected for record in found.records):
        few = replace(settings, states=min(settings.states, QUANTITY_STATES))
        for quantity in further_quantities():
            check = CrossCheck(few, [quantity.name], audits=False)
            yield check
            found.extend(check.result())
            problems, faults, crashed = [*problems, *check.problems], [*faults, *check.faults], crashed or check.crashed
    diagnosis = wanted_diagnosis(study)
    if diagnosis is not None:
        yield diagnosis
        found.causes += diagnosis.result()
    gallery = Gallery(choice.library, [name], study.crashes)
    yield gallery
    found.extend(gallery.result())
    return UnitFound(result=found, problems=problems, faults=faults, crashed=crashed)


def _cross_check_cases(found: CrossCheckResult) -> Iterator[Case]:
    yield from (case_of(record, CROSS_CHECK) for record in found.records)
    wrong: dict[str, list[str]] = {system: [] for system in sorted({record.system for record in found.records})}
    for part in found.superfluous:
        wrong[part.system] += [f"superfluous: {part}"] if part.fails else []
    for finding in found.differs:
        wrong[finding.system] += [f"not held alike after loading: {finding}"] if finding.fails else []
    for system, sentences in wrong.items():
        yield Case.of((CROSS_CHECK, system, _FILES), sentences, replay=f"harness check {system}")


def _readings(found: CrossCheckResult) -> dict[Cell, NightValue]:
    """Numbers of accelerations: a median over the few states of another quantity may be any of the values that its answers often have."""
    return readings_of_records(record for record in found.records if not record.is_further)


# The atlas, case by case, and where motion is asked for the motions that part.


def _atlas_units(choice: NightChoice) -> list[str]:
    names = choice.settings.cases or list(hard_cases())
    return [*dict.fromkeys(names), *([_MOTION] if choice.settings.motion else [])]


def _atlas_study(choice: NightChoice, name: str) -> AtlasStudy:
    of_motion = name == _MOTION
    return AtlasStudy(choice.library, () if of_motion else [name], beside=[MOTION] if of_motion else [], families=not of_motion)


def _atlas_cases(found: Atlas) -> Iterator[Case]:
    for row in found.rows:
        outcome, replay = BROKEN if row.crashed else FAILED, f"harness atlas {row.case} --subject {row.subject}"
        yield Case.of((ATLAS, row.case, row.subject), row.problems, outcome=outcome, replay=replay, seconds=row.seconds)
    yield from cases_about(ATLAS, _MOTION, Atlas(partings=found.partings, stable_steps=found.stable_steps).unexpected)
    yield from cases_about(ATLAS, "not measured", found.problems, BROKEN)


# The survey of robots' files in the folders and packages that were given.


def _survey_study(choice: NightChoice, path: str) -> RobotComparison:
    return RobotComparison(ComparisonSettings((Path(path),), SURVEY_STATES, choice.settings.seed, pairs=()), SURVEY)


def _survey_cases(found: FilesComparison) -> Iterator[Case]:
    for file in found.files:
        wrong = [file.problem] if file.problem else []
        yield Case.of((SURVEY, file.path, file.format or "file"), wrong, replay=_replay(file.path))
    for one in found.subjects:
        name, outcome = f"{one.subject}, {one.kind}", BROKEN if one.verdict == Verdict.ERROR else FAILED
        if one.explained and one.verdict == Verdict.UNSUPPORTED:
            yield Case(stage=SURVEY, group=one.path, name=name, outcome=LEFT_OUT, message=one.message)
        else:
            wrong = [] if one.explained else subject_lines(one) or [one.outcome]
            yield Case.of((SURVEY, one.path, name), wrong, outcome=outcome, replay=_replay(one.path))
    for held in found.switched_on:
        wrong = [] if held.explained else [held.message or f"{held.verdict}, not explained", *held.rest]
        yield Case.of((SURVEY, held.path, f"{held.subject}, all on that is judged"), wrong, replay=_replay(held.path))


def _replay(path: str) -> str:
    return shlex.join(["harness", "compare", path])


# The benchmark, system by system; the members of a family are one unit, because their growth is measured over all of them.


def _families(choice: NightChoice) -> dict[str, list[str]]:
    """Stem of a system file to the systems in it that are asked for."""
    library, named = choice.library, choice.mechanisms
    names = library.select(named or ()) if named != [] else []

    def stem(name: str) -> str:
        member = member_of(library.system_path(name))
        return name if member is None else member[0].stem

    return {one: list(own) for one, own in groupby(sorted(names, key=stem), key=stem)}


def _bench_study(choice: NightChoice, unit: str) -> BenchmarkStudy:
    asked = choice.settings
    settings = BenchmarkSettings(library=choice.library, names=_families(choice)[unit], profile=asked.profile, seed=asked.seed)
    return BenchmarkStudy(replace(settings, motion=asked.motion, derivatives=asked.motion))


def _bench_cases(found: Benchmark) -> Iterator[Case]:
    for cost in found.accelerations:
        if cost.seconds_per_state is None and not cost.failed:
            yield Case(stage=BENCH, group=cost.system, name=way_of(cost), outcome=LEFT_OUT, message=cost.note)
            continue
        replay, wrong = f"harness bench {cost.system} --methods '{cost.method}'", [cost.note] if cost.failed else []
        seconds = cost.states * (cost.seconds_per_state or 0.0)
        yield Case.of((BENCH, cost.system, way_of(cost)), wrong, outcome=BROKEN, replay=replay, seconds=seconds)
    own = {f"{cost.system}, {cost.method}: {cost.note}" for cost in found.accelerations if cost.failed}
    yield from cases_about(BENCH, "not measured", (problem for problem in found.problems if problem not in own), BROKEN)
    yield from cases_about(BENCH, "theory", found.unexpected)


# A sample of the fault campaign: every kind of fault in as many models as are asked for, drawn by the seed.


def _faults_units(choice: NightChoice) -> list[str]:
    named = choice.mechanisms
    if not choice.settings.models or named == []:
        return []
    models, _ = select_models(choice.library, named or ())
    known = [f"{name}/{model_format}" for name, model_format in models]
    return sorted(random.Random(choice.settings.seed).sample(known, min(choice.settings.models, len(known))))


def _faults_study(choice: NightChoice, model: str) -> FaultStudy:
    name, _, model_format = model.rpartition("/")
    states = min(FAULT_STATES, choice.settings.states)
    settings = CampaignSettings(sizes=SIZES, states=states, seed=choice.settings.seed, diagnosed=DIAGNOSED)
    return campaign(choice.library, [name], settings, [model_format])


def _faults_cases(found: Campaign) -> Iterator[Case]:
    place = attrgetter("system", "format", "kind")
    for (system, model_format, kind), own in groupby(sorted(found.faults, key=place), key=place):
        wrong = [sentence for fault in own for sentence in _wrong(fault)]
        yield Case.of((FAULTS, f"{system}/{model_format}", kind), wrong, replay=f"harness faults {system} --kind {kind}")
    # That few are named is of the whole sample.
    yield Case.of((FAULTS, "all models", "named"), [one for one in broken_bars(found.faults) if "first or in their class" in one])
    for death in found.deaths:
        yield Case.of((FAULTS, death.partition(":")[0], "campaign"), [death], outcome=BROKEN)


def _wrong(fault: Fault) -> Iterator[str]:
    """Sentences on a fault that breaks a bar of its own: it is not caught, caught late, or blamed on somebody sound."""
    if not fault.live:
        return
    line, element, attribute = fault.where[0]
    place = f"{fault.system}/{fault.format}:{line}: <{element} {attribute}> {fault.statement}".rstrip()
    if not fault.caught:
        yield f"{place}: not caught"
    if fault.blamed:
        yield f"{place}: blamed on {fault.blamed}"
    if not fault.as_in_theory:
        yield f"{place}: caught only beyond what theory promises"


# The stages.

STAGES = (
    Stage(
        name=CROSS_CHECK,
        kind=CrossCheckResult,
        time_limit=60.0,
        units=lambda choice: choice.library.select(choice.settings.names, with_variants=True),
        steps=_cross_check_steps,
        cases=_cross_check_cases,
        closing=lambda choice, found, workers: CrossCheckResult(worst_cases=ranked(choice.library, found.records, workers)),
        problems=lambda choice: () if choice.settings.names else orphans(choice.library),
        numbers=TrendNumbers(part="records", readings=_readings),
    ),
    Stage(
        name=ATLAS,
        kind=Atlas,
        time_limit=600.0,
        units=_atlas_units,
        steps=one_study(_atlas_study),
        cases=_atlas_cases,
        profile=lambda choice: ATLAS,
        states=lambda choice: STATES,
    ),
    Stage(
        name=SURVEY,
        kind=FilesComparison,
        time_limit=300.0,
        units=lambda choice: [str(path) for path in find_files(choice.settings.survey)] if choice.settings.survey else [],
        steps=one_study(_survey_study, problems=attrgetter("faults")),
        cases=_survey_cases,
        profile=lambda choice: survey_profile(choice.settings.survey),
        states=lambda choice: SURVEY_STATES,
    ),
    Stage(
        name=BENCH,
        kind=Benchmark,
        # Of its own parts only what hangs takes so long; motion in the profile nightly may take an hour.
        time_limit=max(one.time_limit for one in THOROUGHNESS.values()),
        units=lambda choice: list(_families(choice)),
        steps=one_study(_bench_study),
        cases=_bench_cases,
        profile=lambda choice: choice.settings.profile,
        states=lambda choice: THOROUGHNESS[choice.settings.profile].states,
        is_timed=True,
        numbers=TrendNumbers(part="%", readings=readings_of_costs),
    ),
    Stage(
        name=FAULTS,
        kind=Campaign,
        time_limit=36000.0,
        units=_faults_units,
        steps=one_study(_faults_study, lambda study: Campaign(faults=study.result(), deaths=study.deaths)),
        cases=_faults_cases,
        profile=lambda choice: FAULTS,
        states=lambda choice: min(FAULT_STATES, choice.settings.states),
    ),
)


def find_stages() -> dict[str, Stage]:
    """Every stage by name, in the order of a night."""
    return {stage.name: stage for stage in STAGES}


def select_stages(names: Sequence[str]) -> list[Stage]:
    """The stages called ``names``, in the order of a night; all of them for none.

    Raises:
        InvalidRequest: there is no such stage.
    """
    chosen = select(names, find_stages(), "stage of a night")
    return [stage for stage in STAGES if stage in chosen]
