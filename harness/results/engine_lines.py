"""Findings on an engine, in one sentence for somebody who has seen no table of verdicts."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from harness.results.readings import share_text
from harness.results.table import counted, grouped, joined, plural
from harness.verdict import DEPARTS, Verdict, is_soft

# Features by which constraints give.
TIES = ("loops", "coupled joints", "coupled tendons", "mimic joints", "rolling")
# Of mechanisms that are named; of more the first are.
_MOST_NAMED = 4
_SAID = {
    Verdict.ERROR.value: "fails on",
    Verdict.DISAGREES.value: "wrong on",
    Verdict.MISREADS.value: "misreads",
    DEPARTS: "departs from its documentation in",
    Verdict.UNSTABLE.value: "loses digits on",
    Verdict.UNDECIDED.value: "not judged on",
    Verdict.UNSUPPORTED.value: "cannot express or refuses",
}


@dataclass(frozen=True, kw_only=True)
class EngineOutcome:
    """An engine's accelerations of one mechanism or robot.

    Attributes:
        name: of the mechanism or robot. format: of the file that the engine read; "" for the equations.
        outcome: a value of ``Verdict``; of a robot's file as of ``SubjectRecord``. is_robot: True for one.
        readings: as of ``SiteCell``. features: as of ``Record``. from_rigid: how far constraints that give, as the engine documents,
            are from rigid ones; None where they do not give.
    """

    name: str
    format: str
    outcome: str
    is_robot: bool = False
    readings: Sequence[str] = ()
    features: Sequence[str] = ()
    from_rigid: float | None = None


def engine_line(answers: Iterable[EngineOutcome]) -> str:
    """Sentence on where an engine is right and where not: the gravest first, then what it documents, then what it cannot do."""
    known = grouped((one.is_robot, one) for one in answers)
    mechanisms, robots = known.get(False, []), known.get(True, [])
    parts = _right(mechanisms)
    for verdict, said in _SAID.items():
        own = [one for one in mechanisms if one.outcome == verdict]
        # What is misread says more than where.
        told_by_reading = verdict in (Verdict.MISREADS, DEPARTS)
        named = list(dict.fromkeys(name for one in own for name in (one.readings[:1] if told_by_reading else ()) or [one.name]))
        parts += [f"{said} {_listed(named)}"] if named else []
        parts += _soft(mechanisms) if verdict == Verdict.UNSTABLE else []
    parts += [f"of {counted(len(robots), 'robot file')} {joined(_outcomes(robots))}"] if robots else []
    return "; ".join(parts) or "nothing was asked of it"


def _outcomes(robots: Sequence[EngineOutcome]) -> list[str]:
    """Number of answers of each outcome, with what is read otherwise."""
    told = []
    for outcome, own in sorted(grouped((one.outcome, one) for one in robots).items()):
        readings = joined(list(dict.fromkeys(name for one in own for name in one.readings)))
        said = {Verdict.AGREES.value: plural(len(own), "agrees", "agree"), Verdict.MISREADS.value: "misread"}.get(outcome, outcome)
        told.append(f"{len(own)} {said}{f' ({readings})' if readings else ''}")
    return told


def _right(answers: Sequence[EngineOutcome]) -> list[str]:
    """Number of answers that are right, for each format; what the engine refused is no answer."""
    asked = sorted(grouped((one.format, one.outcome) for one in answers if one.outcome != Verdict.UNSUPPORTED).items())
    counts = []
    for model_format, own in asked:
        right, total = own.count(Verdict.AGREES), len(own)
        counts.append(f"{f'all {total}' if 1 < right == total else f'{right} of {total}'} {model_format.upper()}".rstrip())
    return [f"right on {joined(counts)} mechanism{'' if max(len(own) for _, own in asked) == 1 else 's'}"] if counts else []


def _soft(answers: Sequence[EngineOutcome]) -> list[str]:
    soft = [one for one in answers if is_soft(one.outcome, one.from_rigid)]
    if not soft:
        return []
    ties = [feature for feature in TIES if any(feature in one.features for one in soft)]
    distances = [one.from_rigid or 0.0 for one in soft]
    names = counted(len({one.name for one in soft}), "mechanism")
    away = " to ".join(dict.fromkeys(share_text(bound) for bound in (min(distances), max(distances))))
    return [f"{joined(ties) or 'constraints'} soft, as documented (accelerations {away} from rigid ones, {names})"]


def _listed(names: Sequence[str]) -> str:
    """The names, or the first of them and how many more there are."""
    if len(names) <= _MOST_NAMED:
        return joined(names)
    return joined([*names[: _MOST_NAMED - 1], f"{len(names) - _MOST_NAMED + 1} more"])
