"""A sample of the fault campaign: every kind of fault in as many models as are asked for, drawn by the seed."""

from __future__ import annotations

import random
from collections.abc import Iterator
from itertools import groupby

from harness.diagnosis.faults.campaign import CampaignSettings
from harness.diagnosis.faults.study import FaultStudy, campaign, select_models
from harness.diagnosis.faults.summary import Campaign, Fault, broken_bars
from harness.night.stages import NightChoice, Stage, one_study
from harness.results.night import BROKEN, Case

NAME = "faults"
STATES = 1000
# Sizes of changed numbers, and how many faults of each kind in a model are diagnosed.
SIZES, DIAGNOSED = (1e-9, 1e-6, 1e-3, 1.0), 1


def _units(choice: NightChoice) -> list[str]:
    named = choice.mechanisms
    if not choice.settings.models or named == []:
        return []
    models, _ = select_models(choice.library, named or ())
    known = [f"{name}/{model_format}" for name, model_format in models]
    return sorted(random.Random(choice.settings.seed).sample(known, min(choice.settings.models, len(known))))


def _study(choice: NightChoice, model: str) -> FaultStudy:
    name, _, model_format = model.rpartition("/")
    states = min(STATES, choice.settings.states)
    settings = CampaignSettings(sizes=SIZES, states=states, seed=choice.settings.seed, diagnosed=DIAGNOSED)
    return campaign(choice.library, [name], settings, [model_format])


def _cases(found: Campaign) -> Iterator[Case]:
    ordered = sorted(found.faults, key=_place)
    for (system, model_format, kind), own in groupby(ordered, key=_place):
        wrong = [sentence for fault in own for sentence in _wrong(fault)]
        yield Case.of((NAME, f"{system}/{model_format}", kind), wrong, replay=f"harness faults {system} --kind {kind}")
    # That few are named is of the whole sample.
    yield Case.of((NAME, "all models", "named"), [one for one in broken_bars(found.faults) if "first or in their class" in one])
    for death in found.deaths:
        yield Case.of((NAME, death.partition(":")[0], "campaign"), [death], outcome=BROKEN)


def _place(fault: Fault) -> tuple[str, str, str]:
    return fault.system, fault.format, fault.kind


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


STAGE = Stage(
    name=NAME,
    place=5,
    kind=Campaign,
    time_limit=36000.0,
    units=_units,
    steps=one_study(_study, lambda study: Campaign(faults=study.result(), deaths=study.deaths)),
    cases=_cases,
    profile=lambda choice: NAME,
    states=lambda choice: min(STATES, choice.settings.states),
)
